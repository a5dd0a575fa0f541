"""A robot whose closed chains an MJCF holds by <connect>, from MuJoCo, as one small JSON file.

    python golden/closed_chains.py [--out DIR]

Writes DIR/closed_chains.json (default: this script's folder): where the passive joints of golden/coupled/palletizer.xml stand for
positions of the driven ones (Newton's method on the distances that MuJoCo gives for its own constraints), and the torques of the drives,
G' tau of MuJoCo's inverse dynamics of the tree, with G from MuJoCo's Jacobian of the constraints.
"""
import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path = [p for p in sys.path if Path(p or ".").resolve() != HERE]
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

SEED = 20261124
STATES = 12
PASSIVE = ["elbow_joint", "rod_joint", "strut_joint", "plate_joint"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE)
    out = parser.parse_args().out
    model = mujoco.MjModel.from_xml_path(str(HERE / "coupled/palletizer.xml"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    names = [model.joint(k).name for k in range(model.njnt)]
    passive = [names.index(name) for name in PASSIVE]
    active = [k for k in range(model.njnt) if k not in passive]

    def constraints(q):
        data.qpos[:], data.qvel[:] = q, 0
        mujoco.mj_fwdPosition(model, data)
        assert data.nefc == 6
        return data.efc_pos.copy(), data.efc_J.reshape(data.nefc, model.nv).copy()

    def closed(target):
        """Along the way from the drawn pose in small steps."""
        q = model.qpos0.copy()
        for share in np.linspace(0, 1, 21):
            q[active] = model.qpos0[active] + share * target
            for _ in range(20):
                gap, jacobian = constraints(q)
                q[passive] -= np.linalg.lstsq(jacobian[:, passive], gap, rcond=1e-10)[0]
        assert np.abs(constraints(q)[0]).max() < 1e-13
        return q

    def inverse(q, dq, ddq):
        """Of the tree alone."""
        disabled = model.opt.disableflags
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        model.opt.disableflags = disabled
        return data.qfrc_inverse.copy()

    rng = np.random.default_rng(SEED)
    states = []
    for _ in range(STATES):
        q = closed(rng.uniform(-0.6, 0.6, len(active)))
        _, jacobian = constraints(q)
        follow = -np.linalg.lstsq(jacobian[:, passive], jacobian[:, active], rcond=1e-10)[0]
        G = np.zeros((model.nv, len(active)))
        G[active], G[passive] = np.eye(len(active)), follow
        dq, ddq = rng.uniform(-2, 2, len(active)), rng.uniform(-5, 5, len(active))
        # A parallelogram's G is the same in every posture: G ddq is all that accelerates.
        tau = G.T @ inverse(q, G @ dq, G @ ddq)
        states.append({"q": q[active], "dq": dq, "ddq": ddq, "tau": tau, "passive": q[passive]})
    write(out / "closed_chains.json", {
        "mujoco": mujoco.__version__, "seed": SEED, "joints": [names[k] for k in active], "passive": PASSIVE, "states": states,
    })


if __name__ == "__main__":
    main()
