#!/usr/bin/env python3
"""Payloads of 0.3 to 5 kg on simulated arms: the inertia that `dynident export --to payload-ur` writes against the truth.

    payloads.py DYNIDENT SCRATCH [--cases 40] [--seed 1]

Simulates a UR10 and a Franka Panda (robots/) with Pinocchio: 24 s at 125 Hz without and with a box at the flange, five Fourier harmonics of 0.1 Hz, viscous and smooth Coulomb friction, torque noise
with a lag-1 correlation of 0.8, position noise of 2e-5 rad. Boxes have random mass (log-uniform), density (500 to 8000 kg/m^3), edges (ratios up to 3), orientation and centre of mass. Each case is one
`dynident identify` with default settings. A moment of inertia passes if it is within a factor of two of the truth or if the truth is in its stated interval; a product of inertia passes if it is within
half of the mean true moment or if the truth is in its interval (a product may be zero, so a factor means nothing). A case passes if all six pass. Prints one line for each case and the number of cases that pass; exit status 1 unless all pass. Needs Pinocchio.
"""
import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np
import pinocchio

from simulated_arms import correlated_noise, fourier

ROBOTS = pathlib.Path(__file__).resolve().parent.parent / "robots"
# Description, link of the payload, viscous friction, Coulomb friction and torque noise of each joint.
ARMS = {
    "ur10": ("ur10.urdf", "tool0", [12, 12, 8, 2, 2, 2], [8, 9, 7, 2, 2, 2], [0.6, 0.6, 0.5, 0.15, 0.15, 0.15]),
    "panda": ("panda_arm7.urdf", None, [6, 6, 4, 4, 2, 2, 1], [1, 1, 0.8, 0.8, 0.6, 0.5, 0.4], [0.3, 0.3, 0.25, 0.25, 0.1, 0.08, 0.06]),
}
SAMPLES, DT, HARMONICS, BASE_HZ = 3000, 0.008, 5, 0.1
START = np.array([0, -1.2, 1.2, -1, 1, 0, 0])
NAMES = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
ENTRIES = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]


def last_link(model):
    return [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY][-1]


def simulated(arm, seed, box=None):
    """Table of time, positions and torques."""
    file, link, viscous, coulomb, noise = ARMS[arm]
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / file))
    if box:
        frame = model.frames[model.getFrameId(link or last_link(model))]
        model.appendBodyToJoint(frame.parentJoint, pinocchio.Inertia(*box), frame.placement)
    data, n, random = model.createData(), model.nv, np.random.default_rng(seed)
    t = np.arange(SAMPLES) * DT
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    is_limited = high - low < 6
    middle = np.where(is_limited, (low + high) / 2, START[:n])
    amplitude = 1.6 * np.minimum(0.9, np.where(is_limited, (high - low) / 3, 0.9))
    q, v, acc = fourier(t, middle, amplitude, HARMONICS, BASE_HZ, random)
    tau = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, v, acc)])
    tau += np.array(viscous) * v + np.array(coulomb) * np.tanh(v / 0.01)
    error = correlated_noise(tau.shape, random)
    return np.column_stack([t, q + 2e-5 * random.normal(size=q.shape), tau + np.array(noise) * error])


def write(path, table):
    n = (table.shape[1] - 1) // 2
    head = ",".join(["t"] + [f"q{k + 1}" for k in range(n)] + [f"tau{k + 1}" for k in range(n)])
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.9g")


def random_box(random):
    """Mass, centre of mass and inertia about it of a random box."""
    mass = 0.3 * (5 / 0.3) ** random.uniform()
    density = 500 * 16 ** random.uniform()
    edges = 3 ** random.uniform(size=3)
    edges *= (mass / density / edges.prod()) ** (1 / 3)
    square = edges**2
    moments = mass / 12 * (square.sum() - square)
    turn = pinocchio.Quaternion(random.normal(size=4)).normalized().matrix()
    com = np.array([random.uniform(-0.06, 0.06), random.uniform(-0.06, 0.06), random.uniform(0.03, 0.15)])
    return mass, com, turn @ np.diag(moments) @ turn.T


def identified(dynident, scratch, arm, number, box):
    file, link, *_ = ARMS[arm]
    robot = ROBOTS / file
    model = pinocchio.buildModelFromUrdf(str(robot))
    write(scratch / f"{arm}_{number}.csv", simulated(arm, 100 + number, box))
    study = scratch / f"{arm}_{number}.toml"
    columns = f"{{1..{model.nv}}}"
    study.write_text(
        f'[robot]\nfile = "{robot}"\n[[payload]]\nname = "box"\nlink = "{link or last_link(model)}"\n[format]\ntime = {{ column = "t" }}\n'
        f'position = {{ columns = "q{columns}" }}\ntorque = {{ columns = "tau{columns}" }}\n'
        f'[[log]]\nfile = "{arm}_empty.csv"\n[[log]]\nfile = "{arm}_{number}.csv"\npayload = "box"\n'
    )
    out = scratch / f"out_{arm}_{number}"
    subprocess.run([dynident, "identify", str(study), "--out", str(out), "--quiet"], capture_output=True, timeout=600)
    return json.loads((out / "result.json").read_text())["payloads"][0]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dynident")
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.scratch.mkdir(parents=True, exist_ok=True)
    for arm in ARMS:
        write(options.scratch / f"{arm}_empty.csv", simulated(arm, 1))
    random, passed, within, before = np.random.default_rng(options.seed), 0, [], []
    print("case arm mass_kg true_trace written_trace nearest_trace ratios(xx,yy,zz) half_width_95(xx) verdict")
    for number in range(options.cases):
        arm, box = list(ARMS)[number % len(ARMS)], random_box(random)
        found = identified(options.dynident, options.scratch, arm, number, box)
        truth = [box[2][entry] for entry in ENTRIES]
        body = found["controller"]
        values = {value["name"]: value for value in body["values"]}
        good = []
        for name, (a, b), true in zip(NAMES, ENTRIES, truth):
            one = values[name]
            in_interval = one["lower_95"] <= true <= one["upper_95"]
            in_range = 0.5 <= one["value"] / true <= 2 if a == b else abs(one["value"] - true) <= 0.5 * np.trace(box[2]) / 3
            good.append(in_interval or in_range)
        ratios = [values[name]["value"] / true for name, (a, b), true in zip(NAMES, ENTRIES, truth) if a == b]
        nearest = found["possible"]["inertia_at_com_kgm2"]
        trace = lambda moments: moments[0] + moments[3] + moments[5]
        within.append(all(0.5 <= ratio <= 2 for ratio in ratios))
        before.append(trace(nearest) / trace(truth))
        passed += all(good)
        print(
            f"{number + 1} {arm} {box[0]:.2f} {trace(truth):.2e} {trace(body['inertia_at_com_kgm2']):.2e} {trace(nearest):.2e}",
            ",".join(f"{ratio:.2f}" for ratio in ratios),
            f"{values['ixx']['half_width_95']:.1e}",
            "passed" if all(good) else "FAILED: " + " ".join(name for name, ok in zip(NAMES, good) if not ok),
            flush=True,
        )
    print(f"{passed} of {options.cases} cases pass; all three moments within a factor of two in {sum(within)}; nearest body: trace {min(before):.2f} to {max(before):.2f} times the truth")
    sys.exit(passed < options.cases)


if __name__ == "__main__":
    main()
