"""Runs a MuJoCo model as the robot of an iteration. Needs the package ``mujoco``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import mujoco

    from ._native import Run


class MujocoRobot:
    """Runs a MuJoCo model with the torques of a ``Run``, applied at the joints (``qfrc_applied``).

    ``joints`` are the model's joints in the order of the run, by default the joints with the same names. ``noise`` is
    the standard deviation of the measured positions, rad. The controller's period must be a multiple of
    ``model.opt.timestep``.

    MuJoCo's dry friction (``dof_frictionloss``) is a soft constraint that acts with a delay by default. It is as stiff
    as the time step allows with ``dof_solref = 2 * timestep, 1`` and ``dof_solimp = 0.999, 0.999, 1e-3, 0.5, 2``.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        *,
        joints: list[str] | None = None,
        noise: float = 0.0,
        seed: int = 0,
    ) -> None:
        import mujoco

        self._mujoco: Any = mujoco
        self.model = model
        self.joints = joints
        self.noise = noise
        self.seed = seed

    def __call__(self, run: Run) -> None:
        """One run."""
        mujoco, model = self._mujoco, self.model
        joints = [model.joint(name) for name in self.joints or run.joint_names]
        places = np.array([joint.qposadr[0] for joint in joints])
        freedoms = np.array([joint.dofadr[0] for joint in joints])
        period = 1.0 / run.rate_hz
        steps = round(period / model.opt.timestep)
        if steps < 1 or abs(steps * model.opt.timestep - period) > 1e-6 * period:
            raise ValueError(
                f"the controller's period {period} s is not a multiple of the model's timestep {model.opt.timestep} s"
            )
        noise = np.random.default_rng([self.seed, run.number])
        data = mujoco.MjData(model)
        data.qpos[places], data.qvel[freedoms] = run.q[0], run.dq[0]
        for sample in range(run.samples):
            q: npt.NDArray[np.float64] = data.qpos[places] + self.noise * noise.standard_normal(len(joints))
            tau = run.torque(sample * period, q, data.qvel[freedoms].copy())
            data.qfrc_applied[freedoms] = tau
            mujoco.mj_step(model, data, nstep=steps)
