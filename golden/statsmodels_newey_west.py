"""Golden values for Newey and West's covariance, from statsmodels.

    python3 golden/statsmodels_newey_west.py [--out DIR]

Writes statsmodels_newey_west.json: 240 rows of four columns with AR(1) residuals, the covariance with Bartlett's kernel, and the automatic bandwidth of Newey and West (1994) in
NumPy. In place of their weights, the bandwidth uses the trace of the autocovariances of the scores in the metric of the information matrix.
"""
import argparse
import pathlib

import numpy as np
import statsmodels
import statsmodels.api as sm

from write_json import write

SEED = 20261121
ROWS, COLUMNS = 240, 4


def bandwidth(scores, information):
    """Maximum lag of Bartlett's kernel."""
    rows = len(scores)
    pilot = int(4 * (rows / 100) ** (2 / 9))
    inverse = np.linalg.inv(information)
    gamma = [np.einsum("ti,ij,tj->", scores[lag:], inverse, scores[: rows - lag]) for lag in range(pilot + 1)]
    s0 = gamma[0] + 2 * sum(gamma[1:])
    s1 = 2 * sum(lag * value for lag, value in enumerate(gamma))
    return int(1.1447 * (abs(s1 / s0)) ** (2 / 3) * rows ** (1 / 3))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent)
    out = parser.parse_args().out
    rng = np.random.default_rng(SEED)
    X = (rng.standard_normal((ROWS, COLUMNS)).cumsum(axis=0) * 0.2 + rng.standard_normal((ROWS, COLUMNS))).round(9)
    noise = np.zeros(ROWS)
    for k in range(ROWS):
        noise[k] = (0.7 * noise[k - 1] if k else 0.0) + 0.3 * rng.standard_normal()
    y = (X @ np.array([1.0, -2.0, 0.5, 3.0]) + noise).round(9)
    plain = sm.OLS(y, X).fit()
    scores = X * plain.resid[:, None]
    lags = bandwidth(scores, X.T @ X)
    robust = plain.get_robustcov_results("HAC", maxlags=lags, use_correction=True)
    write(
        out / "statsmodels_newey_west.json",
        {
            "source": {"statsmodels": statsmodels.__version__, "numpy": np.__version__, "seed": SEED},
            "w_by_column": X.T.tolist(),
            "tau": y.tolist(),
            "bandwidth": lags,
            "values": plain.params.tolist(),
            "covariance": robust.cov_params().tolist(),
        },
    )


if __name__ == "__main__":
    main()
