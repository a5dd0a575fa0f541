#!/usr/bin/env python3
"""Measures time and memory for reading one recording (seven joints, 21 channels and time) in every supported log format. Each file is written by an independent program.

    log_formats.py DYNIDENT SCRATCH [--rows 1000000] [--runs 3] [--identify] [--check]

Prints a Markdown table: size, wall time (minimum of RUNS) and peak memory of `dynident log FILE`, with --identify also of `dynident identify`, relative to CSV.
--check asserts the results that do not depend on the speed of the machine: every format gives the same numbers as CSV, and the memory of streamed formats does not grow between
ROWS / 4 and ROWS. Files stay in SCRATCH and are used again. Needs numpy, scipy, pyarrow, h5py, zstandard, rosbags."""
import argparse
import csv
import gzip
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

import h5py
import numpy as np
import pyarrow
import pyarrow.feather
import pyarrow.parquet
import scipy.io
import zstandard
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROBOT = ROOT / "robots/iiwa14.urdf"
JOINTS = 7
RATE_HZ = 1000.0
SEED = 20261123
# Peak memory varies by a few MiB between runs (pages of threads and of the allocator); three quarters of 80,000 rows are 10 MiB of numbers.
STEADY_MIB = 5
# pyarrow writes Parquet pages of 1 MiB per column, and one page per column is unpacked at a time: memory grows up to this number of rows.
PAGE_ROWS = 1 << 17
# Rows per Arrow batch in Feather files written by pyarrow.
BATCH_ROWS = 1 << 16
FLAT = {"time": "t_s", "position": "q{1..7}_rad", "velocity": "dq{1..7}_rad_s", "torque": "tau{1..7}_Nm"}
ARRAYS = {"time": "t", "position": "q[{0..6}]", "velocity": "dq[{0..6}]", "torque": "tau[{0..6}]"}
TOPIC = {"time": "/arm.header.stamp", "position": "/arm.position[joint{1..7}]", "velocity": "/arm.velocity[joint{1..7}]", "torque": "/arm.effort[joint{1..7}]"}


def recording(dynident, scratch, rows):
    """t, q, dq, tau of the moving robot, with noise on position and torque."""
    random = np.random.default_rng(SEED)
    t = np.arange(rows) / RATE_HZ
    harmonics, base = 5, 2 * np.pi * 0.1
    amplitude, phase = random.uniform(0.05, 0.2, (JOINTS, harmonics)), random.uniform(0, 2 * np.pi, (JOINTS, harmonics))
    q, dq, ddq = np.zeros((3, rows, JOINTS))
    for joint in range(JOINTS):
        for k in range(harmonics):
            omega = base * (k + 1)
            angle = omega * t + phase[joint, k]
            q[:, joint] += amplitude[joint, k] * np.sin(angle)
            dq[:, joint] += amplitude[joint, k] * omega * np.cos(angle)
            ddq[:, joint] -= amplitude[joint, k] * omega**2 * np.sin(angle)
    # The motion has a period of 10 s, so its torque is computed once.
    period = min(rows, round(10 * RATE_HZ))
    states, torques = scratch / "states.csv", scratch / "torques.csv"
    with open(states, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([f"{name}{k + 1}" for name in ("q", "dq", "ddq") for k in range(JOINTS)])
        writer.writerows(np.hstack([q, dq, ddq])[:period].tolist())
    subprocess.run([dynident, "evaluate", ROBOT, "--states", states, "--quantity", "inverse-dynamics", "--out", torques], check=True, capture_output=True)
    rigid = np.genfromtxt(torques, delimiter=",", skip_header=1)[:, -JOINTS:]
    tau = np.resize(rigid, (rows, JOINTS)) + 0.5 * dq + 0.8 * np.tanh(dq / 0.01)
    return t, q + 1e-6 * random.standard_normal(q.shape), dq, tau + 0.05 * random.standard_normal(tau.shape)


def flat(t, q, dq, tau):
    names = ["t_s"] + [f"{name}{k}_{unit}" for name, unit in [("q", "rad"), ("dq", "rad_s"), ("tau", "Nm")] for k in range(1, JOINTS + 1)]
    return names, np.column_stack([t, q, dq, tau])


def write_csv(path, *arrays):
    names, table = flat(*arrays)
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        # Digits for an exact round trip of a double.
        writer.writerows(table.tolist())


def write_packed(pack):
    def write(path, *arrays):
        plain = path.parent / "log.csv"
        with open(plain, "rb") as source, pack(path) as target:
            shutil.copyfileobj(source, target)
    return write


def write_json_lines(path, t, q, dq, tau):
    with open(path, "w") as file:
        for row in zip(t.tolist(), q.tolist(), dq.tolist(), tau.tolist()):
            file.write(json.dumps(dict(zip(("t", "q", "dq", "tau"), row))) + "\n")


def write_npy(path, t, q, dq, tau):
    table = np.zeros(len(t), dtype=[("t", "f8"), ("q", "f8", JOINTS), ("dq", "f8", JOINTS), ("tau", "f8", JOINTS)])
    table["t"], table["q"], table["dq"], table["tau"] = t, q, dq, tau
    np.save(path, table)


def write_hdf5(path, *arrays):
    with h5py.File(path, "w") as file:
        for name, values in zip(("t", "q", "dq", "tau"), arrays):
            file.create_dataset(name, data=values, compression="gzip", compression_opts=4)


def write_parquet(path, *arrays):
    names, table = flat(*arrays)
    pyarrow.parquet.write_table(pyarrow.table({name: column for name, column in zip(names, table.T)}), path, compression="zstd")


def write_feather(path, *arrays):
    names, table = flat(*arrays)
    pyarrow.feather.write_feather(pyarrow.table({name: column for name, column in zip(names, table.T)}), path, compression="lz4")


def messages(types, t, q, dq, tau):
    """Serialized JointState messages: rosbags serializes the first one, the others replace the changed bytes, and the last one is compared with rosbags."""
    state, header, stamp = (types.types[name] for name in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    names = [f"joint{k}" for k in range(1, JOINTS + 1)]
    nanoseconds = 1_790_000_000_000_000_000 + np.round(1e9 * t).astype(np.int64)

    def serialized(k):
        time = stamp(int(nanoseconds[k] // 10**9), int(nanoseconds[k] % 10**9))
        return bytes(types.serialize_cdr(state(header(time, ""), names, q[k], dq[k], tau[k]), state.__msgtype__))

    table = np.tile(np.frombuffer(serialized(0), dtype=np.uint8), (len(t), 1))
    words = np.stack([nanoseconds // 10**9, nanoseconds % 10**9], axis=1).astype("<u4")
    table[:, 4:12] = words.view(np.uint8)
    # Three sequences at the end, each with length, padding and numbers.
    numbers = 8 * JOINTS
    for place, values in enumerate((tau, dq, q)):
        end = table.shape[1] - place * (numbers + 8)
        table[:, end - numbers : end] = np.ascontiguousarray(values).view(np.uint8)
    assert table[-1].tobytes() == serialized(len(t) - 1)
    return state.__msgtype__, nanoseconds.tolist(), table


def write_bag(plugin):
    def write(path, *arrays):
        types = get_typestore(Stores.ROS2_JAZZY)
        name, nanoseconds, table = messages(types, *arrays)
        with Writer(path, version=9, storage_plugin=plugin) as writer:
            connection = writer.add_connection("/arm", name, typestore=types)
            for time, message in zip(nanoseconds, table):
                writer.write(connection, time, message.tobytes())
    return write


# name: (columns, rows above which memory does not grow, or None if the complete file is held in memory, writer). CSV is first: the others are compared with it, and compressed files are made from it.
FORMATS = {
    "log.csv": (FLAT, 0, write_csv),
    "log.csv.gz": (FLAT, 0, write_packed(lambda path: gzip.open(path, "wb", compresslevel=6))),
    "log.csv.zst": (FLAT, 0, write_packed(lambda path: zstandard.open(path, "wb"))),
    "log.jsonl": (ARRAYS, 0, write_json_lines),
    "log.npy": (ARRAYS, None, write_npy),
    "log.npz": (ARRAYS, None, lambda path, *arrays: np.savez(path, **dict(zip(("t", "q", "dq", "tau"), arrays)))),
    "log.parquet": (FLAT, PAGE_ROWS, write_parquet),
    "log.feather": (FLAT, BATCH_ROWS, write_feather),
    "log.mat": (ARRAYS, None, lambda path, *arrays: scipy.io.savemat(path, dict(zip(("t", "q", "dq", "tau"), arrays)), do_compression=True)),
    "log.h5": (ARRAYS, None, write_hdf5),
    "bag_mcap": (TOPIC, 0, write_bag(StoragePlugin.MCAP)),
    "bag_sqlite": (TOPIC, 0, write_bag(StoragePlugin.SQLITE3)),
}


def size(path):
    return sum(file.stat().st_size for file in path.rglob("*")) if path.is_dir() else path.stat().st_size


# Peak memory includes that of the parent process at the start, so a small process starts the command.
HELPER = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[2:], stdout=open(sys.argv[1], "wb"), stderr=subprocess.DEVNULL).returncode
print(json.dumps([time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024, code]))
"""


def measured(command):
    """Wall time in s, peak memory in MiB, output, exit status."""
    with tempfile.NamedTemporaryFile() as printed:
        helper = [sys.executable, "-S", "-c", HELPER, printed.name, *map(str, command)]
        took, memory, code = json.loads(subprocess.run(helper, check=True, capture_output=True).stdout)
        return took, memory, pathlib.Path(printed.name).read_bytes(), code


def best(command, runs):
    results = [measured(command) for _ in range(runs)]
    if any(code not in (0, 1) for *_, code in results):
        sys.exit(f"exit status {results[-1][-1]}: {' '.join(map(str, command))}")
    return min(result[0] for result in results), max(result[1] for result in results), results[-1][2]


def study(folder, name, columns):
    text = f'[robot]\nfile = "{ROBOT}"\n\n[drive]\ndrive_inertia = false\n\n[format]\n'
    text += f'time = {{ column = "{columns["time"]}" }}\n'
    text += "".join(f'{key} = {{ columns = "{columns[key]}" }}\n' for key in ("position", "velocity", "torque"))
    path = folder / f"{name}.toml"
    path.write_text(text + f'\n[[log]]\nfile = "{name}"\n')
    return path


def numbers(printed, columns):
    """Samples, missing values and range of every channel of the study, in order; for the time, its span."""
    told = json.loads(printed)
    channels = {channel["name"]: channel for channel in told["channels"]}
    names = [columns[key].replace("{1..7}", "{}").replace("{0..6}", "{}") for key in ("position", "velocity", "torque")]
    first = 0 if "{0..6}" in columns["position"] else 1
    found = [channels[name.format(k)] for name in names for k in range(first, first + JOINTS)]
    return [(channel["samples"], channel["missing"], channel["range"]) for channel in found]


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("dynident")
    options.add_argument("scratch", type=pathlib.Path)
    options.add_argument("--rows", type=int, default=1_000_000)
    options.add_argument("--runs", type=int, default=3)
    options.add_argument("--identify", action="store_true")
    options.add_argument("--check", action="store_true")
    chosen = options.parse_args()

    def files(rows):
        folder = chosen.scratch / str(rows)
        folder.mkdir(parents=True, exist_ok=True)
        if any(not (folder / name).exists() for name in FORMATS):
            arrays = recording(chosen.dynident, folder, rows)
            for name, (_, _, write) in FORMATS.items():
                if not (folder / name).exists():
                    write(folder / name, *arrays)
        return folder

    folder = files(chosen.rows)
    fewer = files(chosen.rows // 4) if chosen.check else None
    head = ["file", "MB", "log, s", "of CSV's", "MiB"] + (["identify, s", "of CSV's", "MiB"] if chosen.identify else [])
    print(f"{chosen.rows} rows\n\n| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    of_csv = None
    for name, (columns, steady_rows, _) in FORMATS.items():
        took, memory, printed = best([chosen.dynident, "log", folder / name, "--json"], chosen.runs)
        cells = [took, memory]
        if chosen.identify:
            path = study(folder, name, columns)
            cells += best([chosen.dynident, "identify", path, "--out", folder / "result", "--quiet"], 1)[:2]
        values = numbers(printed, columns)
        of_csv = of_csv or (cells, values)
        shown = [f"{cells[0]:.2f} | {cells[0] / of_csv[0][0]:.2f} | {cells[1]:.0f}"]
        if chosen.identify:
            shown.append(f"{cells[2]:.1f} | {cells[2] / of_csv[0][2]:.2f} | {cells[3]:.0f}")
        print(f"| `{name}` | {size(folder / name) / 1e6:.0f} | {' | '.join(shown)} |", flush=True)
        if chosen.check:
            assert values == of_csv[1], f"{name}: the numbers differ from those of CSV"
            assert all(samples == chosen.rows and missing == 0 for samples, missing, _ in values), name
            if steady_rows is not None and chosen.rows // 4 >= steady_rows:
                before = best([chosen.dynident, "log", fewer / name, "--json"], 1)[1]
                assert memory < before + STEADY_MIB, f"{name}: memory grows from {before:.0f} to {memory:.0f} MiB with four times the rows"


if __name__ == "__main__":
    main()
