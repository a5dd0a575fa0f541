"""Runs the examples in docstrings, of which every public name has one."""

from __future__ import annotations

import doctest
import importlib
import inspect
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from conftest import motion

import dynident
from dynident import fleet

MODULES = ["dynident", *(f"dynident.{name}" for name in ("_describe", "_example", "_functions", "_iterate", "_jobs", "_log"))]
MODULES += [f"dynident.{name}" for name in ("_model", "_page", "_servo", "_study")]
NATIVE = ("Error", "EstimatorRows", "Factors", "LogError", "ResultError", "Robot", "RobotError", "Run", "StopRun", "Study")
NATIVE += ("StudyError", "Watch")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.fixture
def in_repository(root, monkeypatch: pytest.MonkeyPatch) -> None:
    # The examples use files of the repository.
    monkeypatch.chdir(root)


@pytest.mark.parametrize("module", MODULES)
def test_examples_run(module: str, in_repository: None) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("pandas")
    found = doctest.testmod(importlib.import_module(module), optionflags=FLAGS)
    assert found.failed == 0


@pytest.mark.parametrize("name", NATIVE)
def test_examples_of_the_extension_run(name: str, in_repository: None) -> None:
    text = inspect.cleandoc(getattr(dynident, name).__doc__)
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    runner.run(example)
    assert runner.failures == 0


def test_examples_of_fleets_run(planar: dynident.Robot) -> None:
    stated = {
        "drive": {"drive_inertia": False, "viscous": True, "coulomb": "none", "offset": False},
        "friction": "stated",
        "motion": {"differentiator": {"method": "butterworth", "order": 4, "cutoff_hz": 10.0}, "torque_lag_s": 0.0},
    }

    def recorded(seed: int, name: str) -> dynident.Log:
        t, q, dq, ddq = motion(2, 8.0, seed=seed)
        noise = 0.02 * np.random.default_rng(seed).standard_normal(q.shape)
        return dynident.Log.from_arrays(t, q, planar.inverse_dynamics(q, dq, ddq) + dq * [0.8, 0.4] + noise, name=name)

    monday = datetime(2026, 1, 5, 12, tzinfo=timezone.utc)
    logs = {"left": recorded(1, "one"), "right": recorded(2, "two")}
    parts = [
        fleet.reduce(planar, log, arm=arm, recorded_at=monday + timedelta(weeks=week), **stated)
        for week, (arm, log) in enumerate(logs.items())
    ]
    models = {str(seed): fleet.identify(fleet.reduce(planar, recorded(seed, "run"), **stated)) for seed in range(5)}
    weeks = {monday + timedelta(weeks=week): model for week, model in enumerate(models.values())}
    given = {"arm": planar, "stated": stated, "logs": logs, "factors": fleet.merge(parts), "models": models, "weeks": weeks}
    assert doctest.testmod(fleet, extraglobs=given, optionflags=FLAGS).failed == 0


def test_every_public_name_has_an_example() -> None:
    names = [(name, getattr(dynident, name)) for name in dynident.__all__ if name not in ("fleet", "__version__")]
    names += [(f"fleet.{name}", getattr(fleet, name)) for name in fleet.__all__]
    assert len(names) > 50
    assert [name for name, value in names if ">>>" not in (value.__doc__ or "")] == []


def test_every_exception_says_where_if_anywhere() -> None:
    for kind in [dynident.Error, dynident.RobotError, dynident.StudyError, dynident.LogError, dynident.ResultError]:
        error = kind("nowhere in particular")
        assert (error.path, error.line, error.column, error.code) == (None, None, None, None)
