"""Runs the examples in docstrings."""

from __future__ import annotations

import doctest
import importlib

import pytest

import dynident


@pytest.mark.parametrize("module", ["dynident", "dynident._log", "dynident._study", "dynident._jobs", "dynident._model", "dynident._servo", "dynident._describe"])
def test_examples_run(module: str, root, monkeypatch: pytest.MonkeyPatch) -> None:
    # The examples use files of the repository.
    monkeypatch.chdir(root)
    found = doctest.testmod(importlib.import_module(module), optionflags=doctest.ELLIPSIS)
    assert found.failed == 0


def test_every_exception_says_where_if_anywhere() -> None:
    for kind in [dynident.Error, dynident.RobotError, dynident.StudyError, dynident.LogError, dynident.ResultError]:
        error = kind("nowhere in particular")
        assert (error.path, error.line, error.column, error.code) == (None, None, None, None)
