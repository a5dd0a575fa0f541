"""coupled.py DYNIDENT SCRATCH: checks a palletising arm with two closed chains, identified from logs, against MuJoCo.

The MJCF from `export` contains the dependent joints as constraints. The script checks at 200 states that these constraints hold in MuJoCo and that the projected inverse
dynamics of the tree, Gᵀ tau_tree, agree with the exported Python module to 1e-9 (rigid bodies and drive inertia, without friction). Needs mujoco and numpy.
"""
import importlib.util
import json
import pathlib
import subprocess
import sys

import mujoco
import numpy as np

STATES = 200
SAME_PHYSICS = 1e-9


def main():
    dynident, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
    scratch.mkdir(parents=True, exist_ok=True)
    study = pathlib.Path(__file__).resolve().parent.parent / "examples" / "palletizer.toml"
    found = scratch / "result"
    subprocess.run([dynident, "identify", study, "--out", found, "--quiet"], check=True)
    for form, name in [("mjcf", "arm.xml"), ("python", "arm.py"), ("json", "arm.json")]:
        command = [dynident, "export", found / "result.json", "--study", study, "--to", form, "--out", scratch / name]
        subprocess.run(command, check=True, capture_output=True)
    spec = importlib.util.spec_from_file_location("arm", scratch / "arm.py")
    arm = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(arm)
    joints = json.loads((scratch / "arm.json").read_text())["joints"]
    free = [joint["name"] for joint in joints if "follows" not in joint]
    model = mujoco.MjModel.from_xml_path(str(scratch / "arm.xml"))
    # G and q_0 in MuJoCo's order of joints.
    G, start = np.zeros((model.nv, len(free))), np.zeros(model.nv)
    for joint in joints:
        row = model.joint(joint["name"]).dofadr[0]
        if "follows" in joint:
            start[row] = joint["follows"]["offset"]
            for name, multiplier in joint["follows"]["multipliers"].items():
                G[row, free.index(name)] = multiplier
        else:
            G[row, free.index(joint["name"])] = 1.0
    data = mujoco.MjData(model)
    # Open tree without constraints and friction.
    tree = mujoco.MjModel.from_xml_path(str(scratch / "arm.xml"))
    tree.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    tree.dof_damping[:] = 0
    # The drive inertia of the MJCF was fitted together with its simpler friction, so that of the code is used.
    tree.dof_armature[:] = 0
    result = json.loads((found / "result.json").read_text())
    of_code = next({term["symbol"]: term["value"] for term in form["terms"]} for form in result["forms"] if form["class"] == "functions-of-motion")
    for joint in joints:
        for term in joint["terms"]:
            if term["kind"] == "drive-inertia":
                tree.dof_armature[tree.joint(joint["name"]).dofadr[0]] = of_code[term["symbol"]]
    own = mujoco.MjData(tree)
    rng = np.random.default_rng(1)
    worst, open_by = 0.0, 0.0
    for _ in range(STATES):
        q, dq, ddq = rng.uniform(-0.5, 0.5, len(free)), rng.uniform(-1, 1, len(free)), rng.uniform(-3, 3, len(free))
        data.qpos, data.qvel, data.qacc = start + G @ q, G @ dq, G @ ddq
        mujoco.mj_forward(model, data)
        equalities = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert equalities.sum() == model.nv - len(free), "expected one constraint for each dependent joint"
        open_by = max(open_by, np.abs(data.efc_pos[equalities]).max())
        own.qpos, own.qvel, own.qacc = data.qpos, data.qvel, G @ ddq
        mujoco.mj_inverse(tree, own)
        theirs = G.T @ own.qfrc_inverse
        ours = np.asarray(arm.inverse_dynamics(q, dq, ddq)) - np.asarray(arm.friction(dq))
        worst = max(worst, np.abs(theirs - ours).max() / np.abs(ours).max())
    assert worst < SAME_PHYSICS, f"torques differ by {worst:.2e} of the largest"
    assert open_by < 1e-12, f"constraint violation of the dependent joints in MuJoCo: {open_by:.2e}"
    print(f"{STATES} states: torques differ by {worst:.1e} of the largest, the constraint violation is {open_by:.1e}")


if __name__ == "__main__":
    main()
