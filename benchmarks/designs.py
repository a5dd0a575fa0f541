"""Designs motions for about 30 robots from their descriptions only, and checks them with the independent libraries Pinocchio and Coal.

    python3 -m venv .venv && .venv/bin/pip install -r benchmarks/requirements.txt
    .venv/bin/python benchmarks/designs.py [--dynident target/release/dynident] [--out DIR] [--seconds 10] [--quick] [--only NAME ..]

For each robot the script writes a study that contains only the robot description, runs `dynident design`, and checks the exported trajectory of each feasible motion:

* torque from `rnea` plus damping and Coulomb friction of the description, within `effort`;
* positions and velocities within the limits of the description;
* no contact between links, with the real meshes. Links on the same or on adjacent joints are not checked, and neither are entries of `not_checked` in `design.json`:
  pairs of links, links without a shape, links with an unusable shape;
* no shape below the floor given in `design.json`, unless it is below the floor in every posture.

The script prints one row per robot. Exit status 1 if a motion violates a limit that is not listed, or if a robot in `MUST` has no motion. `--quick` searches with
one start. The meshes are in the wheel of example-robot-data.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[1]
DATA = "example-robot-data/robots/"
ROBOTS = {
    # Arms, mostly with meshes.
    "ur3": DATA + "ur_description/urdf/ur3_robot.urdf",
    "ur3_gripper": DATA + "ur_description/urdf/ur3_gripper.urdf",
    "ur5": DATA + "ur_description/urdf/ur5_robot.urdf",
    "ur5_limited": DATA + "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "ur5_gripper": DATA + "ur_description/urdf/ur5_gripper.urdf",
    "ur10": DATA + "ur_description/urdf/ur10_robot.urdf",
    "kinova": DATA + "kinova_description/robots/kinova.urdf",
    "panda": DATA + "panda_description/urdf/panda.urdf",
    "panda_spheres": DATA + "panda_description/urdf/panda_collision.urdf",
    "so100": DATA + "so_arm_description/urdf/so100.urdf",
    "so101": DATA + "so_arm_description/urdf/so101.urdf",
    "xarm7": DATA + "xarm_description/urdf/xarm7.urdf",
    "z1": DATA + "z1_description/urdf/z1.urdf",
    "talos_arm": DATA + "talos_data/robots/talos_left_arm.urdf",
    "tiago": DATA + "tiago_description/robots/tiago_no_hand.urdf",
    "borinot_arm": DATA + "borinot_description/urdf/borinot_flying_arm_2.urdf",
    "hextilt_arm": DATA + "hextilt_description/urdf/hextilt_flying_arm_5.urdf",
    "double_pendulum": DATA + "double_pendulum_description/urdf/double_pendulum.urdf",
    "two_dofs": DATA + "asr_twodof_description/urdf/TwoDofs.urdf",
    "iiwa14": ROOT / "robots/iiwa14.urdf",
    "planar2r": ROOT / "robots/planar2r.urdf",
    "scara": ROOT / "benchmarks/robots/scara_shapes.urdf",
    # Legs and hands with a fixed base.
    "finger": DATA + "finger_edu_description/robots/finger_edu.urdf",
    "bolt": DATA + "bolt_description/robots/bolt.urdf",
    "solo8": DATA + "solo_description/robots/solo.urdf",
    "solo12": DATA + "solo_description/robots/solo12.urdf",
    "a1": DATA + "a1_description/urdf/a1.urdf",
    "go1": DATA + "go1_description/urdf/go1.urdf",
    "go2": DATA + "go2_description/urdf/go2.urdf",
    "anymal_b": DATA + "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": DATA + "anymal_c_simple_description/urdf/anymal.urdf",
    "hyq": DATA + "hyq_description/robots/hyq_no_sensors.urdf",
}
MUST = {"ur3", "ur5", "ur5_limited", "ur10", "kinova", "so101", "scara"}  # robots for which an earlier version found no motion, or a motion with contact
TOUCH = 1e-6  # m: a smaller distance is a contact
SLACK = 1e-6  # relative rounding error of the file
SAMPLES = 500  # samples of the trajectory that are checked for contact


def share() -> Path:
    """Folder of the files in the wheel of example-robot-data."""
    for folder in map(Path, sys.path):
        found = folder / "cmeel.prefix" / "share"
        if (found / "example-robot-data").is_dir():
            return found
    sys.exit("example-robot-data is missing: pip install -r benchmarks/requirements.txt")


class Referee:
    """One robot, as read by Pinocchio and Coal, and one design."""

    def __init__(self, urdf: Path, out: Path) -> None:
        self.design = json.loads((out / "design.json").read_text())
        self.rows = np.loadtxt(out / "trajectory.csv", delimiter=",", skiprows=1)
        self.model = pin.buildModelFromUrdf(str(urdf))
        folders = [str(share()), str(urdf.parent)]
        self.shapes = pin.buildGeomFromUrdf(self.model, str(urdf), pin.GeometryType.COLLISION, None, folders)
        self.data, self.placed = self.model.createData(), pin.GeometryData(self.shapes)
        names = self.design["joints"]
        # File column, factor and offset of each joint of the tree.
        self.follows = {name: (column, 1.0, 0.0) for column, name in enumerate(names)}
        for joint in ElementTree.parse(urdf).getroot().findall("joint"):
            mimic = joint.find("mimic")
            if mimic is not None and mimic.get("joint") in names and joint.get("name") not in names:
                factor, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
                self.follows[joint.get("name")] = (names.index(mimic.get("joint")), factor, offset)
        self.joints = [(self.model.joints[k], *self.follows[self.model.names[k]]) for k in range(1, self.model.njoints)
                       if self.model.names[k] in self.follows]

    def state(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and accelerations for Pinocchio from a file row without its time."""
        n = len(self.design["joints"])
        q, v, a = pin.neutral(self.model), np.zeros(self.model.nv), np.zeros(self.model.nv)
        for joint, column, factor, offset in self.joints:
            x = factor * values[column] + offset
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(x), np.sin(x)
            else:
                q[joint.idx_q] = x
            v[joint.idx_v], a[joint.idx_v] = factor * values[n + column], factor * values[2 * n + column]
        return q, v, a

    def limits(self) -> dict[str, float]:
        """Largest ratio of torque, position and velocity to their limits."""
        worst = {"torque": 0.0, "position": 0.0, "velocity": 0.0}
        model = self.model
        for row in self.rows:
            q, v, a = self.state(row[1:])
            tau = pin.rnea(model, self.data, q, v, a) + model.damping * v + model.friction * np.sign(v)
            torque = np.zeros(len(self.design["joints"]))
            for joint, column, factor, _ in self.joints:
                torque[column] += factor * tau[joint.idx_v]
                if (most := model.velocityLimit[joint.idx_v]) > 0.0:
                    worst["velocity"] = max(worst["velocity"], abs(v[joint.idx_v]) / most)
                if joint.nq == 1:
                    low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
                    if low < high and np.isfinite(high - low):
                        share = abs(q[joint.idx_q] - (low + high) / 2) / ((high - low) / 2)
                        worst["position"] = max(worst["position"], share)
            for joint, column, factor, _ in self.joints:
                if factor == 1.0 and (most := model.effortLimit[joint.idx_v]) > 0.0 and np.isfinite(most):
                    worst["torque"] = max(worst["torque"], abs(torque[column]) / most)
        return worst

    def link(self, shape: int) -> str:
        return self.model.frames[self.shapes.geometryObjects[shape].parentFrame].name

    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of shapes that must stay apart."""
        parents, shapes = self.model.parents, self.shapes.geometryObjects
        listed = "\n".join(self.design["not_checked"])
        unchecked = {frozenset(pair) for pair in re.findall(r"([^\s,:]+) / ([^\s,]+)", listed)}
        without = {name for text in self.design["not_checked"] if text.startswith("links without a collision shape: ")
                   for name in text.split(": ", 1)[1].split(", ")}
        without |= set(re.findall(r"a collision shape of link `([^`]+)`", listed))
        found = []
        for i in range(len(shapes)):
            for j in range(i):
                a, b = shapes[i].parentJoint, shapes[j].parentJoint
                names = {self.link(i), self.link(j)}
                if a != b and parents[a] != b and parents[b] != a and names not in unchecked and not names & without:
                    found.append((i, j))
        return found

    def lowest(self, i: int) -> float:
        """The lowest point of a shape, m."""
        geometry, at = self.shapes.geometryObjects[i].geometry, self.placed.oMg[i]
        if isinstance(geometry, coal.BVHModelBase):
            return float((geometry.vertices() @ at.rotation[2] + at.translation[2]).min())
        down = -at.rotation[2]
        if isinstance(geometry, coal.Box):
            reach = np.abs(down) @ geometry.halfSide
        elif isinstance(geometry, coal.Cylinder):
            reach = abs(down[2]) * geometry.halfLength + geometry.radius * np.hypot(down[0], down[1])
        elif isinstance(geometry, coal.Capsule):
            reach = abs(down[2]) * geometry.halfLength + geometry.radius
        else:
            reach = geometry.radius
        return float(at.translation[2] - reach)

    def touching(self) -> tuple[dict[str, float], int]:
        """Pairs of links in contact and links below the floor, each with the first time, and the number of checked pairs."""
        pairs, found = self.pairs(), {}
        plane = re.search(r"above the plane z = (-?[\d.]+) m", "\n".join(self.design["assumed"]))
        moving = [i for i, shape in enumerate(self.shapes.geometryObjects) if shape.parentJoint > 0]
        # The message rounds to 1 mm.
        plane = float(plane[1]) - 1e-3 if plane else -np.inf
        heights = np.full((len(self.rows), len(moving)), np.inf)
        request = coal.DistanceRequest()
        every = max(1, len(self.rows) // SAMPLES)
        for k in range(0, len(self.rows), every):
            pin.updateGeometryPlacements(self.model, self.data, self.shapes, self.placed, self.state(self.rows[k, 1:])[0])
            for i, j in pairs:
                name = " / ".join(sorted((self.link(i), self.link(j))))
                if name in found:
                    continue
                a, b = (self.shapes.geometryObjects[s].geometry for s in (i, j))
                if not self.near(i, j):
                    continue
                apart = coal.distance(a, self.placed.oMg[i], b, self.placed.oMg[j], request, coal.DistanceResult())
                if apart < TOUCH:
                    found[name] = self.rows[k, 0]
            heights[k] = [self.lowest(i) for i in moving]
        for column, i in enumerate(moving):
            low = heights[::every, column] < plane
            # Ignore links that are always below the floor.
            if low.any() and not low.all():
                found[f"{self.link(i)} / floor"] = self.rows[::every][low.argmax(), 0]
        return found, len(pairs)

    def near(self, i: int, j: int) -> bool:
        """Whether the bounding spheres of two shapes overlap."""
        centres, radii = [], 0.0
        for s in (i, j):
            geometry = self.shapes.geometryObjects[s].geometry
            if geometry.aabb_radius <= 0.0:
                geometry.computeLocalAABB()
            centres.append(self.placed.oMg[s].act(geometry.aabb_center))
            radii += geometry.aabb_radius
        return bool(np.linalg.norm(centres[0] - centres[1]) <= radii + TOUCH)


def study(urdf: Path, options: argparse.Namespace) -> str:
    text = f'[robot]\nfile = "{urdf}"\n\n[design]\n'
    if options.seconds is not None:
        text += f"duration_s = {options.seconds}\n"
    if options.quick:
        text += "search = { starts = 1 }\n"
    return text


def row(name: str, urdf: Path, folder: Path, options: argparse.Namespace) -> tuple[list[str], list[str]]:
    """Returns the row of one robot and its errors."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(study(urdf, options))
    begun = time.monotonic()
    command = [options.dynident, "design", str(folder / "study.toml"), "--out", str(folder / "out"), "--threads", str(options.threads), "--quiet"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = f"{time.monotonic() - begun:.0f}"
    if ran.returncode not in (0, 1) or not (folder / "out" / "design.json").exists():
        return [name, "-", "error", seconds], [f"{name}: exit {ran.returncode}: {ran.stderr.strip()[:300]}"]
    referee = Referee(urdf, folder / "out")
    n = str(len(referee.design["joints"]))
    if not referee.design["feasible"]:
        wrong = [f"{name}: no feasible motion: {' '.join(referee.design['diagnosis'])[:300]}"] if name in MUST else []
        return [name, n, "no motion", seconds], wrong
    worst = referee.limits()
    touching, pairs = referee.touching()
    wrong = [f"{name}: {what} {100 * used:.2f} % of the limit" for what, used in worst.items() if used > 1.0 + SLACK]
    wrong += [f"{name}: {pair} in contact at {at:.3f} s" for pair, at in touching.items()]
    listed = referee.design["not_checked"]
    shapes = sum(text.startswith("a collision shape of link") for text in listed)
    unchecked = len(re.findall(r"[^\s,:]+ / [^\s,]+", "\n".join(listed)))
    cells = [f"{100 * worst[what]:.1f}" for what in ("torque", "position", "velocity")]
    return [name, n, "feasible", seconds, *cells, str(pairs), str(len(touching)), str(unchecked), str(shapes)], wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dynident", default=str(ROOT / "target/release/dynident"))
    parser.add_argument("--out", type=Path, help="folder for the designs (default: a temporary folder)")
    parser.add_argument("--seconds", type=float, help="duration of the motions, s (default: that of the command)")
    parser.add_argument("--quick", action="store_true", help="use one start per search")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", nargs="+", choices=ROBOTS, metavar="NAME")
    options = parser.parse_args()
    head = ["robot", "joints", "verdict", "s", "torque %", "position %", "velocity %", "pairs", "in contact", "pairs listed", "shapes listed"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head), flush=True)
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        for name in options.only or ROBOTS:
            urdf = ROBOTS[name] if isinstance(ROBOTS[name], Path) else share() / ROBOTS[name]
            cells, wrong = row(name, urdf, (options.out or Path(temporary)) / name, options)
            print("| " + " | ".join(cells + [""] * (len(head) - len(cells))) + " |", flush=True)
            faults += wrong
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
