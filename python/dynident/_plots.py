"""Plots with matplotlib (optional)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._log import Log
    from ._model import Model


def figure(width: float, height: float) -> Figure:
    """A figure that a notebook shows. It is not registered with pyplot, so that it needs no backend and is not kept."""
    import io

    from matplotlib.figure import Figure

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            target = io.BytesIO()
            self.savefig(target, format="png", dpi=90)
            return target.getvalue()

    return Shown(figsize=(width, height), layout="constrained")


def recording(log: Log) -> Figure:
    """Plots positions and torques (or commands) of every joint over time."""
    arrays = log._arrays[1]
    second, unit = (arrays[1], "Nm") if arrays[1] is not None else (arrays[3], "command, rad")
    joints = log.q.shape[1]
    found = figure(9, 1.4 * joints)
    axes = found.subplots(joints, 2, sharex=True, squeeze=False)
    for joint in range(joints):
        axes[joint, 0].plot(log.time_s, log.q[:, joint], linewidth=0.8)
        axes[joint, 0].set_ylabel(f"joint {joint + 1}\nrad")
        if second is not None:
            axes[joint, 1].plot(log.time_s, second[:, joint], linewidth=0.8)
            axes[joint, 1].set_ylabel(unit)
    for axis in axes[-1]:
        axis.set_xlabel("time, s")
    return found


def parameters(model: Model) -> Figure:
    """Plots base parameters with 95 % intervals, each divided by its magnitude so that all fit on one axis."""
    entries = [one for one in model.result["base_parameters"] if one["excited"]]
    values = np.array([one["value"] for one in entries], dtype=np.float64)
    bars = np.array([one["half_width_95"] for one in entries], dtype=np.float64)
    size = np.maximum(np.abs(values), bars)
    size[size == 0.0] = 1.0
    found = figure(8, 0.8 + 0.22 * len(entries))
    axes = found.subplots()
    places = np.arange(len(entries))
    axes.errorbar(values / size, places, xerr=bars / size, fmt="o", markersize=3, capsize=2, label="estimate, 95 %")
    prior = np.array([np.nan if one["prior"] is None else one["prior"] for one in entries], dtype=np.float64)
    if np.isfinite(prior).any():
        axes.plot(np.clip(prior / size, -3.0, 3.0), places, "x", markersize=4, label="nominal value")
    axes.set_yticks(places, [one["expression"] if len(one["expression"]) < 50 else one["symbol"] for one in entries])
    axes.invert_yaxis()
    axes.set_xlabel("value / magnitude")
    axes.legend(loc="best")
    return found


def prediction(
    model: Model,
    time_s: npt.ArrayLike,
    q: npt.ArrayLike,
    dq: npt.ArrayLike,
    ddq: npt.ArrayLike,
    tau: npt.ArrayLike | None,
) -> Figure:
    """Plots the torque of every joint over time with its 95 % band."""
    predicted, half = model.predict_with_band(q, dq, ddq)
    time = np.asarray(time_s, dtype=np.float64)
    joints = model.joint_names
    found = figure(8, 1.6 * len(joints))
    all_axes = found.subplots(len(joints), 1, sharex=True, squeeze=False)[:, 0]
    measured = None if tau is None else np.asarray(tau, dtype=np.float64)
    for joint, axes in enumerate(all_axes):
        if measured is not None:
            axes.plot(time, measured[:, joint], color="0.6", linewidth=0.8, label="measured")
        axes.plot(time, predicted[:, joint], linewidth=1.0, label="predicted")
        low, high = predicted[:, joint] - half[:, joint], predicted[:, joint] + half[:, joint]
        axes.fill_between(time, low, high, alpha=0.25, label="95 %")
        axes.set_ylabel(f"{joints[joint]}\nNm")
    all_axes[0].legend(loc="upper right", fontsize="small")
    all_axes[-1].set_xlabel("time, s")
    return found
