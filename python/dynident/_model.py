"""An identified model."""

from __future__ import annotations

import html
import json
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _picture
from ._native import FittedModel, Robot, Study, Watch, _write_files

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.figure import Figure

DESCRIPTIONS = ("identified.urdf", "identified.toml", "identified.xml", "identified.sdf")
"""Files of the robot description with the identified values: URDF, D-H table, MJCF, SDF."""


class Model:
    """An identified dynamic model with error bars and validation, the result of ``identify``.

    ``result`` has the complete contents of ``result.json``. Pickled models do not contain the samples of the fit.
    """

    def __init__(self, native: FittedModel) -> None:
        self._native = native

    @classmethod
    def load(
        cls, folder: str | PathLike[str], study: Study | str | PathLike[str], *, allow_command: bool = False
    ) -> Model:
        """Loads the model and its study from a folder written by ``dynident identify`` or ``save``."""
        place = Path(folder)
        own = study if isinstance(study, Study) else Study.load(study, allow_command=allow_command)

        def text(name: str) -> str | None:
            return (place / name).read_text(encoding="utf-8") if (place / name).is_file() else None

        json_text = (place / "result.json").read_text(encoding="utf-8")
        return cls(FittedModel.of(json_text, own, [text(name) for name in DESCRIPTIONS], text("report.html") or ""))

    @cached_property
    def result(self) -> dict[str, Any]:
        """``result.json`` as a dictionary; its keys are described in ``docs/schemas/result.json``."""
        found: dict[str, Any] = json.loads(self._native.json)
        return found

    @property
    def study(self) -> Study:
        """The study that was used for the fit."""
        return self._native.study

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, in the order of all vectors."""
        return self._native.joint_names

    @property
    def problems(self) -> list[str]:
        """Problems of the model; empty if no problem was found."""
        found: list[str] = self.result["problems"]
        return found

    @property
    def ok(self) -> bool:
        """Whether no problem was found."""
        return not self.problems

    @property
    def names(self) -> list[str]:
        """The base parameters, as sums: ``Izz1 + 0.49 m2``."""
        return [one["expression"] for one in self.result["base_parameters"]]

    def _numbers(self, key: str) -> npt.NDArray[np.float64]:
        values = [one[key] for one in self.result["base_parameters"]]
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    @property
    def values(self) -> npt.NDArray[np.float64]:
        """The estimates of the base parameters, in the order of ``names``."""
        return self._numbers("value")

    @property
    def std(self) -> npt.NDArray[np.float64]:
        """Their standard deviations."""
        return self._numbers("std")

    @property
    def half_width_95(self) -> npt.NDArray[np.float64]:
        """Half widths of their 95 % intervals."""
        return self._numbers("half_width_95")

    @property
    def covariance(self) -> npt.NDArray[np.float64]:
        """Their covariance, shape ``(base parameters, base parameters)``."""
        return np.array(self.result["base_parameter_covariance"], dtype=np.float64)

    @property
    def bodies(self) -> dict[str, npt.NDArray[np.float64]]:
        """Physically consistent inertial parameters of each body in its frame: ``m, mx, my, mz, Ixx, Ixy, Ixz, Iyy,
        Iyz, Izz`` about the frame's origin, kg, kg m, kg m².
        """
        return {body["name"]: np.array(body["parameters"], dtype=np.float64) for body in self.result["bodies"]}

    @property
    def friction(self) -> dict[str, dict[str, float]]:
        """Friction, drive inertia and offset of each joint, by symbol."""
        return {
            joint["name"]: {term["symbol"]: term["value"] for term in joint["laws"]} for joint in self.result["joints"]
        }

    @property
    def validation_error_percent(self) -> dict[str, float | None]:
        """Relative torque error ``100 ‖τ - τ̂‖ / ‖τ‖`` of the exported model on each held-out log, in %."""

        def error(log: dict[str, Any]) -> float | None:
            found: float | None = (log["physical"] or log)["relative_error_percent"]
            return found

        return {log["log"]: error(log) for log in self.result["validation"]}

    def predict(
        self, q: npt.ArrayLike, dq: npt.ArrayLike | None = None, ddq: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.float64]:
        """Computes the torques of a motion including friction, Nm (N). Shapes ``(..., n)``, samples in chronological
        order.
        """
        return self._native.predict(q, dq, ddq)[0]

    def predict_with_band(
        self, q: npt.ArrayLike, dq: npt.ArrayLike | None = None, ddq: npt.ArrayLike | None = None
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Computes the torques as in ``predict`` and the half width of the 95 % band of the filtered torque,
        ``t sqrt(w V wᵀ + σ²)``. The filter is that of the fit.
        """
        return self._native.predict(q, dq, ddq)

    def online(
        self,
        *,
        rate_hz: float,
        forgetting_s: float | None = 15.0,
        correlation_s: float | None = None,
        collision_s: float | None = None,
        payload_s: float | None = None,
        contact_alarms_per_hour: float | None = None,
        drift_alarms_per_hour: float | None = None,
        half_window: int | None = None,
    ) -> Watch:
        """Creates a monitor that detects contact, payload and drift, sample by sample.

        ``forgetting_s`` is the half-life of the sample weights. None keeps all samples and disables drift detection.
        ``correlation_s`` (1) is the correlation time of the residuals. ``collision_s`` (0.02) and ``payload_s`` (2) are
        the time constants of collision and payload detection. ``contact_alarms_per_hour`` (0.05) and
        ``drift_alarms_per_hour`` (0.1) are the accepted false alarm rates. Missing derivatives are computed from
        ``half_window`` (10) samples on each side.
        """
        return self._native.online(
            rate_hz,
            forgetting_s,
            correlation_s,
            collision_s,
            payload_s,
            contact_alarms_per_hour,
            drift_alarms_per_hour,
            half_window,
        )

    def robot(self) -> Robot:
        """A robot with the identified bodies. Raises ``ResultError`` if no robot description can contain them."""
        return Robot.from_urdf(self.to_urdf())

    def export(self, form: str) -> str:
        """Exports the model as ``c``, ``cpp``, ``rust``, ``python``, ``matlab``, ``casadi``, ``jax``, ``pinocchio``,
        ``mjcf``, ``urdf``, ``sdf``, ``ros2-yaml`` or ``json``. A comment lists the parts that the format cannot
        represent.
        """
        return self._native.export(form)[0]

    def to_urdf(self) -> str:
        """The user's URDF with the identified values; for other formats a generated URDF of the same robot."""
        return self._native.descriptions[0] or self.export("urdf")

    def to_mjcf(self) -> str:
        """The user's MJCF with the identified values, or a generated MJCF of the same robot."""
        return self._native.descriptions[2] or self.export("mjcf")

    def to_sdf(self) -> str:
        """The user's SDF with the identified values, or a generated SDF of the same robot."""
        return self._native.descriptions[3] or self.export("sdf")

    def to_c(self) -> str:
        """A C99 header: inverse dynamics, gravity, mass matrix, friction, forward dynamics."""
        return self.export("c")

    def to_simulator(self) -> dict[str, Any]:
        """Armature, damping, frictionloss, delay and actuator gain of every joint with error bars, as defined by MuJoCo
        and similar simulators: ``dynident export --to simulator`` as a dictionary.
        """
        found: dict[str, Any] = json.loads(self._native.simulator()[0])
        return found

    def to_simulator_table(self) -> str:
        """The values of ``to_simulator`` as a Markdown table."""
        return self._native.simulator()[1]

    def to_payload(self, controller: str, name: str | None = None) -> str:
        """An estimated payload in the format of a controller: ``"ur"`` (a line of URScript), ``"franka"`` (JSON),
        ``"kuka"`` (LOAD_DATA) or ``"abb"`` (loaddata). ``name`` selects one of several payloads.
        """
        return self._native.payload(controller, name)[0]

    @property
    def functions(self) -> list[str]:
        """Parts of the study that were Python functions, each with the name of the function."""
        found: list[str] = self.result["method"].get("functions", [])
        return found

    def to_pandas(self) -> pd.DataFrame:
        """The base parameters as a table."""
        import pandas as pd

        return pd.DataFrame.from_records(self.result["base_parameters"]).set_index("expression")

    def save(self, folder: str | PathLike[str]) -> None:
        """Writes ``result.json``, ``report.html`` and the updated robot description, as ``dynident identify`` does."""
        texts = {
            **dict(zip(DESCRIPTIONS, self._native.descriptions, strict=True)),
            "report.html": self._native.report,
            "result.json": json.dumps(self.result, indent=2) + "\n",
        }
        _write_files(fspath(folder), texts)

    def plot(
        self,
        figure: str,
        out: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
        *,
        width_mm: float = 88.0,
        font_pt: float = 8.0,
        dpi: float = 300.0,
        threads: int | None = None,
    ) -> _picture.Picture:
        """Draws ``"residuals"``, ``"parameters"`` or ``"friction"`` for a paper, as ``dynident plot`` does.

        ``out`` is a file or several: ``.svg``, ``.pdf`` or ``.png`` for the picture, ``.csv`` for its data, ``.tex`` or
        ``.md`` for the table. ``dpi`` is the resolution of a PNG. PDF and PNG need a build with these forms, which the wheel is not. The residuals are those of the held-out logs, or of
        all logs if none is held out. Needs no other package.
        """
        return _picture.Picture(self._native.plot(figure, _picture.files(out), width_mm, font_pt, dpi, threads))

    def plot_parameters(self) -> Figure:
        """Plots the base parameters with 95 % intervals and their nominal values."""
        from ._plots import parameters

        return parameters(self)

    def plot_prediction(self, time_s: npt.ArrayLike, q: npt.ArrayLike, dq: npt.ArrayLike, ddq: npt.ArrayLike, tau: npt.ArrayLike | None = None) -> Figure:
        """Plots the torque of every joint over time with its 95 % band, and the measured torque if given."""
        from ._plots import prediction

        return prediction(self, time_s, q, dq, ddq, tau)

    def _repr_html_(self) -> str:
        result = self.result

        def row(cells: list[str], tag: str = "td") -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        verdict = "no problem found" if self.ok else f"{len(self.problems)} problem(s)"
        parts = [f"<b>{html.escape(result['name'])}</b>: {len(self.names)} base parameters, {verdict}"]
        parts += [f"<div style='color:#b00'>PROBLEM: {html.escape(problem)}</div>" for problem in self.problems]
        errors = self.validation_error_percent
        if errors:
            lines = [[log, "-" if error is None else f"{error:.2f} %"] for log, error in errors.items()]
            parts.append("<table>" + row(["held-out log", "error"], "th") + "".join(map(row, lines)) + "</table>")
        numbers = zip(self.names, self.values, self.half_width_95, self.result["base_parameters"], strict=True)
        lines = [
            [name, f"{value:.4g}", f"± {bar:.2g}" if one["excited"] else "nominal: not excited", one["unit"]]
            for name, value, bar, one in numbers
        ]
        parts.append(
            "<details><summary>base parameters (95 %)</summary><table>" + "".join(map(row, lines)) + "</table></details>"
        )
        return "".join(parts)

    def __getstate__(self) -> FittedModel:
        return self._native

    def __setstate__(self, native: FittedModel) -> None:
        self._native = native

    def __repr__(self) -> str:
        errors = ", ".join(
            f"{log}: {'-' if error is None else f'{error:.2f} %'}" for log, error in self.validation_error_percent.items()
        )
        verdict = "" if self.ok else f", {len(self.problems)} problem(s)"
        return f"Model({self.result['name']!r}, {len(self.names)} base parameters, held out {errors or 'nothing'}{verdict})"
