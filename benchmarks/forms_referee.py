#!/usr/bin/env python3
"""Evaluates exported files as their readers do, and compares the errors with those that Dynident prints.

    forms_referee.py DYNIDENT SCRATCH [--data FOLDER] [STUDY.toml ..]

For each study (by default the example sets of examples/ without closed chains, which need constraint forces in MuJoCo): `dynident identify`, `dynident export --to urdf`, `mjcf` and `c`, and `dynident validate --samples`, which writes positions, velocities,
accelerations and torques of every log as the test uses them, and the filter. Everything else is computed here:

- URDF: Pinocchio's inverse dynamics, plus damping and friction of the file. MJCF: MuJoCo's inverse dynamics (armature, damping, stiffness), plus frictionloss. C: the header compiled by gcc.
- Measured and predicted torque pass the same low-pass and decimation. The error is 100 |tau - tau_file| / |tau| over all joints of a held-out log; `printed` is that of NAME.validation.json.
- On the training logs, nonnegative least squares (SciPy) of the torque that the bodies of the file do not explain, joint by joint: damping and Coulomb friction (URDF); the same with armature where the
  file has one (MJCF); damping and Coulomb friction for each direction, an offset, drive inertia, and the best of four step widths (C, with the bodies of the URDF). `fit` and `held out` are the errors
  of the file on the training and on the held-out logs, divided by those of this solution.

Prints a table. Exit status 1 if an error differs from the printed one by more than 1e-6 of it, or if a ratio `held out` is above 1.05. Needs Pinocchio, MuJoCo, SciPy and gcc.
"""
import argparse
import ctypes
import json
import pathlib
import re
import subprocess
import sys
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
from scipy.optimize import nnls

EXAMPLES = pathlib.Path(__file__).resolve().parent.parent / "examples"
NAMES = ["ur10", "panda", "lbr_med7", "lwr4plus_1_to_2", "lwr4plus_23_to_1", "tx40", "ur10_simulated", "tiago", "dfki_pendulum"]
STEP_WIDTHS = [0.001, 0.01, 0.03, 0.1]
SAME, BEST = 1e-6, 1.05


class Log:
    """The samples of a log, and its filter."""

    def __init__(self, folder, entry, dof):
        table = np.loadtxt(folder / entry["file"], delimiter=",", skiprows=1, ndmin=2)
        self.name, self.is_held_out, self.segment = entry["log"], entry["role"] == "validate", table[:, 0]
        self.q, self.dq, self.ddq, self.tau, used = (table[:, 1 + k * dof : 1 + (k + 1) * dof] for k in range(5))
        self.used = used > 0
        self.taps = np.array(entry["taps"] or [1.0])
        self.factor = entry["filter"]["factor"] if entry["filter"] else 1

    def filtered(self, values, joint):
        """Low-pass and decimation of one column per sample; masked samples are left out."""
        rows, used = [], self.used[:, joint].astype(float)
        for segment in np.unique(self.segment):
            here = self.segment == segment
            if here.sum() < len(self.taps):
                continue
            one = lambda x: np.convolve(x[here], self.taps, "valid")[:: self.factor]
            coverage = one(used)
            kept = coverage >= 0.5
            rows.append(one(values * used)[kept] / coverage[kept])
        return np.concatenate(rows) if rows else np.zeros(0)


def of_urdf(path, gravity):
    """Inverse dynamics of the bodies, and damping and friction of each joint."""
    model = pinocchio.buildModelFromUrdf(str(path))
    model.gravity.linear = np.array(gravity)
    data = model.createData()
    joints = {joint.get("name"): joint.find("dynamics") for joint in ElementTree.parse(path).getroot().findall("joint")}
    own = [joints[name] for name in model.names[1:]]
    drive = np.array([[float(one.get(key, 0)) if one is not None else 0.0 for key in ("damping", "friction")] for one in own])
    order = list(model.names[1:])

    def bodies(names, q, dq, ddq):
        there = [names.index(name) for name in order]
        back = [order.index(name) for name in names]
        start = pinocchio.neutral(model)
        # Continuous joints have the cosine and sine of their angle as positions.
        tau = np.array([pinocchio.rnea(model, data, pinocchio.integrate(model, start, row[0][there]), row[1][there], row[2][there]) for row in zip(q, dq, ddq)])
        return tau[:, back], drive[back]

    return bodies


def of_mjcf(path):
    """Inverse dynamics without friction and damping, and damping, frictionloss and armature of each joint."""
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.neq == 0, "followers"
    drive = np.column_stack([model.dof_damping, model.dof_frictionloss, model.dof_armature])
    drive = drive.reshape(model.nv, 3).copy()
    model.dof_damping[:] = 0
    model.dof_armature[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    order = [model.joint(k).name for k in range(model.njnt)]

    def bodies(names, q, dq, ddq):
        there, back = [names.index(name) for name in order], [order.index(name) for name in names]
        tau = np.empty_like(q)
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k][there], dq[k][there], ddq[k][there]
            mujoco.mj_inverse(model, data)
            tau[k] = data.qfrc_inverse
        return tau[:, back], drive[back]

    return bodies


def of_code(path):
    """The torque of the C code."""
    prefix = re.search(r"(\w+)_inverse_dynamics\(", path.read_text()).group(1)
    source, library = path.with_suffix(".c"), path.with_suffix(".so")
    call = f"{prefix}_inverse_dynamics(q + k * n, v + k * n, a + k * n, t + k * n)"
    arguments = "long rows, long n, const double *q, const double *v, const double *a, double *t"
    source.write_text(f'#include "{path.name}"\nvoid torque({arguments}) {{ for (long k = 0; k < rows; k++) {call}; }}\n')
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True)
    torque = ctypes.CDLL(str(library)).torque

    def code(q, dq, ddq):
        out, inputs = np.empty_like(q), [np.ascontiguousarray(x) for x in (q, dq, ddq)]
        pointer = lambda x: x.ctypes.data_as(ctypes.c_void_p)
        torque(ctypes.c_long(len(q)), ctypes.c_long(q.shape[1]), *(pointer(x) for x in (*inputs, out)))
        return out

    return code


def error_percent(logs, torques):
    """The error over all joints of these logs."""
    residual = torque = 0.0
    for log, predicted in zip(logs, torques):
        for joint in range(log.q.shape[1]):
            measured = log.filtered(log.tau[:, joint], joint)
            residual += np.sum((measured - log.filtered(predicted[:, joint], joint)) ** 2)
            torque += np.sum(measured**2)
    return 100 * np.sqrt(residual / torque)


def simple_columns(log, joint, has_inertia):
    columns = [log.dq[:, joint], np.sign(log.dq[:, joint])]
    return columns + [log.ddq[:, joint]] if has_inertia else columns


def rich_columns(log, joint, width):
    v = log.dq[:, joint]
    step = np.tanh(v / width)
    ones = np.ones_like(v)
    return [np.maximum(v, 0), np.minimum(v, 0), np.maximum(step, 0), np.minimum(step, 0), ones, -ones, log.ddq[:, joint]]


def best_error(training, bodies, tests, bodies_of_tests, columns_of):
    """Errors of the nonnegative least squares of the training logs on these and on the held-out logs; `columns_of` gives alternative lists of columns for a joint."""
    residual, torque = np.zeros(2), np.zeros(2)
    for joint in range(training[0].q.shape[1]):
        both = []
        for logs, of_bodies in ((training, bodies), (tests, bodies_of_tests)):
            measured = np.concatenate([log.filtered(log.tau[:, joint], joint) for log in logs])
            rest = np.concatenate([log.filtered(log.tau[:, joint] - body[:, joint], joint) for log, body in zip(logs, of_bodies)])
            matrices = [np.concatenate([np.column_stack([log.filtered(x, joint) for x in columns(log)]) for log in logs]) for columns in columns_of(joint)]
            both.append((matrices, rest, np.sum(measured**2)))
        (matrices, rest, _), (matrices_of_tests, rest_of_tests, _) = both
        solutions = [nnls(matrix, rest) for matrix in matrices]
        chosen = int(np.argmin([norm for _, norm in solutions]))
        values, norm = solutions[chosen]
        residual += [norm**2, np.sum((rest_of_tests - matrices_of_tests[chosen] @ values) ** 2)]
        torque += [one[2] for one in both]
    return 100 * np.sqrt(residual / torque)


def run(dynident, *arguments):
    done = subprocess.run([dynident, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode < 2, f"{arguments}: {done.stderr}"


def refereed(dynident, scratch, study, data):
    """Rows of the table of one study."""
    folder = scratch / study.stem
    run(dynident, "identify", study, *data, "--out", folder, "--quiet")
    result = json.loads((folder / "result.json").read_text())
    files = {form: folder / f"model.{end}" for form, end in (("urdf", "urdf"), ("mjcf", "xml"), ("c", "h"))}
    for form, path in files.items():
        run(dynident, "export", folder, "--to", form, "--out", path, "--quiet")
    run(dynident, "validate", folder / "result.json", "--study", study, *data, "--samples", folder / "samples", "--quiet")
    samples = json.loads((folder / "samples" / "samples.json").read_text())
    names = samples["joints"]
    logs = [Log(folder / "samples", entry, len(names)) for entry in samples["logs"]]
    training, tests = [log for log in logs if not log.is_held_out], [log for log in logs if log.is_held_out]
    readers = {"urdf": of_urdf(files["urdf"], result["robot"]["gravity_m_s2"]), "mjcf": of_mjcf(files["mjcf"])}
    code, bodies_of_urdf = of_code(files["c"]), None
    for form in files:
        bodies, torques = [], []
        for log in logs:
            if form == "c":
                torques.append(code(log.q, log.dq, log.ddq))
                continue
            body, drive = readers[form](names, log.q, log.dq, log.ddq)
            own = drive[:, 0] * log.dq + drive[:, 1] * np.sign(log.dq)
            if form == "mjcf":
                own += drive[:, 2] * log.ddq
            bodies.append(body)
            torques.append(body + own)
        if form == "urdf":
            bodies_of_urdf = bodies
            columns_of = lambda joint: [lambda log: simple_columns(log, joint, False)]
        elif form == "mjcf":
            columns_of = lambda joint: [lambda log: simple_columns(log, joint, drive[joint, 2] > 0)]
        else:
            bodies = bodies_of_urdf
            columns_of = lambda joint: [lambda log, width=width: rich_columns(log, joint, width) for width in STEP_WIDTHS]
        pick = lambda values, chosen: [value for value, log in zip(values, logs) if log in chosen]
        best = best_error(training, pick(bodies, training), tests, pick(bodies, tests), columns_of)
        own = [error_percent(part, pick(torques, part)) for part in (training, tests)]
        printed = json.loads(files[form].with_name(files[form].name + ".validation.json").read_text())
        for log, torque in zip(tests, pick(torques, tests)):
            stated = next(one["relative_error_percent"] for one in printed["held_out"] if one["log"] == log.name)
            yield study.stem, form, stated, error_percent([log], [torque]), own[0] / best[0], own[1] / best[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dynident")
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("study", nargs="*", type=pathlib.Path, default=[EXAMPLES / f"{name}.toml" for name in NAMES])
    parser.add_argument("--data", help="the folder of the public recordings")
    options = parser.parse_args()
    data = ["--data", options.data] if options.data else []
    options.scratch.mkdir(parents=True, exist_ok=True)
    print("| study | form | printed % | referee % | relative difference | fit | held out |\n| --- | --- | --- | --- | --- | --- | --- |")
    failed = 0
    for study in options.study:
        try:
            for name, form, printed, own, fit, ratio in refereed(options.dynident, options.scratch, study, data):
                difference = abs(printed / own - 1)
                failed += difference > SAME or ratio > BEST
                print(f"| `{name}` | {form} | {printed:.4f} | {own:.4f} | {difference:.1e} | {fit:.4f} | {ratio:.4f} |", flush=True)
        except AssertionError as error:
            failed += 1
            print(f"| `{study.stem}` | failed: {error} | | | | | |", flush=True)
    sys.exit(int(failed > 0))


if __name__ == "__main__":
    main()
