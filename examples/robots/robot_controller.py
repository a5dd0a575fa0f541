"""The controllers of docs/src/robot-protocol.md, computed from controller.json and trajectory.csv only.

Both example clients use this module. It contains the inverse dynamics, the friction laws and the control laws for a robot program in
mode `run`. It does not depend on a simulator.
"""
import numpy as np


def cross(a, b):
    """Cross product of two vectors, ten times faster than numpy.cross for one pair."""
    a0, a1, a2 = a.tolist()
    b0, b1, b2 = b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


class InverseDynamics:
    """tau = M(q) ddq + h(q, dq) by the recursive Newton-Euler algorithm, and the laws of the drives."""

    def __init__(self, model, period_s):
        joints = model["joints"]
        names = [joint["name"] for joint in joints]
        self.parent = [names.index(joint["parent"]) if joint["parent"] else None for joint in joints]
        self.turns = [joint["turns"] for joint in joints]
        self.placement = [(np.array(j["rotation"]), np.array(j["translation_m"]), np.array(j["axis"])) for j in joints]
        self.bodies = []
        for joint in joints:
            m, hx, hy, hz, xx, xy, xz, yy, yz, zz = joint["inertial"]
            self.bodies.append((m, np.array([hx, hy, hz]), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])))
        self.gravity = np.array(model["gravity_m_s2"])
        self.laws = [(law, [names.index(name) for name in law["joints"]]) for law in model["laws"]]
        # Deflection of each elastic element.
        self.period_s, self.deflections = period_s, [0.0] * len(self.laws)

    def bodies_torque(self, q, dq, ddq):
        n = len(q)
        frames, wrenches = [None] * n, [None] * n
        motion = [None] * n
        for i in range(n):
            rotation, translation, axis = self.placement[i]
            if self.turns[i]:
                c, s = np.cos(q[i]), np.sin(q[i])
                skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
                rotation = rotation @ (np.outer(axis, axis) * (1 - c) + np.eye(3) * c + skew * s)
            else:
                translation = translation + rotation @ axis * q[i]
            frames[i] = rotation, translation
            if self.parent[i] is None:
                w, dw, a = np.zeros(3), np.zeros(3), -self.gravity
            else:
                w, dw, a = motion[self.parent[i]]
            a = rotation.T @ (a + cross(dw, translation) + cross(w, cross(w, translation)))
            w, dw = rotation.T @ w, rotation.T @ dw
            if self.turns[i]:
                dw = dw + cross(w, axis * dq[i]) + axis * ddq[i]
                w = w + axis * dq[i]
            else:
                a = a + 2 * cross(w, axis * dq[i]) + axis * ddq[i]
            motion[i] = w, dw, a
            m, h, inertia = self.bodies[i]
            force = m * a + cross(dw, h) + cross(w, cross(w, h))
            wrenches[i] = [force, inertia @ dw + cross(w, inertia @ w) + cross(h, a)]
        tau = np.zeros(n)
        for i in reversed(range(n)):
            force, moment = wrenches[i]
            tau[i] = self.placement[i][2] @ (moment if self.turns[i] else force)
            if self.parent[i] is not None:
                rotation, translation = frames[i]
                force = rotation @ force
                wrenches[self.parent[i]][0] += force
                wrenches[self.parent[i]][1] += rotation @ moment + cross(translation, force)
        return tau

    def torque(self, q, dq, ddq, friction_speed):
        """`friction_speed` is the speed for the friction laws, or None for no friction."""
        tau = self.bodies_torque(q, dq, ddq)
        load = tau.copy()
        for number, (law, joints) in enumerate(self.laws):
            kind, value, j = law["kind"], law["value"], joints[0]
            if kind == "drive-inertia":
                tau[j] += value * ddq[j]
            elif kind == "offset":
                tau[j] += value
            elif kind == "coupling" and law["effect"] == "inertia":
                first, second = joints
                shared = value * law["ratios"][0] * law["ratios"][1]
                tau[first] += shared * ddq[second]
                tau[second] += shared * ddq[first]
            elif friction_speed is None:
                continue
            elif kind == "maxwell-slip":
                most = law["yield_displacement"]
                moved = self.deflections[number] + friction_speed[j] * self.period_s
                self.deflections[number] = min(max(moved, -most), most)
                tau[j] += value * self.deflections[number] / most
            elif kind == "coupling":
                first, second = joints
                one, other = law["ratios"]
                if law["effect"] == "viscous":
                    tau[first] += value * one * other * friction_speed[second]
                    tau[second] += value * one * other * friction_speed[first]
                else:
                    felt = step(law["shape"], one * friction_speed[first] + other * friction_speed[second])
                    tau[first] += value * one * felt
                    tau[second] += value * other * felt
            else:
                tau[j] += value * friction(law, friction_speed[j], load[j])
        return tau


# Laws supported by friction(), and terms that are not friction.
KNOWN_LAWS = {"viscous", "coulomb", "stribeck", "sigmoid", "power", "directional-viscous", "directional-coulomb", "load",
              "maxwell-slip", "drive-inertia", "offset", "coupling"}


def step(shape, speed):
    """Step function of dry friction near rest."""
    return np.tanh(speed / shape["width"]) if shape["step"] == "smooth" else np.sign(speed)


def friction(law, speed, load):
    """Torque of the law for a parameter value of 1 (docs/src/friction.md)."""
    kind = law["kind"]
    if kind == "viscous":
        return speed
    if kind == "coulomb":
        return step(law["shape"], speed)
    if kind == "stribeck":
        return np.exp(-abs(speed / law["speed"]) ** law["exponent"]) * step(law["shape"], speed)
    if kind == "sigmoid":
        logistic = lambda x: 0.5 * (1.0 + np.tanh(0.5 * x))
        steep, offset = law["steepness"], law["offset_speed"]
        return logistic(steep * (speed + offset)) - logistic(steep * offset)
    if kind == "power":
        return speed * np.hypot(speed, law["rounding"]) ** (law["exponent"] - 1.0)
    if kind == "load":
        return abs(load) * step(law["shape"], speed)
    full = speed if kind == "directional-viscous" else step(law["shape"], speed)
    return max(full, 0.0) if law["direction"] == "+" else min(full, 0.0)


class Unknown(Exception):
    """The files contain a law or controller that this client does not support. The client declines the motion before the robot moves."""

    def __str__(self):
        return f"this client does not support {self.args[0]}: implement it in robot_controller.py, or use the mode step"


class Controller:
    """Computes the torque with the settings of the files. `own_loop` has the gains of the position loop inside the drives, in file order."""

    def __init__(self, file, own_loop):
        self.settings, n = file["controller"], len(file["joints"])
        self.model = InverseDynamics(file["model"], 1.0 / file["rate_hz"]) if file["model"] else None
        laws = {law["kind"] for law in file["model"]["laws"]} if file["model"] else set()
        if laws - KNOWN_LAWS:
            raise Unknown(f"the laws {', '.join(sorted(laws - KNOWN_LAWS))}")
        known = ("joint-pd", "joint-pid", "pd-gravity", "computed-torque", "finite-time", "position-loop")
        if self.settings["kind"] not in known:
            raise Unknown(f"the controller {self.settings['kind']}")
        of = lambda key: np.broadcast_to(np.array(self.settings.get(key) or 0.0, float), n)
        self.kp, self.ki, self.kd = of("kp"), of("ki"), of("kd")
        if self.settings["kind"] == "position-loop":
            # Use the true gains of the drives, not those in the file.
            self.kp, self.kd = own_loop
        limit = self.settings.get("integral_limit")
        self.limit = np.broadcast_to(np.array(np.inf if limit is None else limit, float), n)
        self.integral, self.last_error = np.zeros(n), None
        self.period = 1.0 / file["rate_hz"]

    def power(self, x, alpha, blend):
        inside = blend ** (alpha - 1) * x if blend > 0 else x
        return np.where(np.abs(x) < blend, inside, np.sign(x) * np.abs(x) ** alpha)

    def torque(self, target, q, dq, ahead):
        """`ahead` is the feedforward torque column of the trajectory, if it has one."""
        q_d, dq_d, ddq_d = target
        e, de, kind = q_d - q, dq_d - dq, self.settings["kind"]
        if kind == "position-loop":
            tau = self.kp * e + self.kd * de
            return tau + ahead if ahead is not None and self.settings["feed_forward"] else tau
        if kind in ("joint-pd", "joint-pid", "pd-gravity"):
            tau = self.kp * e + self.kd * de
            if kind == "joint-pid":
                if self.last_error is not None:
                    grown = self.integral + self.ki * 0.5 * self.period * (e + self.last_error)
                    self.integral = np.clip(grown, -self.limit, self.limit)
                self.last_error = e
                tau = tau + self.integral
            if kind == "pd-gravity":
                zero = np.zeros_like(q)
                tau = tau + self.model.torque(q, zero, zero, None)
            return tau
        if kind == "computed-torque":
            a = ddq_d + self.kp * e + self.kd * de
        else:
            s = self.settings
            alpha = s["alpha"]
            a = ddq_d + self.kp * self.power(e, alpha, s["blend_position"])
            a = a + self.kd * self.power(de, 2 * alpha / (1 + alpha), s["blend_speed"])
        speed = {"none": None, "reference": dq_d, "measured": dq}[self.settings["friction"]]
        return self.model.torque(q, dq, a, speed)

