"""Reference values from MuJoCo for a robot with closed chains (MJCF <connect>), as one small JSON file.

    python golden/closed_chains.py [--out DIR]

Writes DIR/closed_chains.json (default: this script's folder): positions of the passive joints of golden/coupled/palletizer.xml for
positions of the driven joints (Newton's method on MuJoCo's constraint errors), and the drive torques G' tau, with tau from MuJoCo's
inverse dynamics of the tree and G from MuJoCo's constraint Jacobian.
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
        """Solves the constraints in small steps from the reference pose."""
        q = model.qpos0.copy()
        for share in np.linspace(0, 1, 21):
            q[active] = model.qpos0[active] + share * target
            for _ in range(20):
                gap, jacobian = constraints(q)
                q[passive] -= np.linalg.lstsq(jacobian[:, passive], gap, rcond=1e-10)[0]
        assert np.abs(constraints(q)[0]).max() < 1e-13
        return q

    def inverse(q, dq, ddq):
        """Inverse dynamics of the tree without constraints."""
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
        # G of a parallelogram is constant, so the accelerations are G ddq.
        tau = G.T @ inverse(q, G @ dq, G @ ddq)
        states.append({"q": q[active], "dq": dq, "ddq": ddq, "tau": tau, "passive": q[passive]})
    write(out / "closed_chains.json", {
        "mujoco": mujoco.__version__, "seed": SEED, "joints": [names[k] for k in active], "passive": PASSIVE, "states": states,
    })


if __name__ == "__main__":
    main()
