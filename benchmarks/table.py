"""One markdown table from the JSON lines in a folder (see compare.sh): minimum (median) in ns, rivals beside Dynident.

    table.py FOLDER

Several rounds of one program are merged: least of the minima, median of the medians. Pinocchio's two conventions of one
algorithm (world, local) count as its better one, by minimum.
"""
import json
import re
import statistics
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from common import machine

NAMES = {
    ("pinocchio_cpp", "native"): "Pinocchio C++ native",
    ("pinocchio_cpp", "wheel"): "Pinocchio C++ wheel",
    ("pinocchio_cpp", "base"): "Pinocchio C++ SSE2",
    ("pinocchio_python", "wheel"): "Pinocchio Python",
    ("mujoco", "wheel"): "MuJoCo",
}
# Dynident's batched kernels have no counterpart in Pinocchio: the same quantity one call at a time stands beside them.
SAME_QUANTITY = {"regressor_batch": "joint_torque_regressor", "rnea_batch": "rnea", "crba_batch": "crba",
                 "rnea_derivatives_batch": "rnea_derivatives", "aba_batch": "aba"}
VARIANT = re.compile(r"_(world|local)$")


def figures(folder):
    """{(robot, algo): {column: (minimum, median, rounds)}} in order of first appearance."""
    runs = {}
    for path in sorted(Path(folder).glob("*.jsonl")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if not line.startswith("{"):
                continue
            try:
                d = json.loads(line)
            except ValueError as error:
                sys.exit(f"{path}:{number}: not a JSON line ({error})")
            if "algo" in d:
                column = NAMES.get((d["job"], d["build"]), f"{d['job']} {d['build']}".capitalize())
                runs.setdefault((d["robot"], d["algo"], column), []).append((d["min"], d["ns"]))
    table = {}
    for (robot, algo, column), values in runs.items():
        cell = (min(v[0] for v in values), statistics.median(v[1] for v in values), len(values))
        cells = table.setdefault((robot, VARIANT.sub("", algo)), {})
        if column not in cells or cell[0] < cells[column][0]:
            cells[column] = cell
    for (robot, algo), cells in list(table.items()):
        for column, cell in table.get((robot, SAME_QUANTITY.get(algo)), {}).items():
            cells.setdefault(column, cell)
    return table


def number(ns):
    return f"{ns:.3g}" if ns < 100 else f"{ns:.0f}" if ns < 1e6 else f"{ns / 1e6:.3g} ms"


def compiler(command):
    try:
        return subprocess.run([command, "--version"], capture_output=True, text=True).stdout.splitlines()[0]
    except (OSError, IndexError):
        return f"{command} not found"


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    table = figures(sys.argv[1])
    if not table:
        sys.exit(f"{sys.argv[1]}: no JSON lines with an algorithm in *.jsonl")
    present = {c for cells in table.values() for c in cells}
    rivals = [c for c in NAMES.values() if c in present]
    ours = sorted(present - set(rivals))
    m = machine()
    rounds = max(cell[2] for cells in table.values() for cell in cells.values())
    print(f"{m['date']}, {m['cpu']} ({m['simd']}, {m['cores']} cores; one used), {compiler('g++')}, {compiler('rustc')},")
    print(f"Pinocchio {version('pin')}, MuJoCo {version('mujoco')}, NumPy {version('numpy')}. ns a call or a sample of one thread's CPU time:")
    print(f"minimum (median), up to {rounds} runs each, alternating. Last column: best Dynident against native Pinocchio, by minima.\n")
    heads = ["robot", "quantity", *ours, *rivals, *(["times as fast"] if ours else [])]
    print("| " + " | ".join(heads) + " |\n|" + " --- |" * 2 + " ---: |" * (len(heads) - 2))
    robots = list(dict.fromkeys(robot for robot, _ in table))
    for robot in robots:
        for (r, algo), cells in table.items():
            if r != robot:
                continue
            row = [f"{number(cells[c][0])} ({number(cells[c][1])})" if c in cells else "" for c in [*ours, *rivals]]
            if ours:
                best = min((cells[c][0] for c in ours if c in cells), default=None)
                anchor = next((cells[c][0] for c in ("Pinocchio C++ native", "Pinocchio Python") if c in cells), None)
                row.append(f"{anchor / best:.1f}" if best and anchor else "")
            print("| " + " | ".join([robot, algo.replace("_", " "), *row]) + " |")


if __name__ == "__main__":
    main()
