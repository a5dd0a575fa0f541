"""Clocks and units that a reader must guess."""
import numpy as np
import pandas as pd
from corpus import case
from cases_text import both, table, D, text
from cases_more import frame, lag, rnd


def ahead(x, k=3):
    """set points: the motion k samples earlier"""
    return np.vstack([x[k:], x[-1] + np.arange(1, k + 1)[:, None] * (x[-1] - x[-2])])


def clock(name, column, values, robot="ur5", rate=125.0, expect="right", doc="", **k):
    def f(d, a, b, arm):
        def g(l, p):
            t = table(l, "pos_{}", None, "trq_{}", t=column); t[column] = values(l.t); t.to_csv(p, index=False)
        return both(d, a, b, g)
    f.__name__, f.__doc__ = name, doc
    case(robot, rate=rate, expect=expect, **k)(f)


i64 = lambda x: np.round(x).astype(np.int64)
clock("clock_us_named_time", "time", lambda t: i64(t * 1e6), doc="'time' counts us from 0")
clock("clock_us_1khz", "time", lambda t: i64(t * 1e6), rate=1000.0, doc="'time' counts us from 0 at 1 kHz")
clock("clock_ns_named_t", "t", lambda t: i64(t * 1e9), doc="'t' counts ns from 0")
clock("clock_ticks_t", "t", lambda t: i64(t * 125), expect="unsure", doc="'t' counts samples")
clock("clock_ticks_time", "time", lambda t: i64(t * 125), expect="unsure", doc="'time' counts samples")
clock("clock_ms_1khz", "time", lambda t: i64(t * 1e3), rate=1000.0, doc="'time' counts ms at 1 kHz: 0,1,2,..")
clock("clock_ms_from_boot", "millis", lambda t: 734512 + i64(t * 1e3), doc="Arduino millis()")
clock("clock_micros", "micros", lambda t: 734512331 + i64(t * 1e6), doc="Arduino micros()")
clock("clock_rounded_10ms", "time", lambda t: np.round(t, 2), doc="seconds rounded to 0.01 at 125 Hz")
clock("clock_ms_20hz", "time", lambda t: i64(t * 1e3), rate=20.0, seconds=60, doc="'time' counts ms at 20 Hz")
clock("clock_s_wrong_header", "time_ms", lambda t: t, expect="unsure", doc="'time_ms' contains seconds")
clock("clock_epoch_100ns", "filetime", lambda t: 133_500_000_000_000_000 + i64(t * 1e7), expect="unsure", doc="Windows FILETIME, 100 ns")
clock("clock_hms_comma", "Uhrzeit", lambda t: (pd.Timestamp("2024-03-05 12:00:00") + pd.to_timedelta(t, unit="s")).strftime("%H:%M:%S.%f"), doc="time of day in 'Uhrzeit'")
clock("clock_iso_basic", "time", lambda t: (pd.Timestamp("2024-03-05 12:00:00") + pd.to_timedelta(t, unit="s")).strftime("%Y%m%dT%H%M%S.%fZ"), doc="ISO 8601 basic form")
clock("clock_iso_offset_space", "time", lambda t: (pd.Timestamp("2024-03-05 12:00:00", tz="Europe/Berlin") + pd.to_timedelta(t, unit="s")).astype(str), doc="pandas str of zoned stamps (no fraction at whole seconds)")


def units(name, q, tau, fq=1.0, ft=1.0, expect="right", doc="", robot="ur10"):
    def f(d, a, b, arm):
        def g(l, p):
            frame(l, [(q, l.q * fq), (tau, l.tau * ft)], "Time (s)").to_csv(p, index=False)
        return both(d, a, b, g)
    f.__name__, f.__doc__ = name, doc or f"{q}, {tau}"
    case(robot, expect=expect)(f)


units("unit_mrad", "q{1} [mrad]", "tau{1} [Nm]", 1000)
units("unit_deg_word", "Joint {1} angle (degrees)", "Joint {1} torque (Newton meters)", D)
units("unit_rev", "q{1} [rev]", "tau{1} [N*m]", 1 / 2 / np.pi)
units("unit_knm", "q{1} [deg]", "tau{1} [kNm]", D, 1e-3, "unsure")
units("unit_lbf_in", "q{1} [deg]", "tau{1} [lbf*in]", D, 8.8507, "unsure")
units("unit_kgf_cm", "q{1} [deg]", "tau{1} [kgf.cm]", D, 10.197, "unsure")
units("unit_percent", "q{1} [deg]", "torque{1} [%]", D, 1 / 3.3, "unsure")
units("unit_ma", "q{1} [deg]", "current{1} [mA]", D, 1000 / 12.0, "unsure")
units("unit_suffix_mnm", "q{1}_rad", "tau{1}_mNm", 1, 1000)
units("unit_suffix_deg", "q{1}_deg", "tau{1}_Nm", D)
units("unit_rad_says_deg", "q{1} [deg]", "tau{1} [Nm]", 1, 1, "right", "header says deg, values are rad")
units("unit_deg_says_rad", "q{1} [rad]", "tau{1} [Nm]", D, 1, "right", "header says rad, values are deg")


def pick(name, spec, doc, robot="iiwa", expect="right", want=()):
    def f(d, a, b, arm):
        return both(d, a, b, lambda l, p: frame(l, spec(l)).to_csv(p, index=False))
    f.__name__, f.__doc__ = name, doc
    case(robot, expect=expect, want=want)(f)


pick("pick_raw_then_filtered", lambda l: [("q_{1}", l.q), ("q_filtered_{1}", lag(l, l.q)), ("tau_{1}", l.tau), ("tau_filtered_{1}", lag(l, l.tau))], "q, q_filtered, tau, tau_filtered", want=('q_{1}', 'tau_{1}'))
pick("pick_filt_suffix", lambda l: [("pos{1}_filt", lag(l, l.q)), ("pos{1}", l.q), ("trq{1}_filt", lag(l, l.tau)), ("trq{1}", l.tau)], "pos1_filt before pos1", want=('pos{1}', 'trq{1}'))
pick("pick_raw_suffix", lambda l: [("position_{1}", lag(l, l.q)), ("position_raw_{1}", l.q), ("torque_{1}", lag(l, l.tau)), ("torque_raw_{1}", l.tau)], "position, position_raw (filtered by the same filter without a suffix)", want=('position_raw_{1}', 'torque_raw_{1}'))
pick("pick_setpoint", lambda l: [("SetPos{1}", ahead(l.q)), ("ActPos{1}", l.q), ("SetTorque{1}", l.tau * 0.8), ("ActTorque{1}", l.tau)], "SetPos, ActPos, SetTorque, ActTorque", "tx40", want=('ActPos{1}', 'ActTorque{1}'))
pick("pick_soll_ist", lambda l: [("Sollposition_A{1}", ahead(l.q)), ("Istposition_A{1}", l.q), ("Sollmoment_A{1}", l.tau * 0.8), ("Istmoment_A{1}", l.tau)], "Soll and Ist", "iiwa", want=('Istposition_A{1}', 'Istmoment_A{1}'))
pick("pick_goal_present", lambda l: [("goal_position_{1}", ahead(l.q)), ("present_position_{1}", l.q), ("goal_torque_{1}", l.tau * 0.8), ("present_torque_{1}", l.tau)], "goal and present", "iiwa", want=('present_position_{1}', 'present_torque_{1}'))
pick("pick_input_output", lambda l: [("u{1}", l.tau), ("y{1}", l.q), ("r{1}", ahead(l.q))], "control notation u, y, r", expect="refused")
pick("pick_theta_motor_link", lambda l: [("theta_{1}", l.q + l.tau / 5000), ("q_{1}", l.q), ("tau_m_{1}", l.tau + 0.5 * l.dq), ("tau_J_{1}", l.tau)], "theta (motor) and q (link), tau_m and tau_J", want=('q_{1}', 'tau_J_{1}'))
pick("pick_gravity_comp", lambda l: [("q{1}", l.q), ("tau_g{1}", l.tau * 0.97), ("tau{1}", l.tau)], "tau_g (gravity model) before tau", want=('q{1}', 'tau{1}'))
pick("pick_friction_comp", lambda l: [("q{1}", l.q), ("tau_fric{1}", rnd(l, 7)), ("tau_cmd{1}", l.tau * 0.9), ("tau_meas{1}", l.tau)], "tau_fric, tau_cmd, tau_meas", want=('q{1}', 'tau_meas{1}'))
pick("pick_estimate_and_sensor", lambda l: [("q{1}", l.q), ("tau_est{1}", l.tau * 0.9), ("tau_sensor{1}", l.tau)], "tau_est before tau_sensor", want=('q{1}', 'tau_sensor{1}'))
pick("pick_effort_current", lambda l: [("pos{1}", l.q), ("current{1}", l.tau / 9), ("effort{1}", l.tau)], "current and effort", want=('pos{1}', 'effort{1}'))
pick("pick_10_joints_zero_padded", lambda l: [("q{1:02d}", l.q), ("tau{1:02d}", l.tau)], "zero padded numbers")
pick("pick_torque_offset_number", lambda l: [("q{0}", l.q), ("tau{1}", l.tau)], "q0..q6 but tau1..tau7")


def ticks(name, robot, rate, period, doc):
    def f(d, a, b, arm):
        for n, seed in (("run_a", 1), ("run_b", 2)):
            l = arm.log(2 * period, rate, seed=seed, period=period)
            t = table(l, "pos_{}", None, "trq_{}", t="t"); t["t"] = i64(l.t * rate); t.to_csv(f"{d}{n}.csv", index=False)
        return ["run_a.csv", "run_b.csv"]
    f.__name__, f.__doc__ = name, doc
    case(robot, rate=rate, expect="unsure")(f)


ticks("clock_ticks_500", "ur5", 500.0, 10.0, "'t' counts samples at 500 Hz")
ticks("clock_ticks_500_slow", "panda", 500.0, 25.0, "'t' counts samples at 500 Hz, slow motion")
ticks("clock_ticks_500_very_slow", "ur10", 500.0, 60.0, "'t' counts samples at 500 Hz, very slow motion")
ticks("clock_ticks_800_slow", "iiwa", 800.0, 25.0, "'t' counts samples at 800 Hz, slow motion")
pick("pick_set_act_ur", lambda l: [("Set Position {1}", ahead(l.q)), ("Actual Position {1}", l.q), ("Set Torque {1}", l.tau * 0.8), ("Actual Torque {1}", l.tau)], "Set Position, Actual Position, Set Torque, Actual Torque", "ur5", want=('Actual Position {1}', 'Actual Torque {1}'))
pick("pick_act_first", lambda l: [("ActPos{1}", l.q), ("SetPos{1}", ahead(l.q)), ("ActTorque{1}", l.tau), ("SetTorque{1}", l.tau * 0.8)], "ActPos first, then SetPos", "ur5", want=('ActPos{1}', 'ActTorque{1}'))

PAIRS = [("SetPos{1}", "ActPos{1}", "SetTrq{1}", "ActTrq{1}"), ("pos_sp_{1}", "pos_{1}", "trq_sp_{1}", "trq_{1}"), ("desired_position_{1}", "current_position_{1}", "desired_torque_{1}", "current_torque_{1}"),
         ("nominal_q_{1}", "real_q_{1}", "nominal_tau_{1}", "real_tau_{1}"), ("planned_q{1}", "executed_q{1}", "planned_tau{1}", "executed_tau{1}"), ("q_in{1}", "q_out{1}", "tau_in{1}", "tau_out{1}"),
         ("qd{1}", "q{1}", "taud{1}", "tau{1}"), ("q_d{1}", "q{1}", "tau_d{1}", "tau{1}"), ("qdes{1}", "qfb{1}", "taudes{1}", "taufb{1}"), ("CmdPos_J{1}", "FbkPos_J{1}", "CmdTrq_J{1}", "FbkTrq_J{1}"),
         ("q_star_{1}", "q_{1}", "tau_star_{1}", "tau_{1}"), ("traj_pos_{1}", "enc_pos_{1}", "ctrl_torque_{1}", "sensor_torque_{1}"), ("demand_position_{1}", "actual_position_{1}", "demand_torque_{1}", "actual_torque_{1}"),
         ("interp_pos{1}", "encoder_pos{1}", "ctrl_tau{1}", "ft_tau{1}"), ("q_rsp{1}", "q_msr{1}", "tau_pred{1}", "tau_msr{1}"), ("lead_q_{1}", "follow_q_{1}", "lead_tau_{1}", "follow_tau_{1}"), ("leader_pos_{1}", "follower_pos_{1}", "leader_torque_{1}", "follower_torque_{1}"),
         ("sim_q{1}", "real_q{1}", "sim_tau{1}", "real_tau{1}"), ("q_ik_{1}", "q_{1}", "tau_id_{1}", "tau_{1}")]
for k, (qs, qa, ts, ta) in enumerate(PAIRS):
    pick(f"pair_{k:02d}_{qs.split('{')[0].strip('_')}", lambda l, p=(qs, qa, ts, ta): [(p[0], ahead(l.q)), (p[1], l.q), (p[2], l.tau * 0.8), (p[3], l.tau)], f"command {qs}, {ts} before measured {qa}, {ta}", "ur5", want=(qa, ta))
pick("current_only", lambda l: [("current_position_{1}", l.q), ("current_velocity_{1}", l.dq), ("current_torque_{1}", l.tau)], "'current' means present", "ur5", want=('current_position_{1}', 'current_torque_{1}'))
pick("current_target", lambda l: [("target_joint_position_{1}", ahead(l.q)), ("current_joint_position_{1}", l.q), ("current_joint_torque_{1}", l.tau)], "'current' means present, next to target", "ur5", want=('current_joint_position_{1}', 'current_joint_torque_{1}'))
pick("current_camel", lambda l: [("currentPos{1}", l.q), ("currentVel{1}", l.dq), ("currentTorque{1}", l.tau), ("motorCurrent{1}", l.tau / 9)], "'current' means present, with motor currents", "ur5", want=('currentPos{1}', 'currentTorque{1}'))
