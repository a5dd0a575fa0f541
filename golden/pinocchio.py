"""Reference dynamics of every robot in a folder, from Pinocchio, as small JSON files.

    python golden/pinocchio.py [ROBOTS] [--out DIR] [--only NAME ...]

ROBOTS is a folder of URDF files (default: `robots/` of the repository). Writes DIR/pinocchio/<robot>.json; DIR is
this script's folder unless given. The same seed and versions give the same bytes. `golden/README.md` explains
every key.

Conventions: fixed base, world = frame of the root link, joints and bodies by joint name (the vectors follow
`joints`), SI units and radians. A moving body is named by its joint and its frame is that joint's child-link frame;
links behind fixed joints are lumped on it. Inertial parameters per body, about that frame's origin:
[m, m rx, m ry, m rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]. Mimic tags are ignored (every joint is free).

Every value is checked with a second method (Y pi = RNEA, ABA after RNEA, M from unit accelerations, differences for
the derivatives), to detect a wrong use of Pinocchio.
"""
import argparse
import sys
import zlib
from pathlib import Path

# This file has the name of the library, so remove its folder from the import path during the import.
HERE = Path(__file__).resolve().parent
sys.path = [p for p in sys.path if Path(p or ".").resolve() != HERE]
import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

sys.path.insert(0, str(HERE))
from write_json import write  # noqa: E402

SEED = 20261121
SMALL_DOF = 9  # up to this many joints: full regressors, derivatives, base parameters
GRAVITY = np.array([0.0, 0.0, -9.81])
TILTED_GRAVITY = np.array([3.0, -4.0, -8.0])  # tilted base
# Pinocchio orders a body's inertia [Ixx, Ixy, Iyy, Ixz, Iyz, Izz]; this picks [Ixx, Ixy, Ixz, Iyy, Iyz, Izz].
OURS = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])
PARAMETERS = ["m", "m_rx", "m_ry", "m_rz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]
# A column is dependent when its part outside the span of earlier independent columns is below this share of it:
# rounding errors are about 1e-15, and for these robots the ratio of all independent columns is above 0.5.
DEPENDENT = 1e-9


# Robot descriptions with zero inertia about an axis (drive inertia is given elsewhere); forward dynamics is undefined.
WITHOUT_FORWARD_DYNAMICS = {"tx40"}


def close(a, b, relative, what):
    """Fails if two methods for a reference value disagree."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    error = np.max(np.abs(a - b), initial=0.0)
    scale = max(np.max(np.abs(a), initial=0.0), np.max(np.abs(b), initial=0.0), 1e-12)
    if not error <= relative * scale:
        raise SystemExit(f"{what}: two methods differ by {error:g} (scale {scale:g})")


def body_columns(model):
    """Column indices that convert a matrix with 10 n columns to our parameter order."""
    return np.concatenate([10 * b + OURS for b in range(model.njoints - 1)])


def parameters(model):
    return np.concatenate([model.inertias[j].toDynamicParameters()[OURS] for j in range(1, model.njoints)])


def regressor(model, data, q, dq, ddq):
    """Joint torque regressor Y with Y pi = tau, shape (n, 10 n), our parameter order."""
    return pin.computeJointTorqueRegressor(model, data, q, dq, ddq).copy()[:, body_columns(model)]


def positions_within_limits(model, rng):
    low = np.maximum(model.lowerPositionLimit, -np.pi)
    high = np.minimum(model.upperPositionLimit, np.pi)
    return low + (high - low) * rng.random(model.nq)


def states(model, rng):
    """Named states (q, dq, ddq): rest, ordinary, far angles (many turns), high and tiny speeds."""
    n = model.nv
    uniform = lambda scale: rng.uniform(-scale, scale, n)
    prismatic = np.array([model.joints[j].shortname().startswith("JointModelP") for j in range(1, model.njoints)])
    far = np.where(prismatic, 2.0, 100.0)
    yield "zero", np.zeros(n), np.zeros(n), np.zeros(n)
    yield "rest", positions_within_limits(model, rng), np.zeros(n), np.zeros(n)
    yield "ordinary", positions_within_limits(model, rng), uniform(1.0), uniform(2.0)
    yield "far", uniform(1.0) * far, uniform(3.0), uniform(10.0)
    yield "fast", positions_within_limits(model, rng), uniform(30.0), uniform(500.0)
    if n <= SMALL_DOF:
        yield "slow", positions_within_limits(model, rng), uniform(1e-6), uniform(1e-6)
        yield "moving", positions_within_limits(model, rng), uniform(5.0), uniform(20.0)


def derivatives(model, data, q, dq, ddq):
    """dtau/dq and dtau/d(dq) of inverse dynamics, checked against central differences."""
    pin.computeRNEADerivatives(model, data, q, dq, ddq)
    by_q, by_dq = data.dtau_dq.copy(), data.dtau_dv.copy()
    tau = lambda x, v: pin.rnea(model, data, x, v, ddq).copy()
    h = 1e-6
    for j, e in enumerate(np.eye(model.nv)):
        # Truncation h^2 times the third derivative and rounding eps/h both stay below 1e-6 of the matrix.
        scale = max(np.abs(by_q).max(), np.abs(by_dq).max(), np.abs(tau(q, dq)).max())
        for exact, step in ((by_q, (h * e, 0 * e)), (by_dq, (0 * e, h * e))):
            numeric = (tau(q + step[0], dq + step[1]) - tau(q - step[0], dq - step[1])) / (2 * h)
            if not np.max(np.abs(numeric - exact[:, j])) <= 1e-6 * scale:
                raise SystemExit(f"{model.name}: inverse dynamics derivative, column {j}")
    return by_q, by_dq


def placement(frame):
    return {"position_m": frame.translation, "rotation": frame.rotation}


def state_entry(model, tilted, rng, label, q, dq, ddq, probes):
    data, n = model.createData(), model.nv
    tau = pin.rnea(model, data, q, dq, ddq).copy()
    mass_matrix = pin.crba(model, data, q).copy()
    mass_matrix = np.triu(mass_matrix) + np.triu(mass_matrix, 1).T
    bias = pin.nonLinearEffects(model, data, q, dq).copy()
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    applied = gravity + rng.uniform(-5.0, 5.0, n)
    acceleration = pin.aba(model, data, q, dq, applied).copy()
    kinetic = pin.computeKineticEnergy(model, data, q, dq)
    potential = pin.computePotentialEnergy(model, data, q)
    close(mass_matrix @ ddq + bias, tau, 1e-11, f"{model.name} {label}: M ddq + h")
    # Both sides carry the rounding of M times acceleration, which exceeds the torque when accelerations are large.
    scale = 1 + np.abs(mass_matrix).max() * np.abs(acceleration).max() / np.abs(applied).max()
    close(pin.rnea(model, data, q, dq, acceleration), applied, 1e-12 * scale, f"{model.name} {label}: RNEA after ABA")
    close(0.5 * dq @ mass_matrix @ dq, kinetic, 1e-12, f"{model.name} {label}: kinetic energy")
    Y = regressor(model, data, q, dq, ddq)
    close(Y @ parameters(model), tau, 1e-11, f"{model.name} {label}: Y pi")

    pin.framesForwardKinematics(model, data, q)
    entry = {
        "label": label, "q": q, "dq": dq, "ddq": ddq,
        "tau": tau,
        "tau_tilted_gravity": pin.rnea(tilted, tilted.createData(), q, dq, ddq).copy(),
        "gravity_torque": gravity,
        "forward_dynamics": {"tau": applied, "ddq": acceleration},
        "mass_matrix_lower": [mass_matrix[i, : i + 1] for i in range(n)],
        "kinetic_energy_j": kinetic,
        "potential_energy_j": potential,
        "probe_torques": [Y @ p for p in probes],
    }
    joints = range(1, model.njoints)
    if n > SMALL_DOF:
        joints = sorted({1, n // 2, n} | {j for j in joints if not model.children[j]})
        rows = sorted({0, n // 2, n - 1})
        entry["regressor_rows"] = {model.names[r + 1]: Y[r] for r in rows}
    else:
        entry["regressor"] = Y
        entry["dtau_dq"], entry["dtau_dv"] = derivatives(model, data, q, dq, ddq)
        entry["link_placements"] = {f.name: placement(data.oMf[i]) for i, f in enumerate(model.frames) if f.type == pin.BODY}
    entry["joint_placements"] = {model.names[j]: placement(data.oMi[j]) for j in joints}
    return entry


def independent_columns(W):
    """Indices of columns that are independent of earlier columns (left to right, Gram-Schmidt applied twice)."""
    basis, chosen = np.empty((W.shape[0], 0)), []
    smallest_kept, largest_dropped, largest = 1.0, 0.0, np.linalg.norm(W, axis=0).max()
    for j, column in enumerate(W.T):
        norm = np.linalg.norm(column)
        if norm <= DEPENDENT * largest:
            continue
        rest = column / norm
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        share = np.linalg.norm(rest)
        if share > DEPENDENT:
            chosen.append(j)
            basis = np.column_stack([basis, rest / share])
            smallest_kept = min(smallest_kept, share)
        else:
            largest_dropped = max(largest_dropped, share)
    if not (smallest_kept > 1e-5 and largest_dropped < 1e-11):
        raise SystemExit(f"no clear gap between independent and dependent columns: {smallest_kept:g}, {largest_dropped:g}")
    return chosen


def rank(W):
    """Numerical rank with columns scaled to one, without columns that contain only rounding errors."""
    norms = np.linalg.norm(W, axis=0)
    seen = norms > DEPENDENT * norms.max()
    W = W[:, seen] / norms[seen]
    s = np.linalg.svd(W, compute_uv=False)
    r = int(np.sum(s > 1e-9 * s[0]))
    if r < len(s) and not s[r - 1] > 1e4 * s[r]:
        raise SystemExit("no clear gap in the singular values")
    return r


def base_parameters(model, rng):
    """Counts and relations from the regressor stacked over random states.

    Each row of `combination` writes one base parameter as a sum over the standard ones: an independent column j
    holds pi_j plus K[j, d] pi_d of every later column d that depends on it, so W pi = W[:, independent] (combination pi).
    """
    data, n = model.createData(), model.nv
    blocks, friction, drives = [], [], []
    for _ in range(60):
        q, dq, ddq = rng.uniform(-3.0, 3.0, n), rng.uniform(-2.0, 2.0, n), rng.uniform(-3.0, 3.0, n)
        blocks.append(regressor(model, data, q, dq, ddq))
        friction.append(np.stack([np.diag(dq), np.diag(np.sign(dq)), np.eye(n)], axis=2).reshape(n, 3 * n))
        drives.append(np.diag(ddq))
    W, F, D = np.vstack(blocks), np.vstack(friction), np.vstack(drives)
    independent = independent_columns(W)
    if len(independent) != rank(W):
        raise SystemExit(f"{model.name}: {len(independent)} independent columns, rank {rank(W)}")
    K = np.linalg.lstsq(W[:, independent], W, rcond=None)[0]
    close(W[:, independent] @ K, W, 1e-11, f"{model.name}: W = W_b K")
    # Entries are lengths, their products and sines, so no true value is between rounding error and 1e-6 m.
    if np.any((np.abs(K) > 1e-9) & (np.abs(K) < 1e-6)):
        raise SystemExit(f"{model.name}: a coefficient may be a rounding error")
    combination = [
        [[j, K[i, j]] for j in range(W.shape[1]) if abs(K[i, j]) > 1e-9] for i in range(len(independent))
    ]
    for row, j in zip(combination, independent):
        row[[c for c, _ in row].index(j)][1] = 1.0
        if row[0][0] != j:
            raise SystemExit(f"{model.name}: column {j} depends on a later one")
    names = [f"{model.names[b + 1]}.{p}" for b in range(n) for p in PARAMETERS]
    return {
        "count": len(independent),
        "count_with_friction": rank(np.hstack([W, F])),
        "count_with_drive_inertia": rank(np.hstack([W, D])),
        "count_with_friction_and_drive_inertia": rank(np.hstack([W, F, D])),
        "independent": [names[j] for j in independent],
        "combination": {
            names[j]: {names[c]: k for c, k in row} for j, row in zip(independent, combination)
        },
        "values": {names[j]: sum(k * parameters(model)[c] for c, k in row) for j, row in zip(independent, combination)},
    }


def golden(path):
    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = GRAVITY
    tilted = pin.buildModelFromUrdf(str(path))
    tilted.gravity.linear = TILTED_GRAVITY
    if model.nq != model.nv or np.any(model.armature):
        raise SystemExit(f"{path}: joints with one coordinate each and no armature expected")
    # One random stream per robot, so that a new robot does not change the files of the others.
    rng = np.random.default_rng([SEED, zlib.crc32(path.stem.encode())])
    names = list(model.names)[1:]
    probes = rng.standard_normal((3 if model.nv > SMALL_DOF else 1, 10 * model.nv))
    own = parameters(model).reshape(-1, 10)
    out = {
        "schema": "dynident/golden-pinocchio/1",
        "made_by": {"script": "golden/pinocchio.py", "pinocchio": pin.__version__, "numpy": np.__version__, "seed": SEED},
        "robot": path.stem,
        "dof": model.nv,
        "joints": names,
        "parents": {model.names[j]: model.names[model.parents[j]] if model.parents[j] else None for j in range(1, model.njoints)},
        "gravity_mps2": GRAVITY,
        "tilted_gravity_mps2": TILTED_GRAVITY,
        "moving_mass_kg": sum(model.inertias[j].mass for j in range(1, model.njoints)),
        "parameter_order": PARAMETERS,
        "inertial_parameters": dict(zip(names, own)),
        "probe_parameters": probes,
        "states": [state_entry(model, tilted, rng, *s, probes) for s in states(model, rng)],
    }
    if model.nv <= SMALL_DOF:
        out["base_parameters"] = base_parameters(model, rng)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="?", type=Path, default=HERE.parent / "robots", help="folder of URDF files")
    parser.add_argument("--out", type=Path, default=HERE, help="output folder for pinocchio/<robot>.json")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="only these robots")
    options = parser.parse_args()
    wanted = [p for p in sorted(options.robots.glob("*.urdf")) if not options.only or p.stem in options.only]
    paths = [p for p in wanted if p.stem not in WITHOUT_FORWARD_DYNAMICS]
    if not paths:
        parser.error(f"{options.robots}: no URDF files to read")
    for path in paths:
        write(options.out / "pinocchio" / f"{path.stem}.json", golden(path))
        print(f"wrote {options.out / 'pinocchio' / path.stem}.json")


if __name__ == "__main__":
    main()
