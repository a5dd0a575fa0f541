"""Tests user-defined functions in a study: torques, differentiators, estimators, motion families."""

from __future__ import annotations

import json
import pickle
import traceback
import warnings
from typing import Any

import numpy as np
import pytest
from conftest import motion

import dynident
from dynident import fleet

warnings.simplefilter("ignore", dynident.FunctionWarning)
pytestmark = pytest.mark.filterwarnings("ignore::dynident.FunctionWarning")

STATED = {"drive": {"viscous": True, "coulomb": "none", "offset": False}, "friction": "stated"}
# All settings are stated, so that two estimators use the same rows.
MOTION = {"differentiator": {"method": "butterworth", "cutoff_hz": 8.0}, "torque_lag_s": 0.0}
STIFF_S, SLOW = 20.0, 4.0


def stribeck(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Friction of the first joint that decreases with the velocity."""
    return np.tanh(STIFF_S * dq[:, 0]) * np.exp(-SLOW * np.abs(dq[:, 0]))


EXPRESSION = f"tanh({STIFF_S} * dq) * exp(-{SLOW} * abs(dq))"


def recorded(planar: dynident.Robot, seed: int, further: Any = None, **log: Any) -> dynident.Log:
    t, q, dq, ddq = motion(planar.n, seed=seed)
    tau = planar.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4]
    tau += 0.02 * np.random.default_rng(30 + seed).standard_normal(q.shape)
    if further is not None:
        tau[:, 0] += further(q, dq)
    return dynident.Log.from_arrays(t, q, tau, name=f"run {seed}", **log)


@pytest.fixture(scope="module")
def logs(planar: dynident.Robot) -> list[dynident.Log]:
    return [recorded(planar, seed, lambda q, dq: 0.5 * stribeck(q, dq)) for seed in (1, 2)]


def of(model: dynident.Model, name: str) -> float:
    return float(model.values[model.names.index(name)])


def test_a_torque_as_code_is_the_torque_as_an_expression(planar: dynident.Robot, logs: list[dynident.Log]) -> None:
    def own(law: dict[str, Any]) -> dynident.Model:
        torque = [{"name": "ks", "joint": planar.joint_names[0], **law}]
        return dynident.identify(planar, logs[0], torque=torque, **STATED)

    code, expression = own({"function": stribeck}), own({"expression": EXPRESSION})
    assert code.names == expression.names
    # The columns differ only by the rounding of tanh and exp.
    np.testing.assert_allclose(code.values, expression.values, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(code.std, expression.std, rtol=1e-8)
    assert abs(of(code, "ks") - 0.5) < 4 * code.std[code.names.index("ks")]
    assert code.functions == ["torque `ks`: stribeck"]
    assert expression.functions == []
    _, q, dq, ddq = motion(2, seed=5)
    np.testing.assert_allclose(code.predict(q, dq, ddq), expression.predict(q, dq, ddq), atol=1e-9)
    # No export language can represent the function, robot descriptions list it as omitted, and the study can validate
    # it.
    with pytest.raises(dynident.ResultError, match="code of a function"):
        code.to_c()
    assert "stribeck" in code.export("mjcf")
    found = dynident.validate(code, logs[1].validating())
    assert found["validation"][0]["relative_error_percent"] < 1.0


def test_a_torque_that_no_expression_says(planar: dynident.Robot) -> None:
    # A cable that pulls only where it is taut, from an external table.
    lengths, pulls = np.linspace(-4.0, 4.0, 9), np.array([0, 0, 0, 0, 0.1, 0.5, 1.5, 2.0, 2.2])

    def cable(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return np.interp(q[:, 0] + q[:, 1], lengths, pulls)

    train, test = (recorded(planar, seed, lambda q, dq: 0.7 * cable(q, dq)) for seed in (1, 2))
    torque = [{"name": "kc", "joint": planar.joint_names[0], "function": cable}]
    found = dynident.identify(planar, [train, test.validating()], torque=torque, **STATED)
    without = dynident.identify(planar, [train, test.validating()], **STATED)
    assert abs(of(found, "kc") - 0.7) < 4 * found.std[found.names.index("kc")]
    errors = [model.validation_error_percent["run 2"] for model in (found, without)]
    assert errors[0] < 0.5 * errors[1], errors


def differences(q: np.ndarray, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Second-order central differences; a parabola through three points at the ends."""
    second = np.empty_like(q)
    second[1:-1] = q[2:] - 2 * q[1:-1] + q[:-2]
    second[0], second[-1] = second[1], second[-2]
    return q, np.gradient(q, 1.0 / rate_hz, edge_order=2), second * rate_hz**2


def test_differences_as_code_are_the_differences(planar: dynident.Robot) -> None:
    log = recorded(planar, 1)
    built_in = dynident.identify(
        planar, log, motion={"differentiator": {"method": "central-differences", "order": 2}}, **STATED
    )
    whole = dynident.identify(planar, log, motion={"differentiator": differences}, **STATED)
    in_pieces = {"function": differences, "context_samples": 2, "minimum_samples": 3}
    pieces = dynident.identify(planar, log, motion={"differentiator": in_pieces}, **STATED)
    # The derivatives differ by the rounding of positions times the squared rate: 4e-12 for accelerations of a few rad/s².
    np.testing.assert_allclose(pieces.values, built_in.values, rtol=1e-8, atol=1e-9)
    # Without stated context no sample is left out at the ends: four rows more change little compared with the noise.
    assert (np.abs(whole.values - built_in.values) < 0.5 * whole.std).all()
    for own in (whole, pieces):
        assert own.functions == ["motion.differentiator: differences"]
        assert own.result["method"]["motion"]["differentiator"] == {"method": "function", "function": "differences"}


def test_a_differentiator_that_is_not_built_in(planar: dynident.Robot) -> None:
    def fourier(q: np.ndarray, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Least-squares fit of a line and cosines over the whole log: half a period per term, up to 4 Hz."""
        t = np.arange(q.size) / rate_hz
        span = t[-1]
        omega = np.pi * np.arange(int(8 * span)) / span
        angle = omega * t[:, None]
        line = np.stack([t, t**2], axis=1)
        basis = np.hstack([np.cos(angle), line])
        a = np.linalg.lstsq(basis, q, rcond=1e-12)[0]
        first = np.hstack([-omega * np.sin(angle), np.stack([np.ones_like(t), 2 * t], axis=1)])
        second = np.hstack([-(omega**2) * np.cos(angle), np.stack([0 * t, 0 * t + 2.0], axis=1)])
        return basis @ a, first @ a, second @ a

    def noisy(seed: int) -> dynident.Log:
        t, q, dq, ddq = motion(planar.n, seed=seed)
        tau = planar.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4]
        q = q + 2e-4 * np.random.default_rng(seed).standard_normal(q.shape)
        return dynident.Log.from_arrays(t, q, tau, name="noisy")

    own = dynident.identify(planar, noisy(1), motion={"differentiator": fourier}, **STATED)
    plain = dynident.identify(
        planar, noisy(1), motion={"differentiator": {"method": "central-differences", "order": 2}}, **STATED
    )
    truth = {"fv1": 0.8, "fv2": 0.4}
    off = [sum(abs(of(model, name) - value) for name, value in truth.items()) for model in (own, plain)]
    assert off[0] < off[1], off
    assert off[0] < 0.02


def least_squares(rows: dynident.EstimatorRows) -> np.ndarray:
    return np.linalg.lstsq(rows.W, rows.tau, rcond=None)[0]


def test_least_squares_as_code_are_least_squares(planar: dynident.Robot, logs: list[dynident.Log]) -> None:
    training = [logs[0], logs[1]]
    own = dynident.identify(planar, training, estimator=least_squares, motion=MOTION, **STATED)
    built_in = dynident.identify(planar, training, estimator="ordinary", motion=MOTION, **STATED)
    np.testing.assert_allclose(own.values, built_in.values, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(own.std, built_in.std, rtol=1e-9)
    assert own.functions == ["estimator: least_squares"]
    assert own.result["method"]["estimator"] == "function"


def test_rows_are_those_of_the_logs_and_a_covariance_is_taken(planar: dynident.Robot, logs: list[dynident.Log]) -> None:
    seen: list[dynident.EstimatorRows] = []

    def weighted(rows: dynident.EstimatorRows) -> tuple[np.ndarray, np.ndarray]:
        seen.append(rows)
        scale = 1.0 / rows.sigma[rows.joint]
        W, tau = rows.W * scale[:, None], rows.tau * scale
        inverse = np.linalg.inv(W.T @ W)
        return inverse @ (W.T @ tau), inverse

    own = dynident.identify(planar, logs[0], estimator=weighted, motion=MOTION, **STATED)
    estimator = {"method": "weighted", "covariance": "white"}
    white = dynident.identify(planar, logs[0], estimator=estimator, motion=MOTION, **STATED)
    # The normal equations square the condition number.
    np.testing.assert_allclose(own.values, white.values, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(own.covariance, white.covariance, rtol=1e-5, atol=1e-12)
    assert own.result["method"]["covariance"] == "as the function gave it"
    rows = seen[0]
    assert rows.joint_names == planar.joint_names
    assert all(name.startswith(symbol) for name, symbol in zip(own.names, rows.names, strict=True))
    assert rows.W.shape == (len(rows.tau), len(rows.names)) and len(rows.joint) == len(rows.tau)
    of_joint = np.array(rows.joint) == 1
    residual = (rows.tau - rows.W @ own.values)[of_joint]
    # The logs have no noise: the residual is a millionth of the torque and agrees in few digits.
    left = own.result["training"]["joints"][1]["rmse_nm"]
    assert np.sqrt(residual @ residual / rows.samples[1]) == pytest.approx(left, rel=1e-3)


def test_an_estimator_that_is_not_built_in(planar: dynident.Robot, logs: list[dynident.Log]) -> None:
    def ridge(rows: dynident.EstimatorRows) -> np.ndarray:
        size = len(rows.names)
        return np.linalg.lstsq(
            np.vstack([rows.W, 3.0 * np.eye(size)]), np.concatenate([rows.tau, np.zeros(size)]), rcond=None
        )[0]

    shrunk = dynident.identify(planar, logs[0], estimator=ridge, **STATED)
    plain = dynident.identify(planar, logs[0], estimator="ordinary", **STATED)
    assert 0.9 < np.linalg.norm(shrunk.values) / np.linalg.norm(plain.values) < 1.0


HARMONICS, SECONDS, BASE = 3, 6.0, 2 * np.pi / 6.0


def null_space(normal: np.ndarray) -> np.ndarray:
    """A Householder reflection without its first column, as in the built-in family."""
    mirror = normal / np.linalg.norm(normal)
    mirror[0] += np.sign(mirror[0])
    return (np.eye(normal.size) - 2.0 * np.outer(mirror, mirror) / (mirror @ mirror))[:, 1:]


def series(parameters: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, ...]:
    """Fourier series at rest at both ends, as with ``kind = "fourier"``."""
    k = np.arange(1, HARMONICS + 1)
    a, b = (own @ null_space(one).T for own, one in [
        (parameters[:, 1:HARMONICS], np.ones(HARMONICS)), (parameters[:, HARMONICS:], k.astype(float)),
    ])
    omega = k * BASE
    sin, cos = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q = parameters[:, 0] + (sin / omega) @ a.T + (cos / omega) @ b.T
    return q, cos @ a.T - sin @ b.T, -(sin * omega) @ a.T - (cos * omega) @ b.T, (sin * omega**2) @ b.T - (cos * omega**2) @ a.T


LIMITS = {"position": [-1.5, 1.5], "speed": 2.0, "acceleration": 8.0}


def designed(planar: dynident.Robot, family: Any, **search: Any) -> dynident.Design:
    limits = {"joints": [{"joint": name, **LIMITS} for name in planar.joint_names]}
    settings = {"seed": 1, "starts": 2, "evaluations_per_start": 60, "polish_evaluations": 60, **search}
    design = {"family": family, "duration_s": SECONDS, "limits": limits, "search": settings}
    return dynident.design(planar, design=design, drive=STATED["drive"], friction="stated")


def test_a_series_as_code_is_the_series(planar: dynident.Robot) -> None:
    built_in = designed(planar, {"kind": "fourier", "harmonics": HARMONICS})
    parameters = np.array(built_in.result["parameters"]).reshape(planar.n, -1)
    for own, expected in zip(series(parameters, built_in.time_s), (built_in.q, built_in.dq, built_in.ddq), strict=False):
        np.testing.assert_allclose(own, expected, atol=1e-9)
    free = 2 * HARMONICS - 1
    found = designed(planar, {"function": series, "parameters": free, "linear": True})
    assert found.feasible and built_in.feasible
    # Both searches have the same starts; rounding may change the path of a search, but not its result.
    assert found.result["criterion_figure"] == pytest.approx(built_in.result["criterion_figure"], abs=0.05)
    assert found.result["family"] == "function"
    assert found.result["family_settings"]["function"] == "series"


def test_a_family_that_is_not_linear(planar: dynident.Robot) -> None:
    def pulses(parameters: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, ...]:
        """A sine with free amplitude, frequency and offset, multiplied by a window that is at rest at both ends."""
        x = np.pi * time_s[:, None] / SECONDS
        size, omega = 0.5 * np.tanh(parameters[:, 0]), 2.0 + np.tanh(parameters[:, 1])
        w = np.sin(x) ** 4
        rate = np.pi / SECONDS
        dw = 4 * np.sin(x) ** 3 * np.cos(x) * rate
        ddw = (12 * np.sin(x) ** 2 * np.cos(x) ** 2 - 4 * np.sin(x) ** 4) * rate**2
        dddw = (24 * np.sin(x) * np.cos(x) ** 3 - 40 * np.sin(x) ** 3 * np.cos(x)) * rate**3
        s, c = np.sin(omega * time_s[:, None]), np.cos(omega * time_s[:, None])
        s1, s2, s3 = omega * c, -(omega**2) * s, -(omega**3) * c
        q, dq, ddq = w * s, dw * s + w * s1, ddw * s + 2 * dw * s1 + w * s2
        dddq = dddw * s + 3 * ddw * s1 + 3 * dw * s2 + w * s3
        return np.tanh(parameters[:, 2]) + size * q, size * dq, size * ddq, size * dddq

    found = designed(planar, {"function": pulses, "parameters": 3}, evaluations_per_start=30, polish_evaluations=30)
    assert found.feasible, found.result
    np.testing.assert_allclose(found.dq[[0, -1]], 0.0, atol=1e-6)
    with pytest.raises(dynident.StudyError, match="pulses.*not linear"):
        designed(planar, {"function": pulses, "parameters": 3, "linear": True})


def boom(*_: Any) -> Any:
    raise ZeroDivisionError("this very line")


def wrong(value: Any) -> Any:
    def answer(*_: Any) -> Any:
        return value

    return answer


def sections(function: Any) -> list[tuple[str, dict[str, Any]]]:
    return [
        ("torque `k`", {"torque": [{"name": "k", "joint": "joint1", "function": function}]}),
        ("motion.differentiator", {"motion": {"differentiator": function}}),
        ("the estimator", {"estimator": function}),
    ]


def test_what_it_raises_comes_with_its_own_traceback(planar: dynident.Robot) -> None:
    for _, own in sections(boom):
        with pytest.raises(ZeroDivisionError, match="this very line") as caught:
            dynident.identify(planar, recorded(planar, 1), **{**STATED, **own})
        assert "boom" in [frame.name for frame in traceback.extract_tb(caught.value.__traceback__)]
    with pytest.raises(ZeroDivisionError, match="this very line"):
        designed(planar, {"function": boom, "parameters": 2})


def test_a_wrong_answer_is_named(planar: dynident.Robot) -> None:
    for value in (np.zeros(3), None, "text", [np.nan]):
        for what, own in sections(wrong(value)):
            with pytest.raises((dynident.StudyError, ValueError)) as caught:
                dynident.identify(planar, recorded(planar, 1), **{**STATED, **own})
            if isinstance(caught.value, dynident.StudyError):
                assert what in str(caught.value), caught.value

    def with_a_nan(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        values = np.sin(q[:, 0])
        values[q[:, 0] > 1.0] = np.nan
        return values

    with pytest.raises(dynident.StudyError, match=r"torque `k` gave NaN at \("):
        torque = [{"name": "k", "joint": "joint1", "function": with_a_nan}]
        dynident.identify(planar, recorded(planar, 1), torque=torque, **STATED)


def test_a_study_with_code_is_no_text_and_is_pickled(planar: dynident.Robot, logs: list[dynident.Log]) -> None:
    torque = [{"name": "ks", "joint": planar.joint_names[0], "function": stribeck}]
    with pytest.warns(dynident.FunctionWarning, match="torque `ks`: stribeck.*slow"):
        study = dynident.study(planar, logs[0], torque=torque, **STATED)
    assert study.functions == ["torque `ks`: stribeck"]
    with pytest.raises(dynident.StudyError, match="torque `ks`: stribeck is a function of Python"):
        study.to_toml()
    again = pickle.loads(pickle.dumps(study))
    of_study, of_again = dynident.identify(study), dynident.identify(again)
    np.testing.assert_array_equal(of_again.values, of_study.values)
    model = pickle.loads(pickle.dumps(of_study))
    _, q, dq, ddq = motion(2, seed=5)
    np.testing.assert_array_equal(model.predict(q, dq, ddq), of_study.predict(q, dq, ddq))
    # Only functions at module level can be pickled; Python reports the reason.
    own = [{"name": "ks", "joint": planar.joint_names[0], "function": lambda q, dq: stribeck(q, dq)}]
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(dynident.study(planar, logs[0], torque=own, **STATED))
    # Factors are not supported either; a study that only names the function reports that it is missing.
    with pytest.raises(dynident.ResultError, match="stribeck is a function"):
        fleet.reduce(study)
    named = json.loads(study.to_json())
    assert named["torque"][0]["function"] == "stribeck"
    plain = dynident.study(planar, logs[0], torque=[{"name": "ks", "joint": planar.joint_names[0], "function": "stribeck"}])
    with pytest.raises(dynident.StudyError, match="no file holds code"):
        dynident.identify(plain)


def test_a_saved_model_needs_its_code_again(planar: dynident.Robot, logs: list[dynident.Log], tmp_path) -> None:
    def with_law(law: dict[str, Any]) -> dynident.Study:
        return dynident.study(planar, logs[0], torque=[{"name": "ks", "joint": planar.joint_names[0], **law}], **STATED)

    model = dynident.identify(with_law({"function": stribeck}))
    model.save(tmp_path)
    again = dynident.Model.load(tmp_path, with_law({"function": stribeck}))
    np.testing.assert_array_equal(again.values, model.values)
    with pytest.raises(dynident.ResultError, match="was `function stribeck`"):
        dynident.Model.load(tmp_path, with_law({"expression": EXPRESSION}))
