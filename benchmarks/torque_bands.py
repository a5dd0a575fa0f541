#!/usr/bin/env python3
"""Torque band and verdict of correct models on held-out motion unlike the training motion.

    torque_bands.py DYNIDENT SCRATCH [--seed 1]

Simulates a UR10 and a Panda (robots/) with Pinocchio, each with six kinds of friction: stiff and smooth Coulomb, Stribeck, friction under load, friction that holds any torque at rest, presliding (Maxwell slip).
The training log has 30 s at 250 Hz, five Fourier harmonics of 0.1 Hz, white torque noise of 1 %, and position noise of 2e-5 rad. The held-out logs are point-to-point motion (all strokes differ, no pauses)
and pick-and-place (strokes between fixed poses, with pauses) at 0.5, 1 and 2 times the peak speed of the training motion. Each case is `dynident identify` with default settings. Prints the share of
joints and motions with 90 to 99 % of the torque inside the band, and the number of false problems. Needs the packages of `forms_referee.py`.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
import pinocchio

from simulated_arms import fourier, slip

ROBOTS = pathlib.Path(__file__).resolve().parent.parent / "robots"
TRUTHS = ["stiff", "smooth", "stribeck", "load", "held", "slip"]
SPEEDS = [0.5, 1.0, 2.0]
DT, TRAIN_S, TEST_S, HARMONICS, BASE_HZ = 0.004, 30.0, 48.0, 5, 0.1


def strokes(low, high, speed, pause_s, random):
    """Quintic strokes with the given peak speed of each joint; the slowest joint determines the time of a stroke."""
    samples, n = int(TEST_S / DT), len(low)
    middle, half = (low + high) / 2, 0.8 * (high - low) / 2
    poses = middle + half * random.uniform(-1, 1, size=(4, n))
    q, v, acc, here, turn = [], [], [], poses[0], 0
    while sum(map(len, q)) < samples:
        turn += 1
        there = poses[turn % 4] if pause_s else middle + half * random.uniform(-1, 1, size=n)
        seconds = max((1.875 * np.abs(there - here) / speed).max(), 0.2)
        u = np.arange(DT, seconds, DT)[:, None] / seconds
        way = there - here
        q.append(here + way * u**3 * (10 - 15 * u + 6 * u**2))
        v.append(way * 30 * u**2 * (1 - u) ** 2 / seconds)
        acc.append(way * 60 * u * (1 - u) * (1 - 2 * u) / seconds**2)
        rest = np.zeros((int(pause_s * random.uniform(0.5, 1.5) / DT), n))
        q, v, acc, here = q + [rest + there], v + [rest], acc + [rest], there
    return [np.concatenate(parts)[:samples] for parts in (q, v, acc)]


def torque(model, truth, size, motion, random):
    q, v, acc = motion
    data = model.createData()
    rigid = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, v, acc)])
    if size is None:
        size = np.sqrt((rigid**2).mean(axis=0)) + 0.5
    step = np.tanh(v / 0.002)
    rests = np.abs(v).max(axis=1) == 0
    held = random.uniform(-1, 1, size=q.shape)[np.cumsum(np.diff(rests, prepend=rests[0]))] * rests[:, None]
    friction = {
        "stiff": lambda: 0.15 * size * step,
        "smooth": lambda: 0.15 * size * np.tanh(v / 0.05),
        "stribeck": lambda: 0.12 * size * step * (1 + 0.6 * np.exp(-np.abs(v) / 0.1)),
        "load": lambda: (0.1 * size + 0.08 * np.abs(rigid)) * step,
        "held": lambda: 0.15 * size * (step + held),
        "slip": lambda: 0.15 * size * slip(q, (0.005, 0.05)),
    }[truth]()
    return rigid + 0.1 * size * v + friction + 0.01 * size * random.normal(size=q.shape), size


def write(path, q, tau, random):
    n = q.shape[1]
    head = ",".join(["t"] + [f"{key}{k + 1}" for key in ("q", "tau") for k in range(n)])
    table = np.column_stack([np.arange(len(q)) * DT, q + 2e-5 * random.normal(size=q.shape), tau])
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.10g")


def case(scratch, robot, truth, random):
    """Writes logs and study; the names of the held-out logs."""
    path, name = ROBOTS / f"{robot}.urdf", f"{robot}_{truth}"
    model = pinocchio.buildModelFromUrdf(str(path))
    low, high = np.maximum(model.lowerPositionLimit, -2.0), np.minimum(model.upperPositionLimit, 2.0)
    training = fourier(np.arange(0, TRAIN_S, DT), (low + high) / 2, 0.9 * (high - low) / 2, HARMONICS, BASE_HZ, random)
    tau, size = torque(model, truth, None, training, random)
    write(scratch / f"{name}_train.csv", training[0], tau, random)
    peak, logs = np.abs(training[1]).max(axis=0), {}
    for kind, pause_s in (("p2p", 0.0), ("pick", 0.6)):
        for speed in SPEEDS:
            motion = strokes(low, high, speed * peak, pause_s, random)
            logs[f"{name}_{kind}_{speed}"] = (kind, speed)
            write(scratch / f"{name}_{kind}_{speed}.csv", motion[0], torque(model, truth, size, motion, random)[0], random)
    columns = f"{{1..{model.nv}}}"
    study = scratch / f"{name}.toml"
    tests = "".join(f'[[log]]\nfile = "{log}.csv"\nrole = "validate"\n' for log in logs)
    study.write_text(
        f'[robot]\nfile = "{path}"\n[format]\ntime = {{ column = "t" }}\nposition = {{ columns = "q{columns}" }}\ntorque = {{ columns = "tau{columns}" }}\n'
        f'[[log]]\nfile = "{name}_train.csv"\n{tests}'
    )
    return study, logs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dynident")
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.scratch.mkdir(parents=True, exist_ok=True)
    random, found, problems = np.random.default_rng(options.seed), [], 0
    for robot in ("ur10", "panda_arm7"):
        for truth in TRUTHS:
            study, logs = case(options.scratch, robot, truth, random)
            out = study.with_suffix("")
            subprocess.run([options.dynident, "identify", study, "--out", out, "--quiet"], capture_output=True)
            result = json.loads((out / "result.json").read_text())
            lines = [problem for problem in result["problems"] if "its residual is" in problem]
            problems += len(lines)
            bands = [(*logs[band["log"]], band["coverage_percent"]) for band in result["torque_band"]]
            found += bands
            inside = np.array([band[2] for band in bands])
            print(f"{study.stem}: at least 90 %: {(inside >= 90).sum()} of {len(inside)}, above 99 %: {(inside > 99).sum()}, lowest {inside.min():.1f} %", *lines, sep="\n  ", flush=True)
    for kind in ("p2p", "pick"):
        for speed in SPEEDS:
            inside = np.array([band[2] for band in found if band[:2] == (kind, speed)])
            print(f"{kind} at {speed}: 90 to 99 %: {100 * ((inside >= 90) & (inside <= 99)).mean():.1f} %, at least 90 %: {100 * (inside >= 90).mean():.1f} %, median {np.median(inside):.1f} %")
    inside = np.array([band[2] for band in found])
    print(f"{len(inside)} joints and motions: 90 to 99 %: {100 * ((inside >= 90) & (inside <= 99)).mean():.1f} %, at least 90 %: {100 * (inside >= 90).mean():.1f} %, above 99 %: {100 * (inside > 99).mean():.1f} %; {problems} problems of held-out logs")


if __name__ == "__main__":
    main()
