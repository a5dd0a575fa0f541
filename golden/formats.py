"""Golden log files in the formats that dynident-formats reads, written by independent programs, with their values.

    python3 golden/formats.py [--out DIR]

Writes formats/*: the files, and values.json with the expected columns of each file, as hexadecimal floats, and the versions of the
programs. Seeded. Every file contains the same motion of two joints, if its format allows this.
"""
import argparse
import gzip
import importlib.metadata
import io
import json
import pathlib
import sqlite3
import struct

import h5py
import numpy as np
import pandas
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
import scipy
import scipy.io
import zstandard
import cbor2
import mcap
from mcap.writer import CompressionType
from mcap.writer import Writer as RawWriter
from google.protobuf import descriptor_pb2, duration_pb2, message_factory, timestamp_pb2
from google.protobuf.descriptor_pool import DescriptorPool
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros1.writer import Writer as Ros1Writer
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from write_json import write

SEED = 20261123
ROWS = 40
JOINTS = ["shoulder", "elbow"]
START_NS = 1_790_000_000_123_456_789

SEPARATOR = "=" * 80
JOINT_STATE = f"""std_msgs/Header header

string[] name
float64[] position
float64[] velocity
float64[] effort
{SEPARATOR}
MSG: std_msgs/Header
# comment
builtin_interfaces/Time stamp
string frame_id
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
MULTI_ARRAY = f"""MultiArrayLayout  layout
float64[]         data
{SEPARATOR}
MSG: std_msgs/MultiArrayLayout
MultiArrayDimension[] dim
uint32 data_offset
{SEPARATOR}
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
DYNAMIC_STATE = f"""std_msgs/Header header
string[] joint_names
InterfaceValue[] interface_values
{SEPARATOR}
MSG: control_msgs/InterfaceValue
string[] interface_names
float64[] values
""" + JOINT_STATE[JOINT_STATE.index(SEPARATOR):]
POINTS = f"""{SEPARATOR}
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
{SEPARATOR}
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
"""
CONTROLLER_STATE = """std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error  # Redundant, but useful
""" + JOINT_STATE[JOINT_STATE.index(SEPARATOR):] + POINTS
OWN = """uint8 MODE_IDLE=0
string TEXT = "a # b"
bool moving
int8 step
uint16 counter
int32 ticks
uint64 big
float32 current
float32[3] force
string<=8 note
int16[<=4] few
"""

rng = np.random.default_rng(SEED)
T = np.arange(ROWS) / 100.0
Q = np.array([np.sin(3.0 * T + 0.4), 0.7 * np.cos(5.0 * T)])
TAU = np.array([8.0 * np.cos(2.0 * T), 3.0 * np.sin(7.0 * T)]) + 0.01 * rng.standard_normal((2, ROWS))
DQ = np.gradient(Q, 0.01, axis=1)
# Stamps with jitter; the recording times are slightly later.
STAMPS = [START_NS + 10_000_000 * i + int(rng.integers(-40_000, 40_000)) for i in range(ROWS)]
LOGGED = [stamp + 300_000 + int(rng.integers(0, 50_000)) for stamp in STAMPS]
F32 = Q.astype(np.float32)


def seconds(stamps):
    return [(stamp - stamps[0]) / 1e9 for stamp in stamps]


def header(stamp):
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "base"}


def joint_state(i, order=(0, 1)):
    return {
        "header": header(STAMPS[i]),
        "name": [JOINTS[j] for j in order],
        "position": [Q[j, i] for j in order],
        "velocity": [DQ[j, i] for j in order],
        "effort": [TAU[j, i] for j in order],
    }


STATE_COLUMNS = {
    "/joint_states.log_time": seconds(LOGGED),
    "/joint_states.header.stamp": seconds(STAMPS),
    **{f"/joint_states.position[{name}]": Q[j] for j, name in enumerate(JOINTS)},
    **{f"/joint_states.velocity[{name}]": DQ[j] for j, name in enumerate(JOINTS)},
    **{f"/joint_states.effort[{name}]": TAU[j] for j, name in enumerate(JOINTS)},
}


def text_table():
    lines = ["t_s,q1,q2,tau1,tau2"]
    lines += [",".join(repr(float(x)) for x in (T[i], Q[0, i], Q[1, i], TAU[0, i], TAU[1, i])) for i in range(ROWS)]
    return ("\n".join(lines) + "\n").encode()


TEXT_COLUMNS = {"t_s": T, "q1": Q[0], "q2": Q[1], "tau1": TAU[0], "tau2": TAU[1]}


def packed_text(out):
    text = text_table()
    with open(out / "table.csv.gz", "wb") as file:
        # Two gzip members, as in concatenated rotated logs.
        for part in (text[:900], text[900:]):
            file.write(gzip.compress(part, mtime=0))
    (out / "table.csv.zst").write_bytes(zstandard.ZstdCompressor(level=5).compress(text))
    return {"table.csv.gz": TEXT_COLUMNS, "table.csv.zst": TEXT_COLUMNS}


def numpy_files(out):
    matrix = np.column_stack([T, Q.T, TAU.T])
    np.save(out / "matrix.npy", matrix)
    np.save(out / "fortran.npy", np.asfortranarray(matrix))
    np.save(out / "big_endian_f4.npy", F32.T.astype(">f4"))
    kind = np.dtype([("t", "<f8"), ("mode", "u1"), ("label", "S3"), ("q", "<f4", (2,)), ("ticks", ">i4")])
    rows = np.zeros(ROWS, kind)
    rows["t"], rows["mode"], rows["label"], rows["q"], rows["ticks"] = T, np.arange(ROWS) % 3, b"ab", F32.T, np.arange(ROWS) * -7
    np.save(out / "structured.npy", rows)
    # savez uses a fixed date for its members.
    np.savez_compressed(out / "packed.npz", t=T, q=Q, tau=TAU.T, gains=np.array([1.0, 2.0]), name=np.array("arm"))
    np.savez(out / "stored.npz", t=T, q=Q.T, half=F32[0].astype(np.float16))
    # Names of the columns: as text in two encodings, and as Python objects, which are not read.
    np.savez(out / "named.npz", joint_names=np.array(JOINTS, dtype=">U12"), t=T, q=Q, tau=TAU.T)
    np.savez(out / "named_bytes.npz", joint_names=np.array(JOINTS, dtype="S"), t=T, q=Q, tau=TAU.T)
    np.savez(out / "named_objects.npz", joint_names=np.array(JOINTS, dtype=object), t=T, q=Q, tau=TAU.T)
    columns = {str(k): matrix[:, k] for k in range(5)}
    named = {"t": T} | {f"{name}[{JOINTS[k]}]": rows[k] for name, rows in (("q", Q), ("tau", TAU)) for k in range(2)}
    return {
        "matrix.npy": columns,
        "fortran.npy": columns,
        "big_endian_f4.npy": {"0": F32[0], "1": F32[1]},
        "structured.npy": {"t": T, "mode": np.arange(ROWS) % 3, "q[0]": F32[0], "q[1]": F32[1], "ticks": np.arange(ROWS) * -7},
        "packed.npz": {"t": T, "q[0]": Q[0], "q[1]": Q[1], "tau[0]": TAU[0], "tau[1]": TAU[1]},
        "stored.npz": {"t": T, "q[0]": Q[0], "q[1]": Q[1], "half": F32[0].astype(np.float16)},
        "named.npz": named,
        "named_bytes.npz": named,
        "named_objects.npz": {"t": T, "q[0]": Q[0], "q[1]": Q[1], "tau[0]": TAU[0], "tau[1]": TAU[1]},
    }


def json_lines(out):
    lines = []
    for i in range(ROWS):
        row = {"t": T[i], "arm": {"q": list(Q[:, i]), "moving": bool(i % 2)}, "note": "x", "n": i - 5, "maybe": None if i == 3 else 0.5}
        lines.append(json.dumps(row))
    (out / "rows.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    maybe = np.full(ROWS, 0.5)
    maybe[3] = np.nan
    return {
        "rows.jsonl": {
            "t": T, "arm.q[0]": Q[0], "arm.q[1]": Q[1], "arm.moving": np.arange(ROWS) % 2, "n": np.arange(ROWS) - 5, "maybe": maybe,
        }
    }


def own_message(i):
    return {
        "moving": bool(i % 2), "step": -i, "counter": i * 3, "ticks": -100_000 * i, "big": 2**40 + i, "current": float(F32[0, i]),
        "force": [float(x) for x in (F32[0, i], F32[1, i], 0.5)], "note": "ab"[: i % 3], "few": [i, -i],
    }


OWN_COLUMNS = {
    "/own.moving": np.arange(ROWS) % 2, "/own.step": -np.arange(ROWS), "/own.counter": np.arange(ROWS) * 3,
    "/own.ticks": -100_000 * np.arange(ROWS), "/own.big": 2**40 + np.arange(ROWS), "/own.current": F32[0],
    "/own.force[0]": F32[0], "/own.force[1]": F32[1], "/own.force[2]": np.full(ROWS, 0.5), "/own.few[0]": np.arange(ROWS),
    "/own.few[1]": -np.arange(ROWS),
}


def controller_state(i):
    point = lambda x, v: {
        "positions": list(x), "velocities": list(v), "accelerations": [], "effort": [], "time_from_start": {"sec": 1, "nanosec": 500_000_000},
    }
    return {
        "header": header(STAMPS[i]), "joint_names": JOINTS,
        "desired": point(Q[:, i] + 0.01, DQ[:, i]), "actual": point(Q[:, i], DQ[:, i]), "error": point([0.01, 0.01], [0.0, 0.0]),
    }


CONTROLLER_COLUMNS = {
    "/controller/state.header.stamp": seconds(STAMPS),
    **{f"/controller/state.desired.positions[{name}]": Q[j] + 0.01 for j, name in enumerate(JOINTS)},
    **{f"/controller/state.actual.positions[{name}]": Q[j] for j, name in enumerate(JOINTS)},
    **{f"/controller/state.actual.velocities[{name}]": DQ[j] for j, name in enumerate(JOINTS)},
    "/controller/state.error.time_from_start": np.full(ROWS, 1.5),
}


def dynamic_state(i):
    return {
        "header": header(STAMPS[i]), "joint_names": JOINTS,
        "interface_values": [{"interface_names": ["position", "effort"], "values": [Q[j, i], TAU[j, i]]} for j in range(2)],
    }


DYNAMIC_COLUMNS = {
    f"/dynamic_joint_states.interface_values[{name}].values[{what}]": values[j]
    for j, name in enumerate(JOINTS)
    for what, values in (("position", Q), ("effort", TAU))
}


def interpolated(at, times, values):
    """Linear interpolation, with the same order of operations as Dynident for bit-identical results."""
    k = np.searchsorted(times, at, side="right") - 1
    share = [(a - times[i]) / (times[i + 1] - times[i]) if times[i] != a else 0.0 for a, i in zip(at, k)]
    return np.array([values[i] if w == 0.0 else values[i] + (values[i + 1] - values[i]) * w for i, w in zip(k, share)])


def bags(out):
    golden = {}
    schemas = {
        "/joint_states": ("sensor_msgs/msg/JointState", JOINT_STATE), "/tau": ("std_msgs/msg/Float64MultiArray", MULTI_ARRAY),
        "/dynamic_joint_states": ("control_msgs/msg/DynamicJointState", DYNAMIC_STATE), "/own": ("own_msgs/msg/Own", OWN),
        "/controller/state": ("control_msgs/msg/JointTrajectoryControllerState", CONTROLLER_STATE),
    }
    for name, compression, chunk in [
        ("zstd", CompressionType.ZSTD, 4000), ("lz4", CompressionType.LZ4, 4000), ("plain", CompressionType.NONE, 1 << 20),
    ]:
        buffer = io.BytesIO()
        writer = Ros2Writer(buffer, chunk_size=chunk, compression=compression)
        known = {topic: writer.register_msgdef(kind, text) for topic, (kind, text) in schemas.items()}
        put = lambda topic, message, stamp: writer.write_message(topic, known[topic], message, log_time=stamp, publish_time=stamp)
        for i in range(ROWS):
            # The joint order changes between messages, as with drivers that use a map.
            put("/joint_states", joint_state(i, (0, 1) if i % 3 else (1, 0)), LOGGED[i])
            if name != "lz4":
                continue
            put("/dynamic_joint_states", dynamic_state(i), LOGGED[i] + 10)
            put("/own", own_message(i), LOGGED[i] + 20)
            put("/controller/state", controller_state(i), LOGGED[i] + 30)
        writer.finish()
        (out / f"{name}.mcap").write_bytes(buffer.getvalue())
        golden[f"{name}.mcap"] = dict(STATE_COLUMNS)
    golden["lz4.mcap"] |= DYNAMIC_COLUMNS | OWN_COLUMNS | CONTROLLER_COLUMNS

    # Torques in a separate topic at 40 Hz without a header; they are joined by recording time.
    buffer = io.BytesIO()
    writer = Ros2Writer(buffer, compression=CompressionType.ZSTD)
    known = {topic: writer.register_msgdef(kind, text) for topic, (kind, text) in schemas.items()}
    times = [LOGGED[0] + 12_345_678 + 25_000_000 * k for k in range(13)]
    values = np.array([np.cos(0.3 * np.arange(13)), np.sin(0.5 * np.arange(13))])
    events = [(LOGGED[i], "/joint_states", joint_state(i)) for i in range(ROWS)]
    layout = {"dim": [], "data_offset": 0}
    events += [(at, "/tau", {"layout": layout, "data": list(values[:, k])}) for k, at in enumerate(times)]
    for at, topic, message in sorted(events, key=lambda event: event[0]):
        writer.write_message(topic, known[topic], message, log_time=at, publish_time=at)
    writer.finish()
    (out / "two_clocks.mcap").write_bytes(buffer.getvalue())
    inside = [i for i in range(ROWS) if times[0] <= LOGGED[i] <= times[-1]]
    at = [LOGGED[i] for i in inside]
    golden["two_clocks.mcap"] = {
        "joined": True,
        "/joint_states.header.stamp": np.array(seconds(STAMPS))[inside],
        "/joint_states.position[elbow]": Q[1][inside],
        "/tau.data[0]": interpolated(at, np.array(times), values[0]),
        "/tau.data[1]": interpolated(at, np.array(times), values[1]),
    }

    # JSON messages, as written by web tools.
    buffer = io.BytesIO()
    writer = RawWriter(buffer, compression=CompressionType.ZSTD)
    writer.start()
    schema = writer.register_schema(name="state", encoding="jsonschema", data=b'{"type": "object"}')
    channel = writer.register_channel(topic="arm", message_encoding="json", schema_id=schema)
    for i in range(ROWS):
        data = json.dumps({"q": list(Q[:, i]), "mode": "run"}).encode()
        writer.add_message(channel, log_time=LOGGED[i], publish_time=LOGGED[i], data=data)
    writer.finish()
    (out / "json.mcap").write_bytes(buffer.getvalue())
    golden["json.mcap"] = {"arm.log_time": seconds(LOGGED), "arm.q[0]": Q[0], "arm.q[1]": Q[1]}
    return golden


def cdr_messages():
    """Messages for the databases, serialised with the CDR code of the writer."""
    from mcap_ros2._dynamic import serialize_dynamic

    def serialiser(kind, text):
        return serialize_dynamic(kind.replace("/msg/", "/"), text)[kind.replace("/msg/", "/")]

    state, controller = serialiser("sensor_msgs/msg/JointState", JOINT_STATE), serialiser(
        "control_msgs/msg/JointTrajectoryControllerState", CONTROLLER_STATE
    )
    own = serialiser("own_msgs/msg/Own", OWN)
    return (
        [bytes(state(joint_state(i))) for i in range(ROWS)],
        [bytes(controller(controller_state(i))) for i in range(ROWS)],
        [bytes(own(own_message(i))) for i in range(ROWS)],
    )


def databases(out):
    states, controllers, own = cdr_messages()
    packer = zstandard.ZstdCompressor()
    for name, definitions, packed in [("humble.db3", False, False), ("jazzy.db3", True, False), ("packed.db3", True, True)]:
        path = out / name
        path.unlink(missing_ok=True)
        database = sqlite3.connect(path)
        # Small pages, so that trees have inner pages and long messages need overflow pages.
        database.execute("PRAGMA page_size = 512")
        database.execute("PRAGMA journal_mode = MEMORY")
        # Schema of rosbag2_storage_sqlite3, in its two versions.
        database.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL,"
            "offered_qos_profiles TEXT NOT NULL" + (",type_description_hash TEXT NOT NULL)" if definitions else ")")
        )
        database.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
        )
        database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        if definitions:
            database.execute(
                "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,"
                "encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL)"
            )
        topics = [("/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE, states)]
        if not definitions:
            topics.append(
                ("/controller/state", "control_msgs/msg/JointTrajectoryControllerState", CONTROLLER_STATE, controllers)
            )
        else:
            topics.append(("/own", "own_msgs/msg/Own", OWN, own))
        for number, (topic, kind, text, _) in enumerate(topics, 1):
            row = (number, topic, kind, "cdr", "") + (("RIHS01_0",) if definitions else ())
            database.execute(f"INSERT INTO topics VALUES ({','.join('?' * len(row))})", row)
            if definitions:
                database.execute("INSERT INTO message_definitions VALUES (?,?,?,?,?)", (number, kind, "ros2msg", text, "RIHS01_0"))
        for i in range(ROWS):
            for number, (_, _, _, messages) in enumerate(topics, 1):
                data = packer.compress(messages[i]) if packed else messages[i]
                database.execute(
                    "INSERT INTO messages (topic_id, timestamp, data) VALUES (?,?,?)", (number, LOGGED[i] + number - 1, data)
                )
        database.commit()
        database.close()
    return {
        "humble.db3": STATE_COLUMNS | CONTROLLER_COLUMNS,
        "jazzy.db3": STATE_COLUMNS | OWN_COLUMNS,
        "packed.db3": STATE_COLUMNS | OWN_COLUMNS,
    }


def folder(out):
    """A rosbag2 folder in two parts."""
    bag = out / "bag"
    bag.mkdir(exist_ok=True)
    half = ROWS // 2
    for part, rows in enumerate([range(half), range(half, ROWS)]):
        buffer = io.BytesIO()
        writer = Ros2Writer(buffer, compression=CompressionType.ZSTD)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for i in rows:
            writer.write_message("/joint_states", schema, joint_state(i), log_time=LOGGED[i], publish_time=LOGGED[i])
        writer.finish()
        (bag / f"bag_{part}.mcap").write_bytes(buffer.getvalue())
    (bag / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  relative_file_paths:\n"
        "    - bag_0.mcap\n    - bag_1.mcap\n  duration:\n    nanoseconds: 390000000\n",
        encoding="utf-8",
    )
    return {"bag": STATE_COLUMNS}


ROS1_OWN = """uint8 MODE_IDLE=0
bool moving
char letter
byte step
time measured
duration waited
Inner[] inner
float32[3] force
"""
ROS1_INNER = "string label\nfloat64 value\n"
ROS1_STATE = f"""Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{SEPARATOR}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""


def ros1_messages():
    """Messages of a joint state and of an own type, serialised by rosbags, with the definitions."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(ROS1_OWN, "own_msgs/msg/Own"))
    store.register(get_types_from_msg(ROS1_INNER, "own_msgs/msg/Inner"))
    of = lambda name: store.types[name]
    stamp = lambda ns: of("builtin_interfaces/msg/Time")(sec=ns // 10**9, nanosec=ns % 10**9)
    states, own = [], []
    for i in range(ROWS):
        head = of("std_msgs/msg/Header")(seq=i, stamp=stamp(STAMPS[i]), frame_id="base")
        order = [0, 1] if i % 3 else [1, 0]
        state = of("sensor_msgs/msg/JointState")(
            header=head, name=[JOINTS[j] for j in order], position=Q[order, i], velocity=DQ[order, i], effort=TAU[order, i]
        )
        states.append(bytes(store.serialize_ros1(state, "sensor_msgs/msg/JointState")))
        inner = [of("own_msgs/msg/Inner")(label="a" * (i % 4), value=float(Q[0, i])) for _ in range(2)]
        message = of("own_msgs/msg/Own")(
            moving=bool(i % 2), letter=200, step=-i, measured=stamp(STAMPS[i]), waited=of("builtin_interfaces/msg/Duration")(sec=1, nanosec=500_000_000),
            inner=inner, force=F32[0, i] * np.ones(3, np.float32),
        )
        own.append(bytes(store.serialize_ros1(message, "own_msgs/msg/Own")))
    return store, states, own


class Ros1Message:
    """A message as the classes of genpy, for the writer of mcap-ros1-support."""

    _type = "sensor_msgs/JointState"
    _full_text = ROS1_STATE

    def __init__(self, data):
        self.data = data

    def serialize(self, buffer):
        buffer.write(self.data)


def ros1_bags(out):
    """ROS 1 bags with every compression, a bag without chunks, and MCAP with messages of ROS 1 and in CBOR."""
    store, states, own = ros1_messages()
    columns = {
        "/joint_states.header.seq": np.arange(ROWS), **STATE_COLUMNS,
        "/own.moving": np.arange(ROWS) % 2, "/own.letter": np.full(ROWS, 200), "/own.step": -np.arange(ROWS),
        "/own.measured": seconds(STAMPS), "/own.waited": np.full(ROWS, 1.5), "/own.inner[0].value": Q[0], "/own.inner[1].value": Q[0],
        **{f"/own.force[{k}]": F32[0] for k in range(3)},
    }
    for name, compression in [("plain.bag", None), ("bz2.bag", BagWriter.CompressionFormat.BZ2), ("lz4.bag", BagWriter.CompressionFormat.LZ4)]:
        path = out / name
        path.unlink(missing_ok=True)
        writer = BagWriter(path)
        if compression:
            writer.set_compression(compression)
        writer.chunk_threshold = 3000
        with writer:
            state = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
            other = writer.add_connection("/own", "own_msgs/msg/Own", typestore=store)
            for i in range(ROWS):
                writer.write(state, LOGGED[i], states[i])
                writer.write(other, LOGGED[i] + 20, own[i])
    buffer = io.BytesIO()
    writer = Ros1Writer(buffer, compression=CompressionType.ZSTD)
    for i in range(ROWS):
        writer.write_message("/joint_states", Ros1Message(states[i]), log_time=LOGGED[i], publish_time=LOGGED[i])
    writer.finish()
    (out / "ros1.mcap").write_bytes(buffer.getvalue())

    buffer = io.BytesIO()
    writer = RawWriter(buffer, compression=CompressionType.ZSTD)
    writer.start()
    channel = writer.register_channel(topic="arm", message_encoding="cbor", schema_id=0)
    for i in range(ROWS):
        order = [0, 1] if i % 3 else [1, 0]
        data = cbor2.dumps({"name": [JOINTS[j] for j in order], "q": [float(Q[j, i]) for j in order], "half": float(F32[0, i].astype(np.float16)), "n": -i}, canonical=True)
        writer.add_message(channel, log_time=LOGGED[i], publish_time=LOGGED[i], data=data)
    writer.finish()
    (out / "cbor.mcap").write_bytes(buffer.getvalue())
    state_columns = {name: values for name, values in columns.items() if not name.startswith("/own")}
    return {
        **{name: dict(columns) for name in ["plain.bag", "bz2.bag", "lz4.bag"]},
        "ros1.mcap": state_columns,
        "cbor.mcap": {
            "arm.log_time": seconds(LOGGED), "arm.q[shoulder]": Q[0], "arm.q[elbow]": Q[1], "arm.half": F32[0].astype(np.float16), "arm.n": -np.arange(ROWS),
        },
    }


def protobuf_classes():
    """Classes of messages in proto3, as protoc generates them: an arm, and messages of it in a second file."""
    Field = descriptor_pb2.FieldDescriptorProto
    kinds = {name[5:].lower(): number for name, number in Field.Type.items()}

    def fields(message, *descriptions):
        for number, (name, kind, *options) in enumerate(descriptions, 1):
            own = message.field.add(name=name, number=number, label=Field.LABEL_REPEATED if "repeated" in options else Field.LABEL_OPTIONAL)
            if kind.startswith("."):
                own.type, own.type_name = (Field.TYPE_ENUM if "enum" in options else Field.TYPE_MESSAGE), kind
            else:
                own.type = kinds[kind]
            if "unpacked" in options:
                own.options.packed = False
            if "optional" in options:
                own.proto3_optional, own.oneof_index = True, len(message.oneof_decl)
                message.oneof_decl.add(name=f"_{name}")

    pool = DescriptorPool()
    for module in (timestamp_pb2, duration_pb2):
        pool.AddSerializedFile(module.DESCRIPTOR.serialized_pb)
    parts = descriptor_pb2.FileDescriptorProto(name="parts.proto", package="own", syntax="proto3")
    fields(parts.message_type.add(name="Joint"), ("name", "string"), ("position", "double"), ("velocity", "double"), ("effort", "float"))
    mode = parts.enum_type.add(name="Mode")
    for number, name in enumerate(["IDLE", "RUN", "STOP"]):
        mode.value.add(name=name, number=number)
    arm = descriptor_pb2.FileDescriptorProto(name="arm.proto", package="own", syntax="proto3")
    arm.dependency.extend(["parts.proto", "google/protobuf/timestamp.proto", "google/protobuf/duration.proto"])
    message = arm.message_type.add(name="Arm")
    inner = message.nested_type.add(name="Inner")
    fields(inner, ("joint_names", "string", "repeated"), ("tau", "double", "repeated"), ("raw", "sint32", "repeated", "unpacked"))
    entry = message.nested_type.add(name="TemperatureEntry")
    entry.options.map_entry = True
    fields(entry, ("key", "string"), ("value", "double"))
    fields(
        message,
        ("timestamp", ".google.protobuf.Timestamp"), ("joints", ".own.Joint", "repeated"), ("inner", ".own.Arm.Inner"),
        ("temperature", ".own.Arm.TemperatureEntry", "repeated"), ("maybe", "double", "optional"), ("step", "int32"), ("zigzag", "sint64"),
        ("moving", "bool"), ("mode", ".own.Mode", "enum"), ("big", "fixed64"), ("small", "sfixed32"), ("waited", ".google.protobuf.Duration"),
        ("note", "string"), ("image", "bytes"), ("rest", "double"),
    )
    pool.Add(parts)
    pool.Add(arm)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("own.Arm"))


def protobuf_file(out):
    """MCAP with messages in Protobuf, as Foxglove and others write them."""
    Arm = protobuf_classes()
    buffer = io.BytesIO()
    writer = ProtobufWriter(buffer, compression=CompressionType.ZSTD)
    for i in range(ROWS):
        order = [0, 1] if i % 3 else [1, 0]
        # Zeros are not on the wire.
        message = Arm(
            joints=[{"name": JOINTS[j], "position": Q[j, i], "velocity": 0.0 if i % 5 == 0 else DQ[j, i], "effort": F32[j, i]} for j in order],
            inner={"joint_names": [JOINTS[j] for j in order], "tau": [TAU[j, i] for j in order], "raw": [-i, i]},
            temperature={JOINTS[j]: 20.0 + TAU[j, i] for j in order}, step=-i, zigzag=-(2**40) + i, moving=i % 2 == 1, mode=i % 3, big=2**52 + i,
            small=-i, note="a" * (i % 4), image=bytes(i),
        )
        message.timestamp.FromNanoseconds(STAMPS[i])
        message.waited.FromNanoseconds(1_500_000_000)
        if i % 7 != 3:
            message.maybe = 0.0 if i % 2 else 0.5
        writer.write_message("/arm", message, log_time=LOGGED[i], publish_time=LOGGED[i])
    writer.finish()
    (out / "protobuf.mcap").write_bytes(buffer.getvalue())
    still = np.arange(ROWS) % 5 == 0
    of_joint = lambda j: {
        f"/arm.joints[{JOINTS[j]}].position": Q[j], f"/arm.joints[{JOINTS[j]}].velocity": np.where(still, 0.0, DQ[j]),
        f"/arm.joints[{JOINTS[j]}].effort": F32[j], f"/arm.inner.tau[{JOINTS[j]}]": TAU[j], f"/arm.temperature[{JOINTS[j]}]": 20.0 + TAU[j],
        f"/arm.inner.raw[{JOINTS[j]}]": np.where((np.arange(ROWS) % 3 > 0) == (j == 0), -1, 1) * np.arange(ROWS),
    }
    step = np.arange(ROWS)
    return {
        "protobuf.mcap": {
            "/arm.log_time": seconds(LOGGED), "/arm.timestamp": seconds(STAMPS), **of_joint(0), **of_joint(1),
            "/arm.maybe": np.where(step % 7 == 3, np.nan, np.where(step % 2, 0.0, 0.5)), "/arm.step": -step, "/arm.zigzag": -(2.0**40) + step,
            "/arm.moving": step % 2, "/arm.mode": step % 3, "/arm.big": 2.0**52 + step, "/arm.small": -step, "/arm.waited": np.full(ROWS, 1.5),
            "/arm.rest": np.zeros(ROWS),
        }
    }


def packed_parts(out):
    """rosbag2 folders whose parts are compressed as whole files: SQLite and MCAP."""
    packer = zstandard.ZstdCompressor(level=19)
    for name, part in [("packed_database", "jazzy.db3"), ("packed_mcap", "plain.mcap")]:
        bag = out / name
        bag.mkdir(exist_ok=True)
        (bag / f"{part}.zstd").write_bytes(packer.compress((out / part).read_bytes()))
        (bag / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n    - {part}.zstd\n"
            "  compression_format: zstd\n  compression_mode: FILE\n",
            encoding="utf-8",
        )
    return {"packed_database": STATE_COLUMNS | OWN_COLUMNS, "packed_mcap": STATE_COLUMNS}


def ulog_file(out):
    """Writes ULog by its specification, because pyulog writes only files that it has read; pyulog reads the result back."""
    from pyulog import ULog

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)
    data += message("B", bytes(40))
    data += message("I", bytes([len("char[3] sys_name")]) + b"char[3] sys_namePX4")
    data += message("F", b"inner:float torque;uint8_t[3] _padding0;int16_t step;")
    data += message("F", b"arm_state:uint64_t timestamp;double[2] q;inner[2] joints;char[4] note;bool moving;uint8_t[5] _padding0;")
    data += message("A", struct.pack("<BH", 0, 7) + b"arm_state") + message("A", struct.pack("<BH", 1, 9) + b"arm_state")
    for i in range(ROWS):
        for instance, number in enumerate((7, 9)):
            body = struct.pack("<HQ2d", number, 1_000_000 + 10_000 * i, *Q[:, i])
            for j in range(2):
                body += struct.pack("<f3sh", TAU.astype(np.float32)[j, i], b"xyz", -i)
            body += b"abcd" + bytes([(i + instance) % 2])
            data += message("D", body)
        data += message("S", b"")
    path = out / "flight.ulg"
    path.write_bytes(data)
    back = {f"{d.name}_{d.multi_id}": d.data for d in ULog(str(path)).data_list}
    assert (back["arm_state_0"]["q[1]"] == Q[1]).all() and (back["arm_state_1"]["joints[1].torque"] == TAU.astype(np.float32)[1]).all()
    columns = {}
    for instance, topic in enumerate(["arm_state", "arm_state_1"]):
        columns |= {
            f"{topic}.timestamp": 1_000_000 + 10_000 * np.arange(ROWS), f"{topic}.q[0]": Q[0], f"{topic}.q[1]": Q[1],
            f"{topic}.moving": (np.arange(ROWS) + instance) % 2,
        }
        columns |= {f"{topic}.joints[{j}].torque": TAU.astype(np.float32)[j] for j in range(2)}
        columns |= {f"{topic}.joints[{j}].step": -np.arange(ROWS) for j in range(2)}
    return {"flight.ulg": columns}


def octave_file(out):
    """Writes Octave's text format by its sources, because Octave is not available here."""
    number = lambda x: repr(float(x)) if np.isfinite(x) else str(x)
    matrix = lambda name, rows: f"# name: {name}\n# type: matrix\n# rows: {len(rows)}\n# columns: {len(rows[0])}\n" + "".join(
        " " + " ".join(number(x) for x in row) + "\n" for row in rows
    ) + "\n\n"
    text = "# Created by Octave 8.4.0, Mon Nov 23 10:00:00 2026 UTC <user@host>\n"
    text += f"# name: t\n# type: range\n# base, limit, increment\n0 {number(0.01 * (ROWS - 1))} 0.01\n\n\n"
    text += matrix("q", Q.T) + matrix("tau", TAU)
    text += f"# name: ticks\n# type: int32 matrix\n# ndims: 2\n {ROWS} 1\n" + "".join(f"  {i - 3}\n" for i in range(ROWS)) + "\n\n"
    text += "# name: robot\n# type: string\n# elements: 1\n# length: 3\narm\n\n\n"
    text += "# name: z\n# type: complex matrix\n# rows: 1\n# columns: 2\n (1,2) (3,4)\n\n\n"
    text += "# name: log\n# type: scalar struct\n# ndims: 2\n 1 1\n# length: 2\n" + matrix("dq", DQ.T)
    text += "# name: gain\n# type: scalar\n0.5\n\n\n\n\n"
    (out / "octave.txt").write_text(text, encoding="utf-8")
    return {
        "octave.txt": {
            "t": [0.0 + k * 0.01 for k in range(ROWS)], "q[0]": Q[0], "q[1]": Q[1], "tau[0]": TAU[0], "tau[1]": TAU[1],
            "ticks": np.arange(ROWS) - 3, "log.dq[0]": DQ[0], "log.dq[1]": DQ[1],
        }
    }


def matlab_4(out):
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"t": T[:, None], "q": Q.T, "tau": TAU, "name": "arm", "z": Q.T + 1j}, format="4")
    (out / "v4.mat").write_bytes(buffer.getvalue())
    # The other byte order, single and whole numbers, by the documentation.
    variable = lambda kind, name, values: struct.pack(">5i", 1000 + kind, *values.shape, 0, len(name) + 1) + name.encode() + b"\0" + values.T.tobytes()
    (out / "v4_big_endian.mat").write_bytes(
        variable(10, "q", F32.T.astype(">f4")) + variable(20, "ticks", (np.arange(ROWS)[:, None] - 5).astype(">i4"))
        + variable(0, "t", T[:, None].astype(">f8"))
    )
    columns = {"t": T, "q[0]": Q[0], "q[1]": Q[1], "tau[0]": TAU[0], "tau[1]": TAU[1]}
    return {"v4.mat": columns, "v4_big_endian.mat": {"q[0]": F32[0], "q[1]": F32[1], "ticks": np.arange(ROWS) - 5, "t": T}}


def text_arrays(out):
    """Text on its side (pandas), and text with one value on each line (NumPy, SciPy in Matrix Market)."""
    matrix = np.column_stack([T, Q.T, TAU.T])
    columns = {"t_s": T, "q1": Q[0], "q2": Q[1], "tau1": TAU[0], "tau2": TAU[1]}
    pandas.DataFrame(columns).T.to_csv(out / "sideways.csv", header=False)
    np.savetxt(out / "value_list.txt", matrix.ravel(), fmt="%.17g", header=f"shape: {matrix.shape}")
    scipy.io.mmwrite(out / "matrix_market.mtx", matrix, precision=17)
    indexed = {str(k): matrix[:, k] for k in range(5)}
    return {"sideways.csv": columns, "value_list.txt": dict(indexed), "matrix_market.mtx": dict(indexed)}


def text_encodings(out):
    text = text_table().decode()
    (out / "utf16.csv").write_bytes(text.encode("utf-16"))
    (out / "carriage_returns.csv").write_bytes(text.replace("\n", "\r").encode())
    return {"utf16.csv": TEXT_COLUMNS, "carriage_returns.csv": TEXT_COLUMNS}


def parquet_files(out):
    maybe = pa.array([None if i % 7 == 3 else float(TAU[0, i]) for i in range(ROWS)], pa.float64())
    table = pa.table({
        "t": T,
        "stamp": pa.array(STAMPS, pa.timestamp("ns")),
        "observation.state": pa.array([[float(x) for x in Q[:, i]] for i in range(ROWS)], pa.list_(pa.float64())),
        "action": pa.array([[float(x) for x in F32[:, i]] for i in range(ROWS)], pa.list_(pa.float32(), 2)),
        "maybe": maybe,
        "flag": pa.array([bool(i % 2) for i in range(ROWS)]),
        "n": pa.array(range(ROWS), pa.int32()),
        "unsigned": pa.array([2**16 - 1 - i for i in range(ROWS)], pa.uint16()),
        "task": pa.array(["push"] * ROWS),
        "inner": pa.array([{"x": float(TAU[1, i])} for i in range(ROWS)]),
    })
    pq.write_table(table, out / "zstd.parquet", compression="zstd", row_group_size=15)
    pq.write_table(table, out / "snappy.parquet", compression="snappy", use_dictionary=False, data_page_version="2.0")
    columns = {
        "t": T, "stamp": seconds(STAMPS), "observation.state[0]": Q[0], "observation.state[1]": Q[1], "action[0]": F32[0],
        "action[1]": F32[1], "maybe": np.array([np.nan if i % 7 == 3 else TAU[0, i] for i in range(ROWS)]),
        "flag": np.arange(ROWS) % 2, "n": np.arange(ROWS), "unsigned": 2**16 - 1 - np.arange(ROWS), "inner.x": TAU[1],
    }
    return {"zstd.parquet": columns, "snappy.parquet": columns}


def arrow_files(out):
    """All column types with every compression, as a file and as a stream."""
    holes = [i % 7 == 3 for i in range(ROWS)]
    lists = [None if hole else [float(x) for x in Q[:, i]][: 1 if i == 9 else 2] for i, hole in enumerate(holes)]
    table = pa.table({
        "t": T,
        "stamp": pa.array(STAMPS, pa.timestamp("ns", tz="UTC")),
        "task": pa.array(["push"] * ROWS),
        "observation.state": pa.array(lists, pa.list_(pa.float64())),
        "action": pa.array([[float(x) for x in F32[:, i]] for i in range(ROWS)], pa.list_(pa.float32(), 2)),
        "seen": pa.array(["far" if hole else None for hole in holes], pa.string_view()),
        "ticks": pa.array([[i, -i] for i in range(ROWS)], pa.large_list(pa.int16())),
        "mode": pa.array(["idle", "moving"] * (ROWS // 2)).dictionary_encode(),
        "maybe": pa.array([None if hole else float(TAU[0, i]) for i, hole in enumerate(holes)], pa.float64()),
        "flag": pa.array([bool(i % 2) for i in range(ROWS)]),
        "empty": pa.nulls(ROWS),
        "words": pa.array([["a", "b"]] * ROWS, pa.list_(pa.string())),
        "half": pa.array(Q[0].astype(np.float16)),
        "big": pa.array([2**63 + i * 2**40 for i in range(ROWS)], pa.uint64()),
        "small": pa.array([-i for i in range(ROWS)], pa.int8()),
        "waited": pa.array([1500 * i for i in range(ROWS)], pa.duration("us")),
        "clock": pa.array([36_000_000 + i for i in range(ROWS)], pa.time32("ms")),
        "inner": pa.array(
            [None if hole else {"x": float(TAU[1, i]), "name": "b"} for i, hole in enumerate(holes)],
            pa.struct([("x", pa.float64()), ("name", pa.string())]),
        ),
        "matrix": pa.array([[[1.0], [2.0]]] * ROWS, pa.list_(pa.list_(pa.float64()))),
        "either": pa.UnionArray.from_dense(
            pa.array([0, 1] * (ROWS // 2), pa.int8()), pa.array([i // 2 for i in range(ROWS)], pa.int32()),
            [pa.array(T[: ROWS // 2]), pa.array(["x"] * (ROWS // 2))],
        ),
        "last": pa.array(np.arange(ROWS), pa.uint32()),
    })
    for codec in ["lz4", "zstd"]:
        pa.feather.write_feather(table, out / f"{codec}.feather", compression=codec, chunksize=15)
    plain = pa.ipc.IpcWriteOptions(compression=None)
    with pa.ipc.new_file(out / "plain.arrow", table.schema, options=plain) as writer:
        writer.write_table(table, max_chunksize=15)
    with pa.ipc.new_stream(out / "stream.arrows", table.schema, options=plain) as writer:
        writer.write_table(table, max_chunksize=15)
    old = pa.ipc.IpcWriteOptions(use_legacy_format=True, metadata_version=pa.ipc.MetadataVersion.V4)
    with pa.ipc.new_file(out / "before_0_15.feather", table.drop_columns(["seen", "either"]).schema, options=old) as writer:
        writer.write_table(table.drop_columns(["seen", "either"]))

    def present(values):
        return np.array([np.nan if hole else float(x) for hole, x in zip(holes, values)])

    second = present(Q[1])
    second[9] = np.nan
    columns = {
        "t": T, "stamp": seconds(STAMPS), "observation.state[0]": present(Q[0]), "observation.state[1]": second,
        "action[0]": F32[0], "action[1]": F32[1], "ticks[0]": np.arange(ROWS), "ticks[1]": -np.arange(ROWS),
        "maybe": present(TAU[0]), "flag": np.arange(ROWS) % 2, "half": Q[0].astype(np.float16),
        "big": [float(2**63 + i * 2**40) for i in range(ROWS)], "small": -np.arange(ROWS),
        "waited": [1500 * i / 1e6 for i in range(ROWS)], "clock": [(36_000_000 + i) / 1e3 for i in range(ROWS)],
        "inner.x": present(TAU[1]), "last": np.arange(ROWS),
    }
    return {
        name: dict(columns)
        for name in ["lz4.feather", "zstd.feather", "plain.arrow", "stream.arrows", "before_0_15.feather"]
    }


def lerobot_files(out):
    """Data sets in the layout of lerobot 0.4.4 (version 3, several episodes per file) and 0.3 (version 2.1, one file per episode), written by pyarrow."""
    lengths = [15, 12, 13]
    bounds = np.cumsum([0, *lengths])
    stamps = np.concatenate([np.arange(n) / 100.0 for n in lengths]).astype(np.float32)
    episode = np.repeat(np.arange(len(lengths)), lengths)
    time, offset = np.zeros(ROWS), 0.0
    for i in range(ROWS):
        if i and episode[i] != episode[i - 1]:
            offset = time[i - 1] + 10.0 - float(stamps[i])
        time[i] = float(stamps[i]) + offset
    effort = TAU.astype(np.float32)
    names = [f"{joint}.pos" for joint in JOINTS]
    feature = {"dtype": "float32", "shape": [2], "names": names}
    scalar = {"shape": [1], "names": None}
    features = {
        "action": feature | {"names": {"motors": JOINTS}},
        "observation.state": feature,
        "observation.effort": feature | {"names": ["dim"]},
        "observation.images.top": {"dtype": "video", "shape": [3, 4, 4], "names": ["channels", "height", "width"]},
        "timestamp": scalar | {"dtype": "float32"},
        **{key: scalar | {"dtype": "int64"} for key in ["frame_index", "episode_index", "index", "task_index"]},
    }

    def rows(begin, end):
        def lists(values):
            return pa.array([[float(x) for x in values[:, i]] for i in range(begin, end)], pa.list_(pa.float32(), 2))
        return pa.table({
            "action": lists(F32), "observation.state": lists(DQ.astype(np.float32)), "observation.effort": lists(effort),
            "timestamp": stamps[begin:end], "frame_index": np.concatenate([np.arange(n) for n in lengths])[begin:end],
            "episode_index": episode[begin:end], "index": np.arange(begin, end), "task_index": np.zeros(end - begin, np.int64),
        })

    layouts = {
        "lerobot_v2": ("v2.1", "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet", bounds),
        "lerobot_v3": ("v3.0", "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", bounds[[0, 2, 3]]),
    }
    for name, (version, path, ends) in layouts.items():
        info = {
            "codebase_version": version, "robot_type": "two_joints", "total_episodes": len(lengths), "total_frames": ROWS, "fps": 100,
            "chunks_size": 1000, "data_path": path, "features": features,
        }
        (out / name / "meta").mkdir(parents=True, exist_ok=True)
        (out / name / "meta/info.json").write_text(json.dumps(info, indent=4) + "\n", encoding="utf-8")
        for k, (begin, end) in enumerate(zip(ends, ends[1:])):
            file = out / name / path.format(episode_chunk=0, episode_index=k, chunk_index=0, file_index=k)
            file.parent.mkdir(parents=True, exist_ok=True)
            pq.write_table(rows(begin, end), file, compression="snappy", use_dictionary=True)
    columns = {
        "action[shoulder]": F32[0], "action[elbow]": F32[1],
        "observation.state[shoulder.pos]": DQ.astype(np.float32)[0], "observation.state[elbow.pos]": DQ.astype(np.float32)[1],
        "observation.effort[0]": effort[0], "observation.effort[1]": effort[1], "timestamp": stamps,
        "frame_index": np.concatenate([np.arange(n) for n in lengths]), "episode_index": episode, "index": np.arange(ROWS),
        "task_index": np.zeros(ROWS), "time": time,
    }
    return {name: dict(columns) for name in layouts}


def diadem_files(out):
    """Writes headers and numbers according to NI's documentation of the DIAdem keys and published traces of KUKA controllers, because no program that writes
    them is available here: a trace of two drives, and numbers of several types, stored by channel, big-endian."""
    def header(order, channels):
        lines = ["DIAEXTENDED", "#BEGINGLOBALHEADER", "  1,DOS", '102,rob "#KR6R900"', "111,9.9000000000E+34", f"112,{order}", "#ENDGLOBALHEADER", ""]
        for channel in channels:
            lines += ["#BEGINCHANNELHEADER", *(f"{key},{value}" for key, value in channel.items()), "#ENDCHANNELHEADER", ""]
        return "\r\n".join(lines).encode("latin-1")

    clock = {200: "Zeit", 201: "Zeitkanal", 202: "sec", 210: "IMPLIZIT", 220: ROWS, 240: "0.00000", 241: "0.00400000"}
    folder = out / "trace"
    folder.mkdir(exist_ok=True)
    columns = {"Zeit": [0.0 + 0.004 * i for i in range(ROWS)]}
    for drive in range(2):
        micro = 1e6 * Q[drive]
        torque = np.where(np.arange(ROWS) == 5, 9.9e34, TAU[drive])
        (folder / f"run_NextGenDrive#{drive + 1}.r64").write_bytes(np.stack([micro, torque], axis=1).astype("<f8").tobytes())
        channels = [clock]
        for place, (name, unit, factor) in enumerate([("Istposition", "\u00b0", "1.000000e-06"), ("Istmoment", "Nm", "1.000000e+00")]):
            channels.append({
                200: name, 201: "AT_Drive", 202: unit, 210: "EXPLIZIT", 211: f"renamed_NextGenDrive#{drive + 1}.r64", 213: "BLOCK", 214: "REAL64",
                220: ROWS, 221: place + 1, 240: 0, 241: factor,
            })
        (folder / f"run_NextGenDrive#{drive + 1}.dat").write_bytes(header("High -> Low", channels))
        columns[f"Istposition[A{drive + 1}]"] = [float(x) * 1e-6 + 0.0 for x in micro]
        columns[f"Istmoment[A{drive + 1}]"] = np.where(np.arange(ROWS) == 5, np.nan, TAU[drive])
    counts = np.round(1000 * Q[0]).astype(int)
    parts = {"REAL32": F32[1].astype(">f4"), "INT16": counts.astype(">i2"), "WORD8": (np.arange(ROWS) % 7).astype(">u1")}
    channels = [clock]
    for kind, values in parts.items():
        (folder / f"types.{kind}").write_bytes(bytes(values.itemsize) + values.tobytes())
        channels.append({
            200: kind.lower(), 210: "EXPLICIT", 211: f"C:\\KRC\\TRACE\\types.{kind}", 213: "CHANNEL", 214: kind, 220: ROWS, 221: 2,
            240: "0.5", 241: "0.25",
        })
    (folder / "types.dat").write_bytes(header("Low -> High", channels))
    types = {"Zeit": columns["Zeit"], **{kind.lower(): [float(x) * 0.25 + 0.5 for x in values] for kind, values in parts.items()}}
    return {"trace/run_NextGenDrive#2.dat": columns, "trace/types.dat": types}


def matlab_files(out):
    variables = {
        "t": T[:, None], "q": Q.T, "tau": TAU, "ticks": np.arange(ROWS, dtype=np.int16)[:, None], "single_q": F32.T,
        "robot": "arm", "gains": np.array([[1.0, 2.0]]), "log": {"dq": DQ, "inner": {"mode": np.arange(ROWS) % 3}},
    }
    for name, packed in [("plain.mat", False), ("packed.mat", True)]:
        buffer = io.BytesIO()
        scipy.io.savemat(buffer, variables, do_compression=packed)
        # Replace the header text, which contains the date.
        data = bytearray(buffer.getvalue())
        data[:116] = b"MATLAB 5.0 MAT-file Platform: posix, made by SciPy".ljust(116)
        (out / name).write_bytes(data)
    columns = {
        "t": T, "q[0]": Q[0], "q[1]": Q[1], "tau[0]": TAU[0], "tau[1]": TAU[1], "ticks": np.arange(ROWS), "single_q[0]": F32[0],
        "single_q[1]": F32[1], "log.dq[0]": DQ[0], "log.dq[1]": DQ[1], "log.inner.mode": np.arange(ROWS) % 3,
    }
    return {"plain.mat": columns, "packed.mat": columns}


def hdf5_files(out):
    with h5py.File(out / "groups.h5", "w", libver=("v108", "v110")) as file:
        file.create_dataset("t", data=T, track_times=False)
        arm = file.create_group("arm")
        arm.create_dataset("q", data=Q.T, chunks=(16, 2), compression="gzip", shuffle=True, track_times=False)
        arm.create_dataset("tau", data=TAU.astype(np.float32), track_times=False)
        arm.create_dataset("ticks", data=np.arange(ROWS, dtype=">i4"), track_times=False)
        file.create_dataset("note", data="text")
    # Format of MATLAB's save -v7.3: 512 bytes before the HDF5 file, transposed matrices.
    with h5py.File(out / "v73.mat", "w", userblock_size=512) as file:
        for name, values in [("t", T[None, :]), ("q", Q), ("tau", TAU)]:
            data = file.create_dataset(name, data=values, track_times=False)
            data.attrs["MATLAB_class"] = np.bytes_("double")
    with open(out / "v73.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")
    single = TAU.astype(np.float32)
    return {
        "groups.h5": {
            "t": T, "arm.q[0]": Q[0], "arm.q[1]": Q[1], "arm.tau[0]": single[0], "arm.tau[1]": single[1], "arm.ticks": np.arange(ROWS),
        },
        "v73.mat": {"t": T, "q[0]": Q[0], "q[1]": Q[1], "tau[0]": TAU[0], "tau[1]": TAU[1]},
    }


def pooled(files):
    """Stores every distinct series once, with the index of the series for each column."""
    numbers, series = {}, []
    for columns in files.values():
        for name, values in columns.items():
            if isinstance(values, bool):
                continue
            exact = [float(x).hex() for x in values]
            key = tuple(exact)
            if key not in numbers:
                numbers[key] = len(series)
                series.append(exact)
            columns[name] = numbers[key]
    return {"series": series, "files": files}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    out = parser.parse_args().out / "formats"
    out.mkdir(parents=True, exist_ok=True)
    files = {}
    for make in [packed_text, numpy_files, json_lines, bags, databases, folder, packed_parts, ros1_bags, protobuf_file, ulog_file, octave_file, matlab_4, text_arrays, text_encodings, parquet_files, arrow_files, lerobot_files, diadem_files, matlab_files, hdf5_files]:
        files |= make(out)
    versions = {module.__name__: module.__version__ for module in [h5py, mcap, np, pa, pandas, scipy, zstandard]}
    versions |= {name: importlib.metadata.version(name) for name in ["cbor2", "mcap-protobuf-support", "mcap-ros1-support", "protobuf", "pyulog", "rosbags"]}
    files = {name: dict(columns) for name, columns in files.items()}
    write(out / "values.json", {"seed": SEED, "versions": versions, **pooled(files)})


if __name__ == "__main__":
    main()
