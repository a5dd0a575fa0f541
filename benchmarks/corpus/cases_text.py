"""Text dialects of corpus.py."""
import csv, datetime as dt, gzip, io, json, os, zipfile, tarfile
import numpy as np
import pandas as pd
from corpus import case

D = 180 / np.pi
PRISMATIC = {"scara": [2]}


def table(l, q="q{}", dq="dq{}", tau="tau{}", first=1, t="t", names=None, scale=1.0):
    d = {t: l.t} if t else {}
    ids = names or range(first, first + l.n)
    for pattern, x in ((q, l.q * scale), (dq, l.dq * scale), (tau, l.tau)):
        if pattern:
            for i, k in enumerate(ids):
                d[pattern.format(k)] = x[:, i]
    return pd.DataFrame(d)


def both(d, a, b, f, ext="csv"):
    for l, n in ((a, "run_a"), (b, "run_b")):
        f(l, f"{d}{n}.{ext}")
    return [f"run_a.{ext}", f"run_b.{ext}"]


def text(path, s, enc="utf-8"):
    open(path, "w", encoding=enc, newline="").write(s)


@case("ur10")
def german_excel(d, a, b, arm):
    """semicolon, decimal comma, German headers, degrees, Latin-1 degree sign"""
    def f(l, p):
        t = table(l, "Achse{} Position [°]", "Achse{} Geschwindigkeit [°/s]", "Achse{} Moment [Nm]", t="Zeit [s]", scale=D)
        t.to_csv(p, sep=";", decimal=",", index=False, encoding="latin-1")
    return both(d, a, b, f)


@case("panda")
def units_row_tabs(d, a, b, arm):
    """tabs, names row, units row"""
    def f(l, p):
        t = table(l, "pos{}", "vel{}", "trq{}", t="time")
        u = "\t".join(["ms"] + ["deg"] * 7 + ["deg/s"] * 7 + ["Nm"] * 7)
        t.iloc[:, 0] *= 1000
        t.iloc[:, 1:15] *= D
        s = t.to_csv(sep="\t", index=False).split("\n", 1)
        text(p, s[0] + "\n" + u + "\n" + s[1])
    return both(d, a, b, f, "txt")


@case("iiwa")
def savetxt_header(d, a, b, arm):
    """np.savetxt with '# ' header, blanks"""
    def f(l, p):
        np.savetxt(p, np.c_[l.t, l.q, l.dq, l.tau], header="iiwa run, FRI\ntime " + " ".join([f"q_{i}" for i in range(7)] + [f"qdot_{i}" for i in range(7)] + [f"tau_{i}" for i in range(7)]), fmt="%.6f")
    return both(d, a, b, f, "dat")


@case("xarm7")
def quoted_text_bool(d, a, b, arm):
    """quoted text and boolean columns between the numbers"""
    def f(l, p):
        t = table(l, "joint{} position", "joint{} velocity", "joint{} effort", t="stamp")
        t.insert(1, "state", ["moving, auto"] * len(t)); t.insert(2, "estop", [False] * len(t)); t["mode"] = "SERVO"
        t.to_csv(p, index=False, quoting=csv.QUOTE_NONNUMERIC)
    return both(d, a, b, f)


@case("kinova")
def iso_time(d, a, b, arm):
    """ISO 8601 with zone, degrees by header names"""
    def f(l, p):
        t = table(l, "position_deg_{}", None, "torque_nm_{}", t="ts", scale=D)
        t0 = pd.Timestamp("2025-03-05T23:59:52.000Z")
        t["ts"] = [(t0 + pd.Timedelta(seconds=x)).isoformat() for x in l.t]
        t.to_csv(p, index=False)
    return both(d, a, b, f)


def epoch(mult, name):
    def f(d, a, b, arm):
        def g(l, p):
            t = table(l, "q_{}", "qd_{}", "torque_{}", t=name, first=0)
            t[name] = [int(1718000000 * mult) + int(round(x * mult)) for x in l.t]
            t.to_csv(p, index=False)
        return both(d, a, b, g)
    return f


for unit, mult in (("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
    g = epoch(mult, "timestamp"); g.__name__ = f"epoch_{unit}_unnamed"; g.__doc__ = f"epoch {unit} as integers, column 'timestamp'"
    case("ur5")(g)


@case("ur5")
def german_datetime(d, a, b, arm):
    """05.03.2024 12:00:00,004 with semicolon and decimal comma"""
    def f(l, p):
        t = table(l, "q{}", None, "M{}", t="Datum")
        t0 = pd.Timestamp("2024-03-05 12:00:00")
        t["Datum"] = [(t0 + pd.Timedelta(seconds=round(x, 3))).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3] for x in l.t]
        t.to_csv(p, index=False, sep=";", decimal=",")
    return both(d, a, b, f)


@case("ur5")
def rostopic_echo_p(d, a, b, arm):
    """ROS 1 'rostopic echo -p': names in text columns, alphabetical joints"""
    order = np.argsort(a.names)
    def f(l, p):
        d0 = {"%time": [1718000000_000000000 + int(round(x * 1e9)) for x in l.t], "field.header.seq": range(len(l.t)),
              "field.header.stamp": [1718000000_000000000 + int(round(x * 1e9)) for x in l.t], "field.header.frame_id": [""] * len(l.t)}
        for i, j in enumerate(order): d0[f"field.name{i}"] = [l.names[j]] * len(l.t)
        for i, j in enumerate(order): d0[f"field.position{i}"] = l.q[:, j]
        for i, j in enumerate(order): d0[f"field.velocity{i}"] = l.dq[:, j]
        for i, j in enumerate(order): d0[f"field.effort{i}"] = l.tau[:, j]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5", say="name|order|header|UNSURE", expect="unsure")
def ros2_echo_csv(d, a, b, arm):
    """'ros2 topic echo --csv': headerless sec,nanosec,frame,names..,position..,velocity..,effort.., alphabetical joints"""
    order = np.argsort(a.names)
    def f(l, p):
        d0 = pd.DataFrame([[1718000000 + int(x), int(round((x % 1) * 1e9)), "base_link", *[l.names[j] for j in order], *l.q[i, order], *l.dq[i, order], *l.tau[i, order]] for i, x in enumerate(np.round(l.t, 6))])
        d0.to_csv(p, index=False, header=False)
    return both(d, a, b, f)


@case("ur5")
def bagpy_lists(d, a, b, arm):
    """bagpy: name list and tuples of position, velocity, effort in cells, alphabetical joints, secs and nsecs"""
    order = np.argsort(a.names)
    def f(l, p):
        rows = [[1718000000 + x, i, 1718000000 + int(x), int(round((x % 1) * 1e9)), "", str([l.names[j] for j in order]), str(tuple(map(float, l.q[i, order]))), str(tuple(map(float, l.dq[i, order]))), str(tuple(map(float, l.tau[i, order])))] for i, x in enumerate(np.round(l.t, 6))]
        pd.DataFrame(rows, columns=["Time", "header.seq", "header.stamp.secs", "header.stamp.nsecs", "header.frame_id", "name", "position", "velocity", "effort"]).to_csv(p, index=False)
    return both(d, a, b, f)


@case("panda")
def plotjuggler(d, a, b, arm):
    """PlotJuggler export: __time, /joint_states/NAME/position.., alphabetical mix, fingers too"""
    def f(l, p):
        d0 = {"__time": 1718000000 + l.t, "/joint_states/header/seq": np.arange(len(l.t))}
        for q, x in (("effort", l.tau), ("position", l.q), ("velocity", l.dq)):
            for j, n in sorted(enumerate(l.names), key=lambda z: z[1]): d0[f"/joint_states/{n}/{q}"] = x[:, j]
            for n in ("panda_finger_joint1", "panda_finger_joint2"): d0[f"/joint_states/{n}/{q}"] = 0.02 if q == "position" else 0.0
        pd.DataFrame(d0).to_csv(p, index=False, float_format="%.9f")
    return both(d, a, b, f)


@case("iiwa")
def numpy_str_cells(d, a, b, arm):
    """cells '[0.1 0.2 ...]' as str(numpy array)"""
    def f(l, p):
        s = lambda r: np.array2string(r, max_line_width=10000)
        pd.DataFrame({"time": l.t, "q": [s(r) for r in l.q], "tau": [s(r) for r in l.tau]}).to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa", expect="unsure")
def headerless_15(d, a, b, arm):
    """headerless t,q1..7,tau1..7"""
    return both(d, a, b, lambda l, p: np.savetxt(p, np.c_[l.t, l.q, l.tau], delimiter=",", fmt="%.6f"))


@case("panda", expect="unsure", args=["--rate-hz", "125"])
def headerless_28_no_time(d, a, b, arm):
    """headerless q,dq,ddq,tau without time"""
    return both(d, a, b, lambda l, p: np.savetxt(p, np.c_[l.q, l.dq, l.ddq, l.tau], delimiter=" ", fmt="%.6f"), "txt")


@case("ur10", expect="unsure", args=["--rate-hz", "125"])
def headerless_tau_first(d, a, b, arm):
    """headerless tau,q,dq: unusual order"""
    return both(d, a, b, lambda l, p: np.savetxt(p, np.c_[l.tau, l.q, l.dq], delimiter=",", fmt="%.6f"))


@case("iiwa")
def file_per_joint(d, a, b, arm):
    """one CSV per joint with time,position,velocity,torque; all files as logs"""
    for j in range(a.n):
        pd.DataFrame({"time": a.t, "position": a.q[:, j], "velocity": a.dq[:, j], "torque": a.tau[:, j]}).to_csv(f"{d}joint{j+1}.csv", index=False)
    return [f"joint{j+1}.csv" for j in range(a.n)]


@case("ur5", args=["--rate-hz", "125"])
def file_per_quantity(d, a, b, arm):
    """q.csv, dq.csv, tau.csv headerless"""
    for n, x in (("q", a.q), ("dq", a.dq), ("tau", a.tau)):
        np.savetxt(f"{d}{n}.csv", x, delimiter=",", fmt="%.6f")
    return ["q.csv", "dq.csv", "tau.csv"]


@case("z1")
def on_its_side(d, a, b, arm):
    """table on its side: one line per quantity"""
    def f(l, p):
        t = table(l)
        text(p, "\n".join(",".join([k] + [f"{v:.6f}" for v in t[k]]) for k in t) + "\n")
    return both(d, a, b, f)


@case("ur10", rate=150)
def torque_every_third(d, a, b, arm):
    """torque only in every third row (slower sensor), else empty"""
    def f(l, p):
        t = table(l)
        for i in range(l.n): t.loc[np.arange(len(t)) % 3 != 0, f"tau{i+1}"] = np.nan
        t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def shuffled_named(d, a, b, arm):
    """columns NAME_pos, NAME_vel, NAME_eff in random order"""
    def f(l, p):
        t = table(l, "{}_pos", "{}_vel", "{}_eff", names=l.names)
        cols = list(t.columns[1:]); np.random.default_rng(5).shuffle(cols)
        t[["t"] + cols].to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10", expect="unsure", say="wrist_2")
def missing_joint(d, a, b, arm):
    """wrist_2_joint is not in the log"""
    def f(l, p):
        t = table(l, "{}.position", "{}.velocity", "{}.effort", names=l.names)
        t[[c for c in t if "wrist_2" not in c]].to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5")
def per_joint_groups(d, a, b, arm):
    """J1_Pos,J1_Vel,J1_Trq,J2_Pos,.. degrees, UTF-8 mark, CRLF"""
    def f(l, p):
        d0 = {"Time[ms]": np.round(l.t * 1000, 3)}
        for i in range(l.n):
            d0[f"J{i+1}_Pos[deg]"] = l.q[:, i] * D; d0[f"J{i+1}_Vel[deg/s]"] = l.dq[:, i] * D; d0[f"J{i+1}_Trq[Nm]"] = l.tau[:, i]
        pd.DataFrame(d0).to_csv(p, index=False, encoding="utf-8-sig", lineterminator="\r\n")
    return both(d, a, b, f)


@case("tx40", expect="right")
def twincat_scope(d, a, b, arm):
    """TwinCAT Scope export: preamble, a time column per channel"""
    def f(l, p):
        ch = [("ActPos", l.q * D), ("ActTorque", l.tau)]
        names, cols = [], []
        for n, x in ch:
            for i in range(l.n):
                names += ["Name", f"Axis{i+1}.{n}"]; cols += [np.round(l.t * 1000, 3), x[:, i]]
        s = "Name\tScope Project\nFile\tC:\\scope.svdx\nStarttime of export\t132000000\n\n" + "\t".join(names) + "\n" + "\t".join(["SampleTime[ms]", "8"] * (len(names) // 2)) + "\n\n"
        s += "\n".join("\t".join(f"{v:.6f}" for v in r) for r in np.array(cols).T) + "\n"
        text(p, s)
    return both(d, a, b, f)


@case("z1")
def labview_lvm(d, a, b, arm):
    """LabVIEW .lvm with its header"""
    def f(l, p):
        h = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\nDate\t2024/03/05\nTime\t12:00:00.0\n***End_of_Header***\t\n\t\nChannels\t18\t\nSamples\t" + "\t".join([str(len(l.t))] * 18) + "\t\nY_Unit_Label\t" + "\t".join(["rad"] * 6 + ["rad/s"] * 6 + ["Nm"] * 6) + "\t\n***End_of_Header***\t\n"
        t = table(l); names = "X_Value\t" + "\t".join(t.columns[1:]) + "\tComment\n"
        text(p, h + names + t.to_csv(sep="\t", index=False, header=False, float_format="%.6f"))
    return both(d, a, b, f, "lvm")


@case("iiwa")
def writetimetable(d, a, b, arm):
    """MATLAB writetimetable: 'Time' as '0.008 sec', matrices as q_1.."""
    def f(l, p):
        t = table(l, "q_{}", "qd_{}", "tau_{}", t="Time"); t["Time"] = [f"{x:g} sec" for x in l.t]; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("xarm7")
def pandas_index(d, a, b, arm):
    """pandas to_csv with its index column"""
    return both(d, a, b, lambda l, p: table(l, "joint_pos_{}", "joint_vel_{}", "joint_torque_{}", t="time").to_csv(p))


@case("panda")
def pandas_multiindex(d, a, b, arm):
    """two header rows: quantity, joint"""
    def f(l, p):
        cols = pd.MultiIndex.from_tuples([("time", "s")] + [(k, n) for k in ("position", "velocity", "effort") for n in l.names])
        pd.DataFrame(np.c_[l.t, l.q, l.dq, l.tau], columns=cols).to_csv(p, index=False)
    return both(d, a, b, f)


@case("panda")
def franka_many(d, a, b, arm):
    """franka: q, q_d, dq, dq_d, tau_J, tau_J_d (no gravity), tau_ext_hat_filtered, dtau_J"""
    from arms import rigid
    def f(l, p):
        g = rigid(arm.model, l.q, 0 * l.q, 0 * l.q); r = np.random.default_rng(9)
        d0 = {"time": np.round(l.t * 1000).astype(int), "control_command_success_rate": 1.0}
        for k, x in (("q_d", l.q + 1e-3 * np.sin(l.t)[:, None]), ("tau_ext_hat_filtered", r.normal(size=l.q.shape)), ("tau_J_d", l.tau - g), ("q", l.q), ("dq_d", l.dq), ("dq", l.dq), ("dtau_J", np.gradient(l.tau, axis=0)), ("tau_J", l.tau), ("theta", l.q + l.tau / 1e4)):
            for i in range(7): d0[f"state.{k}[{i}]"] = x[:, i]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5", expect="unsure", say="%|rated|permille|scale")
def cia402(d, a, b, arm):
    """EtherCAT: position counts, torque in permille of rated torque"""
    def f(l, p):
        d0 = {"time_us": np.round(l.t * 1e6).astype(np.int64)}
        for i in range(l.n): d0[f"axis{i+1}_6064_position_actual"] = np.round(l.q[:, i] * 2**20 / 2 / np.pi * 100).astype(np.int64)
        for i in range(l.n): d0[f"axis{i+1}_6077_torque_actual"] = np.round(l.tau[:, i] / [56, 56, 28, 12, 12, 12][i] * 1000).astype(int)
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5", expect="unsure", say="UNSURE.*(scale|current)")
def ur_rtde(d, a, b, arm):
    """RTDE: blanks, actual_*, target_*, currents"""
    def f(l, p):
        r = np.random.default_rng(2); d0 = {"timestamp": 1203.2 + l.t}
        for k, x in (("target_q", l.q), ("target_qd", l.dq), ("target_current", l.tau / 12), ("target_moment", l.tau * 1.1), ("actual_q", l.q), ("actual_qd", l.dq), ("actual_current", l.tau / [13, 13, 12, 11, 11, 11])):
            for i in range(6): d0[f"{k}_{i}"] = x[:, i]
        pd.DataFrame(d0).to_csv(p, index=False, sep=" ", float_format="%.6f")
    return both(d, a, b, f)


@case("ur10", expect="right")
def time_in_ms_named_t(d, a, b, arm):
    """column 't' counts ms: 0, 8, 16"""
    def f(l, p):
        t = table(l); t["t"] = np.round(l.t * 1000).astype(int); t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10", expect="unsure", say="rate")
def sample_counter(d, a, b, arm):
    """column 'sample' 0,1,2.. and no time"""
    def f(l, p):
        t = table(l, t="sample"); t["sample"] = np.arange(len(t)); t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def utf16_excel(d, a, b, arm):
    """Excel 'Unicode text': UTF-16 LE, tabs, decimal comma"""
    return both(d, a, b, lambda l, p: table(l).to_csv(p, sep="\t", decimal=",", index=False, encoding="utf-16"), "txt")


@case("iiwa")
def fortran_d(d, a, b, arm):
    """Fortran D exponents, fixed width"""
    def f(l, p):
        t = table(l, "q{}", None, "tau{}")
        text(p, "  ".join(t.columns) + "\n" + "\n".join(" ".join(f"{v:16.8E}".replace("E", "D") for v in r) for r in t.values) + "\n")
    return both(d, a, b, f, "out")


@case("baxter")
def dual_arm_log(d, a, b, arm):
    """14 joints of a dual arm robot; the left arm is studied with the full URDF"""
    def f(l, p):
        d0 = {"time": l.t}; r = np.random.default_rng(4)
        names = ["left_s0", "left_s1", "left_e0", "left_e1", "left_w0", "left_w1", "left_w2"]; ix = [l.names.index(n) for n in names]
        for n, j in zip(names, ix): d0[n] = l.q[:, j]
        for n in names: d0["torque_" + n] = l.tau[:, l.names.index(n)]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5")
def jsonl_joint_state(d, a, b, arm):
    """JSON lines with name list, alphabetical"""
    order = np.argsort(a.names)
    def f(l, p):
        text(p, "".join(json.dumps({"header": {"stamp": {"sec": 1718000000 + int(x), "nanosec": int(round((x % 1) * 1e9))}, "frame_id": ""}, "name": [l.names[j] for j in order], "position": list(l.q[i, order]), "velocity": list(l.dq[i, order]), "effort": list(l.tau[i, order])}) + "\n" for i, x in enumerate(np.round(l.t, 6))))
    return both(d, a, b, f, "jsonl")


@case("ur5", expect="refused", say="yaml|csv|bag|record")
def ros2_echo_yaml(d, a, b, arm):
    """'ros2 topic echo' redirected into a file: YAML documents"""
    order = np.argsort(a.names)
    def f(l, p):
        s = []
        for i, x in enumerate(np.round(l.t, 6)):
            s.append(f"header:\n  stamp:\n    sec: {1718000000+int(x)}\n    nanosec: {int(round((x%1)*1e9))}\n  frame_id: base_link\nname:\n" + "".join(f"- {l.names[j]}\n" for j in order) + "position:\n" + "".join(f"- {l.q[i,j]}\n" for j in order) + "velocity:\n" + "".join(f"- {l.dq[i,j]}\n" for j in order) + "effort:\n" + "".join(f"- {l.tau[i,j]}\n" for j in order) + "---\n")
        text(p, "".join(s))
    return both(d, a, b, f, "txt")


@case("ur5")
def header_repeated(d, a, b, arm):
    """header repeated in mid file (logger restarted, appended), truncated last line, trailing commas"""
    def f(l, p):
        h, *rows = table(l).to_csv(index=False).strip().split("\n"); k = len(rows) // 2
        text(p, "\n".join([h + ","] + [r + "," for r in rows[:k]] + [h + ","] + [r + "," for r in rows[k:-1]]) + "\n" + rows[-1][:40])
    return both(d, a, b, f)


@case("ur5", expect="problem", say="wrap|unwrap|jump")
def wrapped(d, a, b, arm):
    """angles wrapped to 0..360 degrees"""
    def f(l, p):
        t = table(l, "pos_{}", None, "torque_{}", scale=D)
        for i in range(l.n): t[f"pos_{i+1}"] %= 360
        t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa", expect="problem", say="sign = -1")
def reversed_torque(d, a, b, arm):
    """FRI sign of torque, names MeasuredTorque"""
    def f(l, p):
        t = table(l, "MeasuredJointPosition_{}", None, "MeasuredTorque_{}", first=0, t="time"); t.iloc[:, 8:] *= -1; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("scara")
def scara_deg_mm(d, a, b, arm):
    """degrees and mm by joint, torque Nm and N"""
    def f(l, p):
        u = ["deg", "deg", "mm", "deg"]; d0 = {"t_ms": np.round(l.t * 1000, 3)}
        for i in range(4): d0[f"J{i+1}_{u[i]}"] = l.q[:, i] * (1000 if i == 2 else D)
        for i in range(4): d0[f"J{i+1}_torque"] = l.tau[:, i]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("scara")
def scara_silent_units(d, a, b, arm):
    """degrees and mm without a unit in the headers"""
    def f(l, p):
        d0 = {"time": l.t}
        for i in range(4): d0[f"q{i+1}"] = l.q[:, i] * (1000 if i == 2 else D)
        for i in range(4): d0[f"tau{i+1}"] = l.tau[:, i]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def degrees_no_unit(d, a, b, arm):
    """degrees without a unit in the headers"""
    return both(d, a, b, lambda l, p: table(l, "joint_{}", "speed_{}", "torque_{}", scale=D).to_csv(p, index=False))


@case("ur10")
def torque_mnm(d, a, b, arm):
    """torque in mNm by header, deg"""
    def f(l, p):
        t = table(l, "q{}(deg)", "dq{}(deg/s)", "tau{}(mNm)", t="Time(s)", scale=D); t.iloc[:, 13:] *= 1000; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10", expect="unsure")
def torque_ncm_header(d, a, b, arm):
    """torque in Ncm by header: not a unit of the program"""
    def f(l, p):
        t = table(l, "q{} [rad]", "dq{} [rad/s]", "tau{} [Ncm]", t="Time [s]"); t.iloc[:, 13:] *= 100; t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def secs_nsecs(d, a, b, arm):
    """two time columns: secs and nsecs"""
    def f(l, p):
        t = table(l, "position_{}", "velocity_{}", "effort_{}", first=0, t="secs"); t["secs"] = [1718000000 + int(x) for x in np.round(l.t, 6)]
        t.insert(1, "nsecs", [int(round((x % 1) * 1e9)) for x in np.round(l.t, 6)]); t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("kinova")
def actuator_header(d, a, b, arm):
    """Kortex-like: actuators_1_position (deg), velocity (deg/s), torque reversed, current, temperature, voltage"""
    def f(l, p):
        d0 = {"frame_id": np.arange(len(l.t)) * 8 % 65536, "timestamp": l.t}
        for i in range(l.n):
            for k, x in (("position", l.q[:, i] * D), ("velocity", l.dq[:, i] * D), ("torque", -l.tau[:, i]), ("current_motor", l.tau[:, i] / 5), ("voltage", 24 + 0 * l.t), ("temperature_motor", 35 + 0.01 * l.t)):
                d0[f"actuators[{i}].{k}"] = x
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur5")
def measured_and_reference(d, a, b, arm):
    """ref_q, act_q, err_q, ff_tau, act_tau; reference first"""
    def f(l, p):
        d0 = {"t": l.t}; r = np.random.default_rng(7)
        for k, x in (("ref_q", np.roll(l.q, -3, 0)), ("err_q", np.roll(l.q, -3, 0) - l.q), ("act_q", l.q), ("ff_tau", l.tau * 0.9), ("act_tau", l.tau), ("cmd_tau", l.tau * 0.97)):
            for i in range(6): d0[f"{k}_{i+1}"] = x[:, i]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("z1")
def chinese_headers(d, a, b, arm):
    """Chinese headers"""
    return both(d, a, b, lambda l, p: table(l, "关节{}位置(rad)", "关节{}速度(rad/s)", "关节{}力矩(Nm)", t="时间(s)").to_csv(p, index=False))


@case("xarm7")
def time_of_day_logger(d, a, b, arm):
    """log lines of Python logging: '2024-03-05 12:00:00,004 INFO q=[..] tau=[..]'"""
    def f(l, p):
        t0 = pd.Timestamp("2024-03-05 12:00:00")
        text(p, "".join(f"{(t0+pd.Timedelta(seconds=x)).strftime('%Y-%m-%d %H:%M:%S,%f')[:-3]} INFO q=[{', '.join(map(str,l.q[i]))}] tau=[{', '.join(map(str,l.tau[i]))}]\n" for i, x in enumerate(l.t)))
    return both(d, a, b, f, "log")


@case("ur10")
def csv_gz(d, a, b, arm):
    """CSV in gzip, semicolon and decimal comma"""
    return both(d, a, b, lambda l, p: table(l).to_csv(p, sep=";", decimal=",", index=False, compression="gzip"), "csv.gz")


@case("ur10")
def csv_zst(d, a, b, arm):
    """CSV in Zstandard"""
    def f(l, p):
        import zstandard
        open(p, "wb").write(zstandard.ZstdCompressor().compress(table(l).to_csv(index=False).encode()))
    return both(d, a, b, f, "csv.zst")


@case("ur10", expect="refused", say="unzip|unpack")
def csv_zip(d, a, b, arm):
    """CSV in ZIP"""
    def f(l, p):
        with zipfile.ZipFile(p, "w", zipfile.ZIP_DEFLATED) as z: z.writestr("run.csv", table(l).to_csv(index=False))
    return both(d, a, b, f, "zip")


@case("ur10", expect="refused", say="tar|unpack")
def csv_tar_gz(d, a, b, arm):
    """CSV in tar.gz"""
    def f(l, p):
        with tarfile.open(p, "w:gz") as z:
            x = table(l).to_csv(index=False).encode(); i = tarfile.TarInfo("run.csv"); i.size = len(x); z.addfile(i, io.BytesIO(x))
    return both(d, a, b, f, "tar.gz")


@case("ur10", expect="refused", say="tar|unpack")
def csv_tar(d, a, b, arm):
    """CSV in tar"""
    def f(l, p):
        with tarfile.open(p, "w") as z:
            x = table(l).to_csv(index=False).encode(); i = tarfile.TarInfo("run.csv"); i.size = len(x); z.addfile(i, io.BytesIO(x))
    return both(d, a, b, f, "tar")


@case("ur10", expect="refused", say="git lfs pull")
def lfs_pointer(d, a, b, arm):
    """Git LFS pointer instead of the file"""
    return both(d, a, b, lambda l, p: text(p, "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n"))


@case("iiwa")
def single_file_interleaved_noise(d, a, b, arm):
    """one log only, jittering float epoch seconds with 1 ms jitter, ' , ' separated header"""
    r = np.random.default_rng(3)
    t = table(a, " q[{}]", " qd[{}]", " tau_meas[{}]", first=0, t="time_s"); t["time_s"] = 1718000000 + a.t + r.normal(size=len(a.t)) * 2e-4
    t.to_csv(d + "one.csv", index=False, float_format="%.7f")
    return ["one.csv"]


@case("tx40")
def zero_based_mixed(d, a, b, arm):
    """positions numbered from 0, torques from 1, velocities in rpm"""
    def f(l, p):
        d0 = {"Time": l.t}
        for i in range(6): d0[f"pos{i}"] = l.q[:, i]
        for i in range(6): d0[f"vel{i}_rpm"] = l.dq[:, i] * 60 / 2 / np.pi
        for i in range(6): d0[f"torque{i+1}"] = l.tau[:, i]
        pd.DataFrame(d0).to_csv(p, index=False)
    return both(d, a, b, f)


@case("iiwa")
def letters_a1(d, a, b, arm):
    """KUKA letters: A1..A7 (deg), T1..T7"""
    def f(l, p):
        t = table(l, "A{}", None, "T{}", t="time", scale=D); t.to_csv(p, index=False)
    return both(d, a, b, f)


@case("ur10")
def thousands_and_spaces(d, a, b, arm):
    """French: decimal comma, semicolon, narrow no-break spaces around names"""
    def f(l, p):
        t = table(l, "Position axe {} (°)", "Vitesse axe {} (°/s)", "Couple axe {} (N·m)", t="Temps (s)", scale=D); t.to_csv(p, sep=";", decimal=",", index=False)
    return both(d, a, b, f)
