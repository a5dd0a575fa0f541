"""Tests monitoring of a robot, sample by sample."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from conftest import motion

import dynident

RATE_HZ = 200.0
FRICTION = np.array([0.8, 0.4])


@pytest.fixture(scope="module")
def model(planar: dynident.Robot, planar_logs: list[dynident.Log]) -> dynident.Model:
    drive = {"viscous": True, "coulomb": "none", "offset": False}
    return dynident.identify(planar, planar_logs, drive=drive, friction="stated")


def work(planar: dynident.Robot, seed: int, seconds: float, friction: np.ndarray = FRICTION):
    """Positions and their derivatives, and torque with white noise of 0.02 Nm."""
    _, q, dq, ddq = motion(planar.n, seconds=seconds, rate_hz=RATE_HZ, seed=seed)
    noise = 0.02 * np.random.default_rng(100 + seed).standard_normal(q.shape)
    return q, dq, ddq, planar.inverse_dynamics(q, dq, ddq) + dq * friction + noise


def test_the_estimate_goes_on_from_the_model(model: dynident.Model, planar: dynident.Robot) -> None:
    watch = model.online(rate_hz=RATE_HZ, forgetting_s=None, correlation_s=0.05)
    assert watch.names == model.names
    # Before the first sample the estimate is that of the model: the consistent parameters and their error bars.
    np.testing.assert_allclose(watch.covariance, model.covariance, rtol=1e-6, atol=1e-6 * abs(model.covariance).max())
    before = watch.values
    q, dq, ddq, tau = work(planar, seed=7, seconds=20.0)
    watch.update(q, tau, dq, ddq)
    assert watch.samples == len(q)
    truth = dict(zip(planar.base_parameters, planar.base_projection @ planar.inertial_parameters.ravel(), strict=True))
    truth |= {"fv1": 0.8, "fv2": 0.4}
    expected = np.array([truth[name] for name in watch.names])
    std = np.sqrt(np.diag(watch.covariance))
    assert (std < np.sqrt(np.diag(model.covariance))).all()
    # Two in a thousand draws of eight numbers exceed the limit.
    assert (abs(watch.values - expected) < 4.0 * std).all()
    assert (watch.values != before).all()
    bodies, friction = watch.consistent()
    assert bodies.shape == (2, 10)
    assert (bodies[:, 0] > 0).all()
    assert abs(friction["fv1"] - 0.8) < 0.01


def test_samples_are_the_same_one_by_one_and_in_an_array(model: dynident.Model, planar: dynident.Robot) -> None:
    q, _, _, tau = work(planar, seed=8, seconds=2.0)
    one, all_at_once = model.online(rate_hz=RATE_HZ), model.online(rate_hz=RATE_HZ)
    found = [alarm for k in range(len(q)) for alarm in one.update(q[k], tau[k])]
    assert found == all_at_once.update(q, tau)
    np.testing.assert_array_equal(one.values, all_at_once.values)
    assert one.delay_s == 10 / RATE_HZ
    with pytest.raises(dynident.Error, match="always or never"):
        one.update(q, tau, q, q)
    with pytest.raises(dynident.Error, match="both or none"):
        one.update(q, tau, q)
    with pytest.raises(ValueError, match="last axis"):
        one.update(q[:, :1], tau)
    with pytest.raises(dynident.Error, match="finite"):
        one.update(np.full(2, np.nan), np.zeros(2))
    with pytest.raises(dynident.Error, match="rate_hz"):
        model.online(rate_hz=0.0)


def test_a_push_and_a_payload_are_seen(model: dynident.Model, planar: dynident.Robot) -> None:
    watch = model.online(rate_hz=RATE_HZ)
    stated = watch.thresholds_nm
    q, _, _, tau = work(planar, seed=9, seconds=60.0)
    watch.calibrate(q, tau)
    assert watch.thresholds_nm.shape == stated.shape == (2, 2)
    # The model has only the noise after its filter and assumes the same level elsewhere; there are no slow errors here.
    ratio = watch.thresholds_nm / stated
    assert (ratio[:, 0] > 0.6).all()
    assert (ratio < 1.4).all()
    q, _, _, tau = work(planar, seed=10, seconds=20.0)
    watch.restart()
    assert watch.update(q, tau) == []
    assert watch.contact is None
    pushed = tau.copy()
    pushed[2000:, 1] += 0.3
    start_s = watch.samples / RATE_HZ
    watch.restart()
    first = watch.update(q, pushed)[0]
    assert first["kind"] == "collision"
    assert first["joint"] == planar.joint_names[1]
    # 0.05 s plus the delay of the derivatives.
    assert -0.05 <= first["time_s"] - (start_s + 10.0) < 0.05
    assert watch.contact is not None
    assert watch.alarms[0] == first


def test_friction_that_grows_is_drift(model: dynident.Model, planar: dynident.Robot) -> None:
    # Half-life 1 s, a check every 4 s; the contact thresholds are out of reach.
    watch = model.online(rate_hz=RATE_HZ, forgetting_s=1.0, contact_alarms_per_hour=1e-9)
    q, dq, ddq, tau = work(planar, seed=11, seconds=120.0)
    assert [alarm for alarm in watch.update(q, tau, dq, ddq) if alarm["kind"] == "drift"] == []
    assert watch.drift is not None
    assert watch.drift["statistic"] < watch.drift["threshold"]
    q, dq, ddq, tau = work(planar, seed=12, seconds=20.0, friction=FRICTION * [1.0, 1.5])
    found = [alarm for alarm in watch.update(q, tau, dq, ddq) if alarm["kind"] == "drift"]
    assert found
    assert found[0]["parameter"] == "fv2"


def test_lost_samples_and_stalls_raise_no_alarm(model: dynident.Model, planar: dynident.Robot) -> None:
    """Ten minutes of work with lost samples, pauses of three and forty samples, and jitter of the stamps."""
    rng = np.random.default_rng(5)
    watch = model.online(rate_hz=RATE_HZ)
    q, _, _, tau = work(planar, seed=20, seconds=60.0)
    watch.calibrate(q, tau, time_s=np.arange(len(q)) / RATE_HZ)
    watch.restart()
    q, _, _, tau = work(planar, seed=21, seconds=600.0)
    t = np.arange(len(q)) / RATE_HZ
    keep = rng.random(len(q)) > 0.002
    for begin in rng.integers(0, len(q) - 50, 40):
        keep[begin : begin + rng.choice([3, 5, 40])] = False
    stamps = t + rng.uniform(-0.1, 0.1, len(t)) / RATE_HZ
    assert 0.9 < keep.mean() < 0.995
    assert watch.update(q[keep], tau[keep], time_s=stamps[keep]) == []

    # Without time stamps the same samples look like collisions.
    blind = model.online(rate_hz=RATE_HZ)
    blind.calibrate(*work(planar, seed=20, seconds=60.0)[::3])
    assert blind.update(q[keep], tau[keep])

    # Real contacts are still found, with their time.
    pushed = tau.copy()
    pushed[t >= 300.0, 1] += 0.3
    watch.restart()
    first = watch.update(q[keep], pushed[keep], time_s=stamps[keep])[0]
    assert first["kind"] == "collision"
    assert abs(first["time_s"] - 300.0) < 0.05


def test_time_stamps_must_increase(model: dynident.Model) -> None:
    watch = model.online(rate_hz=RATE_HZ)
    zero = np.zeros(2)
    watch.update(zero, zero, time_s=1.0)
    for wrong in (1.0, 0.5, np.nan):
        with pytest.raises(dynident.Error, match="ascending order"):
            watch.update(zero, zero, time_s=wrong)
    with pytest.raises(dynident.Error, match="give time_s always or never"):
        watch.update(zero, zero)
    with pytest.raises(ValueError, match="3 values for 1 samples"):
        watch.update(zero, zero, time_s=[1.1, 1.2, 1.3])
    watch.restart()
    watch.update(zero, zero, time_s=0.1)


@pytest.mark.parametrize("with_times", [False, True])
def test_a_pickled_watch_continues_bit_by_bit(model: dynident.Model, planar: dynident.Robot, with_times: bool) -> None:
    watch = model.online(rate_hz=RATE_HZ, forgetting_s=1.0)
    q, _, _, tau = work(planar, seed=9, seconds=60.0)
    t = np.arange(len(q)) / RATE_HZ

    def times(part: slice) -> dict[str, np.ndarray]:
        return {"time_s": t[part]} if with_times else {}

    watch.calibrate(q[:6000], tau[:6000], **times(slice(0, 6000)))
    tau[8000:, 1] += 0.5
    watch.update(q[6000:8100], tau[6000:8100], **times(slice(6000, 8100)))
    again = pickle.loads(pickle.dumps(watch))
    assert repr(again) == repr(watch)
    rest = slice(8100, None)
    assert again.update(q[rest], tau[rest], **times(rest)) == watch.update(q[rest], tau[rest], **times(rest))
    assert again.alarms == watch.alarms and watch.alarms
    for name in ("values", "covariance", "residuals_nm", "thresholds_nm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(watch, name))
    assert again.drift == watch.drift and again.contact == watch.contact
