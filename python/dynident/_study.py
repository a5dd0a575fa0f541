"""Studies put together from objects."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from os import PathLike, fspath
from typing import Any

import numpy as np

from ._log import Log
from ._native import Robot, Study


def study(
    robot: Robot | str | PathLike[str],
    logs: Log | Iterable[Log] = (),
    *,
    name: str | None = None,
    friction: str | None = None,
    estimator: str | Mapping[str, Any] | None = None,
    **sections: Any,
) -> Study:
    """A study of a robot and its logs.

    ``friction`` is ``"auto"`` (chosen from the data, which is the default) or ``"stated"`` (that of ``drive``).
    ``estimator`` is a method's name or the keys of ``[estimator]``. Further keyword arguments are sections of a study
    by their names, each a mapping of its keys (a list of mappings where the study has ``[[...]]``): ``drive``,
    ``coupling``, ``torque``, ``payload``, ``arm``, ``motion``, ``parallel_filter``, ``design``, ``controller``,
    ``simulation``, ``iteration``. Unknown keys raise ``StudyError``.

    >>> import dynident
    >>> own = dynident.study("robots/planar2r.urdf", drive={"drive_inertia": True})
    >>> own.log_names, "drive_inertia = true" in own.to_toml()
    ([], True)
    """
    robot = robot if isinstance(robot, Robot) else Robot.load(robot)
    logs = [logs] if isinstance(logs, Log) else list(logs)
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
        content["estimator"] = {"method": estimator} if isinstance(estimator, str) else dict(estimator)
    return Study._assemble(_json(content), "<study>", robot, [log._samples() for log in logs])


def with_logs(own: Study, logs: Log | Iterable[Log]) -> Study:
    """The study with these logs in place of its own."""
    logs = [logs] if isinstance(logs, Log) else list(logs)
    content = json.loads(own.to_json())
    content["log"] = [log._section() for log in logs]
    return own._with_sections(_json(content), [log._samples() for log in logs])


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, default=_plain, allow_nan=False)


def _plain(value: object) -> object:
    """Numbers and arrays of NumPy, paths."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, PathLike):
        return fspath(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} is nothing that a study can hold")
