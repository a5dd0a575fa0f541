"""Inspects a robot description, and writes a study from a robot description and recordings."""

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
    """Contents of a robot description and the problems found in it, the result of ``inspect``.

    >>> import dynident
    >>> dynident.inspect(dynident.example().robot)
    Inspection('ur10', ok, ... findings)
    """

    result: dict[str, Any]
    """``dynident inspect --json`` as a dictionary."""
    fixed: str | None
    """The URDF with every error corrected for which the correct numbers are known; all other bytes are unchanged. None
    if there is no such error (``dynident inspect --fix``).
    """

    @property
    def audit(self) -> list[dict[str, Any]]:
        """Violations of physical consistency: ``level``, ``check``, ``where``, ``what``."""
        found: list[dict[str, Any]] = self.result["audit"]
        return found

    @property
    def base_parameters(self) -> list[str]:
        """Identifiable combinations of inertial parameters (base parameters), as sums."""
        found: list[str] = self.result["base_parameters"]["expressions"]
        return found

    @property
    def slips(self) -> list[dict[str, Any]]:
        """Errors recognised by their number patterns: ``slip``, ``links``, ``what``, ``evidence``,
        ``corrections``.
        """
        found: list[dict[str, Any]] = self.result["slips"]
        return found

    @property
    def ok(self) -> bool:
        """Whether no problem was found."""
        return not self.slips and all(entry["level"] != "problem" for entry in self.audit)

    def __repr__(self) -> str:
        count = len(self.audit) + len(self.slips)
        return f"Inspection({self.result['name']!r}, {'ok' if self.ok else 'problems'}, {count} findings)"

    def __str__(self) -> str:
        lines = [f"{entry['level']}: {entry['where']}: {entry['what']}" for entry in self.audit]
        lines += [f"slip: {', '.join(slip['links'])}: {slip['what']}" for slip in self.slips]
        return "\n".join(lines) or f"{self.result['name']}: no problem found"


def inspect(
    robot: Robot | str | PathLike[str], *, total_mass_kg: float | None = None, allow_command: bool = False
) -> Inspection:
    """Checks a robot description for unphysical masses, centres of mass and inertias, for wrong limits and for exporter
    errors, and lists its base parameters. The keys of ``[robot]`` are not applied.

    ``robot`` is a ``Robot`` or the path of a robot description. ``total_mass_kg`` is the expected sum of all masses,
    including the base. For ``allow_command``, see ``Robot.load``.

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
    """A study generated from a robot description and recordings, the result of ``new``.

    >>> import dynident
    >>> dynident.new("robots/ur10.urdf", "examples/ur10_simulated/train.csv")
    NewStudy('study.toml', ... lines, 0 to check)
    """

    result: dict[str, Any]
    """``dynident new --json`` as a dictionary."""
    path: Path
    """Path of the study, even if it was not written. Paths in the study are relative to its folder."""
    allow_command: bool = False
    """Whether the program ``xacro`` may expand its robot file."""

    @property
    def text(self) -> str:
        """The study file, each line with its evidence."""
        return str(self.result["text"])

    @property
    def unsure(self) -> list[dict[str, Any]]:
        """Lines to check before using the study: ``line``, ``reason``, and ``proposed`` (lines for ``stated``)."""
        found: list[dict[str, Any]] = self.result["unsure"]
        return found

    @property
    def ok(self) -> bool:
        """Whether no line needs a check."""
        return not self.unsure

    def study(self) -> Study:
        """Reads the study."""
        return Study.parse(self.text, self.path, allow_command=self.allow_command)

    def __repr__(self) -> str:
        lines = len(self.text.splitlines())
        return f"NewStudy({fspath(self.path)!r}, {lines} lines, {len(self.unsure)} to check)"

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
    """Generates a study from a robot description and recordings in any format, and checks it, as ``dynident new`` does.
    It assigns columns to joints and determines units, rate and drives. The last of several recordings validates the
    model.

    ``out`` is the path of the new study; an existing file is replaced only with ``force``. Without ``out`` nothing is
    written, and paths are relative to the working folder. ``rate_hz`` is for recordings without times. ``stated`` lists
    lines that replace uncertain ones, as proposed by ``unsure``:
    ``[line for one in found.unsure for line in one["proposed"]]``. A robot file with xacro macros needs
    ``allow_command=True``. ``xacro`` contains arguments for the program ``xacro``, such as ``{"ur_type": "ur5e"}``;
    they are written into the study.

    >>> import dynident
    >>> logs = ["examples/ur10_simulated/train.csv", "examples/ur10_simulated/test.csv"]
    >>> found = dynident.new("robots/ur10.urdf", logs)
    >>> found.ok, found.study().log_names
    (True, ['train', 'test'])
    """
    place = Path("study.toml" if out is None else out)
    if out is not None and place.exists() and not force:
        raise StudyError(f"{place} already exists: give another out, or set force=True to replace it")
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
