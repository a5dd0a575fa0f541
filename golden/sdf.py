"""Inverse dynamics of SDF models from Drake, which reads them with Gazebo's libsdformat: reference for Dynident's SDF reader.

    python golden/sdf.py [--out DIR]

Reads golden/sdf/*.sdf (two examples of Drake; urdf_*.sdf, published URDFs converted by libsdformat; and rules_*.sdf, written for single rules of the format), fixes a free base to the world, and writes DIR/sdf.json: joints with limits, and rigid-body torques at random states without damping and dry friction.
"""
import argparse
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, MultibodyForces, PrismaticJoint, RevoluteJoint

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

STATES = 4
SEED = 20261123


def limit(value):
    """None for an unlimited joint."""
    return value if abs(value) < 1e16 else None


def plant_of(path):
    """Drake's model, with a free base fixed to the world."""
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(path))
    children = {plant.get_joint(index).child_body().index() for index in plant.GetJointIndices()}
    bodies = [plant.get_body(BodyIndex(number)) for number in range(1, plant.num_bodies())]
    for body in [body for body in bodies if body.index() not in children]:
        plant.WeldFrames(plant.world_frame(), body.body_frame())
    # Drake ignores the gravity of the document.
    gravity = ElementTree.parse(path).findtext(".//world/gravity")
    if gravity is not None:
        plant.mutable_gravity_field().set_gravity_vector([float(word) for word in gravity.split()])
    else:
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -9.81])
    plant.Finalize()
    return plant


def golden(path, random):
    plant = plant_of(path)
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    joints = [joint for joint in joints if joint.num_positions() == 1]
    if len(joints) != plant.num_positions():
        raise SystemExit(f"{path.name}: a body is not connected")

    order = np.array([joint.position_start() for joint in joints])
    turns = np.array([isinstance(joint, RevoluteJoint) for joint in joints])
    assert all(isinstance(joint, (RevoluteJoint, PrismaticJoint)) for joint in joints)
    entry = {
        # Names without enclosing models, because Drake assigns a joint to the model of its child.
        "joints": [joint.name() for joint in joints],
        "turns": turns.tolist(),
        "lower": [limit(joint.position_lower_limit()) for joint in joints],
        "upper": [limit(joint.position_upper_limit()) for joint in joints],
        "velocity": [limit(joint.velocity_upper_limits()[0]) for joint in joints],
        "damping": [joint.default_damping() for joint in joints],
        "states": [],
    }
    context = plant.CreateDefaultContext()
    forces = MultibodyForces(plant)
    for _ in range(STATES):
        q, dq, ddq = np.zeros((3, len(joints)))
        q[order] = np.where(turns, 3.0, 0.6) * random.uniform(-1, 1, len(joints))
        dq[order], ddq[order] = random.uniform(-2, 2, len(joints)), random.uniform(-5, 5, len(joints))
        plant.SetPositions(context, q)
        plant.SetVelocities(context, dq)
        # Gravity without damping.
        gravity = plant.CalcGravityGeneralizedForces(context)
        forces.SetZero()
        tau = plant.CalcInverseDynamics(context, ddq, forces) - gravity
        entry["states"].append({"q": q[order], "dq": dq[order], "ddq": ddq[order], "tau": tau[order]})
    return entry


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE, help="output folder for sdf.json")
    options = parser.parse_args()
    random = np.random.default_rng(SEED)
    models = {path.stem: golden(path, random) for path in sorted((HERE / "sdf").glob("*.sdf"))}
    write(options.out / "sdf.json", {
        "schema": "dynident/golden-sdf/1",
        "made_by": {"script": "golden/sdf.py", "drake": version("drake"), "numpy": np.__version__, "seed": SEED},
        "models": models,
    })


if __name__ == "__main__":
    main()
