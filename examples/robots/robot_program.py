"""A robot program for the line protocol of docs/src/robot-protocol.md, without the robot: messages, modes, sensors, log, true values.

`mujoco_client.py` and `pinocchio_client.py` add a simulator. A simulator is an object with

    joints                       names, in the order of all vectors
    q, dq                        true positions and velocities
    begin(step_s, q, dq)         starts a motion at this state, with steps of this length
    advance(tau)                 one step with this torque of the drives
    gravity(), friction()        current true torques that the drives must overcome, Nm (N)
    along(q, dq, ddq)            the required drive torque for this state of motion, including friction
    place(joint, offset_m)       base coordinates of a point in the frame of a joint
    truth()                      the true parameters, as a JSON object
"""
import argparse
import collections
import csv
import json
import queue
import sys
import threading
import time
from pathlib import Path

import numpy as np

from robot_controller import Controller, Unknown
from robot_faults import Regression, TorqueChannel, add_options, numbers

PROTOCOL = "dynident-robot/1"


def send(kind, **fields):
    print(json.dumps({"type": kind, **fields}, allow_nan=False), flush=True)


class Messages:
    """Messages of the host. A thread reads them, so that the program can stop while the robot moves."""

    def __init__(self):
        self.waiting = queue.Queue()
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in sys.stdin:
            self.waiting.put(json.loads(line))
        # The end of the input is also a stop.
        self.waiting.put(None)

    def next(self):
        return self.waiting.get()

    def stop_asked(self):
        """Whether a stop has arrived; the host sends nothing else during a motion."""
        try:
            message = self.waiting.get_nowait()
        except queue.Empty:
            return False
        return message is None or message["type"] == "stop"


def breach(envelope, joints, q, dq, tau, q_d):
    """Returns a description of an envelope violation, or None. Limits that are null are not checked."""
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


def outside(envelope, robot):
    """Returns a description of the point that leaves the workspace, or None."""
    if envelope is None or "workspace" not in envelope:
        return None
    box = envelope["workspace"]
    for point in box["points"]:
        place = robot.place(point["joint"], np.array(point["offset_m"]))
        for axis, low, value, high in zip("xyz", box["lower"], place, box["upper"]):
            if (low is not None and value < low) or (high is not None and value > high):
                return f"{axis} of {point['link']} is {value:.4f} m, its limits {low} and {high}"
    return None


def read_table(path):
    """The rows of a trajectory file: t_s, q, dq, ddq, and the torques of the model, if available."""
    with open(path, newline="", encoding="utf-8") as text:
        return np.array([[float(x) for x in row] for row in list(csv.reader(text))[1:]])


class Sensors:
    """Measured positions and velocities for controller and log: delayed, quantised, noisy."""

    def __init__(self, options, random, step_s, period_s, q, dq):
        self.options, self.random, self.period_s = options, random, period_s
        late = lambda delay_s, of_s: 1 + round(delay_s / of_s)
        self.seen = collections.deque([(q, dq)], maxlen=late(options.sensor_delay, step_s))
        self.logged = collections.deque(maxlen=late(options.log_delay, period_s))
        self.before, self.speed = None, dq

    def see(self, q, dq):
        """True state after an integration step."""
        self.seen.append((q, dq))

    def measured(self):
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

    def for_log(self, q, dq):
        self.logged.append((q, dq))
        return self.logged[0]


class Program:
    """Serves runs and steps of one robot until the host says goodbye."""

    def __init__(self, robot, messages, options):
        self.robot, self.messages, self.options = robot, messages, options
        each = lambda values: np.broadcast_to(np.asarray(values, float), len(robot.joints))
        self.own_loop = [each(options.kp), each(options.kd)]
        self.random = np.random.default_rng(options.seed)
        self.truth = {"joints": robot.joints, **robot.truth(), "runs": []}

    def serve(self, name):
        send("hello", protocol=PROTOCOL, name=name, joints=self.robot.joints, modes=["run", "step"], capabilities=["home"])
        while (message := self.messages.next()) is not None:
            if message["type"] == "run":
                self.run(message)
            elif message["type"] == "begin":
                self.step(message)
            elif message["type"] == "bye":
                return

    def begin(self, rate_hz, q, dq, peak):
        # An integer number of integration steps per controller sample.
        self.steps = max(1, int(np.ceil(1.0 / (rate_hz * self.options.step) - 1e-9)))
        step_s = 1.0 / rate_hz / self.steps
        self.robot.begin(step_s, np.array(q, float), np.array(dq, float))
        self.sensors = Sensors(self.options, self.random, step_s, 1.0 / rate_hz, self.robot.q.copy(), self.robot.dq.copy())
        self.given = collections.deque(maxlen=1 + round(self.options.drive_delay / step_s))
        self.channel, self.regression = TorqueChannel(self.options, len(self.robot.joints), rate_hz, peak), Regression()

    def advance(self, delivered):
        for _ in range(self.steps):
            self.given.append(delivered)
            self.robot.advance(self.given[0])
            self.sensors.see(self.robot.q.copy(), self.robot.dq.copy())

    def log(self, time_s, q, dq, sent):
        """Returns the logged sample."""
        q, dq = self.sensors.for_log(q, dq)
        torque = self.channel.logged(sent, self.robot.gravity, self.robot.friction)
        if self.options.torque_noise:
            torque = torque + self.options.torque_noise * self.random.standard_normal(len(torque))
        sample = {"t_s": self.options.log_clock * time_s, "q": q.tolist(), "dq": dq.tolist(), "tau": torque.tolist()}
        if "speed" in self.channel.lacks:
            del sample["dq"]
        return torque, sample

    def note(self, message, largest, left, ended):
        """Writes the true parameters and results of the robot."""
        if self.options.truth:
            self.truth["runs"].append({"run": message["run"], "left_envelope": left, "ended": ended,
                                       **{name: values.tolist() for name, values in largest.items()},
                                       "torque_limit": [limit if np.isfinite(limit) else None for limit in self.channel.limit.tolist()],
                                       "logged_on_commanded": self.regression.result()})
            self.options.truth.write_text(json.dumps(self.truth), encoding="utf-8")

    def run(self, message):
        file = json.loads(Path(message["controller"]).read_text(encoding="utf-8"))
        # The files use the joint order of the host; the robot uses the order of its hello message.
        order = [file["joints"].index(name) for name in self.robot.joints]
        back = [self.robot.joints.index(name) for name in file["joints"]]
        n = len(order)
        try:
            controller = Controller(file, [gains[back] for gains in self.own_loop])
        except Unknown as unknown:
            return send("end", status="stopped", reason=str(unknown))
        envelope = message.get("envelope")
        # If the message has paths from and to the home position, one controller runs approach, trajectory and return.
        motion = read_table(message["trajectory"])
        parts = [("motion", motion)]
        if "home" in message:
            # Omit the shared posture from the paths; the trajectory contains it.
            parts = [("approach", read_table(message["home"]["approach"])[:-1]), *parts,
                     ("return", read_table(message["home"]["return"])[1:])]
        rows = [(part, row) for part, table in parts for row in table]
        state = lambda row: [row[1 + k * n: 1 + (k + 1) * n][order] for k in range(3)]
        peak = None
        if np.any(np.isfinite(self.options.torque_share)):
            peak = np.max([np.abs(self.robot.along(*state(row))) for row in motion], axis=0)
        self.begin(message["rate_hz"], *state(rows[0][1])[:2], peak)
        largest = {name: np.zeros(n) for name in ("tracking_error", "speed", "torque")}
        truly_left = None
        clock = time.monotonic()
        for sample_number, (part, row) in enumerate(rows):
            if self.options.real_time:
                time.sleep(max(0.0, clock + sample_number / message["rate_hz"] - time.monotonic()))
            where = f"{row[0]:.3f} s of the {part}"
            target = [row[1 + k * n: 1 + (k + 1) * n] for k in range(3)]
            true_q, true_dq = self.robot.q.copy(), self.robot.dq.copy()
            q, dq = self.sensors.measured()
            if not np.all(np.isfinite(true_q)) or np.max(np.abs(true_dq)) > 100:
                self.note(message, largest, truly_left, "stopped")
                return send("end", status="stopped", reason=f"a joint moves too fast at {where}")
            ahead = row[1 + 3 * n:] if len(row) > 1 + 3 * n else None
            commanded = controller.torque(target, q[back], dq[back], ahead)[order]
            sent, delivered = self.channel.deliver(commanded)
            for name, value in (("tracking_error", target[0][order] - true_q), ("speed", true_dq), ("torque", delivered)):
                largest[name] = np.maximum(largest[name], np.abs(value))
            truly_left = truly_left or breach(envelope, self.robot.joints, true_q, true_dq, delivered, target[0][order])
            torque, sample = self.log(row[0], q, dq, sent)
            if part == "motion":
                self.regression.add(commanded, torque)
            send("sample", part=part, **sample)
            # After an early stop the robot keeps its position and does not return to the home position.
            if self.messages.stop_asked():
                self.note(message, largest, truly_left, "stopped")
                return send("end", status="stopped", reason="stop requested by the host")
            left = breach(envelope, self.robot.joints, q, dq, delivered, target[0][order]) or outside(envelope, self.robot)
            if left:
                self.note(message, largest, truly_left, "stopped")
                return send("end", status="stopped", reason=f"at {where} {left}")
            self.advance(delivered)
        self.note(message, largest, truly_left, "done")
        send("end", status="done")

    def step(self, message):
        self.begin(message["rate_hz"], message["q"], message["dq"], None)
        for sample in range(message["samples"]):
            q, dq = self.sensors.measured()
            send("state", t_s=sample / message["rate_hz"], q=q.tolist(), dq=dq.tolist())
            answer = self.messages.next()
            if answer is None or answer["type"] not in ("torque", "finish"):
                return send("end", status="stopped", reason="stop requested by the host")
            if answer["type"] == "finish":
                break
            _, delivered = self.channel.deliver(np.array(answer["tau"], float))
            self.advance(delivered)
        send("end", status="done")


def parser_for(description):
    """Adds the options of all clients."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("--friction", type=numbers, default=0.0, help="dry friction of the joints, Nm (N)")
    parser.add_argument("--damping", type=numbers, default=0.0, help="viscous friction of the joints, Nm s/rad (N s/m)")
    parser.add_argument("--armature", type=numbers, default=0.0, help="drive inertia of the joints, kg m^2 (kg)")
    parser.add_argument("--kp", type=numbers, default=0.0, help="stiffness of the position loop inside the drives, Nm/rad (N/m)")
    parser.add_argument("--kd", type=numbers, default=0.0, help="damping of the position loop inside the drives, Nm s/rad (N s/m)")
    parser.add_argument("--step", type=float, default=1e-3, help="maximum integration step, s")
    parser.add_argument("--real-time", action="store_true", help="keep motions to the clock of the computer")
    parser.add_argument("--gravity", type=numbers, help="gravity in the world frame, m/s^2 (default: 9.81 down)")
    parser.add_argument("--stribeck", type=numbers, default=0.0, help="additional dry friction at rest (Stribeck), Nm (N)")
    parser.add_argument("--stribeck-speed", type=numbers, default=0.05, help="velocity at which the --stribeck friction has decreased to a third, rad/s (m/s)")
    parser.add_argument("--load", type=numbers, default=0.0, help="dry friction per Nm (N) of rigid-body torque")
    parser.add_argument("--masses", type=float, default=0.0, help="maximum random error of mass and inertia of each link, percent; see --seed")
    parser.add_argument("--sensor-delay", type=float, default=0.0, help="delay of measured positions and velocities for controller and log, s")
    parser.add_argument("--drive-delay", type=float, default=0.0, help="delay of the drive torque, s")
    parser.add_argument("--log-delay", type=float, default=0.0, help="additional delay of positions and velocities in the log, s")
    parser.add_argument("--quantum", type=float, default=0.0, help="resolution of the encoders, rad (m)")
    parser.add_argument("--position-noise", type=float, default=0.0, help="noise of the encoders, rad (m)")
    parser.add_argument("--torque-noise", type=numbers, default=0.0, help="noise of the logged torque, Nm (N)")
    parser.add_argument("--speed-filter", type=float, default=0.0, help="cut-off of the first-order low-pass for velocities from differences, Hz")
    parser.add_argument("--catch", type=numbers, help="JOINT,POSITION,WIDTH,NM: additional dry friction near a position")
    parser.add_argument("--lengths", type=float, default=0.0, help="increase of the link lengths relative to the description, percent")
    parser.add_argument("--seed", type=int, default=1, help="seed of masses and noise")
    parser.add_argument("--truth", type=Path, help="output file for true parameters and results")
    add_options(parser)
    return parser


class DryFriction:
    """Dry friction of all joints at a state: constant, Stribeck, load-dependent, and near a position."""

    def __init__(self, options, joints):
        each = lambda values: np.broadcast_to(np.asarray(values, float), joints)
        self.dry, self.stribeck, self.speed, self.load = map(each, (options.friction, options.stribeck, options.stribeck_speed, options.load))
        self.catch = options.catch
        # Whether the friction changes during a motion.
        self.varies = bool(np.any(self.stribeck) or np.any(self.load) or options.catch is not None)

    def level(self, q, dq, load):
        """Maximum dry friction torque, Nm (N); `load` is the torque of the bodies, without drives."""
        level = self.dry + self.stribeck * np.exp(-((dq / self.speed) ** 2)) + self.load * np.abs(load)
        if self.catch is not None:
            joint, position, width, torque = self.catch
            level[int(joint)] += torque * (abs(q[int(joint)] - position) < width)
        return level

    def truth(self):
        return {"coulomb": self.dry.tolist(), "stribeck": self.stribeck.tolist(), "load": self.load.tolist()}
