"""Traps: other columns that look like the wanted ones, and clocks that mislead."""
import json
import numpy as np
import pandas as pd
from arms import rigid
from corpus import case
from cases_text import both, table, D, text
from cases_binary import joint_state, stamps, ros2


def frame(l, spec, t="t"):
    d0 = {t: l.t} if t else {}
    for k, x in spec:
        x = np.asarray(x)
        if x.ndim == 1: d0[k] = x
        else:
            for i in range(x.shape[1]): d0[k.format(i, i + 1)] = x[:, i]
    return pd.DataFrame(d0)


def rnd(l, n, s=1.0, seed=0):
    r = np.random.default_rng(seed); k = np.cumsum(r.normal(size=(len(l.t), n)), 0); return s * k / np.abs(k).max(0)


def lag(l, x, tau_s=0.05):
    """causal first-order low-pass"""
    from scipy.signal import lfilter
    a = np.exp(-1 / (tau_s * 125.0)); return lfilter([1 - a], [1, -a], x - x[0], axis=0) + x[0]


@case("ur5")
def json_names_t(d, a, b, arm):
    """JSON lines with t, name list, alphabetical position and effort lists"""
    order = np.argsort(a.names)
    def f(l, p):
        text(p, "".join(json.dumps({"t": x, "name": [l.names[j] for j in order], "position": list(l.q[i, order]), "effort": list(l.tau[i, order])}) + "\n" for i, x in enumerate(np.round(l.t, 6))))
    return both(d, a, b, f, "jsonl")


@case("baxter")
def json_names_baxter(d, a, b, arm):
    """JSON lines with t, name list, alphabetical (e0 e1 s0 s1 w0..), 7 joints, robot with 19 joints"""
    names = ["left_e0", "left_e1", "left_s0", "left_s1", "left_w0", "left_w1", "left_w2"]; ix = [a.names.index(n) for n in names]
    def f(l, p):
        text(p, "".join(json.dumps({"t": x, "name": names, "position": list(l.q[i, ix]), "effort": list(l.tau[i, ix])}) + "\n" for i, x in enumerate(np.round(l.t, 6))))
    return both(d, a, b, f, "jsonl")


@case("panda", expect="unsure", say="left|right|UNSURE")
def two_arms(d, a, b, arm):
    """two arms in one table, left_ and right_; the URDF is one arm; right one is still (tau = gravity)"""
    def f(l, p):
        qr = l.q[::-1] * 0.7; tr = rigid(arm.model, qr, 0 * qr, 0 * qr)
        frame(l, [("left_q{1}", l.q), ("right_q{1}", qr), ("left_tau{1}", l.tau), ("right_tau{1}", tr)]).to_csv(p, index=False)
    return both(d, a, b, f)


@case("panda", expect="unsure")
def two_arms_mixed_order(d, a, b, arm):
    """two arms: right first for positions, left first for torques"""
    def f(l, p):
        qr = l.q[::-1] * 0.7; tr = rigid(arm.model, qr, 0 * qr, 0 * qr)
        frame(l, [("arm1_pos_{1}", qr), ("arm2_pos_{1}", l.q), ("arm2_torque_{1}", l.tau), ("arm1_torque_{1}", tr)]).to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa")
def filtered_and_model(d, a, b, arm):
    """tau_model, tau_gravity, tau_filtered next to tau; q_filtered next to q"""
    def f(l, p):
        g = rigid(arm.model, l.q, 0 * l.q, 0 * l.q)
        frame(l, [("tau_model_{1}", g * 1.1), ("tau_gravity_{1}", g), ("tau_{1}", l.tau), ("q_filtered_{1}", lag(l, l.q)), ("q_{1}", l.q), ("tau_filtered_{1}", lag(l, l.tau))]).to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa")
def ext_torque_first(d, a, b, arm):
    """external torques before measured ones: tauExt, tauMsr; qCmd, qMsr"""
    def f(l, p):
        frame(l, [("qCmd{1}", np.roll(l.q, -5, 0)), ("tauExt{1}", rnd(l, 7)), ("tauCmd{1}", l.tau * 0.9), ("qMsr{1}", l.q), ("tauMsr{1}", l.tau)], "time").to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5", expect="unsure", say="UNSURE.*(current|A)")
def rtde_full(d, a, b, arm):
    """RTDE default-like recipe: TCP pose, speed, force, tool accelerometer, joint voltage, digital bits, currents"""
    def f(l, p):
        frame(l, [("target_q_{0}", np.roll(l.q, -2, 0)), ("target_moment_{0}", l.tau), ("actual_q_{0}", l.q), ("actual_qd_{0}", l.dq), ("actual_current_{0}", l.tau / [13, 13, 12, 11, 11, 11]), ("joint_control_output_{0}", l.tau / 12), ("actual_TCP_pose_{0}", l.q * 0.3), ("actual_TCP_speed_{0}", l.dq * 0.2), ("actual_TCP_force_{0}", rnd(l, 6, 10)), ("joint_temperatures_{0}", 30 + rnd(l, 6)), ("actual_joint_voltage_{0}", 48 + rnd(l, 6)), ("robot_status_bits", np.full(len(l.t), 3)), ("actual_digital_input_bits", np.zeros(len(l.t)))], "timestamp").to_csv(p, index=False, sep=" ", float_format="%.6f")
    return both(d, a, b, f)


@case("xarm7")
def cartesian_and_joint(d, a, b, arm):
    """x..yaw pose, wrench fx..tz, j1..j7, tau1..tau7"""
    def f(l, p):
        frame(l, [(k, rnd(l, 1, 0.3, i)[:, 0]) for i, k in enumerate(("x", "y", "z", "roll", "pitch", "yaw", "fx", "fy", "fz", "tx", "ty", "tz"))] + [("j{1}", l.q), ("tau{1}", l.tau)]).to_csv(p, index=False)
    return both(d, a, b, f)


@case("tx40", expect="unsure", say="motor|gear|UNSURE")
def motor_and_joint(d, a, b, arm):
    """motor_pos (gear 100), joint_pos, motor_torque (1/100), joint velocity"""
    def f(l, p):
        frame(l, [("motor_pos_{1}", l.q * 100), ("motor_torque_{1}", l.tau / 100), ("joint_pos_{1}", l.q), ("joint_vel_{1}", l.dq)], "time").to_csv(p, index=False)
    return both(d, a, b, f)


@case("panda", rate=50, seconds=40, say="repeat|held|keep_every")
def held_values_1khz(d, a, b, arm):
    """logger at 1 kHz, robot state at 50 Hz: each row repeats 20 times"""
    def f(l, p):
        x = table(l).values[:600]; y = np.repeat(x, 20, 0); y[:, 0] = np.arange(len(y)) / 1000
        pd.DataFrame(y, columns=table(l).columns).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def us_12_hour_clock(d, a, b, arm):
    """'3/5/2024 12:59:55.004 PM' over the hour"""
    def f(l, p):
        t = table(l, "q{}", None, "tau{}", t="Time"); t0 = pd.Timestamp("2024-03-05 12:59:55"); t["Time"] = [f"{x.month}/{x.day}/{x.year} {x.strftime('%I:%M:%S.%f')[:-3]} {x.strftime('%p')}" for x in (t0 + pd.to_timedelta(l.t, unit="s"))]; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def time_of_day_midnight(d, a, b, arm):
    """'23:59:55.004' over midnight"""
    def f(l, p):
        t = table(l, "q{}", None, "tau{}", t="clock"); t0 = pd.Timestamp("2024-03-05 23:59:55"); t["clock"] = [x.strftime("%H:%M:%S.%f")[:-3] for x in (t0 + pd.to_timedelta(l.t, unit="s"))]; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa", expect="unsure", say="rate|time|UNSURE")
def matlab_datenum(d, a, b, arm):
    """MAT v5 with t = datenum (days)"""
    from scipy.io import savemat
    return both(d, a, b, lambda l, p: savemat(p, {"t": 739316.5 + l.t / 86400, "q": l.q, "tau": l.tau}), "mat")


@case("iiwa", expect="unsure", say="rate|time|UNSURE")
def excel_serial(d, a, b, arm):
    """Excel serial date in 'Time'"""
    def f(l, p):
        t = table(l, t="Time"); t["Time"] = 45356.5 + l.t / 86400; t.to_csv(p, index=False, float_format="%.11f")
    return both(d, a, b, f)


@case("ur10")
def counter_wraps(d, a, b, arm):
    """uint32 microseconds that wrap in the log"""
    def f(l, p):
        t = table(l, t="timestamp_us"); t["timestamp_us"] = (2**32 - 5_000_000 + np.round(l.t * 1e6).astype(np.int64)) % 2**32; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10", expect="unsure", say="rate|stamp|UNSURE")
def whole_seconds(d, a, b, arm):
    """'2024-03-05 12:00:00' whole seconds at 125 Hz"""
    def f(l, p):
        t = table(l, t="timestamp"); t["timestamp"] = (pd.Timestamp("2024-03-05 12:00:00") + pd.to_timedelta(np.floor(l.t), unit="s")).strftime("%Y-%m-%d %H:%M:%S"); t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10", expect="unsure", say="rate|stamp|UNSURE")
def float32_epoch(d, a, b, arm):
    """epoch seconds as float32: 128 s resolution, Parquet"""
    def f(l, p):
        t = table(l, t="timestamp"); t["timestamp"] = (1718000000 + l.t).astype(np.float32); t.to_parquet(p)
    return both(d, a, b, f, "parquet")


@case("ur10", expect="unsure", say="UNSURE|refuse|not a number")
def german_thousands(d, a, b, arm):
    """torque in mNm as '-1.234,5' (thousands dot, decimal comma), semicolon"""
    g = lambda v: f"{v:,.1f}".replace(",", "_").replace(".", ",").replace("_", ".")
    def f(l, p):
        t = table(l, "q{}", None, "tau{}_mNm"); s = [";".join(t.columns)]
        for i in range(len(t)): s.append(";".join([f"{v:.6f}".replace(".", ",") for v in t.values[i, :7]] + [g(v * 1000) for v in t.values[i, 7:]]))
        text(p, "\n".join(s) + "\n")
    return both(d, a, b, f)


@case("panda")
def rosbag2_panda_fingers(d, a, b, arm):
    """rosbag2: arm and fingers in one JointState, fingers still"""
    from arms import Log
    for l, n in ((a, "run_a"), (b, "run_b")):
        z = np.zeros((len(l.t), 2)); ros2(d + n, Log(l.t, np.c_[z + 0.03, l.q], np.c_[z, l.dq], l.ddq, np.c_[z, l.tau], ["panda_finger_joint1", "panda_finger_joint2", *l.names]), "MCAP")
    return ["run_a", "run_b"]


@case("panda")
def rosbag2_desired_too(d, a, b, arm):
    """/joint_states and /joint_states_desired: the desired one is first in the file"""
    from rosbags.rosbag2 import Writer, StoragePlugin
    from rosbags.typesys import Stores, get_typestore
    ts = get_typestore(Stores.ROS2_HUMBLE)
    for l, n in ((a, "run_a"), (b, "run_b")):
        with Writer(d + n, version=8, storage_plugin=StoragePlugin.MCAP) as w:
            c = [w.add_connection(k, "sensor_msgs/msg/JointState", typestore=ts) for k in ("/franka_state_controller/joint_states_desired", "/franka_state_controller/joint_states")]
            g = rigid(arm.model, l.q, 0 * l.q, 0 * l.q)
            for i, st in enumerate(stamps(l)):
                ns = st[0] * 10**9 + st[1]
                w.write(c[0], ns, ts.serialize_cdr(joint_state(ts, i, st, l.names, np.roll(l.q, -4, 0)[i], l.dq[i], (l.tau - g)[i]), "sensor_msgs/msg/JointState"))
                w.write(c[1], ns + 1000, ts.serialize_cdr(joint_state(ts, i, st, l.names, l.q[i], l.dq[i], l.tau[i]), "sensor_msgs/msg/JointState"))
    return ["run_a", "run_b"]


@case("kinova")
def rosbag2_no_stamp(d, a, b, arm):
    """driver leaves header.stamp zero: only log_time"""
    from rosbags.rosbag2 import Writer, StoragePlugin
    from rosbags.typesys import Stores, get_typestore
    ts = get_typestore(Stores.ROS2_HUMBLE)
    for l, n in ((a, "run_a"), (b, "run_b")):
        with Writer(d + n, version=8, storage_plugin=StoragePlugin.SQLITE3) as w:
            c = w.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=ts)
            for i, st in enumerate(stamps(l)): w.write(c, st[0] * 10**9 + st[1], ts.serialize_cdr(joint_state(ts, i, (0, 0), l.names, l.q[i], l.dq[i], l.tau[i]), "sensor_msgs/msg/JointState"))
    return ["run_a", "run_b"]


@case("xarm7")
def joint_prefix(d, a, b, arm):
    """log names have a prefix: lab_joint1.pos .., URDF joint1"""
    def f(l, p):
        frame(l, [("lab/joint{1}/pos", l.q), ("lab/joint{1}/vel", l.dq), ("lab/joint{1}/torque", l.tau)], "time").to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5")
def abbreviations_alphabetical(d, a, b, arm):
    """columns by short names in alphabetical order: elbow_q, lift_q, pan_q, w1_q.."""
    s = {"elbow_joint": "elbow", "shoulder_lift_joint": "lift", "shoulder_pan_joint": "pan", "wrist_1_joint": "w1", "wrist_2_joint": "w2", "wrist_3_joint": "w3"}
    def f(l, p):
        o = np.argsort(l.names); d0 = {"t": l.t}
        for j in o: d0["q_" + s[l.names[j]]] = l.q[:, j]
        for j in o: d0["tau_" + s[l.names[j]]] = l.tau[:, j]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5")
def descending_columns(d, a, b, arm):
    """columns q6..q1, tau6..tau1"""
    def f(l, p):
        d0 = {"t": l.t}
        for i in reversed(range(6)): d0[f"q{i+1}"] = l.q[:, i]
        for i in reversed(range(6)): d0[f"tau{i+1}"] = l.tau[:, i]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5")
def a_b_differ_in_columns(d, a, b, arm):
    """second log has its columns in another order"""
    def f(l, p, flip):
        t = table(l, "q{}", "dq{}", "tau{}"); c = list(t.columns); (t[[c[0]] + c[:0:-1]] if flip else t).to_csv(p, index=False)
    f(a, d + "run_a.csv", False); f(b, d + "run_b.csv", True)
    return ["run_a.csv", "run_b.csv"]


@case("ur5", expect="unsure")
def a_rad_b_deg(d, a, b, arm):
    """second log is in degrees (same column names)"""
    table(a).to_csv(d + "run_a.csv", index=False); table(b, scale=D).to_csv(d + "run_b.csv", index=False)
    return ["run_a.csv", "run_b.csv"]


@case("z1")
def seven_columns_gripper(d, a, b, arm):
    """Z1: q0..q6 with gripper still at 0, all joints of the URDF"""
    def f(l, p):
        z = np.zeros((len(l.t), 1)); frame(l, [("q_{0}", np.c_[l.q, z - 0.3]), ("tauEst_{0}", np.c_[l.tau, z])]).to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa")
def command_equals_name_torque(d, a, b, arm):
    """'torque' is commanded and 'measured_torque' also there; 'position' and 'commanded_position'"""
    def f(l, p):
        frame(l, [("joint_{1}_commanded_position", np.roll(l.q, -5, 0)), ("joint_{1}_position", l.q), ("joint_{1}_commanded_torque", l.tau * 0.8), ("joint_{1}_measured_torque", l.tau), ("joint_{1}_external_torque", rnd(l, 7))], "time_ns").assign(time_ns=lambda x: (x.time_ns * 1e9).round().astype("int64")).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def dead_time_start(d, a, b, arm):
    """first 3 s all zero (logger started before the robot), q = 0 then jumps to the motion"""
    def f(l, p):
        t = table(l); t.iloc[:375, 1:] = 0.0; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("panda", rate=1000, seconds=12)
def libfranka_1khz(d, a, b, arm):
    """libfranka-like, 1 kHz, time in s as 'time [s]', lost packets (2 % of rows missing)"""
    def f(l, p):
        t = frame(l, [("q[{0}] [rad]", l.q), ("dq[{0}] [rad/s]", l.dq), ("tau_J[{0}] [Nm]", l.tau)], "time [s]"); k = np.random.default_rng(8).uniform(size=len(t)) > 0.02; k[0] = True; t[k].to_csv(p, index=False)
    return both(d, a, b, f)


def named_lists(kind):
    def f(d, a, b, arm):
        order = np.argsort(a.names)
        def g(l, p):
            st = stamps(l); nm = [l.names[j] for j in order]
            if kind == "rostopic":
                ns = [s * 10**9 + n for s, n in st]; d0 = {"%time": ns, "field.header.seq": range(len(ns)), "field.header.stamp": ns, "field.header.frame_id": ""}
                for k, x in (("name", None), ("position", l.q), ("velocity", l.dq), ("effort", l.tau)):
                    for i, j in enumerate(order): d0[f"field.{k}{i}"] = l.names[j] if x is None else x[:, j]
                pd.DataFrame(d0).to_csv(p, index=False)
            elif kind == "bagpy":
                pd.DataFrame([[s + n / 1e9, str(nm), str(l.q[i, order].tolist()), str(l.dq[i, order].tolist()), str(l.tau[i, order].tolist())] for i, (s, n) in enumerate(st)], columns=["Time", "name", "position", "velocity", "effort"]).to_csv(p, index=False)
            else:
                text(p, "".join(json.dumps({"t": x, "name": nm, "position": l.q[i, order].tolist(), "velocity": l.dq[i, order].tolist(), "effort": l.tau[i, order].tolist()}) + "\n" for i, x in enumerate(np.round(l.t, 6))))
        return both(d, a, b, g, "jsonl" if kind == "json" else "csv")
    return f


for robot in ("fetchlike", "wristlike"):
    for kind in ("rostopic", "bagpy", "json"):
        f = named_lists(kind); f.__name__ = f"names_{kind}_{robot}"; f.__doc__ = f"{kind}: joint names as text, alphabetical order that is not that of the chain"
        case(robot)(f)


@case("ur10")
def missing_values_third(d, a, b, arm):
    """torque empty in every third row"""
    def f(l, p):
        t = table(l)
        for i in range(l.n): t.loc[np.arange(len(t)) % 3 == 2, f"tau{i+1}"] = np.nan
        t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10", seconds=60, expect="problem", say="wrap|unwrap")
def wrapped_60s(d, a, b, arm):
    """angles 0..360 degrees, 60 s"""
    def f(l, p):
        t = table(l, "pos_{}", None, "torque_{}", scale=D)
        for i in range(l.n): t[f"pos_{i+1}"] %= 360
        t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("panda", expect="unsure", say="UNSURE.*lock|not in the log")
def missing_joint_panda5(d, a, b, arm):
    """panda_joint5 is not in the log although it moves"""
    def f(l, p):
        t = table(l, "{}_position", None, "{}_effort", names=l.names); t[[c for c in t if "joint5" not in c]].to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa", expect="unsure", say="UNSURE")
def velocity_only(d, a, b, arm):
    """velocities and torques, no positions"""
    return both(d, a, b, lambda l, p: table(l, None, "dq{}", "tau{}").to_csv(p, index=False))
