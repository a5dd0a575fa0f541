"""Simulated arms with known truth, for corpus.py: seeded motions, torques by Pinocchio."""
import os
from dataclasses import dataclass
import numpy as np
import pinocchio as pin

# The wheels of Pinocchio and example-robot-data share a prefix.
PREFIX = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(pin.__file__))), "../../..")
ERD = os.environ.get("ERD", os.path.normpath(PREFIX) + "/share/example-robot-data/robots/")
REPOSITORY = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../robots")) + "/"
OUT = os.path.abspath(os.environ.get("OUT", "corpus")) + "/"
os.makedirs(OUT, exist_ok=True)
FILES = {
    "ur5": ERD + "ur_description/urdf/ur5_robot.urdf",
    "ur10": REPOSITORY + "ur10.urdf",
    "panda": REPOSITORY + "panda.urdf",
    "iiwa": REPOSITORY + "iiwa14.urdf",
    "xarm7": ERD + "xarm_description/urdf/xarm7.urdf",
    "kinova": ERD + "kinova_description/robots/kinova.urdf",
    "z1": ERD + "z1_description/urdf/z1.urdf",
    "tx40": REPOSITORY + "tx40.urdf",
    "scara": OUT + "scara.urdf",
    "fetchlike": OUT + "fetchlike.urdf",
    "wristlike": OUT + "wristlike.urdf",
    "baxter": ERD + "baxter_description/urdf/baxter.urdf",
}
LOCK = {"panda": ["panda_finger_joint1", "panda_finger_joint2"], "z1": ["jointGripper"]}

SCARA = """<robot name="scara">
<link name="base"/>
<link name="l1"><inertial><origin xyz="0.18 0 0"/><mass value="6"/><inertia ixx="0.02" iyy="0.12" izz="0.12" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="l2"><inertial><origin xyz="0.15 0.01 0.05"/><mass value="4"/><inertia ixx="0.015" iyy="0.06" izz="0.06" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="spindle"><inertial><origin xyz="0 0 0.1"/><mass value="1.2"/><inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="flange"><inertial><origin xyz="0.02 0.01 -0.05"/><mass value="1.0"/><inertia ixx="0.004" iyy="0.004" izz="0.006" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="J1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/><limit lower="-2.2" upper="2.2" effort="150" velocity="6"/></joint>
<joint name="J2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.35 0 0"/><axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" effort="80" velocity="9"/></joint>
<joint name="J3" type="prismatic"><parent link="l2"/><child link="spindle"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/><limit lower="-0.2" upper="0" effort="200" velocity="1.2"/></joint>
<joint name="J4" type="revolute"><parent link="spindle"/><child link="flange"/><axis xyz="0 0 1"/><limit lower="-6.28" upper="6.28" effort="20" velocity="20"/></joint>
</robot>"""
if not os.path.exists(OUT + "scara.urdf"):
    open(OUT + "scara.urdf", "w").write(SCARA)

# An iiwa and a UR5 with the joint names of other makers, whose alphabetical order (as in /joint_states) is not that of the chain.
for _name, _base, _joints in (
    ("fetchlike", "iiwa", ["shoulder_pan_joint", "shoulder_lift_joint", "upperarm_roll_joint", "elbow_flex_joint", "forearm_roll_joint", "wrist_flex_joint", "wrist_roll_joint"]),
    ("wristlike", "ur5", ["j1", "j2", "j3", "wrist_yaw", "wrist_pitch", "wrist_roll"]),
):
    if not os.path.exists(OUT + _name + ".urdf"):
        _text = open(FILES[_base]).read()
        for _old, _new in zip(list(pin.buildModelFromUrdf(FILES[_base]).names)[1:], _joints):
            _text = _text.replace(f'"{_old}"', f'"{_new}"')
        open(OUT + _name + ".urdf", "w").write(_text)


@dataclass
class Log:
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    names: list

    @property
    def n(self):
        return self.q.shape[1]

    def every(self, k):
        return Log(*(x[::k] for x in (self.t, self.q, self.dq, self.ddq, self.tau)), self.names)


def load(urdf, robot):
    model = pin.buildModelFromUrdf(urdf)
    lock = [n for n in LOCK.get(robot, []) if model.existJointName(n)]
    if robot == "baxter":
        lock = [n for n in list(model.names)[1:] if not (n.startswith("left_"))]
    if lock:
        model = pin.buildReducedModel(model, [model.getJointId(n) for n in lock], pin.neutral(model))
    return model


def configuration(model, q):
    out = []
    for j in range(1, model.njoints):
        x = q[model.joints[j].idx_v]
        out += [np.cos(x), np.sin(x)] if model.joints[j].nq == 2 else [x]
    return np.array(out)


def rigid(model, q, dq, ddq):
    data = model.createData()
    return np.array([pin.rnea(model, data, configuration(model, a), b, c) for a, b, c in zip(q, dq, ddq)])


class Arm:
    def __init__(self, robot, seed=0):
        self.robot, self.urdf = robot, FILES[robot]
        self.model = load(self.urdf, robot)
        self.names = list(self.model.names)[1:]
        rng = np.random.default_rng([seed, sum(map(ord, robot))])
        for j in range(1, self.model.njoints):
            s = rng.uniform(0.8, 1.25)
            i = self.model.inertias[j]
            self.model.inertias[j] = pin.Inertia(i.mass * s, i.lever, i.inertia * s)
        self.rng = rng
        self.friction = None

    def log(self, seconds=20.0, rate=125.0, seed=1, noise=0.01, period=10.0):
        rng = np.random.default_rng([seed, 77])
        t = np.arange(int(seconds * rate)) / rate
        n = len(self.names)
        q, dq, ddq = (np.zeros((len(t), n)) for _ in range(3))
        w0 = 2 * np.pi / period
        for j in range(n):
            m = self.model.joints[j + 1]
            if m.nq == 2:
                lo, hi = -2.0, 2.0
            else:
                lo, hi = self.model.lowerPositionLimit[m.idx_q], self.model.upperPositionLimit[m.idx_q]
            mid, half = (lo + hi) / 2, (hi - lo) / 2
            if lo < -1.8 and hi > 1.8:
                mid, half = rng.uniform(-0.3, 0.3), 1.4
            amp = 0.75 * min(half, 1.4)
            c = rng.normal(size=5) / np.array([1, 1.3, 1.7, 2.2, 3])
            p = rng.uniform(0, 2 * np.pi, 5)
            k = np.arange(1, 6)[:, None] * w0
            s = np.sin(k * t + p[:, None])
            co = np.cos(k * t + p[:, None])
            x, v, a = c @ s, c @ (k * co), c @ (-k * k * s)
            g = min(amp / np.abs(x).max(), 0.85 * self.model.velocityLimit[m.idx_v] / np.abs(v).max())
            q[:, j], dq[:, j], ddq[:, j] = mid + g * x, g * v, g * a
        tau = rigid(self.model, q, dq, ddq)
        scale = np.sqrt((tau**2).mean(0)) + 0.02 * np.sqrt((tau**2).mean())
        if self.friction is None:
            self.friction = (0.06 * scale * self.rng.uniform(0.5, 1.5, n) / np.abs(dq).max(0), 0.06 * scale * self.rng.uniform(0.5, 1.5, n))
        fv, fc = self.friction
        tau = tau + fv * dq + fc * np.tanh(dq / 0.02)
        tau += noise * scale * rng.normal(size=tau.shape)
        q = np.round(q + 2e-6 * rng.normal(size=q.shape), 6)
        dqm = np.round(dq + 1e-3 * rng.normal(size=dq.shape), 5)
        return Log(t, q, dqm, ddq, np.round(tau, 4), list(self.names))

    def truth_error(self, identified, seed=3):
        """Relative error in % of the rigid-body torque of an identified URDF on another motion, all joints and the worst joint."""
        other = load(identified, self.robot)
        r = np.random.default_rng(seed)
        log = self.log(10.0, 20.0, seed=int(r.integers(1e6)), noise=0)
        a = rigid(self.model, log.q, log.dq, log.ddq)
        b = rigid(other, log.q, log.dq, log.ddq)
        return 100 * np.linalg.norm(a - b) / np.linalg.norm(a)
