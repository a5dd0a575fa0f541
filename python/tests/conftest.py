"""Fixtures for all tests: the robots of the repository and a motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dynident

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def ur10() -> dynident.Robot:
    return dynident.Robot.load(ROOT / "robots" / "ur10.urdf")


@pytest.fixture(scope="session")
def planar() -> dynident.Robot:
    return dynident.Robot.load(ROOT / "robots" / "planar2r.urdf")


def motion(joints: int, seconds: float = 12.0, rate_hz: float = 200.0, seed: int = 0):
    """Sines with incommensurable frequencies, and their derivatives."""
    draw = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    q, dq, ddq = (np.zeros((t.size, joints)) for _ in range(3))
    for joint in range(joints):
        for omega in draw.uniform(0.5, 3.0, 4):
            size, phase = 0.2 + 0.1 * draw.random(), draw.uniform(0, 2 * np.pi)
            q[:, joint] += size * np.sin(omega * t + phase)
            dq[:, joint] += size * omega * np.cos(omega * t + phase)
            ddq[:, joint] -= size * omega**2 * np.sin(omega * t + phase)
    return t, q, dq, ddq


@pytest.fixture(scope="session")
def planar_logs(planar: dynident.Robot) -> list[dynident.Log]:
    """A planar arm with viscous friction of 0.8 and 0.4 Nm s/rad and white torque noise of 0.02 Nm."""
    logs = []
    for seed, role in [(1, "identify"), (2, "validate")]:
        t, q, dq, ddq = motion(planar.n, seed=seed)
        noise = 0.02 * np.random.default_rng(10 + seed).standard_normal(q.shape)
        tau = planar.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4] + noise
        logs.append(dynident.Log.from_arrays(t, q, tau, name=f"run {seed}", role=role))
    return logs
