"""Drives and bodies from commands and positions, for robots that report no torque."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._native import ResultError, _isaac_lab, _write_files
from ._page import Page

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "dynident/servo/1"
MJCF = "identified.xml"
URDF = "identified.urdf"


@dataclass(frozen=True)
class ServoValue:
    """A value of a drive or of a body, with its error bars.

    >>> from dynident import ServoValue
    >>> ServoValue(8.2, 1.1, 0.2, 9.0, True, "Nm/rad").determined
    True
    """

    value: float
    """The value, in ``unit``."""
    half_width_95: float
    """Half width of the 95 % interval, with the uncertainty of the scale."""
    half_width_95_at_scale: float
    """Half width of the 95 % interval if the total mass were known."""
    half_width_95_before: float
    """Half width of the 95 % interval before the fit."""
    determined: bool
    """Whether the motion determines the value: the interval is at most half of that before the fit."""
    unit: str
    """The unit; empty for a number without unit."""


@dataclass(frozen=True)
class ServoScale:
    """The common factor of all torques, inertias and masses, which positions do not contain.

    >>> from dynident import ServoScale
    >>> ServoScale(False, 0.6, 40.0, "the total mass of the description").determined
    False
    """

    determined: bool
    """Whether the logs determine it, with a known payload."""
    mass_kg: float
    """Total mass of the moving bodies, kg."""
    half_width_95_percent: float
    """Half width of the 95 % interval of the factor, %."""
    anchor: str
    """The reason why it is determined, or the log that would determine it."""


class ServoModel:
    """Drives and bodies of a robot without torque sensors, the result of ``identify_servos``.

    >>> import dynident
    >>> dynident.ServoModel.load("missing")
    Traceback (most recent call last):
    FileNotFoundError: ...

    ``result`` has the complete contents of ``result.json``.
    """

    def __init__(self, json_text: str, report: str, mjcf: str | None, urdf: str | None) -> None:
        self._json, self._mjcf, self._urdf = json_text, mjcf, urdf
        self.report = Page(report)
        """The report, one HTML page."""

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> ServoModel:
        """Loads the result from a folder written by ``dynident identify`` or ``save``."""
        place = Path(folder)

        def text(name: str) -> str | None:
            return (place / name).read_text(encoding="utf-8") if (place / name).is_file() else None

        content = (place / "result.json").read_text(encoding="utf-8")
        try:
            schema = json.loads(content).get("schema")
        except (ValueError, AttributeError) as error:
            raise ResultError(f"{place / 'result.json'}: not a result of identify: {error}") from None
        if schema != SCHEMA:
            raise ResultError(
                f"{place / 'result.json'}: schema {schema!r}, not {SCHEMA!r}: for a result of torque use Model.load"
            )
        return cls(content, text("report.html") or "", text(MJCF), text(URDF))

    @cached_property
    def result(self) -> dict[str, Any]:
        """``result.json`` as a dictionary; its keys are described in ``docs/schemas/servo.json``."""
        found: dict[str, Any] = json.loads(self._json)
        return found

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, in the robot's order."""
        found: list[str] = self.result["joints"]
        return found

    @property
    def problems(self) -> list[str]:
        """Problems of the result; empty if no problem was found."""
        found: list[str] = self.result["problems"]
        return found

    @property
    def ok(self) -> bool:
        """Whether no problem was found."""
        return not self.problems

    @property
    def notes(self) -> list[str]:
        """Remarks on the result."""
        found: list[str] = self.result["notes"]
        return found

    @property
    def drives(self) -> dict[str, dict[str, ServoValue]]:
        """Values of the drive of each joint, by name: ``stiffness``, ``damping``, ``armature``, ``Coulomb friction``,
        ``delay``, ..
        """
        return {joint: _values(one) for joint, one in zip(self.joint_names, self.result["drives"], strict=True)}

    @property
    def bodies(self) -> dict[str, dict[str, ServoValue]]:
        """Values of each moving body, by name: ``mass``, ``centre of mass, x``, .."""
        return {one["body"]: _values(one) for one in self.result["bodies"]}

    @property
    def not_determined(self) -> list[str]:
        """Values that the motion did not determine; their intervals are mostly those before the fit."""
        found: list[str] = self.result["not_determined"]
        return found

    @property
    def scale(self) -> ServoScale:
        """The common factor of all torques, inertias and masses."""
        return ServoScale(**self.result["scale"])

    @property
    def validation_error(self) -> dict[str, dict[str, float]]:
        """Root mean square error of the simulated position on each held-out log, by joint, rad (m). Each log is
        simulated from its first position without resets.
        """
        return self._errors("validation", "errors")

    @property
    def training_error(self) -> dict[str, dict[str, float]]:
        """The same on each training log."""
        return self._errors("training", "errors")

    @property
    def command_error(self) -> dict[str, dict[str, float]]:
        """Root mean square distance of the measured position from the command on each held-out log, rad (m): the error
        of a simulation that takes the command for the motion.
        """
        return self._errors("validation", "command_errors")

    def _errors(self, role: str, key: str) -> dict[str, dict[str, float]]:
        return {log["name"]: dict(zip(self.joint_names, log[key], strict=True)) for log in self.result[role]}

    def export(self, form: str) -> str:
        """Exports the drives as ``isaac-lab`` (a Python module with actuators of Isaac Lab), ``mjcf`` or ``urdf``, as
        ``dynident export --to`` does. A comment of the module lists its losses and the error of its motion.
        """
        forms: dict[str, Callable[[], str]] = {
            "isaac-lab": lambda: _isaac_lab(self._json),
            "mjcf": self.to_mjcf,
            "urdf": self.to_urdf,
        }
        if form not in forms:
            raise ResultError(f"unknown form {form!r} for drives: use {', '.join(forms)}")
        return forms[form]()

    def to_mjcf(self) -> str:
        """The user's MJCF with the identified values and ``position`` actuators. Raises ``ResultError`` for a robot
        description of another format.
        """
        return self._description(self._mjcf, "MJCF", self._urdf)

    def to_urdf(self) -> str:
        """The user's URDF with the identified values. Raises ``ResultError`` for a robot description of another
        format.
        """
        return self._description(self._urdf, "URDF", self._mjcf)

    def _description(self, text: str | None, kind: str, other: str | None) -> str:
        if text is not None:
            return text
        use = "use the other format, or load" if other is not None else "load"
        raise ResultError(f"the robot description is not {kind}: {use} the robot from a file of this format")

    def to_pandas(self) -> pd.DataFrame:
        """All values as a table: ``of`` (joint or body), ``name``, value and half widths."""
        import pandas as pd

        owners = [*self.drives.items(), *self.bodies.items()]
        rows = [{"of": of, "name": name, **vars(value)} for of, values in owners for name, value in values.items()]
        return pd.DataFrame.from_records(rows).set_index(["of", "name"])

    def save(self, folder: str | PathLike[str]) -> None:
        """Writes ``result.json``, ``report.html`` and the robot description, as ``dynident identify`` does."""
        content = json.dumps(self.result, indent=2) + "\n"
        texts = {"result.json": content, "report.html": self.report, MJCF: self._mjcf, URDF: self._urdf}
        _write_files(fspath(folder), texts)

    def _repr_html_(self) -> str:
        def row(cells: list[str], tag: str = "td") -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        verdict = "no problem found" if self.ok else f"{len(self.problems)} problem(s)"
        parts = [f"<b>{html.escape(self.result['study'])}</b>: drives of {len(self.joint_names)} joints, {verdict}"]
        parts += [f"<div style='color:#b00'>PROBLEM: {html.escape(problem)}</div>" for problem in self.problems]
        parts.append(f"<div>{html.escape(self.scale.anchor)}</div>")
        if self.validation_error:
            lines = [
                [log, *(f"{1e3 * error:.1f}" for error in errors.values())]
                for log, errors in self.validation_error.items()
            ]
            head = row(["held-out log: error, mrad (mm)", *self.joint_names], "th")
            parts.append("<table>" + head + "".join(map(row, lines)) + "</table>")
        names = list(dict.fromkeys(name for values in self.drives.values() for name in values))
        lines = [[joint, *(_cell(values.get(name)) for name in names)] for joint, values in self.drives.items()]
        parts.append("<table>" + row(["joint", *names], "th") + "".join(map(row, lines)) + "</table>")
        parts.append("<div>± 95 % at this scale; in brackets: not determined by the motion</div>")
        return "".join(parts)

    def __repr__(self) -> str:
        errors = ", ".join(
            f"{log}: {1e3 * sum(errors.values()) / len(errors):.1f} mrad" for log, errors in self.validation_error.items()
        )
        verdict = "" if self.ok else f", {len(self.problems)} problem(s)"
        return f"ServoModel({self.result['study']!r}, {len(self.joint_names)} joints, held out {errors or 'nothing'}{verdict})"


def _values(owner: Mapping[str, Any]) -> dict[str, ServoValue]:
    keys = ServoValue.__dataclass_fields__
    return {one["name"]: ServoValue(**{key: one[key] for key in keys}) for one in owner["values"]}


def _cell(value: ServoValue | None) -> str:
    if value is None:
        return ""
    text = f"{value.value:.4g} ± {value.half_width_95_at_scale:.2g}"
    return text if value.determined else f"({text})"
