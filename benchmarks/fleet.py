"""fleet.py [--logs N] [--quick]: reduces the logs of a fleet of simulated UR10 robots in a loop, on Ray with one and two workers, and on Ray while workers are killed.
Prints the sizes, times and memory use quoted on the fleet page. Needs the package, ray and dask (python/tests/requirements.txt)."""

from __future__ import annotations

import argparse
import os
import platform
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import dynident
from dynident import fleet

ROOT = Path(__file__).resolve().parents[1]
RATE_HZ, SECONDS = 200.0, 20.0
STATED = {
    "drive": {"coulomb": "smooth", "coulomb_width": 0.02, "drive_inertia": True},
    "friction": "stated",
    "estimator": "weighted",
    "motion": {"differentiator": {"method": "butterworth", "order": 4, "cutoff_hz": 8.0}, "torque_lag_s": 0.0},
}
ARMS = 20


def recorded(seed: int, seconds: float = SECONDS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, positions and torques of one run of arm `seed % ARMS`. The friction differs by 3 % between arms."""
    robot = dynident.Robot.load(ROOT / "robots" / "ur10.urdf")
    draw, arm = np.random.default_rng(seed), np.random.default_rng(seed % ARMS)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    q, dq, ddq = (np.zeros((t.size, robot.n)) for _ in range(3))
    for joint in range(robot.n):
        for omega in draw.uniform(0.5, 4.0, 4):
            size, phase = 0.15 + 0.1 * draw.random(), draw.uniform(0, 2 * np.pi)
            q[:, joint] += size * np.sin(omega * t + phase)
            dq[:, joint] += size * omega * np.cos(omega * t + phase)
            ddq[:, joint] -= size * omega**2 * np.sin(omega * t + phase)
    viscous = 10.0 * (1.0 + 0.03 * arm.standard_normal(robot.n))
    tau = robot.inverse_dynamics(q, dq, ddq) + viscous * dq + 5.0 * np.tanh(dq / 0.02)
    noise = np.random.default_rng(10_000 + seed)
    return t, q + 1e-5 * noise.standard_normal(q.shape), tau + 0.3 * noise.standard_normal(tau.shape)


def write(folder: Path, seed: int) -> Path:
    path = folder / f"{seed}.npz"
    t, q, tau = recorded(seed)
    np.savez(path, t=t, q=q, tau=tau)
    return path


def reduced(path: Path) -> dynident.Factors:
    with np.load(path) as table:
        log = dynident.Log.from_arrays(table["t"], table["q"], table["tau"], name=path.stem)
    robot = dynident.Robot.load(ROOT / "robots" / "ur10.urdf")
    return fleet.reduce(robot, log, arm=f"arm {int(path.stem) % ARMS}", segments=4, **STATED)


class Killer(threading.Thread):
    """Kills busy Ray workers one after another."""

    def __init__(self, most: int) -> None:
        super().__init__(daemon=True)
        self.most, self.killed, self.over = most, 0, threading.Event()

    def run(self) -> None:
        while self.killed < self.most and not self.over.wait(0.4):
            found = subprocess.run(["pgrep", "-f", "ray::run"], capture_output=True, text=True, check=False)
            for pid in found.stdout.split()[:1]:
                try:
                    os.kill(int(pid), signal.SIGKILL)
                    self.killed += 1
                except ProcessLookupError:
                    pass


def on_ray(paths: list[Path], workers: int, kill: int = 0) -> tuple[float, bytes, int]:
    import ray

    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, runtime_env={"env_vars": {"PYTHONPATH": path}})
    fleet.each(reduced, paths[: 2 * workers], on="ray")  # imports
    killer = Killer(kill)
    killer.start()
    start = time.perf_counter()
    found = fleet.merged(reduced, paths, on="ray", batch=8)
    seconds = time.perf_counter() - start
    killer.over.set()
    ray.shutdown()
    return seconds, found.to_bytes(), killer.killed


def high_water_mb() -> float:
    """Peak memory of this process since its program was loaded, megabytes (Linux)."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) / 1024


def reduce_file(path: Path) -> None:
    """Runs the work of one worker on one file in a separate process; returns its peak memory and the size of the factors in bytes."""
    log = dynident.Log.read(path, position="q{1..6}", torque="tau{1..6}", time="t")
    robot = dynident.Robot.load(ROOT / "robots" / "ur10.urdf")
    factors = fleet.reduce(robot, log, segments=4, **STATED)
    print(high_water_mb(), len(factors.to_bytes()))


def peak(rows: int, folder: Path) -> tuple[float, int]:
    """Peak memory of a process that reduces a CSV file with this number of rows, megabytes, and size of its factors, bytes."""
    path = folder / f"{rows}.csv"
    t, q, tau = recorded(1, 4000 / RATE_HZ)
    with path.open("w") as file:
        file.write(",".join(["t", *(f"q{k}" for k in range(1, 7)), *(f"tau{k}" for k in range(1, 7))]) + "\n")
        for begin in range(0, rows, t.size):
            # The motion is repeated; jumps between the repetitions do not affect the memory measurement.
            table = np.column_stack([t + begin / RATE_HZ, q, tau])[: rows - begin]
            np.savetxt(file, table, fmt="%.7g", delimiter=",")
    done = subprocess.run([sys.executable, __file__, "--file", str(path)], capture_output=True, text=True, check=False)
    path.unlink()
    if done.returncode:
        raise SystemExit(done.stderr)
    megabytes, size = done.stdout.split()
    return float(megabytes), int(size)


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--logs", type=int, default=1000)
    ask.add_argument("--quick", action="store_true", help="few logs: test the script without a meaningful measurement")
    ask.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    asked = ask.parse_args()
    if asked.file:
        reduce_file(asked.file)
        return
    count, kills, rows = (24, 2, [4_000, 16_000]) if asked.quick else (asked.logs, 50, [10_000, 100_000, 1_000_000])
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}, Dynident {dynident.__version__}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = [write(folder, seed) for seed in range(count)]

        single = []
        start = time.perf_counter()
        parts = []
        for path in paths:
            begin = time.perf_counter()
            parts.append(reduced(path))
            single.append(time.perf_counter() - begin)
        loop_s = time.perf_counter() - start
        print(f"reduce, loop: {count} logs of {SECONDS:.0f} s at {RATE_HZ:.0f} Hz in {loop_s:.1f} s; one {1e3 * statistics.median(single):.1f} ms")

        start = time.perf_counter()
        whole = fleet.merge(parts)
        merge_s = time.perf_counter() - start
        bytes_of_loop = whole.to_bytes()
        print(f"merge: {merge_s:.2f} s; file {len(bytes_of_loop) / 1e6:.1f} MB, {len(bytes_of_loop) / count / 1e3:.1f} kB a log")

        start = time.perf_counter()
        models = fleet.identify_each(whole)
        each_s = (time.perf_counter() - start) / len(models)
        found = fleet.spread(models)
        print(f"identify: {each_s:.2f} s an arm of {count // len(models)} logs; unlike {found.unlike}, {len(found.differing)} parameters differ: {found.differing[:6]}")

        seconds = {}
        for workers in (1, 2, 1, 2) if not asked.quick else (1, 2):
            once, gathered, _ = on_ray(paths, workers)
            assert gathered == bytes_of_loop, "Ray and the loop give different bytes"
            seconds[workers] = min(once, seconds.get(workers, once))
        print(f"Ray: one worker {seconds[1]:.1f} s, two {seconds[2]:.1f} s: {seconds[1] / seconds[2]:.2f} times")
        once, gathered, killed = on_ray(paths, 2, kills)
        assert gathered == bytes_of_loop, "killed workers change the result"
        print(f"Ray, {killed} workers killed: {once:.1f} s, the same bytes")

        for row in rows:
            megabytes, size = peak(row, folder)
            print(f"a process that reduces a CSV file of {row} rows: {megabytes:.0f} MB at most, {size} bytes of factors")
    print(f"this process, with the factors of all logs: {high_water_mb():.0f} MB")


if __name__ == "__main__":
    main()
