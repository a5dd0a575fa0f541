"""Reference dynamics from Pinocchio for robots with dependent joints, as one small JSON file.

    python golden/coupled_joints.py [--out DIR]

Writes DIR/coupled_joints.json (default: this script's folder). `mimic`: robots with mimic tags, which Pinocchio
reads. `loops`: `examples/robots/palletizer.urdf` with its two closed chains, from Pinocchio's mass matrix, bias and frame
Jacobians of the **tree** and the constraint that the cut points coincide: M ddq + h = tau + J' lambda, J ddq =
-dJ dq, solved by least squares (the chains are planar, so one of three equations per point is redundant). Positions of
the passive joints are found by Newton's method from zero in small steps, independent of the coupling equations.
"""
import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path = [p for p in sys.path if Path(p or ".").resolve() != HERE]
import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

SEED = 20261123
STATES = 12
MIMIC = {"followers": "golden/coupled/followers.urdf", "panda": "robots/panda.urdf"}
LOOPS = [("rod_end", "forearm_back"), ("strut_end", "plate_back")]
ACTIVE = ["waist_joint", "shoulder_joint", "crank_joint", "wrist_joint"]
PASSIVE = ["elbow_joint", "rod_joint", "strut_joint", "plate_joint"]


def near(a, b, what):
    a, b = np.asarray(a), np.asarray(b)
    scale = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0), 1e-12)
    error = np.abs(a - b).max(initial=0.0)
    if not error <= 1e-9 * scale:
        raise SystemExit(f"{what}: two routes differ by {error:g} (scale {scale:g})")


def full_position(model, angles):
    """Converts positions: Pinocchio uses cosine and sine for an unlimited joint."""
    q = pin.neutral(model)
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        elif joint.nq == 1:
            q[joint.idx_q] = angle
    return q


def mimic(path, rng):
    """States of a robot with mimic tags."""
    model = pin.buildModelFromUrdf(str(path), mimic=True)
    tree = pin.buildModelFromUrdf(str(path))
    # Dependent joints have no separate velocity.
    names = [n for n in list(model.names)[1:] if model.joints[model.getJointId(n)].nv == 1 and "Mimic" not in model.joints[model.getJointId(n)].shortname()]
    at = [model.joints[model.getJointId(n)].idx_v for n in names]
    data, of_tree = model.createData(), tree.createData()
    states = []
    for _ in range(STATES):
        q, dq, ddq = rng.uniform(-1, 1, len(names)), rng.uniform(-2, 2, len(names)), rng.uniform(-5, 5, len(names))
        position = full_position(model, dict(zip(names, q)))
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[at], a[at] = dq, ddq
        tau = pin.rnea(model, data, position, v, a).copy()
        mass = pin.crba(model, data, position).copy()
        mass = np.triu(mass) + np.triu(mass, 1).T
        near(pin.rnea(model, data, position, v, 0 * a) + mass @ a, tau, "mass matrix")
        pin.forwardKinematics(model, data, position)
        places = {n: data.oMi[model.getJointId(n)].translation.copy() for n in list(model.names)[1:]}
        states.append({"q": q, "dq": dq, "ddq": ddq, "tau": tau[at], "mass_matrix": mass[np.ix_(at, at)], "placements_m": places})
    return {"joints": names, "bodies": tree.njoints - 1, "states": states}


def loops(path, rng):
    """States of the palletising arm."""
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    index = {n: model.joints[model.getJointId(n)].idx_v for n in ACTIVE + PASSIVE}
    active, passive = [index[n] for n in ACTIVE], [index[n] for n in PASSIVE]
    frames = [[model.getFrameId(link) for link in pair] for pair in LOOPS]

    def gap(q):
        pin.framesForwardKinematics(model, data, q)
        return np.concatenate([data.oMf[a].translation - data.oMf[b].translation for a, b in frames])

    def jacobian(q):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        own = lambda f: pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3]
        return np.vstack([own(a) - own(b) for a, b in frames])

    def closed(target):
        """Closes the loops with Newton's method in small steps from zero."""
        q = np.zeros(model.nq)
        for share in np.linspace(0, 1, 21):
            q[active] = share * target
            for _ in range(20):
                q[passive] -= np.linalg.lstsq(jacobian(q)[:, passive], gap(q), rcond=1e-10)[0]
        if not np.abs(gap(q)).max() < 1e-13:
            raise SystemExit("a loop cannot be closed")
        return q

    states, regressors = [], []
    ours = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])
    columns = np.concatenate([10 * b + ours for b in range(model.njoints - 1)])
    for number in range(STATES + 28):
        q = closed(rng.uniform(-0.6, 0.6, len(active)))
        J = jacobian(q)
        follow = -np.linalg.lstsq(J[:, passive], J[:, active], rcond=1e-10)[0]
        G = np.zeros((model.nv, len(active)))
        G[active], G[passive] = np.eye(len(active)), follow
        dq_active, ddq_active, tau = rng.uniform(-2, 2, 4), rng.uniform(-5, 5, 4), rng.uniform(-300, 300, 4)
        dq = G @ dq_active
        pin.forwardKinematics(model, data, q, dq, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        drift = lambda f: pin.getFrameClassicalAcceleration(model, data, f, pin.LOCAL_WORLD_ALIGNED).linear.copy()
        bend = np.concatenate([drift(a) - drift(b) for a, b in frames])
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        h = pin.rnea(model, data, q, dq, np.zeros(model.nv))
        # Forward: accelerations and forces at the cut joints.
        system = np.block([[M, -J.T], [J, np.zeros((J.shape[0],) * 2)]])
        applied = np.zeros(model.nv)
        applied[active] = tau
        forward = np.linalg.lstsq(system, np.concatenate([applied - h, -bend]), rcond=1e-11)[0][: model.nv]
        near(J @ forward + bend + 10.0, np.full(len(bend), 10.0), "constraint, compared with accelerations of about 10 m/s^2")
        # Inverse: accelerations of all joints from the constraint, then torques of the active joints and constraint forces.
        ddq = G @ ddq_active
        ddq[passive] -= np.linalg.lstsq(J[:, passive], bend, rcond=1e-10)[0]
        select = np.zeros((model.nv, len(active)))
        select[active, range(len(active))] = 1.0
        both = np.linalg.lstsq(np.hstack([select, J.T]), M @ ddq + h, rcond=1e-11)[0]
        near(select @ both[:4] + J.T @ both[4:], M @ ddq + h, "inverse dynamics")
        if number < STATES:
            states.append({"q": q[active], "passive_q": q[passive], "dq": dq_active, "ddq": ddq_active, "tau": both[:4],
                           "applied_tau": tau, "forward_ddq": forward[active]})
        Y = pin.computeJointTorqueRegressor(model, data, q, dq, ddq)[:, columns]
        regressors.append(G.T @ Y)
    values = np.linalg.svd(np.vstack(regressors) / np.abs(np.vstack(regressors)).max(), compute_uv=False)
    rank = int(np.sum(values > 1e-9 * values[0]))
    if not values[rank] < 1e-3 * values[rank - 1]:
        raise SystemExit("the rank is ambiguous")
    return {"joints": ACTIVE, "passive": PASSIVE, "states": states, "base_parameters": rank}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=HERE)
    out = parser.parse_args().out
    rng = np.random.default_rng(SEED)
    root = HERE.parent
    found = {
        "versions": {"pinocchio": pin.__version__, "seed": SEED},
        "mimic": {name: mimic(root / path, rng) for name, path in MIMIC.items()},
        "loops": loops(root / "examples" / "robots" / "palletizer.urdf", rng),
    }
    write(out / "coupled_joints.json", found)


if __name__ == "__main__":
    main()
