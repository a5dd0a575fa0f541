"""Faults of a robot's torque channel and clock, for tests of the checks that must detect them (benchmarks/loop_faults.py).

All faults are off by default. Joints are numbered from 0 in the order of the `hello` message. Faults are applied to a torque in this
order: controller command, exchanged joints and chatter (`sent`), clipping, drive gain (`delivered`). In the log: command or delivered
torque, minus gravity and friction, exchanged joints, scale, delay, noise.
"""
import collections

import numpy as np


def numbers(text):
    """Parses comma-separated numbers."""
    return np.array([float(part) for part in text.split(",")])


def add_options(parser):
    """Adds the options of all faults."""
    group = parser.add_argument_group("faults of torque and clock")
    group.add_argument("--torque", type=numbers, default=np.inf, help="maximum torque of the drives, Nm (N)")
    group.add_argument("--torque-share", type=numbers, default=np.inf,
                       help="maximum torque of the drives as a fraction of the true peak torque along the trajectory")
    group.add_argument("--drive-gain", type=numbers, default=1.0, help="ratio of delivered to commanded torque; not visible in the log")
    group.add_argument("--log-command", action="store_true", help="the log contains the command instead of the clipped torque")
    group.add_argument("--swap-command", type=numbers, help="J,K: the commands of two joints go to the wrong drives")
    group.add_argument("--chatter", type=numbers, default=0.0, help="torque that alternates from sample to sample, Nm (N)")
    group.add_argument("--chatter-share", type=float, default=0.2, help="fraction of each second with chatter")
    group.add_argument("--log-scale", type=numbers, default=1.0, help="ratio of logged to true torque; negative for a reversed sign")
    group.add_argument("--log-swap", type=numbers, help="J,K: the logged torques of two joints are exchanged")
    group.add_argument("--log-without", default="", help="comma-separated parts missing in the log: gravity and friction (torques), or speed (not a fault)")
    group.add_argument("--log-torque-delay", type=float, default=0.0, help="delay of the logged torque, s")
    group.add_argument("--log-clock", type=float, default=1.0, help="seconds of the log clock per true second")


def exchanged(values, pair):
    """`values` with two of them exchanged; unchanged without a pair."""
    if pair is None:
        return values
    order = np.arange(len(values))
    first, second = (int(joint) for joint in pair)
    order[[first, second]] = second, first
    return values[order]


class TorqueChannel:
    """Torque faults between controller, drives and log in one run."""

    def __init__(self, options, joints, rate_hz, peak):
        """`peak` is the true peak torque of each joint along the trajectory, or None if unknown."""
        each = lambda values: np.broadcast_to(np.asarray(values, float), joints)
        self.options, self.rate_hz, self.samples = options, rate_hz, 0
        self.limit = each(options.torque)
        if peak is not None and np.any(np.isfinite(options.torque_share)):
            self.limit = np.minimum(self.limit, each(options.torque_share) * peak)
        self.gain, self.scale, self.chatter = each(options.drive_gain), each(options.log_scale), each(options.chatter)
        self.lacks = [part for part in options.log_without.split(",") if part]
        self.waiting = collections.deque(maxlen=1 + round(options.log_torque_delay * rate_hz))

    def deliver(self, commanded):
        """Returns the torque sent to the drives, and the delivered torque."""
        sent = exchanged(commanded, self.options.swap_command)
        second = int(self.rate_hz)
        if self.samples % second < self.options.chatter_share * second:
            sent = sent + self.chatter * (1.0 if self.samples % 2 else -1.0)
        self.samples += 1
        clipped = np.clip(sent, -self.limit, self.limit)
        return (sent if self.options.log_command else clipped), self.gain * clipped

    def logged(self, sent, gravity, friction):
        """Returns the logged torque; `gravity` and `friction` return the current true torques."""
        torque = sent
        if "gravity" in self.lacks:
            torque = torque - gravity()
        if "friction" in self.lacks:
            torque = torque - friction()
        torque = self.scale * exchanged(torque, self.options.log_swap)
        self.waiting.append(torque)
        return self.waiting[0]


class Regression:
    """Regression of logged on commanded torque for each joint: the reference for a check of the log."""

    def __init__(self):
        self.commanded, self.logged = [], []

    def add(self, commanded, logged):
        self.commanded.append(commanded)
        self.logged.append(logged)

    def result(self):
        """Slope, intercept (Nm, N) and correlation of each joint; null for a joint with constant torque."""
        x, y = np.array(self.commanded), np.array(self.logged)
        if len(x) < 3:
            return None
        dx, dy = x - x.mean(axis=0), y - y.mean(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (dx * dy).sum(axis=0) / (dx * dx).sum(axis=0)
            correlation = (dx * dy).sum(axis=0) / np.sqrt((dx * dx).sum(axis=0) * (dy * dy).sum(axis=0))
        finite = lambda values: [round(float(value), 6) if np.isfinite(value) else None for value in values]
        return {"slope": finite(slope), "intercept": finite(y.mean(axis=0) - slope * x.mean(axis=0)), "correlation": finite(correlation),
                "rms_difference": finite(np.sqrt(((y - x) ** 2).mean(axis=0)))}
