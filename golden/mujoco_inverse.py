"""A second reference for inverse dynamics: MuJoCo on two arms, at the states of the Pinocchio files.

    python golden/mujoco_inverse.py [ROBOTS] [--out DIR]

Reads golden/pinocchio/<robot>.json for the states, runs `mj_inverse` and the mass matrix on the same URDF (damping,
dry friction, armature, limits and contacts switched off) and writes DIR/mujoco/<robot>.json with MuJoCo's results,
if they agree with Pinocchio's to 1e-11 of the largest entry (measured: 2e-15).
"""
import argparse
import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

HERE = Path(__file__).resolve().parent
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

ARMS = ["panda_arm7", "ur10"]
# Differences between two programs in double precision are rounding errors; the limit allows for sums of large terms.
AGREEMENT = 1e-11


def load(path):
    """Loads the URDF in MuJoCo with the given inertias, without merging fixed bodies into the world."""
    tree = ElementTree.parse(path)
    extension = ElementTree.SubElement(tree.getroot(), "mujoco")
    # balanceinertia and boundmass stay off: MuJoCo must not fix the inertias that are compared.
    ElementTree.SubElement(extension, "compiler", fusestatic="false", balanceinertia="false", boundmass="0", boundinertia="0")
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(tree.getroot(), encoding="unicode"))
    for field in ("dof_damping", "dof_frictionloss", "dof_armature"):
        getattr(model, field)[:] = 0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    return model


def mass_matrix(model, data):
    full = np.zeros((model.nv, model.nv))
    for j in range(model.nv):
        column = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, column, np.eye(model.nv)[j])
        full[:, j] = column
    return full


def relative_difference(a, b):
    return float(np.max(np.abs(a - b)) / np.max(np.abs(b)))


def golden(path, reference):
    model = load(path)
    model.opt.gravity[:] = reference["gravity_mps2"]
    data = mujoco.MjData(model)
    joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
    order = [reference["joints"].index(name) for name in joints]
    entries, worst_tau, worst_mass = [], 0.0, 0.0
    for state in reference["states"]:
        q, dq, ddq = (np.array(state[k], float)[order] for k in ("q", "dq", "ddq"))
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        tau, mass = data.qfrc_inverse.copy(), mass_matrix(model, data)
        lower = state["mass_matrix_lower"]
        theirs = np.array([[lower[max(i, j)][min(i, j)] for j in order] for i in order])
        worst_tau = max(worst_tau, relative_difference(tau, np.array(state["tau"], float)[order]))
        worst_mass = max(worst_mass, relative_difference(mass, theirs))
        entries.append({"label": state["label"], "q": q, "dq": dq, "ddq": ddq, "tau": tau,
                        "mass_matrix_lower": [mass[i, : i + 1] for i in range(model.nv)]})
    if not (worst_tau < AGREEMENT and worst_mass < AGREEMENT):
        raise SystemExit(f"{path.stem}: MuJoCo and Pinocchio differ by {worst_tau:g} in torque, {worst_mass:g} in M")
    print(f"{path.stem}: differs from Pinocchio by at most {worst_tau:.2g} in torque, {worst_mass:.2g} in the mass matrix")
    return {
        "schema": "dynident/golden-mujoco/1",
        "made_by": {"script": "golden/mujoco_inverse.py", "mujoco": mujoco.__version__, "numpy": np.__version__},
        "robot": path.stem, "joints": joints, "gravity_mps2": model.opt.gravity,
        "agrees_with_pinocchio_to": AGREEMENT,
        "states": entries,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="?", type=Path, default=HERE.parent / "robots", help="folder of URDF files")
    parser.add_argument("--out", type=Path, default=HERE, help="output folder for mujoco/<robot>.json")
    options = parser.parse_args()
    for name in ARMS:
        reference = json.loads((HERE / "pinocchio" / f"{name}.json").read_text(encoding="utf-8"))
        write(options.out / "mujoco" / f"{name}.json", golden(options.robots / f"{name}.urdf", reference))


if __name__ == "__main__":
    main()
