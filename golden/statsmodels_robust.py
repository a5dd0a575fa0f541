"""Golden values for robust, instrumental and generalised least squares, from statsmodels and NumPy.

    python3 golden/statsmodels_robust.py [--out DIR]

Writes statsmodels_robust.json: one joint with gross errors (RLM with Huber's and Tukey's weights), one with noise in the regressor and instruments (IV2SLS with a manual cluster
covariance; the Durbin-Wu-Hausman test as an F test of the augmented OLS), two joints with correlated errors (GLS, iterated).
"""
import argparse
import pathlib

import numpy as np
import statsmodels
import statsmodels.api as sm
from statsmodels.sandbox.regression.gmm import IV2SLS

from write_json import write

SEED = 20261122
SEGMENT_ROWS = 20


def robust(rng):
    rows = 240
    X = rng.standard_normal((rows, 3)) * np.array([1.0, 5.0, 0.1]).round(9)
    y = X @ np.array([1.0, -0.3, 20.0]) + 0.3 * rng.standard_normal(rows)
    bad = rng.choice(rows, 12, replace=False)
    y[bad] += 8.0 * rng.standard_normal(12) + 5.0
    X, y = X.round(9), y.round(9)
    found = {"w_by_column": X.T.tolist(), "tau": y.tolist()}
    for name, norm in (("huber", sm.robust.norms.HuberT(1.345)), ("tukey", sm.robust.norms.TukeyBiweight(4.685))):
        fit = sm.RLM(y, X, M=norm).fit(tol=1e-13, maxiter=500, conv="coefs")
        found[name] = {"values": fit.params.tolist(), "scale": float(fit.scale)}
    return found


def instrumental(rng):
    rows = 300
    truth = rng.standard_normal((rows, 3)).cumsum(axis=0) * 0.2 + rng.standard_normal((rows, 3))
    truth[:, 2] = 1.0
    Z = truth.copy()
    Z[:, :2] += 0.2 * rng.standard_normal((rows, 2))
    X = truth.copy()
    X[:, :2] += 0.5 * rng.standard_normal((rows, 2))
    y = truth @ np.array([2.0, -1.0, 0.5]) + 0.2 * rng.standard_normal(rows)
    Z, X, y = Z.round(9), X.round(9), y.round(9)
    fit = IV2SLS(y, X, Z).fit()
    left = X - Z @ np.linalg.lstsq(Z, X, rcond=None)[0]
    fitted = X - left
    u = y - X @ fit.params
    A = np.linalg.inv(fitted.T @ fitted)
    meat = np.zeros((3, 3))
    for start in range(0, rows, SEGMENT_ROWS):
        s = fitted[start : start + SEGMENT_ROWS].T @ u[start : start + SEGMENT_ROWS]
        meat += np.outer(s, s)
    groups = -(-rows // SEGMENT_ROWS)
    c = groups / (groups - 1) * (rows - 1) / (rows - 3)
    augmented = sm.OLS(y, np.hstack([X, left[:, :2]])).fit()
    test = augmented.f_test(np.eye(5)[3:])
    # Cragg-Donald statistic for the two noisy columns, with the constant removed from all columns.
    V = left[:, :2]
    centred = fitted[:, :2] - fitted[:, :2].mean(axis=0)
    sigma = V.T @ V / (rows - 3)
    weakest = float(np.linalg.eigvals(np.linalg.solve(sigma, centred.T @ centred)).real.min() / 3)
    return {
        "z_by_column": Z.T.tolist(),
        "w_by_column": X.T.tolist(),
        "tau": y.tolist(),
        "values": fit.params.tolist(),
        "sigma": float(np.sqrt(u @ u / (rows - 3))),
        "covariance_segments": (c * A @ meat @ A).tolist(),
        "hausman_f": float(test.fvalue),
        "hausman_p": float(test.pvalue),
        "weakest_f": weakest,
    }


def generalized(rng):
    rows = 200
    columns = [[0, 1, 2], [1, 2]]
    W = [(rng.standard_normal((rows, len(c))) * 2.0).round(9) for c in columns]
    theta = np.array([0.7, -2.0, 1.2])
    noise = rng.multivariate_normal([0, 0], [[0.25, 0.12], [0.12, 0.09]], rows)
    tau = [(W[j] @ theta[columns[j]] + noise[:, j]).round(9) for j in range(2)]
    X = np.zeros((2 * rows, 3))
    for j in range(2):
        X[j * rows : (j + 1) * rows, columns[j]] = W[j]
    y = np.concatenate(tau)
    omega = np.eye(2)
    for _ in range(100):
        fit = sm.GLS(y, X, sigma=np.kron(omega, np.eye(rows))).fit()
        e = (y - X @ fit.params).reshape(2, rows).T
        omega = e.T @ e / (rows - 1.5)
    return {
        "joint_columns": columns,
        "joints": [{"w_by_column": W[j].T.tolist(), "tau": tau[j].tolist()} for j in range(2)],
        "values": fit.params.tolist(),
        "omega": omega.tolist(),
        "covariance_unscaled": fit.normalized_cov_params.tolist(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    out = parser.parse_args().out
    rng = np.random.default_rng(SEED)
    golden = {
        "source": {"statsmodels": statsmodels.__version__, "numpy": np.__version__, "seed": SEED},
        "segment_rows": SEGMENT_ROWS,
        "robust": robust(rng),
        "instrumental": instrumental(rng),
        "generalized": generalized(rng),
    }
    write(out / "statsmodels_robust.json", golden)


if __name__ == "__main__":
    main()
