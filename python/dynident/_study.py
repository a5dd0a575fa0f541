"""Builds studies from objects."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Mapping
from os import PathLike, fspath
from typing import Any

import numpy as np

from ._functions import Functions, FunctionWarning
from ._log import Log, with_different_names
from ._native import Robot, Study


def study(
    robot: Robot | str | PathLike[str],
    logs: Log | Iterable[Log] = (),
    *,
    name: str | None = None,
    friction: str | None = None,
    estimator: str | Mapping[str, Any] | Callable[..., object] | None = None,
    allow_command: bool = False,
    **sections: Any,
) -> Study:
    """Builds a study from a robot and its logs.

    Logs of the same name get numbers, ``log (2)``, because results list logs by name.
    ``allow_command`` permits the program ``xacro`` to expand a robot file with macros, see ``Robot.load``.
    ``friction`` is ``"auto"`` (selected from the data, the default) or ``"stated"`` (the terms of ``drive``).
    ``estimator`` is a method's name or the keys of ``[estimator]``. Further keyword arguments are sections of a study
    by their names, each a mapping of its keys (a list of mappings where the study has ``[[...]]``): ``drive``,
    ``coupling``, ``torque``, ``payload``, ``arm``, ``motion``, ``parallel_filter``, ``design``, ``controller``,
    ``simulation``, ``iteration``. Unknown keys raise ``StudyError``.

    A torque, a differentiator, the estimator or the family of a design may be your own function, under the key
    ``function``. For the estimator and the differentiator the function may also replace the whole section:

    - ``torque=[{"name": "k", "joint": "joint1", "function": f}]``: ``f(q, dq)``, both of shape ``(samples, n)``, gives
      the torque per unit of the coefficient, ``(samples,)``;
    - ``motion={"differentiator": f}``: ``f(q, rate_hz)`` with the positions of one joint, ``(samples,)``, gives
      ``q, dq, ddq``, each ``(samples,)``; a mapping may also hold ``context_samples`` (the number of
      neighbouring samples that affect a sample; by default the whole log), ``minimum_samples`` (5) and the filter
      ``smooth(signal, rate_hz)`` for the torque;
    - ``estimator=f``: ``f(rows)`` with ``EstimatorRows`` gives the values, ``(columns,)``, or a pair of values
      and covariance;
    - ``design={"family": {"function": f, "parameters": k, "linear": True}}``: ``f(parameters, time_s)`` with ``(n, k)``
      and ``(samples,)`` gives ``q, dq, ddq, dddq``, each ``(samples, n)``; without ``linear``
      Dynident differentiates it numerically.

    Such a study cannot be written as text (``to_toml`` raises) and is slow; a ``FunctionWarning`` reports this.

    >>> import dynident
    >>> own = dynident.study("robots/planar2r.urdf", drive={"drive_inertia": True})
    >>> own.log_names, "drive_inertia = true" in own.to_toml()
    ([], True)
    """
    robot = robot if isinstance(robot, Robot) else Robot.load(robot, allow_command=allow_command)
    logs = with_different_names([logs] if isinstance(logs, Log) else logs)
    section: dict[str, Any] = {"file": fspath(robot.path), **json.loads(robot._settings)}
    drive = dict(sections.pop("drive", {}))
    if friction is not None:
        drive["friction"] = friction
    content: dict[str, Any] = {
        "name": name or robot.name or "identification",
        "robot": section,
        "drive": drive,
        "log": [log._section() for log in logs],
        **sections,
    }
    if estimator is not None:
        content["estimator"] = {"method": estimator} if isinstance(estimator, str) else estimator
    functions = Functions()
    content = functions.taken_from(content)
    samples = [log._samples() for log in logs]
    made = Study._assemble(_json(content), "<study>", robot, samples, functions.named or None)
    for part in made.functions:
        warnings.warn(f"{part} is a Python function: slow, for experiments only", FunctionWarning, stacklevel=3)
    return made


def with_logs(own: Study, logs: Log | Iterable[Log]) -> Study:
    """The study with these logs in place of the existing ones.

    >>> import dynident
    >>> given = dynident.example()
    >>> dynident.with_logs(given.study, given.logs[:1]).log_names
    ['train']
    """
    logs = with_different_names([logs] if isinstance(logs, Log) else logs)
    content = json.loads(own.to_json())
    content["log"] = [log._section() for log in logs]
    return own._with_sections(_json(content), [log._samples() for log in logs])


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, default=_plain, allow_nan=False)


def _plain(value: object) -> object:
    """Converts NumPy numbers and arrays and paths to plain values."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, PathLike):
        return fspath(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} is not supported in a study: use numbers, strings, lists or mappings")
