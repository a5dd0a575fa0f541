"""Golden values for the estimators, from statsmodels and NumPy.

    python3 golden/statsmodels_estimators.py [--out DIR]

Writes statsmodels_estimators.json. Two logs of two joints with different lengths; joint 1 depends on all columns, joint 2 only on the
last three. Columns of very different magnitude; AR(1) residuals. Segments of 25 rows; the last segment of a log is shorter.
"""
import argparse
import pathlib

import numpy as np
import scipy
import statsmodels
import statsmodels.api as sm

from write_json import write

SEED = 20261121
SEGMENT_ROWS = 25
COLUMNS = [[0, 1, 2, 3, 4], [2, 3, 4]]
SCALES = np.array([1.0, 30.0, 0.01, 2.0, 1.0])
THETA = np.array([1.5, -0.2, 40.0, 0.7, -1.1])
SIGMA = [0.8, 0.05]
ROWS = [310, 215]


def simulated_logs():
    """The logs in file format, and all rows stacked: regressor, torque, joint and cluster numbers."""
    rng = np.random.default_rng(SEED)
    logs = []
    X, y, joint_of, cluster, log_cluster = [], [], [], [], []
    for log, rows in enumerate(ROWS):
        joints = []
        for joint, columns in enumerate(COLUMNS):
            W = rng.standard_normal((rows, len(columns))).cumsum(axis=0) * 0.1
            W = (W + rng.standard_normal(W.shape)) * SCALES[columns]
            noise = np.zeros(rows)
            for k in range(rows):
                noise[k] = (0.7 * noise[k - 1] if k else 0.0) + SIGMA[joint] * rng.standard_normal()
            W, tau = W.round(9), (W @ THETA[columns] + noise).round(9)
            joints.append({"w_by_column": W.T.tolist(), "tau": tau.tolist()})
            full = np.zeros((rows, 5))
            full[:, columns] = W
            X.append(full)
            y.append(tau)
            segment = np.arange(rows) // SEGMENT_ROWS
            joint_of.append(np.full(rows, joint))
            cluster.append(segment + 1000 * joint + 10000 * log)
            log_cluster.append(segment + 10000 * log)
        logs.append(joints)
    return logs, np.vstack(X), *map(np.concatenate, (y, joint_of, cluster, log_cluster))


def fit(X, y, cluster, log_cluster, weights):
    """Weighted least squares with all its covariances, and the plain statsmodels result."""
    model = sm.WLS(y, X, weights=weights)
    plain = model.fit()
    by_joint = model.fit(cov_type="cluster", cov_kwds={"groups": cluster})
    across = model.fit(cov_type="cluster", cov_kwds={"groups": log_cluster})
    rows = X * np.sqrt(weights)[:, None]
    return {
        "values": plain.params.tolist(),
        "std_scaled": plain.bse.tolist(),
        "covariance_unscaled": plain.normalized_cov_params.tolist(),
        "covariance_segments": by_joint.cov_params().tolist(),
        "covariance_segments_across_joints": across.cov_params().tolist(),
        "condition_raw": float(np.linalg.cond(rows)),
        "condition_scaled": float(np.linalg.cond(rows / np.linalg.norm(rows, axis=0))),
    }, plain


def joint_sigma(residual, joint_of):
    """Noise of each joint; its share of the five parameters reduces the degrees of freedom."""
    return np.array([np.sqrt((residual[joint_of == j] ** 2).sum() / ((joint_of == j).sum() - 5 / 2)) for j in range(2)])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    out = parser.parse_args().out
    logs, X, y, joint_of, cluster, log_cluster = simulated_logs()
    ols, result = fit(X, y, cluster, log_cluster, np.ones(len(y)))
    ols["rss"] = float(result.ssr)
    sigma = np.ones(2)
    for _ in range(200):
        wls, result = fit(X, y, cluster, log_cluster, 1.0 / sigma[joint_of] ** 2)
        sigma = joint_sigma(y - X @ result.params, joint_of)
    wls["joint_sigma"] = sigma.tolist()

    # A prior on the weighted problem: independent, mean and standard deviation per column.
    mean, std = THETA * 1.1, np.abs(THETA) * 0.02
    prior = {"mean": mean.tolist(), "std": std.tolist()}
    sigma = np.ones(2)
    for _ in range(200):
        w = 1.0 / sigma[joint_of]
        A = np.vstack([X * w[:, None], np.diag(1.0 / std)])
        theta = np.linalg.lstsq(A, np.concatenate([y * w, mean / std]), rcond=None)[0]
        sigma = joint_sigma(y - X @ theta, joint_of)
    prior["values"] = theta.tolist()
    # Use QR, because the normal equations square the condition number.
    inverse = np.linalg.inv(np.linalg.qr(A, mode="r"))
    prior["covariance_white"] = (inverse @ inverse.T).tolist()
    golden = {
        "source": {
            "statsmodels": statsmodels.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "seed": SEED,
        },
        "segment_rows": SEGMENT_ROWS,
        "joint_columns": COLUMNS,
        "logs": logs,
        "ordinary": ols,
        "weighted": wls,
        "prior": prior,
    }
    write(out / "statsmodels_estimators.json", golden)


if __name__ == "__main__":
    main()
