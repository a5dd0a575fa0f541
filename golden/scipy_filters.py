"""Golden values for the filters of dynident-recording, from SciPy and NumPy.

    python3 golden/scipy_filters.py [--out DIR]

Writes scipy_filters.json. Seeded; the file contains the library versions.
"""
import argparse
import math
import pathlib
from fractions import Fraction

import numpy as np
import scipy
from scipy import signal
from scipy.signal._arraytools import odd_ext

from write_json import write

SEED = 20261121


def smooth_and_derivatives(x, order, cutoff_hz, rate_hz):
    """sosfiltfilt of x, and sixth-order central differences of its output. The odd extension is kept, so that the
    differences at the ends are also central."""
    sos = signal.butter(order, cutoff_hz, fs=rate_hz, output="sos")
    sections = len(sos)
    pad = 3 * (2 * sections + 1 - min((sos[:, 2] == 0).sum(), (sos[:, 5] == 0).sum()))
    extended = odd_ext(x, pad)
    zi = signal.sosfilt_zi(sos)
    y, _ = signal.sosfilt(sos, extended, zi=zi * extended[0])
    y, _ = signal.sosfilt(sos, y[::-1], zi=zi * y[-1])
    y = y[::-1]
    reference = signal.sosfiltfilt(sos, x)
    assert np.allclose(y[pad:-pad], reference, rtol=0, atol=1e-14 * np.abs(x).max())
    at = np.arange(pad, pad + len(x))
    dq = rate_hz * (45 * (y[at + 1] - y[at - 1]) - 9 * (y[at + 2] - y[at - 2]) + (y[at + 3] - y[at - 3])) / 60
    ddq = rate_hz**2 * (
        270 * (y[at + 1] + y[at - 1]) - 27 * (y[at + 2] + y[at - 2]) + 2 * (y[at + 3] + y[at - 3]) - 490 * y[at]
    ) / 180
    return {"order": order, "cutoff_hz": cutoff_hz, "rate_hz": rate_hz, "q": reference, "dq": dq, "ddq": ddq}


def polynomial_weights(window, degree, at, derivative):
    """Weights of the least-squares polynomial's derivative at the integer `at`, -half to half, in exact arithmetic."""
    half, terms = window // 2, degree + 1
    moments = [sum(Fraction(k) ** p for k in range(-half, half + 1)) for p in range(2 * terms)]
    # Gauss-Jordan on [V^T V | d^derivative of (1, x, x^2, ..) at `at`]; V^T V is positive definite, so no pivoting.
    rows = [
        [moments[i + j] for j in range(terms)]
        + [Fraction(math.perm(i, derivative) * at ** (i - derivative) if i >= derivative else 0)]
        for i in range(terms)
    ]
    for i in range(terms):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for j in range(terms):
            if j != i:
                rows[j] = [x - rows[j][i] * y for x, y in zip(rows[j], rows[i])]
    return np.array([float(sum(rows[i][-1] * k**i for i in range(terms))) for k in range(-half, half + 1)])


def savitzky_golay(x, window, degree, rate_hz):
    """Definition of `savgol_filter(mode="interp")` with exact weights. SciPy uses powers of the sample number, which leaves three
    correct digits for 101 samples and degree 8, and the error depends on the processor. SciPy is used as a check."""
    half, derivatives = window // 2, []
    for d in range(3):
        inside = polynomial_weights(window, degree, 0, d)
        y = np.convolve(x, inside[::-1], mode="same")
        for k in range(half):
            y[k] = polynomial_weights(window, degree, k - half, d) @ x[:window]
            y[-1 - k] = polynomial_weights(window, degree, half - k, d) @ x[-window:]
        derivatives.append(y * rate_hz**d)
        witness = signal.savgol_filter(x, window, degree, deriv=d, delta=1 / rate_hz, mode="interp")
        assert np.abs(derivatives[d] - witness).max() <= (2e-2 if degree > 5 else 1e-9) * np.abs(witness).max()
    return {"window": window, "degree": degree, "rate_hz": rate_hz, "derivatives": derivatives}


def causal(x, order, cutoff_hz, rate_hz):
    """sosfilt of x after its odd extension, and sixth-order central differences of the output with the extension at the end."""
    sos = signal.butter(order, cutoff_hz, fs=rate_hz, output="sos")
    pad = 3 * (order + 1)
    extended = odd_ext(x, pad)
    y, _ = signal.sosfilt(sos, extended, zi=signal.sosfilt_zi(sos) * extended[0])
    at = np.arange(pad, pad + len(x))
    dq = rate_hz * (45 * (y[at + 1] - y[at - 1]) - 9 * (y[at + 2] - y[at - 2]) + (y[at + 3] - y[at - 3])) / 60
    ddq = rate_hz**2 * (
        270 * (y[at + 1] + y[at - 1]) - 27 * (y[at + 2] + y[at - 2]) + 2 * (y[at + 3] + y[at - 3]) - 490 * y[at]
    ) / 180
    _, delay = signal.group_delay(signal.butter(order, cutoff_hz, fs=rate_hz), w=[1e-6])
    return {
        "order": order, "cutoff_hz": cutoff_hz, "rate_hz": rate_hz, "q": y[at], "dq": dq, "ddq": ddq, "delay_s": delay[0] / rate_hz,
    }


def series(x, base_hz, harmonics, trend, rate_hz):
    """numpy.linalg.lstsq of offset, straight line and harmonics, and the derivatives of the fit."""
    t = np.arange(len(x)) / rate_hz
    zero, one = np.zeros_like(t), np.ones_like(t)
    columns = [[one, zero, zero]] + ([[t, one, zero]] if trend else [])
    for k in range(1, harmonics + 1):
        w = 2 * math.pi * k * base_hz
        s, c = np.sin(w * t), np.cos(w * t)
        columns += [[s, w * c, -w * w * s], [c, -w * s, -w * w * c]]
    basis = np.array(columns)
    coefficients = np.linalg.lstsq(basis[:, 0].T, x, rcond=None)[0]
    q, dq, ddq = np.einsum("k,kdn->dn", coefficients, basis)
    return {"base_hz": base_hz, "harmonics": harmonics, "trend": trend, "rate_hz": rate_hz, "q": q, "dq": dq, "ddq": ddq}


def in_frequency(x, cutoff_hz, mirrored, rate_hz):
    """numpy.fft: jw X up to the cut-off, zero above."""
    whole = np.concatenate([x, x[-2:0:-1]]) if mirrored else x
    spectrum, f = np.fft.rfft(whole), np.fft.rfftfreq(len(whole), 1 / rate_hz)
    kept = np.where(f <= cutoff_hz, spectrum, 0)
    q, dq, ddq = [np.fft.irfft(kept * (2j * math.pi * f) ** d, len(whole))[: len(x)] for d in range(3)]
    return {"cutoff_hz": cutoff_hz, "mirrored": mirrored, "rate_hz": rate_hz, "q": q, "dq": dq, "ddq": ddq}


def averaged_differences(x, window, rate_hz):
    """numpy.gradient-like second differences of second order, then a centred mean with a shorter window at the ends."""
    second = np.empty_like(x)
    second[1:-1] = x[2:] - 2 * x[1:-1] + x[:-2]
    second[0], second[-1] = second[1], second[-2]
    n, half = len(x), window // 2
    mean = lambda y, i, h: y[i - h : i + h + 1].mean()
    ddq = np.array([mean(second, i, min(half, i, n - 1 - i)) for i in range(n)]) * rate_hz**2
    return {"window": window, "rate_hz": rate_hz, "dq": np.gradient(x, 1 / rate_hz, edge_order=2), "ddq": ddq}


def five_points(x, passes):
    """savgol_filter(5, 3, mode="interp"), repeated: the weights (-3, 12, 17, 12, -3)/35."""
    for _ in range(passes):
        x = signal.savgol_filter(x, 5, 3, mode="interp")
    return {"passes": passes, "smooth": x}


def kaiser_taps(factor, stop_band_db, rate_hz):
    """Kaiser-windowed sinc by scipy.signal.firwin, with the length and shape documented in DecimationSettings."""
    reduced = rate_hz / factor
    attenuation = stop_band_db + 2.0
    width = 2 * math.pi * 0.4 * reduced / rate_hz
    length = (attenuation - 7.95) / (2.285 * width) + 1
    count = 2 * (math.ceil(length) // 2) + 1
    window = ("kaiser", signal.kaiser_beta(attenuation))
    return {
        "factor": factor,
        "stop_band_db": stop_band_db,
        "rate_hz": rate_hz,
        "taps": signal.firwin(count, 0.4 * reduced, window=window, fs=rate_hz, scale=True),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    out = parser.parse_args().out
    random = np.random.default_rng(SEED)
    # A motion with an offset, a nonzero velocity at the end, and encoder noise.
    t = np.arange(160) / 200.0
    x = 1.3 + np.sin(4.0 * t + 0.3) + 0.4 * np.cos(11.0 * t) + 1e-3 * random.standard_normal(len(t))
    golden = {
        "versions": {"numpy": np.__version__, "scipy": scipy.__version__},
        "seed": SEED,
        "signal": x,
        "butterworth": [
            smooth_and_derivatives(x, order, cutoff_hz, 200.0)
            for order, cutoff_hz in [(1, 20.0), (2, 5.0), (3, 12.0), (4, 8.0), (5, 30.0), (6, 15.0), (8, 40.0), (4, 90.0)]
        ],
        "savitzky_golay": [
            savitzky_golay(x, window, degree, 200.0) for window, degree in [(5, 2), (5, 3), (11, 4), (31, 5), (101, 4), (101, 8)]
        ],
        "low_pass": [causal(x, *case, 200.0) for case in [(1, 20.0), (2, 5.0), (4, 8.0), (5, 30.0)]],
        "fourier_fit": [series(x, *case, 200.0) for case in [(1.5, 3, True), (1.25, 8, False), (0.7, 2, True)]],
        "frequency_domain": [in_frequency(x, *case, 200.0) for case in [(12.0, True), (12.0, False), (60.0, True)]],
        "smoothed_differences": [averaged_differences(x, window, 200.0) for window in [3, 11, 31]],
        "five_point_cubic": [five_points(x, passes) for passes in [1, 4]],
        "gradient": np.gradient(x, 1 / 200.0, edge_order=2),
        "decimation": [kaiser_taps(*case) for case in [(2, 60.0, 1000.0), (10, 60.0, 1000.0), (5, 90.0, 500.0), (25, 40.0, 5000.0)]],
    }
    write(out / "scipy_filters.json", golden)


if __name__ == "__main__":
    main()
