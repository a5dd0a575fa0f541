"""Tests the iteration on independent robots: MuJoCo behind the line protocol, with the imperfections of real robots.

    pip install mujoco numpy
    python benchmarks/campaign.py target/release/dynident --out target/campaign              # 5 seeds of each arm and fault
    python benchmarks/campaign.py target/release/dynident --out target/campaign --seeds 20 --only ur10,panda
    python benchmarks/campaign.py target/release/dynident --out target/campaign --quick      # one arm, one fault: used by the checks

Each seed draws a different robot. Masses and inertias differ from the description by up to 30 %. The robots have viscous, dry, Stribeck and
load-dependent dry friction, drive inertia, delays of 0 to 8 ms between sensors and drives, quantised encoders, velocities from position
differences, and torque noise. The studies do not state the friction (`friction = "auto"`). Each arm is also run with faults that no model
explains: torque saturation, a delayed log, a sticking joint, wrong link lengths. An iteration with a faulty robot must never converge.

Writes table.md and runs.csv (one line per run) to --out, and a folder for each iteration. Existing iterations are not repeated. Errors are
those of the base parameters of bodies and drives in result.json, compared with the true values, in units of the stated standard deviation.
Dynident's friction laws differ from MuJoCo's, so friction is judged by the motion of the robot. Exit status 1 if a faulty robot converged,
or if a robot left its envelope without a stop.
"""
import argparse
import csv
import json
import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
CLIENTS = {name: ROOT / "examples" / "robots" / f"{name}_client.py" for name in ("mujoco", "pinocchio")}

SEARCH = """
[design]
family = { kind = "fourier", harmonics = 5 }
duration_s = 10.0
criterion = "d-optimal"
torque_std_nm = 0.05

[design.search]
rate_hz = 100.0
seed = SEED
starts = 2

[design.defaults]
floor = false
self_collision = false
acceleration = false

[design.limits]
joints = [
JOINTS
]

[iteration]
rate_hz = 500.0
max_runs = 6
differentiator = { method = "deviation", smoother = { method = "butterworth", cutoff_hz = 6.0 } }
parallel_filter = { factor = 25, cutoff_hz = 6.0 }
settled = { tracking_tolerance = 1e-2 }
"""


def searched(names, speed, acceleration, torque, rest):
    """Design and iteration sections of a study: limits of each joint, then keys of [iteration] and further tables."""
    rows = zip(names, speed, acceleration, torque)
    line = '    { joint = "%s", speed = %s, acceleration = %s, torque = %s },'
    return SEARCH.replace("JOINTS", "\n".join(line % row for row in rows)) + rest


UR10 = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]

# For each arm: robot description, further sections of the study, true friction (Nm, Nm s/rad) and drive inertia (kg m^2).
ARMS = {
    "ur10": {
        "urdf": "robots/ur10.urdf",
        "study": searched(UR10, [1.5] * 3 + [2.0] * 3, [4.0] * 3 + [6.0] * 3, [230.0, 230.0, 100.0, 35.0, 35.0, 35.0],
                          "bandwidth_hz = 4.0\nspeed_steps = [0.5]\n"),
        "friction": [10, 10, 7, 3, 3, 2], "damping": [8, 8, 6, 2, 2, 1.5], "armature": [1, 1, 0.8, 0.2, 0.2, 0.2],
        "stribeck": [3, 3, 2, 1, 1, 0.6], "load": [0.03] * 6, "torque_noise": 0.1, "step": 2.5e-4,
        "clip": [330, 330, 150, 4, 6, 4], "catch": [2, 0.0, 0.15, 25.0],
    },
    "panda": {
        "urdf": "robots/panda_arm7.urdf",
        "study": searched([f"panda_joint{k}" for k in range(1, 8)], [1.5] * 7, [6, 5, 6, 8, 10, 10, 10], [60.0] * 4 + [7.0] * 3,
                          "bandwidth_hz = 4.0\n"),
        "friction": [0.9, 0.9, 0.7, 0.7, 0.4, 0.4, 0.3], "damping": [0.6, 0.6, 0.5, 0.5, 0.3, 0.3, 0.2], "armature": [0.1] * 7,
        "stribeck": [0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.1], "load": [0.03] * 7, "torque_noise": 0.05, "step": 2.5e-4,
        "clip": [87, 87, 87, 10, 12, 1.2, 12], "catch": [3, -1.5, 0.15, 8.0],
    },
    "paper-2r": {
        "urdf": "examples/robots/paper_2r.urdf", "gravity": [0.0, -9.8, 0.0],
        "study": """
[design]
family = { kind = "spliced-logistic", period_times_omega = 40.0, offsets = [0.0, 0.0] }
criterion = { kind = "windowed-condition", problem = "step-wise" }
optimiser = "gradient"
torque_std_nm = 1.0

[design.search]
rate_hz = 100.0
seed = SEED

[design.defaults]
floor = false
self_collision = false
acceleration = false
stop_margin_percent = 0.0

[design.limits]
joints = [
    { joint = "joint1", position = [0.0, 3.141592653589793], speed = 0.5235987755982988, acceleration = 0.20943951023931953 },
    { joint = "joint2", position = [0.0, 3.141592653589793], speed = 0.5235987755982988, acceleration = 0.20943951023931953 },
]

[controller]
kind = "finite-time"
kp = [2.0, 4.0]
kd = [20.0, 4.0]
alpha = 0.7

[iteration]
rate_hz = 250.0
every_sample = true
prior = "none"
start = "model-free"
model_free = { kind = "joint-pd", kp = [100.0, 16.0], kd = [60.0, 8.0] }
max_runs = 6
differentiator = { method = "deviation", smoother = { method = "butterworth", cutoff_hz = 2.0 } }
parallel_filter = { factor = 25, cutoff_hz = 2.0 }
settled = { tracking_tolerance = 1e-2 }
envelope = { tracking_error = 3.0 }
""",
        "friction": [0.8, 0.5], "damping": [0.6, 0.4], "armature": [0.0, 0.0], "stribeck": [0.4, 0.3], "load": [0.03] * 2,
        "torque_noise": 0.05, "step": 5e-4, "clip": [24, 30], "catch": [1, 1.5, 0.15, 6.0],
    },
    "position-drives": {
        "urdf": "robots/tx40.urdf",
        "study": searched([f"joint_{k}" for k in range(1, 7)], [2.0, 2.0, 2.5, 3.0, 3.0, 4.0], [8, 8, 10, 15, 15, 20],
                          [100.0, 100.0, 75.0, 35.0, 30.0, 20.0],
                          "[controller]\nkind = \"position-loop\"\nkp = KP\nkd = KD\n"),
        "kp": [4000, 4000, 1500, 300, 300, 100], "kd": [250, 250, 80, 15, 15, 5],
        "friction": [6, 6, 4, 2, 2, 1], "damping": [8, 8, 5, 2, 2, 1], "armature": [0.6, 0.6, 0.2, 0.05, 0.05, 0.02],
        "stribeck": [2, 2, 1.2, 0.6, 0.6, 0.3], "load": [0.03] * 6, "torque_noise": 0.1, "step": 2.5e-4,
        "clip": [132, 132, 103, 3.5, 43, 31], "catch": [2, 0.5, 0.15, 15.0],
    },
    # Gravity acts only on the slide, where it is constant. Units at the slide: N, N s/m and kg.
    "scara": {
        "urdf": "benchmarks/robots/scara.urdf",
        "study": searched(["shoulder", "elbow", "slide", "flange"], [2.0, 2.5, 0.4, 4.0], [8, 10, 3, 20], [90.0, 45.0, 110.0, 9.0],
                          "bandwidth_hz = 4.0\n"),
        "friction": [4, 2.5, 8, 0.6], "damping": [3, 2, 20, 0.3], "armature": [0.5, 0.2, 3, 0.03], "stribeck": [1, 0.7, 2, 0.2],
        "stribeck-speed": [0.05, 0.05, 0.01, 0.05], "load": [0.03] * 4, "torque_noise": 0.05, "step": 2.5e-4,
        "clip": [15, 8, 45, 0.9], "catch": [1, 0.5, 0.15, 8.0],
    },
    # The last joint is much lighter than its effort limit suggests.
    "gripper-arm": {
        "urdf": "benchmarks/robots/gripper_arm.urdf",
        "study": searched(["waist", "shoulder", "elbow", "wrist", "gripper"], [2.0] * 5, [6, 5, 6, 8, 8], [22.0, 45.0, 22.0, 22.0, 22.0],
                          "bandwidth_hz = 4.0\n"),
        "friction": [0.6, 0.8, 0.6, 0.3, 0.1], "damping": [0.4, 0.5, 0.4, 0.2, 0.05], "armature": [0.05, 0.08, 0.05, 0.03, 0.009],
        "stribeck": [0.2, 0.3, 0.2, 0.1, 0.03], "load": [0.03] * 5, "torque_noise": 0.02, "step": 2.5e-4,
        "clip": [2.0, 12, 4, 0.6, 0.25], "catch": [2, 1.0, 0.15, 3.0],
    },
}
FAULTS = ["clips", "lags", "catches", "other-lengths"]


def numbers(values):
    return ",".join(f"{value:g}" for value in values)


def robot_of(name, fault, seed, client="mujoco", **more):
    """Returns the command of the robot, and the total delay of sensors and drives, s. `more` contains further options of the client."""
    arm = ARMS[name]
    random = np.random.default_rng(1000 + seed)
    late = 1e-3 * random.uniform(0.0, 8.0)
    shares = random.uniform(0.0, 1.0)
    options = {key: numbers(arm[key]) for key in (
        "friction", "damping", "armature", "stribeck", "stribeck-speed", "load", "gravity", "kp", "kd") if key in arm}
    options |= {"masses": 30, "seed": seed, "step": arm["step"], "quantum": 1e-5, "speed-filter": 100, "torque-noise": arm["torque_noise"]}
    if "kp" in arm:
        # The drives close the loop internally; only their reported values are delayed.
        options["log-delay"] = late
    else:
        options |= {"sensor-delay": f"{shares * late:.5f}", "drive-delay": f"{(1 - shares) * late:.5f}"}
    if fault == "clips":
        options["torque"] = numbers(arm["clip"])
    elif fault == "lags":
        options["log-delay"] = 0.02
    elif fault == "catches":
        options["catch"] = numbers(arm["catch"])
    elif fault == "other-lengths":
        options["lengths"] = 12
    options |= more
    words = [sys.executable, str(CLIENTS[client]), str(ROOT / arm["urdf"]), "--truth", "truth.json"]
    # Use `--key=value`, because values may begin with a minus. True means an option without a value.
    return words + [f"--{key}" if value is True else f"--{key}={value}" for key, value in options.items()], late


def write_study(name, seed, command, to, tables=None):
    """`tables` replaces the design and iteration sections of the arm."""
    arm = ARMS[name]
    tables = (tables or arm["study"]).replace("SEED", str(seed)).replace("KP", json.dumps(arm.get("kp"))).replace("KD", json.dumps(arm.get("kd")))
    gravity = f"gravity_m_s2 = {arm['gravity']}\n" if "gravity" in arm else ""
    drive = "drive_inertia = true\n" if any(arm["armature"]) else ""
    to.write_text(
        f'name = "{name}, seed {seed}"\n\n[robot]\nfile = {json.dumps(str(ROOT / arm["urdf"]))}\n{gravity}\n'
        f'[drive]\nfriction = "auto"\noffset = false\n{drive}{tables}'
        f'\n[iteration.robot]\nkind = "process"\ncommand = {json.dumps(command)}\n', encoding="utf-8")


def true_value(expression, truth):
    """Value of a base parameter from the true parameters; None if it contains friction."""
    own = {}
    for number, (body, inertia) in enumerate(zip(truth["bodies"], truth["drive_inertia"]), 1):
        for symbol, value in zip(["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"], body):
            own[f"{symbol}{number}"] = value
        own[f"Ia{number}"] = inertia
    value, sign, factor = 0.0, 1.0, 1.0
    for word in expression.split():
        if word in "+-":
            sign = 1.0 if word == "+" else -1.0
        elif re.fullmatch(r"-?[\d.]+(e-?\d+)?", word):
            factor = float(word)
        elif word.lstrip("-") in own:
            sign *= -1.0 if word.startswith("-") else 1.0
            value += sign * factor * own[word.lstrip("-")]
            sign, factor = 1.0, 1.0
        else:
            return None
    return value


def judged(folder, status):
    """Result of one iteration."""
    row = {"status": "failed", "exit": status, "converged": False, "runs": 0, "parameters": 0, "square": 0.0, "inside": 0,
           "worst": 0.0, "tracking_first": None, "tracking_last": None, "in_envelope": True, "stopped": True, "reason": ""}
    truth_file, file = folder / "truth.json", folder / "result" / "iterations.json"
    truth = json.loads(truth_file.read_text(encoding="utf-8")) if truth_file.exists() else {"runs": []}
    # A motion outside its envelope must be stopped.
    left = [run for run in truth["runs"] if run["left_envelope"]]
    row |= {"in_envelope": not left, "stopped": all(run["ended"] == "stopped" for run in left)}
    if not file.exists():
        row["reason"] = (folder / "output.txt").read_text(encoding="utf-8").strip()[-400:]
        return row
    iterations = json.loads(file.read_text(encoding="utf-8"))
    runs = iterations["runs"]
    row |= {"status": iterations["status"], "converged": iterations["converged"], "runs": len(runs), "reason": iterations["reason"],
            "unmet": "; ".join(part.get("text") or part.get("condition", "") for part in iterations["unmet"])}
    if runs:
        row |= {"tracking_first": max(truth["runs"][0]["tracking_error"]), "tracking_last": max(truth["runs"][-1]["tracking_error"])}
    result = folder / "result" / "result.json"
    if result.exists():
        errors = []
        for parameter in json.loads(result.read_text(encoding="utf-8"))["base_parameters"]:
            true = true_value(parameter["expression"], truth)
            if true is not None and parameter["std"]:
                off = parameter["value"] - true
                errors.append((off / parameter["std"], abs(off) <= parameter["half_width_95"], parameter["symbol"]))
        worst = max(errors, key=lambda error: abs(error[0]), default=(0.0, True, ""))
        row |= {"parameters": len(errors), "square": sum(error[0] ** 2 for error in errors),
                "inside": sum(error[1] for error in errors), "worst": f"{worst[2]} {worst[0]:.1f}"}
    return row


def run_study(dynident, folder):
    """Runs study.toml in this folder into result/; returns the exit status, the wall time, and the processor time including the robot program, s."""
    start = time.monotonic()
    with open(folder / "output.txt", "w", encoding="utf-8") as output:
        process = subprocess.Popen([dynident, "iterate", "study.toml", "--out", "result", "--allow-command", "--fresh"], cwd=folder,
                                   stdout=output, stderr=subprocess.STDOUT, env=os.environ | {"OMP_NUM_THREADS": "1"})
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, round(time.monotonic() - start, 1), round(usage.ru_utime + usage.ru_stime, 1)


def write_csv(rows, to):
    keys = list(dict.fromkeys(key for row in rows for key in row))
    with open(to, "w", newline="", encoding="utf-8") as text:
        writer = csv.DictWriter(text, keys)
        writer.writeheader()
        writer.writerows(rows)


def iterate(dynident, name, fault, seed, out):
    """Runs one iteration, unless its result exists."""
    folder = out / f"{name}_{fault or 'sound'}_{seed}"
    done = folder / "row.json"
    if done.exists():
        return json.loads(done.read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    command, late = robot_of(name, fault, seed)
    write_study(name, seed, command, folder / "study.toml")
    status, seconds, _ = run_study(dynident, folder)
    row = {"arm": name, "fault": fault or "", "seed": seed, "late_ms": round(1e3 * late, 2), "seconds": seconds} | judged(folder, status)
    done.write_text(json.dumps(row), encoding="utf-8")
    print(f"{name} {fault or 'sound'} {seed}: {row['status']}, {row['runs']} runs, {row['seconds']} s", flush=True)
    return row


def percent(count, of):
    return f"{100 * count / of:.0f} %" if of else "-"


def table(rows):
    """Table with one line for each arm and fault."""
    lines = ["| arm | robot | seeds | converged | inside the envelope | runs | true tracking error, last run, rad (median) | parameters | rms (error / bar) | inside 95 % |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for key in dict.fromkeys((row["arm"], row["fault"]) for row in rows):
        own = [row for row in rows if (row["arm"], row["fault"]) == key]
        told = [row for row in own if row["parameters"]] if not key[1] else []
        count = sum(row["parameters"] for row in told)
        rms = f"{math.sqrt(sum(row['square'] for row in told) / count):.2f}" if count else "-"
        tracking = [row["tracking_last"] for row in own if row["tracking_last"] is not None]
        runs = [row["runs"] for row in own]
        lines.append(
            f"| {key[0]} | {key[1] or 'sound'} | {len(own)} | {percent(sum(row['converged'] for row in own), len(own))} "
            f"| {percent(sum(row['in_envelope'] for row in own), len(own))} | {min(runs)} to {max(runs)} "
            f"| {f'{np.median(tracking):.1e}' if tracking else '-'} | {count or '-'} | {rms} | {percent(sum(row['inside'] for row in told), count)} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dynident", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(ARMS), help="comma-separated arms")
    parser.add_argument("--faults", default=",".join(FAULTS), help="comma-separated faults; empty for no fault")
    parser.add_argument("--quick", action="store_true", help="only the first arm: one robot without faults and one with torque saturation")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    dynident, out = options.dynident.resolve(), options.out.resolve()
    names, faults, seeds = options.only.split(","), [fault for fault in options.faults.split(",") if fault], options.seeds
    if options.quick:
        names, faults, seeds = names[:1], faults[:1], 1
    rows = [iterate(dynident, name, fault, seed, out) for seed in range(options.first_seed, options.first_seed + seeds)
            for name in names for fault in [None, *faults]]
    (out / "table.md").write_text(table(rows), encoding="utf-8")
    write_csv(rows, out / "runs.csv")
    print(table(rows), end="")
    wrong = [row for row in rows if (row["fault"] and row["converged"]) or not row["stopped"]]
    for row in wrong:
        print(f"{row['arm']} {row['fault'] or 'sound'} {row['seed']}: {row['status']}, inside its envelope: {row['in_envelope']}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
