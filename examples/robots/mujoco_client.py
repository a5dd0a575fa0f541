"""A robot program for Dynident's line protocol: MuJoCo on a URDF arm (see docs/src/robot-protocol.md).

    pip install mujoco numpy
    python examples/robots/mujoco_client.py robots/panda_arm7.urdf [--friction 0.2] [--damping 0.5] [--armature 0.1]

It offers both modes. In `run` it runs the control loop itself from the two files it is handed: joint PD and PID by their gains,
model-based controllers through a small Newton-Euler recursion over the numbers of controller.json. In `step` it holds the
torques that it is sent. Where the study states a home it begins there, and runs approach, trajectory and return. It stops at a
stop message, when its input ends, and when a sample leaves the envelope that a motion comes with: a simulated robot stands at
once, a real one brakes here. --friction, --damping and --armature give the joints dry (Nm) and viscous (Nm s/rad) friction and
drive inertia (kg m^2) that the URDF does not tell: one number, or one for each joint with commas between; --torque cuts the
drives' torque (Nm). --kp and --kd are the drives' own position loop, for the controller position-loop. What real robots have on
top is off unless it is asked for: --stribeck and --load friction, masses that are not the description's, delays, quantised and
noisy encoders, velocities from differences; and what no model has: a joint that catches (--catch), links of another length
(--lengths). --truth FILE says what the robot truly is and what it truly did (benchmarks/campaign.py). Standard output belongs to
the protocol; messages go to standard error.
"""
import argparse
import collections
import csv
import json
import queue
import sys
import threading
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np

PROTOCOL = "dynident-robot/1"


def send(kind, **fields):
    print(json.dumps({"type": kind, **fields}, allow_nan=False), flush=True)


def load(path, options):
    friction, damping, armature, step_s = options.friction, options.damping, options.armature, options.step
    tree = ElementTree.parse(path)
    # A point mass is no body here: a grain of dust on it is.
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
    # Dry friction is a soft constraint here: as stiff as the steps allow, or it comes 20 ms late.
    model.dof_solref[:], model.dof_solimp[:] = (2 * step_s, 1.0), (0.999, 0.999, 1e-3, 0.5, 2.0)
    # Limits of joints are the controller's business, and links may overlap at their joints.
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
    """What hangs rigidly on each joint: the ten inertial parameters about its frame, as Dynident has them."""
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
        # How far each elastic element is deflected.
        self.period_s, self.deflections = period_s, [0.0] * len(self.laws)

    def bodies_torque(self, q, dq, ddq):
        n = len(q)
        frames, wrenches = [None] * n, [None] * n
        motion = [None] * n
        for i in range(n):
            rotation, translation, axis = self.placement[i]
            if self.turns[i]:
                c, s = np.cos(q[i]), np.sin(q[i])
                cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
                rotation = rotation @ (np.outer(axis, axis) * (1 - c) + np.eye(3) * c + cross * s)
            else:
                translation = translation + rotation @ axis * q[i]
            frames[i] = rotation, translation
            if self.parent[i] is None:
                w, dw, a = np.zeros(3), np.zeros(3), -self.gravity
            else:
                w, dw, a = motion[self.parent[i]]
            a = rotation.T @ (a + np.cross(dw, translation) + np.cross(w, np.cross(w, translation)))
            w, dw = rotation.T @ w, rotation.T @ dw
            if self.turns[i]:
                dw = dw + np.cross(w, axis * dq[i]) + axis * ddq[i]
                w = w + axis * dq[i]
            else:
                a = a + 2 * np.cross(w, axis * dq[i]) + axis * ddq[i]
            motion[i] = w, dw, a
            m, h, inertia = self.bodies[i]
            force = m * a + np.cross(dw, h) + np.cross(w, np.cross(w, h))
            wrenches[i] = [force, inertia @ dw + np.cross(w, inertia @ w) + np.cross(h, a)]
        tau = np.zeros(n)
        for i in reversed(range(n)):
            force, moment = wrenches[i]
            tau[i] = self.placement[i][2] @ (moment if self.turns[i] else force)
            if self.parent[i] is not None:
                rotation, translation = frames[i]
                force = rotation @ force
                wrenches[self.parent[i]][0] += force
                wrenches[self.parent[i]][1] += rotation @ moment + np.cross(translation, force)
        return tau

    def torque(self, q, dq, ddq, friction_speed):
        """`friction_speed` is the speed at which friction is taken, or None for no friction."""
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
                cross = value * law["ratios"][0] * law["ratios"][1]
                tau[first] += cross * ddq[second]
                tau[second] += cross * ddq[first]
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


# What friction() knows, and what is not friction.
KNOWN_LAWS = {"viscous", "coulomb", "stribeck", "sigmoid", "power", "directional-viscous", "directional-coulomb", "load",
              "maxwell-slip", "drive-inertia", "offset", "coupling"}


def step(shape, speed):
    """The step of dry friction near rest."""
    return np.tanh(speed / shape["width"]) if shape["step"] == "smooth" else np.sign(speed)


def friction(law, speed, load):
    """The law's torque for the parameter 1 (docs/src/friction.md)."""
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
    """Something of the files that this client does not know: the motion is declined before anything moves."""

    def __str__(self):
        return f"this client does not know {self.args[0]}: add it here, or run in the mode step"


class Controller:
    """Torque from the files' settings; `own_loop` are the gains of the drives' own position loop, in the files' order."""

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
            # The drives' own gains, whatever the file believes of them.
            self.kp, self.kd = own_loop
        limit = self.settings.get("integral_limit")
        self.limit = np.broadcast_to(np.array(np.inf if limit is None else limit, float), n)
        self.integral, self.last_error = np.zeros(n), None
        self.period = 1.0 / file["rate_hz"]

    def power(self, x, alpha, blend):
        inside = blend ** (alpha - 1) * x if blend > 0 else x
        return np.where(np.abs(x) < blend, inside, np.sign(x) * np.abs(x) ** alpha)

    def torque(self, target, q, dq, ahead):
        """`ahead` is the trajectory's own torque column, where it has one."""
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


class Messages:
    """What the host writes, read aside, so that a stop is heard while the robot moves."""

    def __init__(self):
        self.waiting = queue.Queue()
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in sys.stdin:
            self.waiting.put(json.loads(line))
        # The host is gone: that is a stop, too.
        self.waiting.put(None)

    def next(self):
        return self.waiting.get()

    def stop_asked(self):
        """Whether a stop has come; nothing else comes in the middle of a motion."""
        try:
            message = self.waiting.get_nowait()
        except queue.Empty:
            return False
        return message is None or message["type"] == "stop"


def breach(envelope, joints, q, dq, tau, q_d):
    """What leaves the envelope, in words; None while nothing does. Limits that are null do not count."""
    if envelope is None:
        return None
    for j, name in enumerate(joints):
        low, high = envelope["lower"][j], envelope["upper"][j]
        if (low is not None and q[j] < low) or (high is not None and q[j] > high):
            return f"position of {name} is {q[j]:.4f}, its limits {low} and {high}"
        for key, value in (("speed", dq[j]), ("torque", tau[j]), ("tracking_error", q_d[j] - q[j])):
            limit = envelope[key][j]
            if limit is not None and abs(value) > limit:
                return f"{key} of {name} is {value:.4f}, its limit {limit:.4f}"
    return None


def outside(envelope, model, data):
    """Which point leaves the workspace, in words; bodies stand where the last step began."""
    if envelope is None or "workspace" not in envelope:
        return None
    box = envelope["workspace"]
    for point in box["points"]:
        body = model.jnt_bodyid[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, point["joint"])]
        place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point["offset_m"]
        for axis, low, value, high in zip("xyz", box["lower"], place, box["upper"]):
            if (low is not None and value < low) or (high is not None and value > high):
                return f"{axis} of {point['link']} is {value:.4f} m, its limits {low} and {high}"
    return None


def read_table(path):
    """The rows of a table that was handed over: t_s, q, dq, ddq, and the model's torques if there is a model."""
    with open(path, newline="", encoding="utf-8") as text:
        return np.array([[float(x) for x in row] for row in list(csv.reader(text))[1:]])


class Robot:
    def __init__(self, model, messages, options):
        self.model, self.data, self.messages, self.options = model, mujoco.MjData(model), messages, options
        each = lambda values: np.broadcast_to(np.asarray(values, float), model.nv)
        self.most, self.own_loop = options.torque, [each(options.kp), each(options.kd)]
        self.dry, self.stribeck, self.load = each(options.friction), each(options.stribeck), each(options.load)
        self.varies = bool(np.any(self.stribeck) or np.any(self.load) or options.catch is not None)
        self.random = np.random.default_rng(options.seed)
        self.joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
        self.truth = {"joints": self.joints, "bodies": bodies(model).tolist(), "drive_inertia": model.dof_armature.tolist(),
                      "viscous": model.dof_damping.tolist(), "coulomb": self.dry.tolist(), "stribeck": self.stribeck.tolist(),
                      "load": self.load.tolist(), "runs": []}

    def start(self, rate_hz, q, dq):
        # Whole steps from one sample of the controller to the next.
        self.steps = max(1, int(np.ceil(1.0 / (rate_hz * self.options.step) - 1e-9)))
        self.model.opt.timestep = step_s = 1.0 / rate_hz / self.steps
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, dq
        mujoco.mj_kinematics(self.model, self.data)
        line = lambda first, delay_s, of_s: collections.deque([first], maxlen=1 + round(delay_s / of_s))
        # What the encoders and the drives still have before them, step by step; what the log has, sample by sample.
        self.seen = line((self.data.qpos.copy(), self.data.qvel.copy()), self.options.sensor_delay, step_s)
        self.given = line(None, self.options.drive_delay, step_s)
        self.logged = line(None, self.options.log_delay, 1.0 / rate_hz)
        self.before, self.speed, self.period_s = None, np.array(dq, float), 1.0 / rate_hz

    def measured(self):
        """Positions and velocities as the controller gets them."""
        q, dq = self.seen[0]
        if self.options.position_noise:
            q = q + self.options.position_noise * self.random.standard_normal(len(q))
        if self.options.quantum:
            q = self.options.quantum * np.round(q / self.options.quantum)
        if self.options.speed_filter:
            if self.before is not None:
                share = 1.0 - np.exp(-2.0 * np.pi * self.options.speed_filter * self.period_s)
                self.speed = self.speed + share * ((q - self.before) / self.period_s - self.speed)
            self.before, dq = q, self.speed
        return q.copy(), dq.copy()

    def log(self, q, dq, tau):
        """The sample as it is logged."""
        if self.options.torque_noise:
            tau = tau + self.options.torque_noise * self.random.standard_normal(len(tau))
        self.logged.append((q, dq))
        q, dq = self.logged[0] or self.logged[1]
        return {"q": q.tolist(), "dq": dq.tolist(), "tau": tau.tolist()}

    def friction_now(self):
        """Dry friction at this speed and under this load: the torque of the bodies, without drives."""
        q, dq, load = self.data.qpos, self.data.qvel, np.zeros(self.model.nv)
        mujoco.mj_mulM(self.model, self.data, load, self.data.qacc)
        load += self.data.qfrc_bias - self.model.dof_armature * self.data.qacc
        dry = self.dry + self.stribeck * np.exp(-((dq / self.options.stribeck_speed) ** 2)) + self.load * np.abs(load)
        if self.options.catch is not None:
            joint, position, width, torque = self.options.catch
            dry[int(joint)] += torque * (abs(q[int(joint)] - position) < width)
        return dry

    def advance(self, tau):
        for _ in range(self.steps):
            if self.varies:
                self.model.dof_frictionloss[:] = self.friction_now()
            self.given.append(tau)
            self.data.qfrc_applied[:] = self.given[0] if self.given[0] is not None else self.given[1]
            mujoco.mj_step(self.model, self.data)
            self.seen.append((self.data.qpos.copy(), self.data.qvel.copy()))

    def note(self, message, largest, left, ended):
        """What the robot truly did, beside what it is."""
        if self.options.truth:
            self.truth["runs"].append({"run": message["run"], "left_envelope": left, "ended": ended,
                                       **{name: values.tolist() for name, values in largest.items()}})
            self.options.truth.write_text(json.dumps(self.truth), encoding="utf-8")

    def run(self, message):
        file = json.loads(Path(message["controller"]).read_text(encoding="utf-8"))
        # The files' order is the host's; this robot's own order is its hello's.
        order = [file["joints"].index(name) for name in self.joints]
        back = [self.joints.index(name) for name in file["joints"]]
        n = len(order)
        try:
            controller = Controller(file, [gains[back] for gains in self.own_loop])
        except Unknown as unknown:
            return send("end", status="stopped", reason=str(unknown))
        envelope = message.get("envelope")
        # From home to the trajectory and back, where the host says so: one controller runs through all of it.
        parts = [("motion", read_table(message["trajectory"]))]
        if "home" in message:
            # The posture that a way shares with the trajectory is the trajectory's.
            parts = [("approach", read_table(message["home"]["approach"])[:-1]), *parts,
                     ("return", read_table(message["home"]["return"])[1:])]
        rows = [(part, row) for part, table in parts for row in table]
        first = [rows[0][1][1 + k * n: 1 + (k + 1) * n][order] for k in range(2)]
        self.start(message["rate_hz"], *first)
        largest = {name: np.zeros(n) for name in ("tracking_error", "speed", "torque")}
        truly_left = None
        for part, row in rows:
            where = f"{row[0]:.3f} s of the {part}"
            target = [row[1 + k * n: 1 + (k + 1) * n] for k in range(3)]
            true_q, true_dq = self.data.qpos.copy(), self.data.qvel.copy()
            q, dq = self.measured()
            if not np.all(np.isfinite(true_q)) or np.max(np.abs(true_dq)) > 100:
                return send("end", status="stopped", reason=f"a joint moves too fast at {where}")
            # A drive gives what it can, and logs what it gives.
            ahead = row[1 + 3 * n:] if len(row) > 1 + 3 * n else None
            tau = np.clip(controller.torque(target, q[back], dq[back], ahead)[order], -self.most, self.most)
            for name, value in (("tracking_error", target[0][order] - true_q), ("speed", true_dq), ("torque", tau)):
                largest[name] = np.maximum(largest[name], np.abs(value))
            truly_left = truly_left or breach(envelope, self.joints, true_q, true_dq, tau, target[0][order])
            send("sample", part=part, t_s=row[0], **self.log(q, dq, tau))
            # Whatever ends a run early: the robot stays where it is, and does not go home.
            if self.messages.stop_asked():
                self.note(message, largest, truly_left, "stopped")
                return send("end", status="stopped", reason="the host asked for it")
            left = breach(envelope, self.joints, q, dq, tau, target[0][order]) or outside(envelope, self.model, self.data)
            if left:
                self.note(message, largest, truly_left, "stopped")
                return send("end", status="stopped", reason=f"at {where} {left}")
            self.advance(tau)
        self.note(message, largest, truly_left, "done")
        send("end", status="done")

    def step(self, message):
        self.start(message["rate_hz"], message["q"], message["dq"])
        for sample in range(message["samples"]):
            time = sample / message["rate_hz"]
            q, dq = self.measured()
            send("state", t_s=time, q=q.tolist(), dq=dq.tolist())
            answer = self.messages.next()
            if answer is None or answer["type"] not in ("torque", "finish"):
                return send("end", status="stopped", reason="the host asked for it")
            if answer["type"] == "finish":
                break
            self.advance(answer["tau"])
        send("end", status="done")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf", type=Path)
    numbers = lambda text: np.array([float(part) for part in text.split(",")])
    parser.add_argument("--friction", type=numbers, default=0.0, help="dry friction of the joints, Nm")
    parser.add_argument("--damping", type=numbers, default=0.0, help="viscous friction of the joints, Nm s/rad")
    parser.add_argument("--armature", type=numbers, default=0.0, help="drive inertia of the joints, kg m^2")
    parser.add_argument("--torque", type=numbers, default=np.inf, help="largest torque of the drives, Nm")
    parser.add_argument("--kp", type=numbers, default=0.0, help="stiffness of the drives' own position loop, Nm/rad")
    parser.add_argument("--kd", type=numbers, default=0.0, help="damping of the drives' own position loop, Nm s/rad")
    parser.add_argument("--step", type=float, default=1e-3, help="longest step of the integration, s; a torque seems half of it late")
    parser.add_argument("--gravity", type=numbers, help="gravity in the world, m/s^2; the default is MuJoCo's, 9.81 down")
    parser.add_argument("--stribeck", type=numbers, default=0.0, help="dry friction at rest on top, Nm")
    parser.add_argument("--stribeck-speed", type=float, default=0.05, help="where that has fallen to a third, rad/s")
    parser.add_argument("--load", type=numbers, default=0.0, help="dry friction for each Nm of the bodies' torque")
    parser.add_argument("--masses", type=float, default=0.0, help="every link's mass and inertia by up to so many percent off, by --seed")
    parser.add_argument("--sensor-delay", type=float, default=0.0, help="how late the controller and the log see positions and velocities, s")
    parser.add_argument("--drive-delay", type=float, default=0.0, help="how late drives give their torque, s")
    parser.add_argument("--log-delay", type=float, default=0.0, help="how late the log alone has positions and velocities, s")
    parser.add_argument("--quantum", type=float, default=0.0, help="step of the encoders, rad")
    parser.add_argument("--position-noise", type=float, default=0.0, help="noise of the encoders, rad")
    parser.add_argument("--torque-noise", type=float, default=0.0, help="noise of the logged torque, Nm")
    parser.add_argument("--speed-filter", type=float, default=0.0, help="velocities are differences through a first-order low-pass, Hz")
    parser.add_argument("--catch", type=numbers, help="JOINT,POSITION,WIDTH,NM: this much more dry friction about a position")
    parser.add_argument("--lengths", type=float, default=0.0, help="links so many percent longer than the description's")
    parser.add_argument("--seed", type=int, default=1, help="of masses and noise")
    parser.add_argument("--truth", type=Path, help="where to write what the robot is and did")
    options = parser.parse_args()
    messages = Messages()
    robot = Robot(load(options.urdf, options), messages, options)
    send("hello", protocol=PROTOCOL, name=f"MuJoCo {mujoco.__version__}: {options.urdf.name}", joints=robot.joints,
         modes=["run", "step"], capabilities=["home"])
    while (message := messages.next()) is not None:
        if message["type"] == "run":
            robot.run(message)
        elif message["type"] == "begin":
            robot.step(message)
        elif message["type"] == "bye":
            return


if __name__ == "__main__":
    main()
