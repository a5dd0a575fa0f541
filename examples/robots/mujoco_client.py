"""A robot program for Dynident's line protocol: MuJoCo on a URDF arm (see docs/src/robot-protocol.md).

    pip install mujoco numpy
    python examples/robots/mujoco_client.py robots/panda_arm7.urdf [--friction 0.2] [--damping 0.5] [--armature 0.1]

The client supports both modes. In mode `run` it runs the control loop with the two received files. Joint PD and PID use their gains;
model-based controllers use a Newton-Euler recursion with the numbers of controller.json (robot_controller.py). In mode `step` it holds
the received torques. If the study has a home position, the client starts there, and runs approach, trajectory and return. It stops at
a stop message, at the end of its input, and when a sample leaves the envelope of the motion. A simulated robot stops immediately; a
real robot must brake here (robot_program.py). --friction, --damping and --armature add dry (Nm) and viscous (Nm s/rad) friction and
drive inertia (kg m^2) that are not in the URDF: one number, or one per joint, comma-separated. --kp and --kd are the gains of the
position loop inside the drives, for the controller position-loop. Other properties of real robots are off by default: Stribeck and
load-dependent friction, masses different from the description, delays, quantised and noisy encoders, velocities from differences. Faults
that no model describes are also off: a sticking joint (--catch), wrong link lengths (--lengths), and faults of torque and clock
(robot_faults.py). --truth FILE writes the true parameters and results (benchmarks/campaign.py, benchmarks/loop_faults.py). Standard
output is for the protocol; messages go to standard error.
"""
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

from robot_program import DryFriction, Messages, Program, parser_for


def load(path, options):
    friction, damping, armature, step_s = options.friction, options.damping, options.armature, options.step
    tree = ElementTree.parse(path)
    # MuJoCo rejects point masses; give them a small inertia.
    for inertial in tree.getroot().iter("inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        moments = ("ixx", "iyy", "izz")
        if float(mass.get("value")) > 0 and not any(float(inertia.get(moment)) for moment in moments):
            for moment in moments:
                inertia.set(moment, "1e-6")
    extension = ElementTree.SubElement(tree.getroot(), "mujoco")
    ElementTree.SubElement(extension, "compiler", fusestatic="false", balanceinertia="false", boundmass="0", boundinertia="0",
                           discardvisual="true")
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(tree.getroot(), encoding="unicode"))
    model.dof_frictionloss[:], model.dof_damping[:], model.dof_armature[:] = friction, damping, armature
    # Dry friction is a soft constraint: make it as stiff as the step allows, otherwise it acts with a delay of 20 ms.
    model.dof_solref[:], model.dof_solimp[:] = (2 * step_s, 1.0), (0.999, 0.999, 1e-3, 0.5, 2.0)
    # The envelope checks the joint limits, and links may overlap at their joints.
    model.jnt_limited[:] = 0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    if options.gravity is not None:
        model.opt.gravity[:] = options.gravity
    off = 1.0 + 0.01 * options.masses * np.random.default_rng(options.seed).uniform(-1.0, 1.0, model.nbody)
    model.body_mass *= off
    model.body_inertia *= off[:, None]
    model.body_pos *= 1.0 + 0.01 * options.lengths
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def bodies(model):
    """The ten inertial parameters of all bodies rigidly attached to each joint, about the frame of the joint, as in Dynident."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    out = np.zeros((model.njnt, 10))
    for body in range(1, model.nbody):
        carrier = body
        while carrier and model.body_jntnum[carrier] == 0:
            carrier = model.body_parentid[carrier]
        if not carrier:
            continue
        frame, mass = data.xmat[carrier].reshape(3, 3), model.body_mass[body]
        com = frame.T @ (data.xipos[body] - data.xpos[carrier])
        axes = frame.T @ data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T + mass * (com @ com * np.eye(3) - np.outer(com, com))
        out[model.body_jntadr[carrier]] += [mass, *(mass * com), *inertia[0], *inertia[1, 1:], inertia[2, 2]]
    return out


class MujocoRobot:
    """Simulator interface of robot_program.py."""

    def __init__(self, model, options):
        self.model, self.data, self.scratch = model, mujoco.MjData(model), mujoco.MjData(model)
        self.joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
        self.dry = DryFriction(options, model.nv)
        self.drag = np.zeros(model.nv)

    @property
    def q(self):
        return self.data.qpos

    @property
    def dq(self):
        return self.data.qvel

    def begin(self, step_s, q, dq):
        self.model.opt.timestep = step_s
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, dq
        mujoco.mj_kinematics(self.model, self.data)
        self.drag = np.zeros(self.model.nv)

    def advance(self, tau):
        if self.dry.varies:
            load = np.zeros(self.model.nv)
            mujoco.mj_mulM(self.model, self.data, load, self.data.qacc)
            load += self.data.qfrc_bias - self.model.dof_armature * self.data.qacc
            self.model.dof_frictionloss[:] = self.dry.level(self.data.qpos, self.data.qvel, load)
        self.data.qfrc_applied[:] = tau
        mujoco.mj_step(self.model, self.data)
        self.drag = -(self.data.qfrc_passive + self.data.qfrc_constraint)

    def bodies_torque(self, q, dq, ddq):
        data, tau = self.scratch, np.zeros(self.model.nv)
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_comVel(self.model, data)
        mujoco.mj_rne(self.model, data, 1, tau)
        return tau

    def gravity(self):
        zero = np.zeros(self.model.nv)
        return self.bodies_torque(self.data.qpos, zero, zero)

    def friction(self):
        return self.drag

    def along(self, q, dq, ddq):
        bodies = self.bodies_torque(q, dq, ddq)
        return bodies + self.model.dof_armature * ddq + self.model.dof_damping * dq + self.dry.level(q, dq, bodies) * np.sign(dq)

    def place(self, joint, offset_m):
        """Uses the body positions at the beginning of the last step."""
        body = self.model.jnt_bodyid[mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, joint)]
        return self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ offset_m

    def truth(self):
        return {"bodies": bodies(self.model).tolist(), "drive_inertia": self.model.dof_armature.tolist(),
                "viscous": self.model.dof_damping.tolist(), **self.dry.truth()}


def main():
    options = parser_for(__doc__).parse_args()
    Program(MujocoRobot(load(options.urdf, options), options), Messages(), options).serve(f"MuJoCo {mujoco.__version__}: {options.urdf.name}")


if __name__ == "__main__":
    main()
