"""Compares Dynident with FIGAROH on FIGAROH's UR10 example, and with mujoco.sysid on the arm of its tutorial: alternating runs, one thread.

    python benchmarks/rivals [--rounds 2] [--seeds 5] [--quick] [--out FOLDER]

Each round draws the noise of each seed; all tools use the same recording, one after the other. Writes table.md and figures.json into FOLDER
(target/rivals) and the table to standard output. --quick runs one round of one seed with fewer settings. Exit status 1 if FIGAROH's reference case or Dynident
misses the target of FIGAROH's example for its noise draw: 0.1 Nm rms error of the true torque at every joint of the held-out motion.
"""
import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import contextlib
import importlib.metadata
import io
import json
import logging
import platform
import statistics
import sys
import tempfile
import time
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import arm_tutorial
import common
import ur10_example
import with_dynident
import with_figaroh
import with_sysid

HERE = Path(__file__).resolve().parent
# FIGAROH's acceptance limit for the identified model, relative to the noise-free torque of the held-out motion.
MOST_RMS_NM = 0.1


def lines(file, begin, end):
    """Number of lines in a user's program between two marks, without blank lines, comments and docstrings."""
    own = (HERE / file).read_text().split(f"# begin {begin}\n")[1].split(f"# end {end}\n")[0].splitlines()
    return sum(1 for line in own if line.strip() and not line.strip().startswith(("#", '"""')))


def percent(found, truth):
    return 100 * np.linalg.norm(found - truth) / np.linalg.norm(truth)


class Figures:
    """Results of all runs with one setting."""

    def __init__(self):
        self.seconds, self.true, self.measured, self.worst_joint, self.rms_nm = [], [], [], [], []
        self.bars, self.inside, self.refused, self.warned = [], [], 0, 0

    def judge(self, tau, truth, measured=None):
        """Adds held-out torques (samples, joints), compared with the true and the measured torques."""
        self.true.append(percent(tau, truth))
        self.worst_joint.append(max(percent(tau[:, joint], truth[:, joint]) for joint in range(tau.shape[1])))
        self.rms_nm.append(float(np.sqrt(np.mean((tau - truth) ** 2, axis=0)).max()))
        if measured is not None:
            self.measured.append(percent(tau, measured))

    def numbers(self):
        def middle(values):
            return float(np.median(values)) if values else None

        return dict(
            runs=len(self.seconds),
            seconds_min=min(self.seconds),
            seconds_median=statistics.median(self.seconds),
            held_out_percent=middle(self.true),
            held_out_percent_most=float(max(self.true)) if self.true else None,
            worst_joint_percent=middle(self.worst_joint),
            worst_joint_rms_nm_most=max(self.rms_nm, default=None),
            held_out_measured_percent=middle(self.measured),
            error_in_bars_rms=float(np.sqrt(np.mean(np.square(self.bars)))) if self.bars else None,
            inside_95=float(np.mean(self.inside)) if self.inside else None,
            refused=self.refused,
            warned=self.warned,
        )


@contextlib.contextmanager
def timed(figures):
    """Adds the processor time of a run, s; hides its output."""
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        begin = time.process_time()
        yield
        figures.seconds.append(time.process_time() - begin)


BEST = dict(kind=with_figaroh.GradientUR10, wls=True, decimate=True)
FIGAROH = {
    "example": ("FIGAROH, as its example: derivatives by its helper, least squares", dict()),
    "example weighted": ("FIGAROH, its example's derivatives, weighted, decimated by 10", dict(wls=True, decimate=True)),
    "gradient": ("FIGAROH, derivatives by its pipeline, least squares", dict(kind=with_figaroh.GradientUR10)),
    "best": ("FIGAROH, derivatives by its pipeline, weighted, decimated by 10", BEST),
    "friction": ("FIGAROH, the same with friction and offsets fitted", dict(**BEST, friction=True, offset=True)),
    "reference": ("FIGAROH, its reference case: exact derivatives given, consistent bodies", dict(kind=with_figaroh.ExactUR10, stage="physical_fit")),
    "reference weighted": ("FIGAROH, exact derivatives given, weighted", dict(kind=with_figaroh.ExactUR10, wls=True)),
}
DYNIDENT = {
    "default": ("Dynident, by default (friction sought)", dict()),
    "no friction": ("Dynident, no friction stated", with_dynident.NO_FRICTION),
}


def run_figaroh(figures, settings, folder, test):
    """Runs FIGAROH on the recordings in a folder; the evaluation is not part of the measured time."""
    settings = dict(settings)
    calls = {key: settings.pop(key) for key in ("kind", "wls", "decimate") if key in settings}
    kind = "exact" if calls.get("kind") is with_figaroh.ExactUR10 else "positions"
    with_figaroh.write_configuration(folder / "ur10.yaml", folder / f"test_{kind}.csv", **settings)
    with timed(figures):
        found = with_figaroh.identify(folder / "ur10.urdf", folder / "ur10.yaml", folder / f"train_{kind}.csv", **calls)
    motion = test.q, test.dq, test.ddq
    if found.selected is not None and not found.selected.accepted:
        figures.refused += 1
    else:
        figures.judge(with_figaroh.predict(found, *motion), test.tau, test.tau_measured)
    # The true base parameters reproduce the noise-free torques of the held-out motion exactly.
    truth, *_ = np.linalg.lstsq(with_figaroh.base_regressor(found, *motion), test.tau.T.ravel(), rcond=None)
    told = found.result["wls_std_deviations"] if calls.get("wls") else found.std_relative
    inertial = [not name.startswith(("fv", "fs", "off")) for name in found.params_base]
    bars = ((found.phi_base - truth) / (np.array(told) / 100 * np.abs(found.phi_base)))[inertial]
    figures.bars += bars.tolist()
    figures.inside += (np.abs(bars) <= 1.96).tolist()


def run_dynident(figures, sections, folder, test, truth):
    with timed(figures):
        model = with_dynident.identify_ur10(folder / "ur10.urdf", folder / "train_positions.csv", folder / "test_positions.csv", **sections)
    figures.judge(model.predict(test.q, test.dq, test.ddq), test.tau, test.tau_measured)
    figures.warned += not model.ok
    bars, inside = with_dynident.errors_in_bars(model, truth, lambda name: not name.startswith(("fv", "fc", "off", "fs", "sig", "fr", "fq", "fl", "slip")))
    figures.bars += bars
    figures.inside += inside


def ur10(seeds, rounds, quick, folder):
    """Results of all settings at every noise level, by level and setting."""
    (folder / "ur10.urdf").write_text(ur10_example.urdf(ur10_example.NOMINAL))
    # FIGAROH names Ixx, Ixy, Iyy, Ixz, Iyz, Izz; Dynident Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
    truth = with_dynident.symbols(ur10_example.TRUTH[:, [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]])
    chosen = ["example", "best", "reference"] if quick else list(FIGAROH)
    found = {}
    for level in ur10_example.NOISE:
        figures = found[level] = defaultdict(Figures)
        for _ in range(rounds):
            for seed in ur10_example.SEEDS[:seeds]:
                train, test = ur10_example.rebuild(level, seed)
                for name, recording in (("train", train), ("test", test)):
                    for kind in ("positions", "exact"):
                        with_figaroh.write_recording(folder / f"{name}_{kind}.csv", recording, kind == "exact")
                for index in range(max(len(chosen), len(DYNIDENT))):
                    for key in chosen[index : index + 1]:
                        run_figaroh(figures[key], FIGAROH[key][1], folder, test)
                    for key in list(DYNIDENT)[index : index + 1]:
                        run_dynident(figures[key], DYNIDENT[key][1], folder, test, truth)
                figures["noise"].judge(test.tau, test.tau, test.tau_measured)
                figures["noise"].seconds.append(0.0)
    return found


# Questions: position noise, rad, and whether damping is known.
QUESTIONS = {
    "tutorial": ("as the tutorial: 0.6 rad, armatures unknown", 0.6, True),
    "encoder": ("0.001 rad, armatures unknown", 1e-3, True),
    "fine encoder": ("0.0001 rad, armatures unknown", 1e-4, True),
    "damping": ("0.001 rad, armatures and dampings unknown", 1e-3, False),
    "fine damping": ("0.0001 rad, armatures and dampings unknown", 1e-4, False),
}


# Start values of mujoco.sysid. Dynident's problem is linear and needs no start values.
STARTS = {
    "sysid": ("mujoco.sysid, from 0.01", {"armature": arm_tutorial.FIRST_GUESS, "damping": 0.01}),
    "sysid nearer": ("mujoco.sysid, from 0.3 and 0.5", {"armature": 0.3, "damping": 0.5}),
}
MOST = {"armature": 0.6, "damping": 2.0}


def run_sysid(figures, start, known, train, test):
    unknown = ["armature"] if known else ["armature", "damping"]
    true = np.concatenate([arm_tutorial.ARMATURE, arm_tutorial.DAMPING])[: 5 * len(unknown)]
    xml = arm_tutorial.mjcf(np.full(5, start["armature"]), arm_tutorial.DAMPING if known else np.full(5, start["damping"]))
    with timed(figures):
        parameters, half_width, model = with_sysid.identify(xml, train, unknown, start, MOST)
    figures.judge(arm_tutorial.inverse(model, test.q, test.dq, test.ddq), test.tau)
    error = np.abs(parameters.as_vector() - true) / half_width
    figures.bars += (1.96 * error).tolist()
    figures.inside += (error <= 1).tolist()


def run_dynident_on_arm(figures, known, train, test):
    xml = arm_tutorial.mjcf(np.full(5, arm_tutorial.FIRST_GUESS), arm_tutorial.DAMPING if known else np.full(5, 0.01))
    with timed(figures):
        model = with_dynident.identify_arm(xml, train, arm_tutorial.DAMPING if known else None)
    figures.judge(model.predict(test.q, test.dq, test.ddq), test.tau)
    figures.warned += not model.ok
    truth = with_dynident.symbols(arm_tutorial.bodies(), Ia=arm_tutorial.ARMATURE, fv=arm_tutorial.DAMPING)
    bars, inside = with_dynident.errors_in_bars(model, truth)
    figures.bars += bars
    figures.inside += inside


def arm(seeds, rounds, quick):
    """Results of both tools for every question, by question and tool."""
    test = arm_tutorial.record("test", 0.0, 0)
    found = {}
    for key in ["tutorial", "encoder"] if quick else QUESTIONS:
        _, noise, known = QUESTIONS[key]
        figures = found[key] = defaultdict(Figures)
        for _ in range(rounds):
            for seed in range(seeds):
                train = arm_tutorial.record("train", noise, seed)
                for start in list(STARTS)[: 1 if known else 2]:
                    run_sysid(figures[start], STARTS[start][1], known, train, test)
                run_dynident_on_arm(figures["dynident"], known, train, test)
    return found


def number(value, digits=2):
    """Formats a number for a table: the given significant digits, at least all digits before the decimal point; "> 1000" for larger values."""
    if value is None:
        return ""
    return "> 1000" if value > 1000 else f"{value:.{digits}g}" if value < 10**digits else f"{value:.0f}"


def row(words, numbers, measured):
    cells = [
        words,
        f"{number(numbers['seconds_min'])} ({number(numbers['seconds_median'])})" if numbers["seconds_min"] else "",
        f"{number(numbers['held_out_percent'])} ({number(numbers['held_out_percent_most'])})" if numbers["held_out_percent"] is not None else "",
        number(numbers["worst_joint_percent"]),
        *([number(numbers["held_out_measured_percent"], 3)] if measured else []),
        number(numbers["error_in_bars_rms"]),
        "" if numbers["inside_95"] is None else f"{100 * numbers['inside_95']:.0f} %",
        f"{numbers['refused'] + numbers['warned']} of {numbers['runs']}",
    ]
    return "| " + " | ".join(cells) + " |"


def table(ur10_found, arm_found):
    machine = common.machine()
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("dynident", "figaroh", "mujoco", "pin", "numpy", "scipy"))
    used = {
        "FIGAROH": lines("with_figaroh.py", "user", "user"),
        "mujoco.sysid": lines("with_sysid.py", "user", "user"),
        "Dynident for the UR10": lines("with_dynident.py", "ur10", "ur10"),
        "Dynident for the arm": lines("with_dynident.py", "arm", "arm"),
    }
    out = [
        f"{machine['date']}, {machine['cpu']} ({machine['cores']} cores, one used; load {machine['load']}), Python {platform.python_version()}, {versions}.",
        "Lines of a user's program: " + ", ".join(f"{name} {count}" for name, count in used.items()) + ".",
    ]
    head = "| {} | processor s: least (median) | held out, %: median (most) | worst joint, % | {}error / bar, rms | truth inside 95 % | refused or warned |"
    for level, figures in ur10_found.items():
        effort, position = ur10_example.NOISE[level]
        out += ["", f"UR10, noise of {100 * effort:g} % on the torques and {position:g} rad on the positions:", ""]
        out += [head.format("setting", "against measured, % | "), "| --- |" + " ---: |" * 7]
        for key, (words, _) in {**FIGAROH, **DYNIDENT}.items():
            if key in figures:
                out.append(row(words, figures[key].numbers(), True))
        out.append(f"| the truth itself | | | | {number(figures['noise'].numbers()['held_out_measured_percent'], 3)} | | | |")
    out += ["", "The arm of the tutorial, 2 s at 500 Hz:", "", head.format("position noise, question | tool", ""), "| --- | --- |" + " ---: |" * 6]
    for key, figures in arm_found.items():
        for tool, words in {**{start: words for start, (words, _) in STARTS.items()}, "dynident": "Dynident"}.items():
            if tool in figures:
                out.append(row(f"{QUESTIONS[key][0]} | {words}", figures[tool].numbers(), False))
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path, default=HERE.parents[1] / "target" / "rivals")
    options = parser.parse_args()
    rounds, seeds = (1, 1) if options.quick else (options.rounds, min(options.seeds, len(ur10_example.SEEDS)))
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(os.environ.get("CORE", max(os.sched_getaffinity(0))))})
    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as folder:
        ur10_found = ur10(seeds, rounds, options.quick, Path(folder))
    arm_found = arm(seeds, rounds, options.quick)
    options.out.mkdir(parents=True, exist_ok=True)
    text = table(ur10_found, arm_found)
    (options.out / "table.md").write_text(text)
    figures = {"ur10": ur10_found, "arm": arm_found}
    plain = {robot: {case: {key: one.numbers() for key, one in of.items()} for case, of in cases.items()} for robot, cases in figures.items()}
    (options.out / "figures.json").write_text(json.dumps(plain, indent=1) + "\n")
    print(text, end="")
    # The example evaluates its first draw.
    first = {key: ur10_found["low"][key].rms_nm[:1] for key in ("reference", *DYNIDENT)}
    if not all(rms and rms[0] <= MOST_RMS_NM for rms in first.values()):
        sys.exit(f"the torque error of a joint in the held-out motion is above {MOST_RMS_NM} Nm rms, or the model was refused: {first}")


if __name__ == "__main__":
    main()
