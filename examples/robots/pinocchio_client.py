"""A robot program for Dynident's line protocol: Pinocchio's rigid-body dynamics with the integrator in this file (see docs/src/robot-protocol.md).

    pip install pin numpy
    python examples/robots/pinocchio_client.py robots/panda_arm7.urdf [--friction 0.2] [--damping 0.5] [--armature 0.1]

The options are those of mujoco_client.py; the dynamics are independent of it. A step is a drift of half its length, a kick with the
dynamics at its middle, and a drift of the other half; the error is of second order. Dry friction has exact stiction: projected Gauss-Seidel
finds friction torques within their limits that stop a joint, or the limit torque against the motion of a sliding joint.
"""
import numpy as np
import pinocchio

from robot_program import DryFriction, Messages, Program, parser_for

# Maximum number of sweeps over the joints, and the stopping limit for the change of a friction torque relative to its limit.
SWEEPS, SETTLED = 50, 1e-9


def load(options):
    model = pinocchio.buildModelFromUrdf(str(options.urdf))
    if model.nq != model.nv:
        raise SystemExit(f"{options.urdf}: this client does not support continuous joints: make them revolute")
    if options.gravity is not None:
        model.gravity.linear = options.gravity
    factors = 1.0 + 0.01 * options.masses * np.random.default_rng(options.seed).uniform(-1.0, 1.0, model.njoints)
    for joint in range(1, model.njoints):
        body = model.inertias[joint]
        # Scale mass and moments of inertia equally; scale the centre of mass with the lengths.
        model.inertias[joint] = pinocchio.Inertia(factors[joint] * body.mass, body.lever, factors[joint] * body.inertia)
        placement = model.jointPlacements[joint]
        model.jointPlacements[joint] = pinocchio.SE3(placement.rotation, placement.translation * (1.0 + 0.01 * options.lengths))
    model.armature = np.array(np.broadcast_to(np.asarray(options.armature, float), model.nv))
    return model


def inertial(body):
    """The ten inertial parameters about the frame of the joint, as in Dynident."""
    mass, com = body.mass, body.lever
    about = body.inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return [mass, *(mass * com), *about[0], *about[1, 1:], about[2, 2]]


class PinocchioRobot:
    """Simulator interface of robot_program.py."""

    def __init__(self, model, options):
        self.model, self.data = model, model.createData()
        self.joints = list(model.names)[1:]
        self.damping = np.array(np.broadcast_to(np.asarray(options.damping, float), model.nv))
        self.dry = DryFriction(options, model.nv)

    def begin(self, step_s, q, dq):
        self.step_s, self.q, self.dq = step_s, q, dq
        zero = np.zeros(self.model.nv)
        self.acceleration, self.stuck, self.drag = zero, zero.tolist(), zero
        self.load = self.gravity()

    def advance(self, tau):
        h, model, data = self.step_s, self.model, self.data
        middle = self.q + 0.5 * h * self.dq
        # Velocity in the middle of the step, predicted with the last acceleration.
        speed = self.dq + 0.5 * h * self.acceleration
        bias = pinocchio.nonLinearEffects(model, data, middle, speed)
        inverse = np.triu(pinocchio.computeMinverse(model, data, middle))
        inverse = inverse + np.triu(inverse, 1).T
        viscous = self.damping * speed
        free = self.dq + h * (inverse @ (tau - bias - viscous))
        limit = self.dry.level(middle, speed, self.load)
        after, self.stuck = with_dry_friction(free.tolist(), (h * inverse).tolist(), limit.tolist(), self.stuck)
        after = np.array(after)
        self.acceleration = (after - self.dq) / h
        self.drag = viscous + np.array(self.stuck)
        self.load = tau - self.drag - model.armature * self.acceleration
        self.q, self.dq = middle + 0.5 * h * after, after

    def gravity(self):
        return pinocchio.computeGeneralizedGravity(self.model, self.data, self.q).copy()

    def friction(self):
        return self.drag

    def along(self, q, dq, ddq):
        with_drives = pinocchio.rnea(self.model, self.data, q, dq, ddq).copy()
        bodies = with_drives - self.model.armature * ddq
        return with_drives + self.damping * dq + self.dry.level(q, dq, bodies) * np.sign(dq)

    def place(self, joint, offset_m):
        pinocchio.forwardKinematics(self.model, self.data, self.q)
        return self.data.oMi[self.model.getJointId(joint)].act(offset_m)

    def truth(self):
        return {"bodies": [inertial(body) for body in list(self.model.inertias)[1:]], "drive_inertia": self.model.armature.tolist(),
                "viscous": self.damping.tolist(), **self.dry.truth()}


def with_dry_friction(velocity, response, limit, torque):
    """Returns the velocity after a step, and the dry friction torque during the step.

    `velocity` is the velocity without dry friction, `response` its change per unit torque in this step, `torque` the initial guess.
    At rest the friction torque is within its limit; in motion it equals the limit and opposes the motion.
    """
    joints = range(len(velocity))
    torque = [min(max(torque[i], -limit[i]), limit[i]) for i in joints]
    after = [velocity[i] - sum(response[i][k] * torque[k] for k in joints) for i in joints]
    for _ in range(SWEEPS):
        is_settled = True
        for i in joints:
            wanted = torque[i] + after[i] / response[i][i]
            wanted = min(max(wanted, -limit[i]), limit[i])
            change = wanted - torque[i]
            if change != 0.0:
                torque[i] = wanted
                for k in joints:
                    after[k] -= response[k][i] * change
                is_settled = is_settled and abs(change) <= SETTLED * limit[i]
        if is_settled:
            break
    return after, torque


def main():
    options = parser_for(__doc__).parse_args()
    robot = PinocchioRobot(load(options), options)
    Program(robot, Messages(), options).serve(f"Pinocchio {pinocchio.__version__}: {options.urdf.name}")


if __name__ == "__main__":
    main()
