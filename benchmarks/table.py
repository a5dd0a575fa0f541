"""Writes Markdown tables from the JSON lines in a folder (see compare.sh): minimum (median) in ns of Dynident and the rivals, the limits
of the machine, and the share of these limits that Dynident reaches.

    table.py FOLDER

Several rounds of one program are merged: least of the minima, median of the medians. If Pinocchio has two conventions of an
algorithm (world, local), the faster one is used, by minimum.
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
    ("pandas", "wheel"): "pandas",
}
# Dynident's batched kernels have no counterpart in Pinocchio; they are compared with single calls for the same quantity.
SAME_QUANTITY = {"regressor_batch": "joint_torque_regressor", "rnea_batch": "rnea", "crba_batch": "crba",
                 "rnea_derivatives_batch": "rnea_derivatives", "aba_batch": "aba"}
VARIANT = re.compile(r"_(world|local)$")


# Rivals for the last column; the first one with a result is used.
ANCHORS = ("Pinocchio C++ native", "Pinocchio Python", "MuJoCo", "pandas")


PACKAGES = {"Pinocchio": "pin", "MuJoCo": "mujoco", "NumPy": "numpy", "pandas": "pandas"}


def lines(folder):
    for path in sorted(Path(folder).glob("*.jsonl")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if not line.startswith("{"):
                continue
            try:
                yield json.loads(line)
            except ValueError as error:
                sys.exit(f"{path}:{number}: not a JSON line ({error})")


def own_column(job, build):
    return NAMES.get((job, build), f"{job} {build}".capitalize())


def figures(folder):
    """{(robot, algo): {column: (minimum, median, rounds)}} in order of first appearance."""
    runs = {}
    for d in lines(folder):
        if "algo" in d:
            runs.setdefault((d["robot"], d["algo"], own_column(d["job"], d["build"])), []).append((d["min"], d["ns"]))
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


def comparison(table, ours, rivals):
    """One table of these rows, with the columns that have results."""
    present = {c for cells in table.values() for c in cells}
    ours, rivals = ([c for c in columns if c in present] for columns in (ours, rivals))
    heads = ["robot", "quantity", *ours, *rivals, *(["times as fast"] if ours else [])]
    print("| " + " | ".join(heads) + " |\n|" + " --- |" * 2 + " ---: |" * (len(heads) - 2))
    for robot in dict.fromkeys(robot for robot, _ in table):
        for (r, algo), cells in table.items():
            if r != robot:
                continue
            row = [f"{number(cells[c][0])} ({number(cells[c][1])})" if c in cells else "" for c in [*ours, *rivals]]
            if ours:
                best = min((cells[c][0] for c in ours if c in cells), default=None)
                anchor = next((cells[c][0] for c in ANCHORS if c in cells), None)
                row.append(f"{anchor / best:.1f}" if best and anchor else "")
            print("| " + " | ".join([robot, algo.replace("_", " "), *row]) + " |")


def limits(folder):
    """{(limit, column): (maximum rate per second, description)}"""
    found = {}
    for d in lines(folder):
        if d.get("job") == "limit":
            key = (d["limit"], own_column("dynident", d["build"]) if d["build"] else "")
            found[key] = max(found.get(key, (0.0, "")), (d["per_second"], d["what"]))
    return found


def shares(folder, table, limit):
    """Rows of robot, quantity, work of one call, rate, share of the limit."""
    rows = []
    for d in {(d["robot"], d["count_of"]): d for d in lines(folder) if d.get("job") == "operations"}.values():
        cells = table.get((d["robot"], d["count_of"]), {})
        own = [(cell[0], column) for column, cell in cells.items() if column.startswith("Dynident")]
        if not own:
            continue
        least, column = min(own)
        head = [d["robot"], d["count_of"].replace("_", " "), column.removeprefix("Dynident ")]
        rate = d["bytes"] / least
        parts = [f"{100e9 * rate / limit[key, ''][0]:.0f} % of {key}" for key in ("newlines", "floats") if (key, "") in limit]
        rows.append([*head, f"{d['bytes']:.0f} bytes", f"{rate:.2f} GB/s", ", ".join(parts)])
    return rows


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
    print(f"{m['date']}, {m['cpu']} ({m['simd']}, {m['cores']} cores; one used; load {m['load']}), {compiler('g++')}, {compiler('rustc')},")
    packages = ", ".join(f"{name} {version(package)}" for name, package in PACKAGES.items())
    print(f"{packages}. CPU time of one thread in ns per call, sample, row or command:")
    print(f"minimum (median), up to {rounds} runs each, alternating. Last column: best Dynident compared with the first of")
    print(f"{', '.join(ANCHORS)} with a result, by minima.\n")
    of_pinocchio = {key: cells for key, cells in table.items() if any(c.startswith("Pinocchio") for c in cells)} or table
    comparison(of_pinocchio, ours, rivals)
    others = {key: cells for key, cells in table.items() if key not in of_pinocchio}
    if others:
        print()
        comparison(others, ours, rivals)
    limit = limits(sys.argv[1])
    if limit:
        print("\nLimits of the machine, one core, measured in the same run:\n")
        print("| limit | | per second | description |\n| --- | --- | ---: | --- |")
        for (name, column), (rate, what) in limit.items():
            unit = "GFLOP" if name == "peak_flops" else "GB"
            print(f"| {name.replace('_', ' ')} | {column.removeprefix('Dynident ')} | {rate / 1e9:.3g} {unit} | {what} |")
    rows = shares(sys.argv[1], table, limit)
    if rows:
        print("\nShare of these limits: bytes divided by the minimum time.\n")
        print("| robot | quantity | | per call | reached | share |\n| --- | --- | --- | ---: | ---: | --- |")
        for row in rows:
            print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
