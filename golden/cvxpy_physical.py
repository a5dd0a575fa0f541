"""Golden values for the physically consistent fit, from cvxpy with Clarabel.

    python3 golden/cvxpy_physical.py [--out DIR]

Writes cvxpy_physical.json. Small random problems: rows R over base parameters theta = B pi, bodies with pseudo-inertia P >= margin P0, mass limits,
a box for the centre of mass, an ellipsoid for all mass, total mass, nonnegative scalars; one of three priors. The problems are formulated here from the
definitions, independently of Dynident.
"""
import argparse
import pathlib
import warnings

import clarabel
import cvxpy as cp
import numpy as np

from write_json import write

SEED = 20261121
MARGIN = 1e-4
# Tolerances for Clarabel; the first one that it reaches is used. An entropic prior is flat for parameters without data: there a gap of 1e-10 leaves parameter
# differences of a few 1e-6, which depend on the machine. Quadratic priors agree to 1e-8 with a tolerance of 1e-10, which is the limit of double precision.
TOLERANCES = {"entropic": [1e-12, 1e-11], "pullback": [1e-10], "euclidean": [1e-10]}
DIGITS = 9


def pseudo_inertia(p):
    """Pseudo-inertia [Sigma h; h' m] of the ten parameters, as a NumPy array or a cvxpy expression."""
    half = 0.5 * (p[4] + p[7] + p[9])
    rows = [
        [half - p[4], -p[5], -p[6], p[1]],
        [-p[5], half - p[7], -p[8], p[2]],
        [-p[6], -p[8], half - p[9], p[3]],
        [p[1], p[2], p[3], p[0]],
    ]
    return np.array(rows) if isinstance(p, np.ndarray) else cp.bmat(rows)


def body_of(points, masses):
    """Ten parameters of point masses."""
    p = np.zeros(10)
    for m, (x, y, z) in zip(masses, points):
        p += m * np.array([1, x, y, z, y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y])
    return p


def random_body(rng, count, size):
    return body_of(rng.uniform(-size, size, (count, 3)), rng.uniform(0.2, 1.5, count))


def problem(rng, bodies, kind, prior, weight):
    scalars = 2
    n = 10 * bodies + scalars
    truth, described = [], []
    for i in range(bodies):
        size = rng.uniform(0.1, 0.4)
        body = random_body(rng, 2 if kind == "boundary" else 6, size)
        reference = random_body(rng, 8, size)
        entry = {"reference": reference.round(6)}
        if kind == "limits":
            m, com = body[0], body[1:4] / body[0]
            entry["mass_kg"] = np.array([0.6 * m, 0.9 * m]).round(6)
            if i == 0:
                entry["com_box_m"] = np.array([com - [0.01, 0.05, 0.05], com + [-0.002, 0.05, 0.1]]).round(6)
            else:
                entry["ellipsoid"] = np.array([[0.0, 0.01, 0.02], [1.2 * size, 1.5 * size, 1.1 * size]]).round(6)
        truth.append(body)
        described.append(entry)
    truth = np.concatenate(truth + [np.array([0.0, 1.5])])
    independent = np.array([c for c in range(n) if c >= 10 * bodies or rng.uniform() < 0.6])
    dependent = np.array([c for c in range(n) if c not in independent])
    K = np.where(rng.uniform(size=(len(independent), len(dependent))) < 0.15, rng.standard_normal((len(independent), len(dependent))), 0.0)
    K[-scalars:] = 0.0
    B = np.zeros((len(independent), n))
    B[np.arange(len(independent)), independent] = 1.0
    B[:, dependent] = K.round(4)
    R = np.triu(0.3 * rng.standard_normal(2 * (len(independent),)))
    np.fill_diagonal(R, 1.0)
    R = (R * rng.uniform(5.0, 200.0, len(independent))).round(4)
    rho = (R @ B @ truth + {"noisy": 2.0, "boundary": 6.0, "limits": 2.0}[kind] * rng.standard_normal(len(R))).round(6)
    case = {"bodies": described, "base_map": B, "rows": R, "right": rho, "kind": kind, "prior": prior, "prior_weight": weight, "scalars": scalars}
    if kind == "limits":
        case["total_mass_kg"] = (np.array([0.7, 0.8]) * truth[: 10 * bodies : 10].sum()).round(6)
    return case


def distance(prior, P0, P, p, p0):
    """Convex distance of a body from its prior, by the definitions of Lee, Wensing and Park (2020)."""
    root = np.linalg.inv(np.linalg.cholesky(P0))
    Q = root @ P @ root.T
    if prior == "entropic":
        return cp.trace(Q) - cp.log_det(Q) - 4
    if prior == "pullback":
        return 0.5 * cp.sum_squares(Q - np.eye(4))
    m = p0[0]
    length = np.sqrt(np.trace(P0[:3, :3]) / m)
    units = m * np.array([1.0] + 3 * [length] + 6 * [length**2])
    return 0.5 * cp.sum_squares(cp.multiply(1 / units, p - p0))


def solve(case):
    bodies, scalars = len(case["bodies"]), case["scalars"]
    pi = cp.Variable(10 * bodies + scalars)
    data = 0.5 * cp.sum_squares(case["rows"] @ case["base_map"] @ pi - case["right"])
    distances, constraints, masses = 0.0, [], 0.0
    for i, body in enumerate(case["bodies"]):
        p, p0 = pi[10 * i : 10 * i + 10], body["reference"]
        P, P0 = pseudo_inertia(p), pseudo_inertia(p0)
        distances += distance(case["prior"], P0, P, p, p0)
        S = cp.Variable((4, 4), PSD=True)
        root = np.linalg.inv(np.linalg.cholesky(P0))
        constraints.append(root @ P @ root.T - MARGIN * np.eye(4) == S)
        masses += p[0]
        if "mass_kg" in body:
            constraints += [p[0] >= body["mass_kg"][0], p[0] <= body["mass_kg"][1]]
        if "com_box_m" in body:
            low, high = body["com_box_m"]
            constraints += [p[1:4] >= p[0] * low, p[1:4] <= p[0] * high]
        if "ellipsoid" in body:
            c, a = body["ellipsoid"]
            E = np.diag(1 / a**2)
            Q = np.block([[-E, (E @ c)[:, None]], [(E @ c)[None, :], np.array([[1 - c @ E @ c]])]])
            constraints.append(cp.trace(P @ Q) >= 0)
    rest = pi[10 * bodies :]
    distances += 0.5 * cp.sum_squares(rest)
    constraints.append(rest >= 0)
    if "total_mass_kg" in case:
        constraints += [masses >= case["total_mass_kg"][0], masses <= case["total_mass_kg"][1]]
    program = cp.Problem(cp.Minimize(data + case["prior_weight"] * distances), constraints)
    for tolerance in TOLERANCES[case["prior"]]:
        with warnings.catch_warnings():
            # cvxpy warns if a tolerance is not reached; then the next one is tried.
            warnings.simplefilter("ignore", UserWarning)
            program.solve(solver=cp.CLARABEL, tol_gap_abs=tolerance, tol_gap_rel=tolerance, tol_feas=tolerance, max_iter=200, warm_start=False)
        if program.status == cp.OPTIMAL:
            break
    else:
        raise RuntimeError(f"{case['kind']} {case['prior']}: {program.status}")
    return {"objective": round(float(program.value), DIGITS - 3), "parameters": pi.value.round(DIGITS), "base_values": (case["base_map"] @ pi.value).round(DIGITS)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    out = parser.parse_args().out
    rng = np.random.default_rng(SEED)
    cases = []
    for kind in ["noisy", "boundary", "limits"]:
        for prior, weight in [("entropic", 0.5), ("pullback", 0.5), ("euclidean", 1.0)]:
            case = problem(rng, 2 if kind != "boundary" else 3, kind, prior, weight)
            case["solution"] = solve(case)
            cases.append(case)
    golden = {
        "source": {"cvxpy": cp.__version__, "clarabel": clarabel.__version__, "numpy": np.__version__, "seed": SEED},
        "margin": MARGIN,
        "cases": cases,
    }
    write(out / "cvxpy_physical.json", golden)


if __name__ == "__main__":
    main()
