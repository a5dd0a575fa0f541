#!/usr/bin/env python3
"""changes.py DYNIDENT SCRATCH [--draws N] [--seed S] [--robots NAME ..] [--cases NAME ..]: are the parts that changed found, with the right odds and masses?

Simulates robots (Pinocchio; viscous and Coulomb friction of 15 % of the torque each, drive inertia of 20 %, offsets of 3 %, torque noise of 1 %, a torque lag of 2 ms, encoder steps of 1e-5).
A draw differs from its description in nothing, one load of 0.3 to 3 kg, the mass of one body (±50 %), the friction of one joint (×2), one drive inertia (×2), two of these, or every body (±20 %).
Each draw is identified and compared with its description (`description_differences` of result.json), which has no friction, and with the result of an unchanged robot (`dynident compare`).
Prints one line for each draw and a summary: how often the right parts are the most probable ones or are listed with at least a tenth of their probability, how often other parts have odds above 20,
how often a part is named (probability above 0.5) where none changed, errors of masses and centres of loads, torque error after the edit (the changed bodies of the written URDF
get the values of the description; with no changed body, the last one) and the share of draws in which its predicted bar holds, and how often the bars of masses contain the true mass.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
import pinocchio as pin
from simulated_arms import fourier

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROBOTS = {name: ROOT / folder / f"{name}.urdf" for name, folder in [("ur10", "robots"), ("iiwa14", "robots"), ("panda_arm7", "robots"), ("scara", "benchmarks/robots")]}
CASES = ["nothing", "load", "body", "friction", "drive", "two changes", "every body"]
RATE_HZ, LAG_S, ODDS, LISTED = 250, 0.002, 20.0, 0.1


def scaled(inertia, factor):
    return pin.Inertia(inertia.mass * factor, inertia.lever, inertia.inertia * factor)


class Robot:
    """A model with drives; the mass of the loads and bodies that changed, by part."""

    def __init__(self, model):
        self.model, self.changed = model.copy(), {}
        n = model.nv
        q, v, a = motion(model, np.arange(0, 10, 0.02), np.random.default_rng(0))
        torque = torques(model, q, v, a)
        size = lambda rows: np.sqrt((rows**2).mean(axis=0))
        # Gravity of a vertical slide is constant.
        self.size = np.maximum(size(torque - torque.mean(axis=0)), 0.5)
        self.viscous, self.coulomb, self.offset, self.noise = 0.15 * self.size / size(v), 0.15 * self.size, 0.03 * self.size, 0.01 * self.size
        self.drive = 0.2 * self.size / size(a)

    def change(self, kind, joint, random):
        inertias = self.model.inertias
        if kind == "load":
            mass, centre = random.uniform(0.3, 3.0), random.uniform(-0.1, 0.1, 3)
            inertias[joint + 1] = inertias[joint + 1] + pin.Inertia(mass, centre, mass * 0.05**2 * np.eye(3))
            self.changed["body", joint] = (mass, centre)
        elif kind == "body":
            factor = random.choice([0.5, 1.5])
            self.changed["body", joint] = ((factor - 1) * inertias[joint + 1].mass, inertias[joint + 1].lever)
            inertias[joint + 1] = scaled(inertias[joint + 1], factor)
        elif kind == "friction":
            self.viscous[joint] *= 2
            self.coulomb[joint] *= 2
            self.changed["friction", joint] = None
        elif kind == "drive":
            self.drive[joint] *= 2
            self.changed["drive", joint] = None


def motion(model, t, random):
    """Positions, velocities and accelerations at the times t."""
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    low, high = np.maximum(low, -1.5), np.minimum(high, 1.5)
    return fourier(t, (low + high) / 2, 0.45 * (high - low), 8, 0.1, random)


def torques(model, q, v, a):
    data = model.createData()
    return np.array([pin.rnea(model, data, *row) for row in zip(q, v, a)])


def drawn(model, case, random):
    robot, n = Robot(model), model.nv
    joints = [int(joint) for joint in random.permutation(n)]
    kinds = {"two changes": random.choice(["load", "body", "friction", "drive"], 2), "nothing": [], "every body": []}.get(case, [case])
    for kind in kinds:
        # The first body turns about a vertical axis with its drive, so that torque does not distinguish them.
        joint = next(joint for joint in joints if joint > 0 or kind in ("friction", "drive"))
        joints.remove(joint)
        robot.change(kind, joint, random)
    if case == "every body":
        for body in range(1, n + 1):
            robot.model.inertias[body] = scaled(model.inertias[body], random.uniform(0.8, 1.2))
    return robot


def recorded(robot, path, seconds, seed):
    model, t = robot.model, np.arange(0, seconds, 1 / RATE_HZ)
    q, _, _ = motion(model, t, np.random.default_rng(seed))
    # The torque is late.
    earlier, v, a = motion(model, t - LAG_S, np.random.default_rng(seed))
    torque = torques(model, earlier, v, a) + robot.viscous * v + robot.coulomb * np.tanh(v / 0.02) + robot.drive * a + robot.offset
    torque += robot.noise * np.random.default_rng([*seed, 1]).normal(size=q.shape)
    q = np.round(q / 1e-5) * 1e-5
    names = [model.names[k + 1] for k in range(model.nv)]
    head = ",".join(["t", *(f"q_{name}" for name in names), *(f"tau_{name}" for name in names)])
    np.savetxt(path, np.column_stack([t, q, torque]), delimiter=",", header=head, comments="", fmt="%.9g")
    return names


def study(urdf, names):
    columns = lambda kind: "[" + ", ".join(f'"{kind}_{name}"' for name in names) + "]"
    return f"""[robot]
file = "{urdf}"
[format]
time = {{ column = "t" }}
position = {{ columns = {columns("q")} }}
torque = {{ columns = {columns("tau")} }}
[[log]]
file = "train.csv"
[[log]]
file = "test.csv"
role = "validate"
"""


def identified(arguments, urdf, robot, folder, seed):
    """Folder of the result, made once."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "R" / "result.json").exists():
        names = recorded(robot, folder / "train.csv", 30, [*seed, 2])
        recorded(robot, folder / "test.csv", 10, [*seed, 3])
        (folder / "study.toml").write_text(study(urdf, names))
        command = [arguments.dynident, "identify", folder / "study.toml", "--out", folder / "R", "--quiet", "--threads", "1"]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        if not (folder / "R" / "result.json").exists():
            raise SystemExit(f"{folder}: {done.stderr}")
    return folder / "R"


def part_of(model, words):
    """Kind and joint of a part as Dynident names it."""
    if "`" not in words:
        return ("all friction", 0)
    name = words.split("`")[1]
    if words.startswith("body"):
        return ("body", model.frames[model.getFrameId(name)].parentJoint - 1)
    return ("drive" if words.startswith("drive") else "friction", model.getJointId(name) - 1)


def judged(model, explanations, truth):
    """Parts and probability of the best explanation; whether it is right, whether the right one is listed, whether a wrong one has odds above ODDS."""
    parts = lambda own: "every body" if own.get("everything") else sorted(part_of(model, part["part"]) for part in own["parts"])
    best, own = parts(explanations[0]), explanations[0]["probability"]
    true = sum(own["probability"] for own in explanations if parts(own) == truth)
    return {"best": best, "probability": own, "right": best == truth, "listed": true >= LISTED * own, "wrong": best != truth and own > ODDS * max(true, 1e-12)}


def edited_error(robot, model, urdf):
    """Torque error in percent of the written model after the changed bodies are restored, on a new motion."""
    edited, true = pin.buildModelFromUrdf(str(urdf)), robot.model.copy()
    for body in [joint + 1 for kind, joint in robot.changed if kind == "body"] or [model.nv]:
        edited.inertias[body] = true.inertias[body] = model.inertias[body]
    rows = motion(model, np.arange(0, 10, 0.05), np.random.default_rng(9))
    expected = torques(true, *rows)
    return 100 * np.linalg.norm(torques(edited, *rows) - expected) / np.linalg.norm(expected)


def mass_bars(model, robot, result):
    """Name, error and half width of the 95 % bar of each mass."""
    bars = []
    for body in result["bodies"]:
        if body.get("std"):
            index = model.frames[model.getFrameId(body["name"])].parentJoint
            bars.append((body["name"], body["mass_kg"] - robot.model.inertias[index].mass, 1.96 * body["std"][0]))
    return bars


def measured(arguments, name, case, draw):
    urdf, seed = ROBOTS[name], [arguments.seed, list(ROBOTS).index(name), draw]
    model = pin.buildModelFromUrdf(str(urdf))
    folder = pathlib.Path(arguments.scratch) / f"{name}_{arguments.seed}_{draw}"
    reference = identified(arguments, urdf, Robot(model), folder / "reference", [*seed, 99])
    number = CASES.index(case)
    robot = drawn(model, case, np.random.default_rng([*seed, number]))
    found = identified(arguments, urdf, robot, folder / case.replace(" ", "_"), [*seed, number])
    result = json.loads((found / "result.json").read_text())
    differences = result["description_differences"]
    text = subprocess.run([arguments.dynident, "compare", reference, found, "--json"], check=True, capture_output=True, text=True).stdout
    bodies = sorted(part for part in robot.changed if part[0] == "body")
    log = result["validation"][0]
    row = {
        "robot": name, "case": case, "draw": draw, "truth": sorted(robot.changed), "bodies": bodies, "followed": differences["is_followed"],
        "description": judged(model, differences["explanations"], "every body" if case == "every body" else bodies),
        "reference": judged(model, json.loads(text)["changes"][0]["explanations"], "every body" if case == "every body" else sorted(robot.changed)),
        "held_out": (log.get("physical") or log["model"])["relative_error_percent"], "bars": mass_bars(model, robot, result), "loads": [],
        "edit": None if case == "every body" else edited_error(robot, model, found / "identified.urdf"),
    }
    predicted = {model.frames[model.getFrameId(own["name"])].parentJoint - 1: own["error_95_percent"] for own in differences["bodies"]}
    if len(bodies) == 1:
        row["predicted"] = predicted.get(bodies[0][1])
    for part in differences["explanations"][0]["parts"]:
        own = part_of(model, part["part"])
        if row["description"]["right"] and own in robot.changed:
            mass, centre = robot.changed[own]
            row["loads"].append((part["mass_kg"], mass, part["half_width_95_kg"], float(np.linalg.norm(np.subtract(part["centre_m"], centre))) if part.get("centre_m") else None))
    return row


def line(row):
    own, other = row["description"], row["reference"]
    inside = sum(abs(error) <= bar + 1e-6 for _, error, bar in row["bars"])
    text = f"{row['robot']:11} {row['case']:11} {row['draw']}: truth {row['truth']}; description: {own['best']} {own['probability']:.3f}{', followed' if row['followed'] else ''}"
    text += f"; reference: {other['best']} {other['probability']:.3f}; held-out {row['held_out']:.2f} %, bars {inside} of {len(row['bars'])}"
    text += f", edit {row['edit']:.2f} %" if row["edit"] is not None else ""
    text += f" (at most {row['predicted']:.2f})" if row.get("predicted") else ""
    return text + "".join(f", {mass:.3f} ± {bar:.3f} of {true:.3f} kg" for mass, true, bar, _ in row["loads"])


def summary(case, rows):
    count = len(rows)
    text = f"{case} ({count}):"
    for kind in ["description", "reference"]:
        right, listed, wrong = (sum(row[kind][key] for row in rows) for key in ["right", "listed", "wrong"])
        named = sum(isinstance(row[kind]["best"], list) and bool(row[kind]["best"]) and row[kind]["probability"] > 0.5 for row in rows)
        text += f" {kind}: right {right}, listed {listed}, wrong with odds above {ODDS:.0f}: {wrong}, parts named {named};"
    bars = [abs(error) <= bar + 1e-6 for row in rows for _, error, bar in row["bars"]]
    text += f" followed {sum(row['followed'] for row in rows)}; bars of masses {100 * np.mean(bars):.1f} % of {len(bars)}; held-out error {np.mean([row['held_out'] for row in rows]):.3f} %"
    edits = [row["edit"] for row in rows if row["edit"] is not None]
    if edits:
        text += f"; error after the edit: median {np.median(edits):.2f} %, largest {max(edits):.2f} %, at most 2 % in {sum(edit <= 2 for edit in edits)}"
    predicted = [row["edit"] <= row["predicted"] for row in rows if row.get("predicted") and row["edit"] is not None]
    return text + (f", within its bar in {sum(predicted)} of {len(predicted)}" if predicted else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dynident")
    parser.add_argument("scratch")
    parser.add_argument("--draws", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", nargs="+", choices=list(ROBOTS), default=list(ROBOTS))
    parser.add_argument("--cases", nargs="+", choices=CASES, default=CASES)
    arguments = parser.parse_args()
    rows = []
    for draw in range(arguments.draws):
        for robot in arguments.robots:
            for case in arguments.cases:
                rows.append(measured(arguments, robot, case, draw))
                print(line(rows[-1]), flush=True)
    for case in arguments.cases:
        print(summary(case, [row for row in rows if row["case"] == case]))
    loads = [load for row in rows for load in row["loads"]]
    # The torque determines a mass if its bar is at most 5 % of it.
    known = [load for load in loads if load[2] <= 0.05 * abs(load[1])]
    print(f"masses of changes: {sum(abs(mass - true) <= 0.05 * abs(true) for mass, true, *_ in loads)} of {len(loads)} within 5 %, of those that torque determines {sum(abs(mass - true) <= 0.05 * abs(true) for mass, true, *_ in known)} of {len(known)}; "
          f"inside their bar {sum(abs(mass - true) <= bar for mass, true, bar, _ in loads)}; centres that torque determines: {sum(centre is not None and centre <= 0.01 for *_, centre in known)} of {len(known)} within 10 mm")
    (pathlib.Path(arguments.scratch) / f"changes_{arguments.seed}.json").write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
