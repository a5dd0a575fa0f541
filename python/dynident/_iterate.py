"""Runs the robot, identifies it, loads the better model and repeats."""

from __future__ import annotations

import html
import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from . import _native, _picture
from ._jobs import ProblemWarning, _watched
from ._model import Model
from ._native import ResultError, Robot, Run, Study
from ._page import Page, problem, table
from ._progress import Progress
from ._study import study as make_study

RobotFunction = Callable[[Run], object]
"""Moves a robot to ``run.q[0]``, then calls ``run.torque(time_s, q, dq)`` at every sample and applies the torque."""


@dataclass(frozen=True, eq=False)
class Iteration:
    """Result of an iteration, see ``iterate``.

    >>> import dynident, tempfile
    >>> study = "examples/iterate_paper_2r.toml"
    >>> found = dynident.iterate(study, tempfile.mkdtemp())
    >>> found.ok, found.status
    (True, 'converged')
    """

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

    @property
    def status(self) -> str:
        """``converged``, ``settled`` (no further change, but unmet conditions), ``runs-used-up``, ``refused``, ``waiting``
        or ``interrupted``; ``result["reason"]`` explains it.
        """
        return str(self.result["status"])

    @property
    def problems(self) -> list[str]:
        """Why the model must not be used without a check; empty if the iteration has converged."""
        if self.converged:
            return []
        reason = str(self.result["reason"])
        unmet = [f"{one['message']}: {one['remedy']}" for one in self.result.get("unmet", [])]
        return ["; ".join([f"the iteration has not converged ({self.status}): {reason}", *unmet])]

    @property
    def ok(self) -> bool:
        """Whether the iteration has converged."""
        return not self.problems

    @property
    def report(self) -> Page:
        """The report page, ``report.html``."""
        place = self.folder / "report.html"
        return Page(place.read_text(encoding="utf-8") if place.is_file() else "")

    def model(self) -> Model:
        """The identified model; its ``problems`` include those of the iteration. Raises ``ResultError`` if no model was
        identified.
        """
        if not (self.folder / "result.json").is_file():
            reason = self.result.get("no_result") or self.result.get("reason") or self.result["status"]
            raise ResultError(f"{self.folder}: no model was found: {reason}")
        found = Model.load(self.folder, self.study)
        return found._with_problems(self.problems)

    def _errors(self) -> list[str]:
        return [f"{max(run['max_tracking_error_rad'], default=0.0):.3g}" for run in self.runs]

    def _repr_html_(self) -> str:
        rows = [
            [str(run["run"]), error, "yes" if run["accepted"] else f"no: {run.get('reason') or ''}"]
            for run, error in zip(self.runs, self._errors(), strict=True)
        ]
        parts = [f"<b>{html.escape(str(self.result['name']))}</b>: {html.escape(self.status)}, {len(self.runs)} runs"]
        parts += [problem(text) for text in self.problems]
        parts.append(table(["run", "largest tracking error, rad (m)", "accepted"], rows))
        return "".join(parts)

    def __repr__(self) -> str:
        return f"Iteration({self.status}, {len(self.runs)} runs, largest tracking errors {', '.join(self._errors())})"


def iterate(
    study: Study | Robot | str | PathLike[str],
    out: str | PathLike[str],
    *,
    robot: RobotFunction | None = None,
    resume: bool = True,
    allow_command: bool = False,
    threads: int | None = None,
    heard: Callable[[int, float], object] | None = None,
    progress: bool | Progress | None = None,
    **sections: Any,
) -> Iteration:
    """Runs a robot repeatedly, each time with the newly identified model, until tracking error and parameters converge.

    ``robot`` is a function that runs a robot with the controller of the given ``Run``; ``dynident.mujoco`` contains one
    for MuJoCo models. Without it the study defines the robot: a simulation, a program or a folder. Programs that the
    files name or need are started only with ``allow_command``. All runs are stored in ``out``. A repeated call
    continues there, unless ``resume`` is False. ``heard(run, largest tracking error)`` is called after every run. A
    function as robot needs confirmed gains or ``iteration={"bandwidth_hz": 2.0, ...}``, like every external robot.

    Ctrl-C stops the robot and keeps the recorded samples. An exception of the function ends the iteration and is raised
    again; its run does not count, and the next call repeats it. If the robot itself stopped (a protective stop), raise
    ``StopRun("reason")``: such a run counts once it has begun, and its controller is treated as rejected.

    An iteration that does not converge issues a ``ProblemWarning``, ``Iteration.ok`` is False, and the problem is also
    listed by the model. ``progress`` as in ``identify``.

    >>> import dynident, tempfile
    >>> found = dynident.iterate("examples/iterate_paper_2r.toml", tempfile.mkdtemp())
    >>> found.converged, found.model().ok
    (True, True)
    """
    if isinstance(study, Study):
        whole = study
    elif isinstance(study, Robot):
        whole = make_study(study, **sections)
    else:
        whole = Study.load(fspath(study), allow_command=allow_command)
    if sections and not isinstance(study, Robot):
        raise TypeError(f"{', '.join(sections)}: a Study already contains its sections: omit these arguments")
    place = fspath(out)
    text = _watched(
        progress,
        lambda hear: _native._iterate(whole, place, robot, resume, allow_command, threads, heard, hear),
    )
    found = Iteration(json.loads(text), Path(out), whole)
    for one in found.problems:
        warnings.warn(one, ProblemWarning, stacklevel=2)
    return found
