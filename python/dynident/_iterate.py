"""Runs the robot, identifies it, loads the better model and repeats."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from . import _native, _picture
from ._model import Model
from ._native import ResultError, Robot, Run, Study
from ._study import study as make_study

RobotFunction = Callable[[Run], object]
"""Moves a robot to ``run.q[0]``, then calls ``run.torque(time_s, q, dq)`` at every sample and applies the torque."""


@dataclass(frozen=True, eq=False)
class Iteration:
    """Result of an iteration."""

    result: dict[str, Any]
    """``iterations.json`` as a dictionary: every run with its tracking error, estimate and verdict."""
    folder: Path
    """Output folder: ``result.json``, ``identified.urdf``, ``controller.json``, ``report.html``, ``runs/``."""
    study: Study
    """The study that was iterated."""

    @property
    def converged(self) -> bool:
        """Whether tracking and parameters have converged and no problem was found."""
        return bool(self.result["converged"])

    @property
    def runs(self) -> list[dict[str, Any]]:
        """The runs in chronological order."""
        found: list[dict[str, Any]] = self.result["runs"]
        return found

    def plot(
        self,
        out: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
        *,
        width_mm: float = 88.0,
        font_pt: float = 8.0,
        dpi: float = 300.0,
    ) -> _picture.Picture:
        """Draws tracking error and error bars by run; the arguments are those of ``Model.plot``."""
        place = self.folder / "iterations.json"
        return _picture.Picture(_native._plot_convergence(place, _picture.files(out), width_mm, font_pt, dpi))

    def model(self) -> Model:
        """The identified model. Raises ``ResultError`` if no model was identified."""
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
    """Runs a robot repeatedly, each time with the newly identified model, until tracking error and parameters converge.

    ``robot`` is a function that runs a robot with the controller of the given ``Run``; ``dynident.mujoco`` contains one
    for MuJoCo models. Without it the study defines the robot: a simulation, a program or a folder. Programs that the
    files name or need are started only with ``allow_command``. All runs are stored in ``out``. A repeated call
    continues there, unless ``resume`` is False. ``heard(run, largest tracking error)`` is called after every run. A
    function as robot needs confirmed gains or ``iteration={"bandwidth_hz": 2.0, ...}``, like every external robot.

    Ctrl-C stops the robot and keeps the recorded samples. An exception of the function ends the iteration and is raised
    again.
    """
    if isinstance(study, Study):
        whole = study
    elif isinstance(study, Robot):
        whole = make_study(study, **sections)
    else:
        whole = Study.load(fspath(study), allow_command=allow_command)
    if sections and not isinstance(study, Robot):
        raise TypeError(f"{', '.join(sections)}: a Study already contains its sections: omit these arguments")
    text = _native._iterate(whole, fspath(out), robot, resume, allow_command, threads, heard)
    return Iteration(json.loads(text), Path(out), whole)
