"""Inverse dynamics of MJCF models from MuJoCo: reference for Dynident's MJCF reader.

    python golden/mjcf.py [--out DIR]

Reads golden/mjcf/*.xml (published models, see golden/mjcf_models.py, and rules_*.xml, written for single rules of the
format) and writes DIR/mjcf.json: joints, `mj_inverse` at random states without armature, damping, dry friction,
springs, media, gravity compensation and constraints, and the compiled values of these properties.
"""
import argparse
import sys
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

STATES = 4
SEED = 20261123


def moves(model, body):
    """True for a body that has a joint or is carried by such a body (a mocap body is not)."""
    while body and not model.body_dofnum[body]:
        body = model.body_parentid[body]
    return bool(body)


def golden(path, random):
    model = mujoco.MjModel.from_xml_path(str(path))
    hinge, slide = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
    if not set(model.jnt_type.tolist()) <= {hinge, slide}:
        raise SystemExit(f"{path.name}: a joint is neither a hinge nor a slide")
    turns = model.jnt_type == hinge
    is_off = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    entry = {
        "joints": [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)],
        "turns": turns.tolist(),
        "limited": (model.jnt_limited != 0).tolist(),
        "range": model.jnt_range.copy(),
        "armature": model.dof_armature.copy(),
        "damping": np.array(model.dof_damping).reshape(model.nv, -1)[:, 0].copy(),
        "frictionloss": model.dof_frictionloss.copy(),
        "gravity": np.zeros(3) if is_off else model.opt.gravity.copy(),
        "moving_mass": float(sum(model.body_mass[b] for b in range(model.nbody) if moves(model, b))),
    }
    for field in ("dof_armature", "dof_damping", "dof_frictionloss", "jnt_stiffness", "body_gravcomp"):
        getattr(model, field)[:] = 0
    for field in ("tendon_stiffness", "tendon_damping", "tendon_armature"):
        getattr(model, field)[:] = 0
    model.opt.density = model.opt.viscosity = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    # MuJoCo precomputes the inertia of joints that only slide in the world, including armature.
    mujoco.mj_setConst(model, data)
    entry["states"] = []
    for _ in range(STATES):
        data.qpos[:] = np.where(turns, 3.0, 0.6) * random.uniform(-1, 1, model.nv)
        data.qvel[:], data.qacc[:] = random.uniform(-2, 2, model.nv), random.uniform(-5, 5, model.nv)
        mujoco.mj_inverse(model, data)
        entry["states"].append({"q": data.qpos.copy(), "dq": data.qvel.copy(), "ddq": data.qacc.copy(),
                                "tau": data.qfrc_inverse.copy()})
    return entry


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE, help="output folder for mjcf.json")
    options = parser.parse_args()
    random = np.random.default_rng(SEED)
    models = {path.stem: golden(path, random) for path in sorted((HERE / "mjcf").glob("*.xml"))}
    write(options.out / "mjcf.json", {
        "schema": "dynident/golden-mjcf/1",
        "made_by": {"script": "golden/mjcf.py", "mujoco": mujoco.__version__, "numpy": np.__version__, "seed": SEED},
        "models": models,
    })


if __name__ == "__main__":
    main()
