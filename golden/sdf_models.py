"""Converts published URDFs to SDF for golden/sdf with the converter of libsdformat.

    pip install --no-deps example-robot-data==6.0.0
    g++ -O1 -std=c++17 golden/urdf_to_sdf.cpp -o urdf_to_sdf $(pkg-config --cflags --libs sdformat12)
    python golden/sdf_models.py urdf_to_sdf [--out DIR]

Shapes, materials, transmissions and simulator blocks are removed first. A model is written only if Drake's inverse dynamics
of the SDF agree with Pinocchio's of the URDF (1e-9 of the largest torque, because the converter writes 12 digits).
"""
import argparse
import importlib.metadata
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
from pydrake.multibody.tree import MultibodyForces

HERE = Path(__file__).resolve().parent
# Otherwise `pinocchio` is the script in this folder.
sys.path.remove(str(HERE))
import pinocchio  # noqa: E402

sys.path.insert(0, str(HERE))
from sdf import plant_of  # noqa: E402

SAME = 1e-9
OWN = ["g1_29dof", "iiwa14", "panda", "tx40", "ur10"]
PUBLISHED = {
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "bolt": "bolt_description/robots/bolt.urdf",
    "finger_edu": "finger_edu_description/robots/finger_edu.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "so101": "so_arm_description/urdf/so101.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
}


def plain(path):
    """A URDF with only the links, their inertials, and the joints."""
    root = ElementTree.parse(path).getroot()
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for link in root.iter("link"):
        for child in list(link):
            if child.tag != "inertial":
                link.remove(child)
    return ElementTree.tostring(root, encoding="unicode")


def off(urdf, sdf):
    """Difference between the torques of the two programs, relative to the largest torque."""
    model, plant = pinocchio.buildModelFromXML(urdf), plant_of(sdf)
    # Pinocchio adds the rotor inertias of the description, which are not part of the rigid bodies.
    model.armature = np.zeros(model.nv)
    data, context, forces = model.createData(), plant.CreateDefaultContext(), MultibodyForces(plant)
    joints = [joint for joint in map(plant.get_joint, plant.GetJointIndices()) if joint.num_positions() == 1]
    assert model.nv == len(joints) == plant.num_positions(), sdf.name
    ours = [joint.position_start() for joint in joints]
    theirs = [model.joints[model.getJointId(joint.name())] for joint in joints]
    random, worst = np.random.default_rng(5), 0.0
    for _ in range(3):
        q, dq, ddq = (random.uniform(-1, 1, len(joints)) for _ in range(3))
        angles, velocity, acceleration = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for k, joint in enumerate(theirs):
            angles[joint.idx_q : joint.idx_q + joint.nq] = q[k] if joint.nq == 1 else (np.cos(q[k]), np.sin(q[k]))
            velocity[joint.idx_v], acceleration[joint.idx_v] = dq[k], ddq[k]
        expected = pinocchio.rnea(model, data, angles, velocity, acceleration)[[joint.idx_v for joint in theirs]]
        plant_q, plant_dq, plant_ddq = np.zeros((3, len(joints)))
        plant_q[ours], plant_dq[ours], plant_ddq[ours] = q, dq, ddq
        plant.SetPositions(context, plant_q)
        plant.SetVelocities(context, plant_dq)
        forces.SetZero()
        found = plant.CalcInverseDynamics(context, plant_ddq, forces) - plant.CalcGravityGeneralizedForces(context)
        worst = max(worst, np.max(np.abs(found[ours] - expected)) / np.max(np.abs(expected)))
    return worst


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("converter", help="the compiled golden/urdf_to_sdf.cpp")
    parser.add_argument("--out", type=Path, default=HERE / "sdf", help="output folder for the models")
    options = parser.parse_args()
    data = Path(importlib.metadata.distribution("example-robot-data").locate_file(""))
    data = data / "cmeel.prefix/share/example-robot-data/robots"
    files = {name: HERE.parent / "robots" / f"{name}.urdf" for name in OWN} | {name: data / path for name, path in PUBLISHED.items()}
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, path in sorted(files.items()):
            urdf = plain(path)
            source = Path(folder) / f"{name}.urdf"
            source.write_text(urdf, encoding="utf-8")
            written = subprocess.run([options.converter, source], check=True, capture_output=True, text=True).stdout
            target = options.out / f"urdf_{name}.sdf"
            target.write_text(written.rstrip() + "\n", encoding="utf-8", newline="\n")
            difference = off(urdf, target)
            print(f"{name}: Drake's torque of the SDF and Pinocchio's of the URDF differ by {difference:.1e}")
            if not difference < SAME:
                target.unlink()
                raise SystemExit(f"{name}: the dynamics of the converted model differ")


if __name__ == "__main__":
    main()
