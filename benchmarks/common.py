"""Shared functions of the benchmark scripts: robot files, states, timing, JSON output (one line per result)."""
import json
import os
import statistics
import time
from pathlib import Path

import numpy as np

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
NAMES = ["planar2r", "ur10", "panda_arm7", "iiwa14", "talos_reduced"]


def robot_path(name):
    return str(ROBOTS / f"{name}.urdf")


def states(model, n, seed=1):
    """n random (q, dq, ddq): q inside the position limits (at most one turn), dq and ddq uniform in +-1."""
    rng = np.random.default_rng(seed)
    low = np.maximum(model.lowerPositionLimit, -np.pi)
    high = np.minimum(model.upperPositionLimit, np.pi)
    q = low + (high - low) * rng.random((n, model.nq))
    return q, rng.uniform(-1, 1, (n, model.nv)), rng.uniform(-1, 1, (n, model.nv))


def fourier(model, n, duration_s, seed=3, harmonics=5, base_hz=0.1, amplitude=0.4):
    """A smooth exciting motion: q, dq, ddq at n instants of [0, duration_s)."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, duration_s, n, endpoint=False)[:, None]
    q, dq, ddq = (np.zeros((n, model.nv)) for _ in range(3))
    for k in range(1, harmonics + 1):
        a, b = amplitude * rng.normal(size=(1, model.nv)), amplitude * rng.normal(size=(1, model.nv))
        w = 2 * np.pi * base_hz * k
        q += a / w * np.sin(w * t) - b / w * np.cos(w * t)
        dq += a * np.cos(w * t) + b * np.sin(w * t)
        ddq += -a * w * np.sin(w * t) + b * w * np.cos(w * t)
    return q, dq, ddq


def emit_timed(job, build, robot, nv, algo, call, repeats, per=1):
    """Measures `call` with the CPU clock of this thread, divides by `per`, and prints median, minimum and maximum in ns."""
    call()
    ns = []
    for _ in range(repeats):
        start = time.process_time_ns()
        call()
        ns.append((time.process_time_ns() - start) / per)
    figure(job, build, robot, nv, algo, ns)


def figure(job, build, robot, nv, algo, ns):
    """Prints median, minimum and maximum of these times in ns."""
    figures = dict(ns=statistics.median(ns), min=min(ns), max=max(ns))
    print(json.dumps(dict(job=job, build=build, robot=robot, nv=nv, algo=algo, **{k: round(v, 1) for k, v in figures.items()})), flush=True)


def machine():
    """Processor, cores, load and date, for the head of a table."""
    cpu = "unknown processor"
    if Path("/proc/cpuinfo").exists():
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.split(":", 1)[1].strip()
                break
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    simd = "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "AVX2 not detected"
    return dict(cpu=cpu, simd=simd, cores=os.cpu_count(), load=round(os.getloadavg()[0], 2), date=time.strftime("%Y-%m-%d"))
