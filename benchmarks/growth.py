#!/usr/bin/env python3
"""Measures how time and memory grow: `dynident identify` with rows, logs, joints and threads; single calls and batches of the dynamics with joints.

    growth.py DYNIDENT DYNIDENT_BENCHMARK SCRATCH [--full] [--rows N] [--joints N] [--logs N] [--limit-s 300] [--only CURVE..] [--out growth.csv]

Prints one CSV line per point: curve, number, threads, processor and wall time in s (minimum of RUNS for short runs), peak memory. Then prints the logarithmic slope of each curve
between adjacent points (1 is proportional). Short by default; --full measures up to 10^6 rows, 200 joints and 1,000 logs, --rows 100000000 more rows. A curve ends after a point
that took longer than --limit-s, with a note. Recordings are computed with NumPy and `dynident evaluate`, and stay in SCRATCH.

rows     a Panda arm, 22 columns at 1 kHz; the last fifth is for validation
logs     the same arm, N recordings of 2,000 rows each; the last one is for validation
log      `dynident log` of the files of `rows`: reading only
identify serial chains of N joints, 4,000 rows at 200 Hz; the last fifth is for validation
others   serial chains: one call, or one sample of a batch
"""
import argparse
import csv
import itertools
import json
import math
import os
import pathlib
import subprocess
import sys

import numpy as np
from common import machine

ROOT = pathlib.Path(__file__).resolve().parent.parent
PANDA = ROOT / "robots/panda_arm7.urdf"
# A run shorter than this, s, is repeated RUNS times.
SHORT_S, RUNS = 3.0, 3
ROWS_OF_A_LOG, ROWS_OF_A_CHAIN = 2_000, 4_000
CHUNK = 100_000
# NumPy writes this number of rows in a few minutes.
OWN_NOISE = 10_000_000
HEADER = ["curve", "number", "threads", "processor_s", "wall_s", "memory_mib"]
CALLS = ["rnea", "crba", "aba", "rnea_derivatives", "joint_torque_regressor", "rnea_batch", "crba_batch", "rnea_derivatives_batch", "regressor_batch"]

# Peak memory includes that of the parent process at the start, so a small process starts the command.
HELPER = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
wall, used = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([used.ru_utime + used.ru_stime, wall, used.ru_maxrss / 1024, done.returncode, done.stderr[-2000:]]))
"""


def measured(command):
    """Minimum processor and wall time, s, and peak memory, MiB, of a command."""
    best = None
    for _ in range(RUNS):
        printed = subprocess.run([sys.executable, "-S", "-c", HELPER, *map(str, command)], check=True, capture_output=True).stdout
        processor, wall, memory, code, told = json.loads(printed)
        # Accept a negative verdict, because the work is the same.
        if code not in (0, 1):
            sys.exit(f"exit status {code}: {' '.join(map(str, command))}\n{told}")
        best = [processor, wall, memory] if best is None else [min(best[0], processor), min(best[1], wall), max(best[2], memory)]
        if wall > SHORT_S:
            break
    return best


def motion(joints, rate_hz, seed):
    """q, dq, ddq over one period (10 s) of a Fourier series with five harmonics of 0.1 Hz."""
    random = np.random.default_rng(seed)
    t = np.arange(round(10 * rate_hz)) / rate_hz
    q, dq, ddq = np.zeros((3, len(t), joints))
    for joint, k in itertools.product(range(joints), range(1, 6)):
        omega, amplitude, phase = 2 * np.pi * 0.1 * k, random.uniform(0.05, 0.2), random.uniform(0, 2 * np.pi)
        angle = omega * t + phase
        q[:, joint] += amplitude * np.sin(angle)
        dq[:, joint] += amplitude * omega * np.cos(angle)
        ddq[:, joint] -= amplitude * omega**2 * np.sin(angle)
    return q, dq, ddq


def torque(dynident, robot, scratch, arrays):
    joints = arrays[0].shape[1]
    states, torques = scratch / "states.csv", scratch / "torques.csv"
    names = [f"{name}{k + 1}" for name in ("q", "dq", "ddq") for k in range(joints)]
    np.savetxt(states, np.hstack(arrays), delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    subprocess.run([dynident, "evaluate", robot, "--states", states, "--quantity", "inverse-dynamics", "--out", torques], check=True, capture_output=True)
    rigid = np.loadtxt(torques, delimiter=",", skiprows=1, ndmin=2)[:, -joints:]
    dq = arrays[1]
    return rigid + 0.5 * dq + 0.8 * np.tanh(dq / 0.01)


def write_log(path, period, rows, rate_hz, seed):
    """Time, positions, velocities, torques; noise of 1e-5 rad and 0.05 Nm. Existing files are kept. Rows after OWN_NOISE repeat the first rows with new times."""
    if path.exists():
        return
    if rows > OWN_NOISE:
        first = path.with_suffix(".first")
        write_log(first, period, OWN_NOISE, rate_hz, seed)
        return repeat_log(first, path, rows, rate_hz)
    random = np.random.default_rng(seed)
    q, dq, tau = period
    joints, length = q.shape[1], len(q)
    unfinished = path.with_suffix(".part")
    with open(unfinished, "w") as file:
        file.write(",".join(["t"] + [f"{name}{k + 1}" for name in ("q", "dq", "tau") for k in range(joints)]) + "\n")
        for first in range(0, rows, CHUNK):
            at = np.arange(first, min(first + CHUNK, rows))
            noise = random.standard_normal((2, len(at), joints))
            own = at % length
            table = np.column_stack([at / rate_hz, q[own] + 1e-5 * noise[0], dq[own], tau[own] + 0.05 * noise[1]])
            np.savetxt(file, table, delimiter=",", fmt="%.9g")
    unfinished.rename(path)


def repeat_log(first, path, rows, rate_hz):
    """Repeats the rows of a log with continuous time."""
    unfinished = path.with_suffix(".part")
    with open(unfinished, "wb") as file:
        at = 0
        while at < rows:
            with open(first, "rb") as source:
                header = next(source)
                if at == 0:
                    file.write(header)
                for line in itertools.islice(source, rows - at):
                    file.write(b"%.9g,%b" % (at / rate_hz, line.partition(b",")[2]))
                    at += 1
    unfinished.rename(path)


def study(path, robot, joints, logs):
    """Writes a study of these logs. The last log is for validation; of a single log, the last fifth."""
    text = f'[robot]\nfile = "{robot}"\n\n[format]\ntime = {{ column = "t" }}\n'
    text += "".join(f'{key} = {{ columns = "{name}{{1..{joints}}}" }}\n' for key, name in (("position", "q"), ("velocity", "dq"), ("torque", "tau")))
    if len(logs) == 1:
        text += f'\n[[log]]\nfile = "{logs[0]}"\nfraction = [0.0, 0.8]\n\n[[log]]\nfile = "{logs[0]}"\nfraction = [0.8, 1.0]\nrole = "validate"\n'
    else:
        text += "".join(f'\n[[log]]\nfile = "{log}"\n' for log in logs) + 'role = "validate"\n'
    path.write_text(text)
    return path


def chain(path, joints):
    """A serial arm: axes alternate between z, y and x; links of 0.1 m, mass decreasing from 1.5 to 0.5 kg."""
    links, joint_texts = ['<link name="base"/>'], []
    for k in range(joints):
        mass, axis = 0.5 + 1.0 / (1 + k), ["0 0 1", "0 1 0", "1 0 0"][k % 3]
        inertia = [0.01 * mass, 0.008 * mass, 0.005 * mass]
        moments = f'<inertia ixx="{inertia[0]}" iyy="{inertia[1]}" izz="{inertia[2]}" ixy="0" ixz="0" iyz="0"/>'
        links.append(f'<link name="link{k + 1}"><inertial><origin xyz="0.01 0.02 0.05"/><mass value="{mass}"/>{moments}</inertial></link>')
        parent = f"link{k}" if k else "base"
        ends = f'<parent link="{parent}"/><child link="link{k + 1}"/><origin xyz="0.02 0 0.1"/>'
        limits = '<limit lower="-3" upper="3" velocity="3" effort="500"/>'
        joint_texts.append(f'<joint name="joint{k + 1}" type="revolute">{ends}<axis xyz="{axis}"/>{limits}</joint>')
    path.write_text(f'<robot name="chain{joints}">{"".join(links + joint_texts)}</robot>\n')
    return path


class Curves:
    def __init__(self, out, limit_s):
        self.points, self.limit_s, self.ended = [], limit_s, set()
        self.out = open(out, "w", newline="", encoding="utf-8") if out else None
        self.tell(HEADER)

    def tell(self, cells):
        line = ",".join(str(cell) for cell in cells)
        print(line, flush=True)
        if self.out:
            self.out.write(line + "\n")
            self.out.flush()

    def point(self, curve, number, threads, command):
        if (curve, threads) in self.ended:
            return
        processor, wall, memory = measured(command)
        self.points.append((curve, number, threads, processor, wall, memory))
        self.tell([curve, number, threads, f"{processor:.4g}", f"{wall:.4g}", f"{memory:.1f}"])
        if wall > self.limit_s:
            self.ended.add((curve, threads))
            print(f"# {curve} with {threads} threads ends at {number}: {wall:.0f} s", file=sys.stderr)

    def single(self, curve, number, seconds):
        self.points.append((curve, number, 1, seconds, None, None))
        self.tell([curve, number, 1, f"{seconds:.4g}", "", ""])

    def slopes(self):
        print("\nlogarithmic slopes of processor time, and increase of memory from the first point:")
        for curve, threads in dict.fromkeys((point[0], point[2]) for point in self.points):
            own = [point for point in self.points if (point[0], point[2]) == (curve, threads)]
            told = []
            for before, after in zip(own, own[1:]):
                per = math.log(after[1] / before[1])
                slope = f"{math.log(max(after[3], 1e-9) / max(before[3], 1e-9)) / per:.2f}"
                told.append(f"{before[1]}..{after[1]}: {slope}" + (f" ({after[5] - own[0][5]:+.0f} MiB)" if after[5] else ""))
            print(f"  {curve}, {threads} thread{'s' if threads > 1 else ''}: {'; '.join(told)}")


def decades(first, last):
    """first, 10 first, .. up to last"""
    return [first * 10**k for k in range(20) if first * 10**k <= last]


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("dynident")
    options.add_argument("benchmark")
    options.add_argument("scratch", type=pathlib.Path)
    options.add_argument("--full", action="store_true")
    options.add_argument("--rows", type=int)
    options.add_argument("--joints", type=int)
    options.add_argument("--logs", type=int)
    options.add_argument("--limit-s", type=float, default=300.0)
    options.add_argument("--only", nargs="*", default=["rows", "logs", "identify", "calls"])
    options.add_argument("--out", type=pathlib.Path)
    chosen = options.parse_args()
    rows = chosen.rows or (10**6 if chosen.full else 10**4)
    joints = chosen.joints or (200 if chosen.full else 4)
    logs = chosen.logs or (1000 if chosen.full else 3)
    scratch = chosen.scratch.resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    threads = sorted({1, min(2, os.cpu_count() or 1)})
    curves = Curves(chosen.out, chosen.limit_s)
    identify = lambda path, count: [chosen.dynident, "identify", path, "--out", scratch / "result", "--quiet", "--threads", count]

    if {"rows", "logs"} & set(chosen.only):
        q, dq, ddq = motion(7, 1000.0, 1)
        period = q, dq, torque(chosen.dynident, PANDA, scratch, (q, dq, ddq))
    if "rows" in chosen.only:
        for number in decades(1000, rows):
            log = scratch / f"rows{number}.csv"
            write_log(log, period, number, 1000.0, 2)
            curves.point("log", number, 1, [chosen.dynident, "log", log, "--json", "--threads", 1])
            for count in threads:
                curves.point("rows", number, count, identify(study(scratch / f"rows{number}.toml", PANDA, 7, [log]), count))
    if "logs" in chosen.only:
        files = []
        for number in [n for n in (1, 3, 10, 30, 100, 300, 1000) if n <= logs]:
            while len(files) < number + 1:
                files.append(scratch / f"log{len(files)}.csv")
                # Each log starts at a different point of the motion.
                turned = [np.roll(array, -733 * len(files), axis=0) for array in period]
                write_log(files[-1], turned, ROWS_OF_A_LOG, 1000.0, 100 + len(files))
            for count in threads:
                curves.point("logs", number, count, identify(study(scratch / f"logs{number}.toml", PANDA, 7, files), count))
    chains = [n for n in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100, 140, 200) if n <= joints]
    robots = {number: chain(scratch / f"chain{number}.urdf", number) for number in chains}
    if "calls" in chosen.only:
        simd = machine()["simd"]
        level = ["--level", simd] if simd in ("AVX2", "AVX-512") else []
        command = [chosen.benchmark, *level, "--robots", scratch, "--only", ",".join(CALLS), *(f"chain{number}" for number in chains)]
        least = {}
        for line in subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines():
            told = json.loads(line)
            if "algo" in told:
                key = (told["algo"], told["nv"])
                least[key] = min(least.get(key, math.inf), told["min"])
        for call, number in itertools.product(CALLS, chains):
            curves.single(call, number, 1e-9 * least[call, number])
    if "identify" in chosen.only:
        for number in chains:
            if ("identify", 1) in curves.ended:
                break
            log = scratch / f"chain{number}.csv"
            if not log.exists():
                arrays = motion(number, 200.0, 3)
                tau = torque(chosen.dynident, robots[number], scratch, arrays)
                write_log(log, (arrays[0], arrays[1], tau), ROWS_OF_A_CHAIN, 200.0, 4)
            curves.point("identify", number, 1, identify(study(scratch / f"chain{number}.toml", robots[number], number, [log]), 1))
    curves.slopes()


if __name__ == "__main__":
    main()
