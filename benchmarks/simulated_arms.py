"""Motion, presliding and noise of simulated arms, for the scripts that measure forms, payloads and torque bands."""
import numpy as np


def fourier(t, middle, amplitude, harmonics, base_hz, random):
    """Positions, velocities and accelerations of a random Fourier series at the times t, within the amplitude about the middle."""
    n = len(middle)
    omega = 2 * np.pi * base_hz * np.arange(1, harmonics + 1)
    a, b = random.normal(size=(harmonics, n)), random.normal(size=(harmonics, n))
    total = np.abs(a).sum(0) + np.abs(b).sum(0)
    a, b = a / total, b / total
    sine, cosine = np.sin(np.outer(t, omega)), np.cos(np.outer(t, omega))
    q = middle + amplitude * (sine @ a + cosine @ b)
    v = amplitude * ((cosine * omega) @ a - (sine * omega) @ b)
    return q, v, -amplitude * ((sine * omega**2) @ a + (cosine * omega**2) @ b)


def slip(q, yields):
    """Maxwell slip: the mean of elements, each of which sticks until its displacement."""
    state, out = np.zeros((len(yields), q.shape[1])), np.empty_like(q)
    for k in range(len(q)):
        step = q[k] - q[max(k - 1, 0)]
        for i, most in enumerate(yields):
            state[i] = np.clip(state[i] + step / most, -1, 1)
        out[k] = state.mean(axis=0)
    return out


def correlated_noise(shape, random):
    """Noise of variance 1 with a lag-1 correlation of 0.8 along the rows."""
    error = random.normal(size=shape)
    for k in range(1, len(error)):
        error[k] = 0.8 * error[k - 1] + 0.6 * error[k]
    return error
