"""Binary formats of corpus.py, each by its usual Python writer."""
import json, os, pickle, struct, io
from pathlib import Path
import numpy as np
import pandas as pd
from corpus import case
from cases_text import both, table, D, text

# --- ROS ---------------------------------------------------------------------------------------------

def stamps(l, t0=1718000000):
    return [(t0 + int(x), int(round((x % 1) * 1e9))) for x in np.round(l.t, 6)]


def joint_state(ts, seq, stamp, names, q, dq, tau, ros1=False, frame=""):
    T = ts.types
    st = T["builtin_interfaces/msg/Time"](*stamp)
    H = T["std_msgs/msg/Header"]
    h = H(seq=seq, stamp=st, frame_id=frame) if ros1 else H(stamp=st, frame_id=frame)
    return T["sensor_msgs/msg/JointState"](header=h, name=list(names), position=np.asarray(q, float), velocity=np.asarray(dq, float), effort=np.asarray(tau, float))


def ros2(path, l, storage, mode=None, gripper=None, order=None, distro="ROS2_HUMBLE", topic="/joint_states", lists=False, shift=0.0):
    from rosbags.rosbag2 import Writer, StoragePlugin, CompressionMode, CompressionFormat
    from rosbags.typesys import Stores, get_typestore
    ts = get_typestore(Stores[distro])
    order = np.argsort(l.names) if order is None else order
    w = Writer(path, version=8 if distro != "ROS2_FOXY" else 5, storage_plugin=StoragePlugin[storage])
    if mode: w.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with w:
        c = w.add_connection(topic, "sensor_msgs/msg/JointState", typestore=ts)
        r = np.random.default_rng(1)
        for i, st in enumerate(stamps(l)):
            ns = st[0] * 10**9 + st[1]
            o = order if not isinstance(order, str) else r.permutation(l.n)
            w.write(c, ns + int(r.uniform(1e5, 2e6)), ts.serialize_cdr(joint_state(ts, i, st, [l.names[j] for j in o], l.q[i, o], l.dq[i, o], l.tau[i, o]), "sensor_msgs/msg/JointState"))
            if gripper and i % 4 == 0:
                st2 = (st[0], st[1] + 1_000_000)
                w.write(c, ns + 3_000_000, ts.serialize_cdr(joint_state(ts, i, st2, gripper, [0.02] * len(gripper), [0.0] * len(gripper), [0.0] * len(gripper)), "sensor_msgs/msg/JointState"))


def ros2case(name, robot, doc, **k):
    def f(d, a, b, arm):
        for l, n in ((a, "run_a"), (b, "run_b")): ros2(f"{d}{n}", l, **k)
        return ["run_a", "run_b"]
    f.__name__, f.__doc__ = name, doc
    case(robot)(f)


ros2case("rosbag2_sqlite", "ur5", "rosbag2 sqlite3, alphabetical joints", storage="SQLITE3")
ros2case("rosbag2_sqlite_msgzstd", "ur5", "rosbag2 sqlite3, zstd by message", storage="SQLITE3", mode="MESSAGE")
ros2case("rosbag2_sqlite_filezstd", "iiwa", "rosbag2 sqlite3, zstd by file", storage="SQLITE3", mode="FILE")
ros2case("rosbag2_mcap", "kinova", "rosbag2 mcap", storage="MCAP")
ros2case("rosbag2_mcap_filezstd", "xarm7", "rosbag2 mcap, zstd by file", storage="MCAP", mode="FILE")
ros2case("rosbag2_two_publishers", "panda", "arm and gripper publish on one /joint_states in separate messages", storage="MCAP", gripper=["panda_finger_joint1", "panda_finger_joint2"])
ros2case("rosbag2_order_changes", "ur5", "order of names changes in each message", storage="MCAP", order="random")


@case("iiwa")
def rosbag2_multiarray(d, a, b, arm):
    """positions on /joint_states, measured torque on Float64MultiArray topic at another rate"""
    from rosbags.rosbag2 import Writer, StoragePlugin
    from rosbags.typesys import Stores, get_typestore
    ts = get_typestore(Stores.ROS2_HUMBLE); T = ts.types
    for l, n in ((a, "run_a"), (b, "run_b")):
        with Writer(d + n, version=8, storage_plugin=StoragePlugin.MCAP) as w:
            c = w.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=ts)
            c2 = w.add_connection("/joint_torque_measured", "std_msgs/msg/Float64MultiArray", typestore=ts)
            for i, st in enumerate(stamps(l)):
                ns = st[0] * 10**9 + st[1]
                w.write(c, ns, ts.serialize_cdr(joint_state(ts, i, st, l.names, l.q[i], l.dq[i], []), "sensor_msgs/msg/JointState"))
                m = T["std_msgs/msg/Float64MultiArray"](layout=T["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0), data=l.tau[i].copy())
                w.write(c2, ns + 200_000, ts.serialize_cdr(m, "std_msgs/msg/Float64MultiArray"))
    return ["run_a", "run_b"]


def ros1(path, l, comp=None, gripper=False):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore
    ts = get_typestore(Stores.ROS1_NOETIC)
    w = Writer(path)
    if comp: w.set_compression(getattr(Writer.CompressionFormat, comp))
    order = np.argsort(l.names)
    with w:
        c = w.add_connection("/robot/joint_states", "sensor_msgs/msg/JointState", typestore=ts)
        for i, st in enumerate(stamps(l)):
            w.write(c, st[0] * 10**9 + st[1] + 500_000, ts.serialize_ros1(joint_state(ts, i, st, [l.names[j] for j in order], l.q[i, order], l.dq[i, order], l.tau[i, order], True), "sensor_msgs/msg/JointState"))


for comp in (None, "BZ2", "LZ4"):
    def f(d, a, b, arm, comp=comp):
        return both(d, a, b, lambda l, p: ros1(p, l, comp), "bag")
    f.__name__, f.__doc__ = f"ros1_bag_{comp or 'plain'}".lower(), f"ROS 1 bag, {comp}"
    case("ur5")(f)


# --- MCAP without ROS 2 --------------------------------------------------------------------------------

@case("panda")
def mcap_json(d, a, b, arm):
    """MCAP with JSON messages, names in the message"""
    from mcap.writer import Writer
    def f(l, p):
        with open(p, "wb") as fh:
            w = Writer(fh); w.start()
            s = w.register_schema(name="ArmState", encoding="jsonschema", data=json.dumps({"type": "object"}).encode())
            c = w.register_channel(topic="/arm/state", message_encoding="json", schema_id=s)
            for i, (x, st) in enumerate(zip(l.t, stamps(l))):
                ns = st[0] * 10**9 + st[1]
                w.add_message(c, log_time=ns, publish_time=ns, data=json.dumps({"t": x, "joint_names": l.names, "q": list(l.q[i]), "qd": list(l.dq[i]), "tau": list(l.tau[i])}).encode())
            w.finish()
    return both(d, a, b, f, "mcap")


@case("iiwa")
def mcap_cbor(d, a, b, arm):
    """MCAP with CBOR messages, no schema, one topic per quantity"""
    from mcap.writer import Writer, CompressionType
    import cbor2
    def f(l, p):
        with open(p, "wb") as fh:
            w = Writer(fh, compression=CompressionType.LZ4); w.start()
            cs = {k: w.register_channel(topic=f"/lbr/{k}", message_encoding="cbor", schema_id=0) for k in ("position", "torque")}
            for i, st in enumerate(stamps(l)):
                ns = st[0] * 10**9 + st[1]
                for k, x in (("position", l.q), ("torque", l.tau)):
                    w.add_message(cs[k], log_time=ns, publish_time=ns, data=cbor2.dumps({"stamp": ns / 1e9, "values": [float(v) for v in x[i]]}))
            w.finish()
    return both(d, a, b, f, "mcap")


@case("ur10")
def mcap_ros1msg(d, a, b, arm):
    """MCAP with ros1msg JointState (converted bag)"""
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore
    ts = get_typestore(Stores.ROS1_NOETIC); order = np.argsort(a.names)
    def f(l, p):
        with open(p, "wb") as fh:
            w = Writer(fh); w.start()
            s = w.register_schema(name="sensor_msgs/JointState", encoding="ros1msg", data=ts.generate_msgdef("sensor_msgs/msg/JointState")[0].encode())
            c = w.register_channel(topic="/joint_states", message_encoding="ros1", schema_id=s)
            for i, st in enumerate(stamps(l)):
                ns = st[0] * 10**9 + st[1]
                w.add_message(c, log_time=ns, publish_time=ns, data=bytes(ts.serialize_ros1(joint_state(ts, i, st, [l.names[j] for j in order], l.q[i, order], l.dq[i, order], l.tau[i, order], True), "sensor_msgs/msg/JointState")))
            w.finish()
    return both(d, a, b, f, "mcap")


@case("xarm7")
def mcap_protobuf(d, a, b, arm):
    """MCAP with Protobuf: repeated joints {name, position, velocity, effort}, Timestamp"""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
    from mcap_protobuf.writer import Writer
    fd = descriptor_pb2.FileDescriptorProto(name="arm.proto", package="lab", syntax="proto3", dependency=["google/protobuf/timestamp.proto"])
    j = fd.message_type.add(name="Joint")
    for i, (n, ty) in enumerate((("name", 9), ("effort", 1), ("position", 2), ("velocity", 2)), 1): j.field.add(name=n, number=i, type=ty, label=1)
    m = fd.message_type.add(name="ArmState")
    m.field.add(name="stamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp")
    m.field.add(name="joints", number=2, type=11, label=3, type_name=".lab.Joint")
    pool = descriptor_pool.Default()
    try: pool.FindFileByName("arm.proto")
    except KeyError: pool.Add(fd)
    M = message_factory.GetMessageClass(pool.FindMessageTypeByName("lab.ArmState"))
    def f(l, p):
        with open(p, "wb") as fh, Writer(fh) as w:
            for i, st in enumerate(stamps(l)):
                x = M(); x.stamp.seconds, x.stamp.nanos = st
                for k in reversed(range(l.n)): x.joints.add(name=l.names[k], position=l.q[i, k], velocity=l.dq[i, k], effort=l.tau[i, k])
                w.write_message("/arm", x, log_time=st[0] * 10**9 + st[1], publish_time=st[0] * 10**9 + st[1])
    return both(d, a, b, f, "mcap")


# --- tables ---------------------------------------------------------------------------------------------

for codec in ("snappy", "gzip", "brotli", "lz4", "zstd", "none"):
    def f(d, a, b, arm, codec=codec):
        return both(d, a, b, lambda l, p: table(l, "joint_positions_{}", "joint_velocities_{}", "joint_efforts_{}", t="timestamp", first=0).to_parquet(p, compression=codec if codec != "none" else None), "parquet")
    f.__name__, f.__doc__ = f"parquet_{codec}", f"pandas to_parquet, {codec}"
    case("ur10")(f)


@case("panda")
def parquet_lists_datetime(d, a, b, arm):
    """Parquet: datetime index, list columns, float32"""
    def f(l, p):
        t = pd.DataFrame({"observation.q": list(l.q.astype(np.float32)), "observation.tau": list(l.tau.astype(np.float32))}, index=pd.Index(pd.Timestamp("2024-03-05T12:00:00Z") + pd.to_timedelta(l.t, unit="s"), name="time"))
        t.to_parquet(p)
    return both(d, a, b, f, "parquet")


@case("kinova")
def feather_lz4(d, a, b, arm):
    """Feather, names by joint"""
    return both(d, a, b, lambda l, p: table(l, "{}/position", "{}/velocity", "{}/effort", names=l.names, t="time").to_feather(p), "feather")


@case("scara")
def arrow_stream(d, a, b, arm):
    """Arrow IPC stream"""
    import pyarrow as pa
    def f(l, p):
        t = pa.Table.from_pandas(table(l))
        with pa.OSFile(p, "wb") as s, pa.ipc.new_stream(s, t.schema) as w: w.write_table(t, max_chunksize=100)
    return both(d, a, b, f, "arrows")


@case("panda", rate=20, seconds=60, args=["--rate-hz", "20"])
def robomimic(d, a, b, arm):
    """robomimic-like HDF5: data/demo_k/obs/robot0_joint_pos, joint_vel, torque, actions; 4 demos"""
    import h5py
    with h5py.File(d + "demo.hdf5", "w") as h:
        g = h.create_group("data"); g.attrs["total"] = 4; g.attrs["env_args"] = "{}"
        for k, n in enumerate((240, 250, 235, 260)):
            s = slice(k * 240, k * 240 + n); x = g.create_group(f"demo_{k}"); x.attrs["num_samples"] = n
            x["actions"] = np.random.default_rng(k).normal(size=(len(a.t[s]), 7)); x["dones"] = np.zeros(len(a.t[s]), int); x["rewards"] = np.zeros(len(a.t[s]))
            o = x.create_group("obs")
            o["robot0_joint_pos"], o["robot0_joint_vel"], o["robot0_joint_torque"] = a.q[s], a.dq[s], a.tau[s]
            o["robot0_joint_pos_cos"], o["robot0_joint_pos_sin"], o["robot0_eef_pos"] = np.cos(a.q[s]), np.sin(a.q[s]), a.q[s, :3]
            o["robot0_gripper_qpos"] = np.full((len(a.t[s]), 2), 0.02)
    return ["demo.hdf5"]


@case("panda", rate=20, seconds=60, args=["--rate-hz", "20"])
def libero_plus_torque(d, a, b, arm):
    """LIBERO-like HDF5: data/demo_k/obs/joint_states, gripper_states, ee_states, own joint_torques"""
    import h5py
    with h5py.File(d + "demo.hdf5", "w") as h:
        g = h.create_group("data")
        for k, n in enumerate((400, 380, 400)):
            s = slice(k * 400, k * 400 + n); x = g.create_group(f"demo_{k}")
            x["actions"] = np.zeros((n, 7)); x["robot_states"] = np.zeros((n, 9)); x["states"] = np.c_[np.arange(n) * 0.05, np.zeros((n, 40))]
            o = x.create_group("obs"); o["joint_states"], o["joint_torques"] = a.q[s], a.tau[s]
            o["gripper_states"] = np.full((n, 2), 0.02); o["ee_states"] = a.q[s, :6]; o["agentview_rgb"] = np.zeros((n, 8, 8, 3), np.uint8)
    return ["demo.hdf5"]


@case("iiwa")
def hdf5_7xN_gzip(d, a, b, arm):
    """HDF5 with 7xN data sets in gzip chunks, groups robot/state, epoch ns time"""
    import h5py
    def f(l, p):
        with h5py.File(p, "w") as h:
            g = h.create_group("robot/state")
            g.create_dataset("stamp_ns", data=(1718000000 * 10**9 + np.round(l.t * 1e9)).astype(np.int64))
            for k, x in (("position", l.q), ("velocity", l.dq), ("torque", l.tau)): g.create_dataset(k, data=x.T.astype("f4"), compression="gzip", chunks=(7, 100), shuffle=True)
    return both(d, a, b, f, "h5")


@case("ur10")
def mat73(d, a, b, arm):
    """MATLAB v7.3: q 6xN, tau 6xN, t 1xN with the 512 byte header"""
    import h5py
    def f(l, p):
        with h5py.File(p, "w", userblock_size=512) as h:
            for k, x in (("t", l.t[:, None]), ("q", l.q), ("qd", l.dq), ("tau", l.tau)):
                h[k] = x.T; h[k].attrs["MATLAB_class"] = np.bytes_("double")
        with open(p, "r+b") as fh:
            fh.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Tue Mar  5 12:00:00 2024 HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")
    return both(d, a, b, f, "mat")


@case("ur10")
def mat5_struct(d, a, b, arm):
    """MAT v5: struct data with time, q (N x 6), dq, tau, and meta"""
    from scipy.io import savemat
    return both(d, a, b, lambda l, p: savemat(p, {"data": {"time": l.t, "q": l.q, "dq": l.dq, "tau": l.tau, "Ts": 0.008, "robot": "ur10"}}, do_compression=True), "mat")


@case("z1")
def mat5_simulink_out(d, a, b, arm):
    """MAT v5: tout, q_meas 6xN, tau_meas 6xN, q_ref, tau_cmd"""
    from scipy.io import savemat
    return both(d, a, b, lambda l, p: savemat(p, {"tout": l.t[:, None], "q_ref": np.roll(l.q, -2, 0).T, "q_meas": l.q.T, "tau_cmd": l.tau.T * 0.95, "tau_meas": l.tau.T}), "mat")


@case("iiwa")
def mat4(d, a, b, arm):
    """MAT v4: one matrix per quantity"""
    from scipy.io import savemat
    return both(d, a, b, lambda l, p: savemat(p, {"t": l.t, "pos": l.q, "torque": l.tau}, format="4"), "mat")


@case("ur5", expect="unsure", args=["--rate-hz", "125"])
def mat5_one_matrix(d, a, b, arm):
    """MAT v5: one unnamed matrix N x 19"""
    from scipy.io import savemat
    return both(d, a, b, lambda l, p: savemat(p, {"M": np.c_[l.t, l.q, l.dq, l.tau]}), "mat")


@case("scara")
def octave_text(d, a, b, arm):
    """Octave save -text"""
    def f(l, p):
        s = "# Created by Octave 8.4.0, Tue Mar 05 12:00:00 2024 UTC <lab@pc>\n"
        for k, x in (("t", l.t[:, None]), ("q", l.q), ("qd", l.dq), ("tau", l.tau)):
            s += f"# name: {k}\n# type: matrix\n# rows: {x.shape[0]}\n# columns: {x.shape[1]}\n" + "\n".join(" " + " ".join(f"{v:.10g}" for v in r) for r in x) + "\n\n\n"
        text(p, s)
    return both(d, a, b, f, "txt")


@case("panda")
def npz(d, a, b, arm):
    """npz: timestamps, qs (N,7), dqs, taus, meta object array"""
    return both(d, a, b, lambda l, p: np.savez_compressed(p, timestamps=l.t + 1718000000, qs=l.q, dqs=l.dq, taus=l.tau, info=np.array({"robot": "panda"}, dtype=object)), "npz")


@case("iiwa")
def npy_structured(d, a, b, arm):
    """structured npy: t, q(7), tau(7)"""
    def f(l, p):
        x = np.zeros(len(l.t), dtype=[("t", "f8"), ("q", "f4", 7), ("tau", "f4", 7), ("mode", "i1")]); x["t"], x["q"], x["tau"] = l.t, l.q, l.tau; np.save(p, x)
    return both(d, a, b, f, "npy")


@case("iiwa", expect="unsure")
def npy_matrix(d, a, b, arm):
    """npy matrix N x 22: t, q, dq, tau"""
    return both(d, a, b, lambda l, p: np.save(p, np.c_[l.t, l.q, l.dq, l.tau]), "npy")


@case("ur5", args=["--rate-hz", "125"])
def npy_files(d, a, b, arm):
    """q.npy and tau.npy as two files of one run"""
    np.save(d + "q.npy", a.q); np.save(d + "tau.npy", a.tau)
    return ["q.npy", "tau.npy"]


@case("ur5", expect="refused", say="pickle")
def pickle_df(d, a, b, arm):
    """pandas pickle: must be refused"""
    return both(d, a, b, lambda l, p: table(l).to_pickle(p), "pkl")


@case("ur5", expect="refused", say="nptdms")
def tdms(d, a, b, arm):
    """TDMS"""
    from nptdms import TdmsWriter, ChannelObject
    def f(l, p):
        with TdmsWriter(p) as w: w.write_segment([ChannelObject("arm", k, v.values) for k, v in table(l).items()])
    return both(d, a, b, f, "tdms")


@case("ur5", expect="refused", say="asammdf")
def mf4(d, a, b, arm):
    """MF4"""
    from asammdf import MDF, Signal
    def f(l, p):
        m = MDF(version="4.10"); m.append([Signal(v.values, l.t, name=k) for k, v in table(l, t=None).items()]); m.save(p, overwrite=True)
    return both(d, a, b, f, "mf4")


@case("ur5", expect="refused", say="read_excel")
def xlsx(d, a, b, arm):
    """xlsx"""
    return both(d, a, b, lambda l, p: table(l).iloc[:300].to_excel(p, index=False), "xlsx")


# --- LeRobot and ULog -------------------------------------------------------------------------------------

def lerobot(folder, a, episodes, version, fps, features, frames):
    """features: name -> list of names; frames: name -> (N, k) array"""
    os.makedirs(folder + "/meta"); n = len(a.t) // episodes
    info = {"codebase_version": version, "robot_type": "arm", "fps": fps, "total_episodes": episodes, "total_frames": n * episodes, "total_tasks": 1, "chunks_size": 1000, "splits": {"train": f"0:{episodes}"},
            "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet" if version == "v2.1" else "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "features": {**{k: {"dtype": "float32", "shape": [len(v)], "names": v} for k, v in features.items()}, **{k: {"dtype": "int64" if k != "timestamp" else "float32", "shape": [1], "names": None} for k in ("timestamp", "frame_index", "episode_index", "index", "task_index")}}}
    json.dump(info, open(folder + "/meta/info.json", "w"), indent=2)
    parts = []
    for e in range(episodes):
        s = slice(e * n, (e + 1) * n)
        t = pd.DataFrame({**{k: list(v[s].astype(np.float32)) for k, v in frames.items()}, "timestamp": (np.arange(n) / fps).astype(np.float32), "frame_index": np.arange(n), "episode_index": e, "index": np.arange(n) + e * n, "task_index": 0})
        parts.append(t)
    if version == "v2.1":
        os.makedirs(folder + "/data/chunk-000")
        for e, t in enumerate(parts): t.to_parquet(f"{folder}/data/chunk-000/episode_{e:06d}.parquet")
        text(folder + "/meta/episodes.jsonl", "".join(json.dumps({"episode_index": e, "tasks": ["x"], "length": n}) + "\n" for e in range(episodes)))
        text(folder + "/meta/tasks.jsonl", json.dumps({"task_index": 0, "task": "x"}) + "\n")
    else:
        os.makedirs(folder + "/data/chunk-000"); os.makedirs(folder + "/meta/episodes/chunk-000")
        pd.concat(parts).to_parquet(folder + "/data/chunk-000/file-000.parquet")
        pd.DataFrame({"episode_index": range(episodes), "data/chunk_index": 0, "data/file_index": 0, "dataset_from_index": [e * n for e in range(episodes)], "dataset_to_index": [(e + 1) * n for e in range(episodes)], "length": n, "tasks": [["x"]] * episodes}).to_parquet(folder + "/meta/episodes/chunk-000/file-000.parquet")


for ver, tag in (("v2.1", "v21"), ("v3.0", "v30")):
    def f(d, a, b, arm, ver=ver):
        n = [f"joint{i+1}" for i in range(7)]
        lerobot(d + "ds", a, 4, ver, 50, {"observation.state": [x + ".pos" for x in n] + ["gripper.pos"], "observation.effort": n + ["gripper"], "action": [x + ".pos" for x in n] + ["gripper.pos"]},
                {"observation.state": np.c_[a.q * D, 0 * a.t], "observation.effort": np.c_[a.tau, 0 * a.t], "action": np.c_[np.roll(a.q, -3, 0) * D, 0 * a.t]})
        return ["ds"]
    f.__name__, f.__doc__ = f"lerobot_{tag}_effort", f"LeRobot {ver}: state in degrees with gripper, observation.effort, action"
    case("xarm7", rate=50, seconds=60)(f)


@case("iiwa")
def ulog(d, a, b, arm):
    """ULog: arm_state {timestamp, float[7] q, float[7] tau}"""
    def f(l, p):
        m = lambda ty, x: struct.pack("<HB", len(x), ord(ty)) + x
        out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000)
        out += m("B", bytes(40)) + m("F", b"arm_state:uint64_t timestamp;float[7] q;float[7] dq;float[7] tau;uint8_t mode;") + m("A", b"\0" + struct.pack("<H", 0) + b"arm_state")
        for i, x in enumerate(l.t): out += m("D", struct.pack("<HQ21fB", 0, 5_000_000 + int(round(x * 1e6)), *l.q[i], *l.dq[i], *l.tau[i], 3))
        open(p, "wb").write(out)
    return both(d, a, b, f, "ulg")
