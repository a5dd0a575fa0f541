"""Before there is a study: look at a robot's description, and write a study from it and recordings."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from . import _native
from ._native import Robot, Study, StudyError
from ._progress import Progress


@dataclass(frozen=True, eq=False)
class Inspection:
    """What a robot's description says, and what is wrong with it."""

    result: dict[str, Any]
    """``dynident inspect --json`` as a dictionary."""
    fixed: str | None
    """The URDF with every slip corrected whose numbers can be known, and every other byte as it was; None where there is
    none (``dynident inspect --fix``).
    """

    @property
    def audit(self) -> list[dict[str, Any]]:
        """What speaks against its physics: ``level``, ``check``, ``where``, ``what``."""
        found: list[dict[str, Any]] = self.result["audit"]
        return found

    @property
    def base_parameters(self) -> list[str]:
        """What torque can tell of its bodies, as sums of inertial parameters."""
        found: list[str] = self.result["base_parameters"]["expressions"]
        return found

    @property
    def slips(self) -> list[dict[str, Any]]:
        """Mistakes that a pattern of its numbers gives away: ``slip``, ``links``, ``what``, ``evidence``,
        ``corrections``.
        """
        found: list[dict[str, Any]] = self.result["slips"]
        return found

    @property
    def ok(self) -> bool:
        """Whether nothing is a problem."""
        return not self.slips and all(entry["level"] != "problem" for entry in self.audit)

    def __str__(self) -> str:
        lines = [f"{entry['level']}: {entry['where']}: {entry['what']}" for entry in self.audit]
        lines += [f"slip: {', '.join(slip['links'])}: {slip['what']}" for slip in self.slips]
        return "\n".join(lines) or f"{self.result['name']}: nothing stands against it"


def inspect(
    robot: Robot | str | PathLike[str], *, total_mass_kg: float | None = None, allow_command: bool = False
) -> Inspection:
    """Reads and audits a robot's description as it was read (keys of ``[robot]`` are not in force): masses, centres of
    mass and inertias that cannot be, limits, slips of exporters; lists its base parameters.

    ``robot`` is a ``Robot`` or a description's path; ``total_mass_kg`` what all masses, the base's with them, should add
    up to; ``allow_command`` as of ``Robot.load``.

    >>> import dynident
    >>> found = dynident.inspect("robots/ur10.urdf")
    >>> found.ok, len(found.base_parameters)
    (True, 36)
    """
    own = robot if isinstance(robot, Robot) else Robot.load(robot, allow_command=allow_command)
    text, fixed = _native._inspect(own, total_mass_kg)
    return Inspection(json.loads(text), fixed)


@dataclass(frozen=True, eq=False)
class NewStudy:
    """A study that was written from a robot and recordings."""

    result: dict[str, Any]
    """``dynident new --json`` as a dictionary."""
    path: Path
    """Where it stands or would stand: files in it are as seen from there."""
    allow_command: bool = False
    """Whether the program ``xacro`` may expand its robot file."""

    @property
    def text(self) -> str:
        """The study file, every line with what speaks for it."""
        return str(self.result["text"])

    @property
    def unsure(self) -> list[dict[str, Any]]:
        """What a person should look at: ``line``, ``reason``, and ``proposed``, lines that may be ``stated``."""
        found: list[dict[str, Any]] = self.result["unsure"]
        return found

    @property
    def ok(self) -> bool:
        """Whether nothing is left to look at."""
        return not self.unsure

    def study(self) -> Study:
        """The study, read."""
        return Study.parse(self.text, self.path, allow_command=self.allow_command)

    def __str__(self) -> str:
        return self.text


def new(
    robot: str | PathLike[str],
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    out: str | PathLike[str] | None = None,
    *,
    rate_hz: float | None = None,
    stated: Iterable[Mapping[str, Any]] = (),
    xacro: Mapping[str, str] | None = None,
    allow_command: bool = False,
    force: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> NewStudy:
    """Writes a study from a robot's description and recordings in any format: which columns are which joints, units,
    rate, drives, what tests the model (the last of several recordings). Then examines it, as ``dynident new``.

    With ``out`` it is written there, over what is there only with ``force``; without, it is as for ``study.toml`` in the
    working folder, and nothing is written. ``rate_hz`` is for recordings without times; ``stated`` are lines in place of
    those that are not sure, as ``unsure`` proposes them: ``[line for one in found.unsure for line in one["proposed"]]``. A robot file with xacro macros needs ``allow_command=True``; ``xacro`` are arguments of the program
    that expands them, ``{"ur_type": "ur5e"}``, and are written into the study.

    >>> import dynident
    >>> logs = ["examples/ur10_simulated/train.csv", "examples/ur10_simulated/test.csv"]
    >>> found = dynident.new("robots/ur10.urdf", logs)
    >>> found.ok, found.study().log_names
    (True, ['train', 'test'])
    """
    place = Path("study.toml" if out is None else out)
    if out is not None and place.exists() and not force:
        raise StudyError(f"{place} is there already, and may hold what somebody wrote: give another out, or force=True")
    files = [logs] if isinstance(logs, (str, PathLike)) else list(logs)
    lines = json.dumps([dict(line) for line in stated])
    text = _native._new(
        fspath(robot),
        [fspath(file) for file in files],
        place,
        rate_hz,
        lines,
        dict(xacro or {}),
        allow_command,
        threads,
        progress,
    )
    found = NewStudy(json.loads(text), place, allow_command)
    if out is not None:
        _native._write_files(place.parent, {place.name: found.text})
    return found
