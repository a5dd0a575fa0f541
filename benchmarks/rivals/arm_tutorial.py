"""The arm of mujoco.sysid's tutorial with a simulated recording: five joints under open-loop torques, armatures unknown.

The tutorial is the notebook in the repository of the package (`python/mujoco/sysid/sysid.ipynb` of github.com/google-deepmind/mujoco), "Robot Arm: Identifying Joint Armature".
Arm, torques, length, rate and noise are those of the tutorial; the samples are simulated with MuJoCo, as in the tutorial.
"""
from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np

JOINTS = [f"joint{i}" for i in range(1, 6)]
ARMATURE = np.array([0.5, 0.4, 0.3, 0.2, 0.1])
DAMPING = np.array([1.0, 0.8, 0.6, 0.4, 0.2])
FIRST_GUESS = 0.01
MASS = np.array([1.0, 0.8, 0.6, 0.4, 0.2])
COM_Z = [0.05, 0.05, 0.05, 0.04, 0.03]
AXES = ["0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0"]
HEIGHT = [0.1, 0.1, 0.1, 0.1, 0.08]
RATE_HZ = 500.0
DURATION_S = 2.0
# Amplitude Nm, frequency Hz, phase rad of the torque of every joint: those of the tutorial, and another motion for validation.
TORQUES = {
    "train": [(5.0, 0.5, 0.0), (4.0, 0.7, 0.5), (3.0, 0.4, 1.0), (2.0, 0.9, 1.5), (1.0, 0.6, 2.0)],
    "test": [(4.0, 0.8, 0.3), (3.0, 1.0, 2.0), (2.5, 0.9, 0.4), (1.5, 0.6, 2.5), (0.8, 1.0, 0.7)],
}


@dataclass
class Recording:
    """True motion and recorded positions; the torques are the exact commanded torques, as in the tutorial."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    q_measured: np.ndarray


def bodies():
    """m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz of every body about the frame of its joint."""
    com = np.array(COM_Z)
    across = MASS * (0.01 + com**2)
    nothing = 0 * MASS
    return np.column_stack([MASS, nothing, nothing, MASS * com, across, nothing, nothing, across, nothing, 0.005 * MASS])


def mjcf(armature, damping):
    """The arm with these armatures and dampings."""
    opened = ""
    for i, joint in enumerate(JOINTS):
        m = MASS[i]
        opened += (
            f'<body name="link{i + 1}" pos="0 0 {HEIGHT[i]}"><inertial pos="0 0 {COM_Z[i]}" mass="{m}" diaginertia="{0.01 * m} {0.01 * m} {0.005 * m}"/>'
            f'<joint name="{joint}" type="hinge" axis="{AXES[i]}" range="-3.14 3.14" armature="{armature[i]}" damping="{damping[i]}"/>'
        )
    motors = "".join(f'<motor name="act{i}" joint="{joint}"/>' for i, joint in enumerate(JOINTS, 1))
    sensors = "".join(f'<jointpos name="{joint}_pos" joint="{joint}"/>' for joint in JOINTS)
    return (
        '<mujoco model="arm"><compiler angle="radian" autolimits="true"/>'
        f'<option integrator="implicitfast" timestep="{1 / RATE_HZ}"><flag contact="disable"/></option>'
        f'<worldbody>{opened}{"</body>" * len(JOINTS)}</worldbody><actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>'
    )


def record(name, noise_rad, seed):
    """Simulates the arm with the torques `name` from rest in the upright posture, with white noise on the positions."""
    model = mujoco.MjModel.from_xml_string(mjcf(ARMATURE, DAMPING))
    data = mujoco.MjData(model)
    t = np.arange(int(DURATION_S * RATE_HZ)) / RATE_HZ
    tau = np.column_stack([a * np.sin(2 * np.pi * f * t + phase) for a, f, phase in TORQUES[name]])
    q, dq, ddq = np.zeros((3, len(t), len(JOINTS)))
    for row, torque in enumerate(tau):
        q[row], dq[row] = data.qpos, data.qvel
        data.ctrl = torque
        mujoco.mj_forward(model, data)
        ddq[row] = data.qacc
        mujoco.mj_step(model, data)
    if np.abs(q).max() > 3.14:
        raise RuntimeError(f"{name}: the arm reaches its limits")
    return Recording(t, q, dq, ddq, tau, q + np.random.default_rng(seed).normal(0.0, noise_rad, q.shape))


def inverse(model, q, dq, ddq):
    """Torques, Nm, of a MuJoCo model for a motion."""
    data, tau = mujoco.MjData(model), np.zeros_like(q)
    for row, (data.qpos, data.qvel, data.qacc) in enumerate(zip(q, dq, ddq)):
        mujoco.mj_inverse(model, data)
        tau[row] = data.qfrc_inverse
    return tau
