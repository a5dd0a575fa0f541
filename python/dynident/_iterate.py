"""Run, identify, load the better model, run again."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from . import _native
from ._model import Model
from ._native import ResultError, Robot, Run, Study
from ._study import study as make_study

RobotFunction = Callable[[Run], object]
"""Brings a robot to ``run.q[0]``, asks ``run.torque(time_s, q, dq)`` at every sample and applies it."""


@dataclass(frozen=True, eq=False)
class Iteration:
    """How an iteration ended."""

    result: dict[str, Any]
    """``iterations.json`` as a dictionary: every run with its tracking error, estimate and verdict."""
    folder: Path
    """Where its files are: ``result.json``, ``identified.urdf``, ``controller.json``, ``report.html``, ``runs/``."""
    study: Study
    """The study that was iterated."""

    @property
    def converged(self) -> bool:
        """Whether tracking and parameters have converged and nothing stands against it."""
        return bool(self.result["converged"])

    @property
    def runs(self) -> list[dict[str, Any]]:
        """The runs, the first first."""
        found: list[dict[str, Any]] = self.result["runs"]
        return found

    def model(self) -> Model:
        """The model that was found; raises ``ResultError`` where the runs gave none."""
        if not (self.folder / "result.json").is_file():
            reason = self.result.get("no_result") or self.result.get("reason") or self.result["status"]
            raise ResultError(f"{self.folder}: no model was found: {reason}")
        return Model.load(self.folder, self.study)


def iterate(
    study: Study | Robot | str | PathLike[str],
    out: str | PathLike[str],
    *,
    robot: RobotFunction | None = None,
    resume: bool = True,
    allow_command: bool = False,
    threads: int | None = None,
    heard: Callable[[int, float], object] | None = None,
    **sections: Any,
) -> Iteration:
    """Runs a robot again and again, each time with the better model, until all has settled.

    ``robot`` is a function that runs a robot under the controller of each ``Run`` it is given (``dynident.mujoco`` has
    one for a MuJoCo model); without it the study says which: its simulation, a program, a folder. Programs that the
    files name or need are started only with ``allow_command``. ``out`` keeps all runs: called again it goes on where it ended, unless
    ``resume`` is False. ``heard(run, largest tracking error)`` is called after every run. A robot that is a function
    needs gains that somebody stands for, or ``iteration={"bandwidth_hz": 2.0, ...}``, as every robot outside.

    Ctrl-C stops the robot and keeps what was recorded. What the function raises ends the iteration and is raised.
    """
    if isinstance(study, Study):
        whole = study
    elif isinstance(study, Robot):
        whole = make_study(study, **sections)
    else:
        whole = Study.load(fspath(study), allow_command=allow_command)
    if sections and not isinstance(study, Robot):
        raise TypeError(f"{', '.join(sections)}: a study has its sections already")
    text = _native._iterate(whole, fspath(out), robot, resume, allow_command, threads, heard)
    return Iteration(json.loads(text), Path(out), whole)
