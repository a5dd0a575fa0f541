"""Creates the golden files again and compares them with the committed files. Exit status 1 and one line for each difference.

    python golden/check.py [NAME ...]

NAME selects generators of the table below (default: all). Text and structure must be equal, numbers to 1e-12 relative to
the largest entry of their array. The generators are deterministic. Differences between machines are the last bit of sine
and cosine (the C library selects its version by processor), up to 2e-14 of the largest entry of an array, and the kernel
of the linear algebra library, up to 2e-13 in the covariances of the estimators.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
RELATIVE = 1e-12
# The last digits of an iterative solver depend on its stopping rule; its inputs are still compared with RELATIVE.
SOLVED = {"cvxpy_physical.json": ("solution", 1e-6)}

# name: (script, golden files). Every script takes `--out DIR` (default: its own folder).
GENERATORS = {
    "pinocchio": ("pinocchio.py", "pinocchio/*.json"),
    "mujoco": ("mujoco_inverse.py", "mujoco/*.json"),
    "mujoco-closed-loop": ("mujoco_closed_loop.py", "mujoco_closed_loop.json"),
    "coupled": ("coupled_joints.py", "coupled_joints.json"),
    "closed-chains": ("closed_chains.py", "closed_chains.json"),
    "mjcf": ("mjcf.py", "mjcf.json"),
    "springs": ("springs.py", "springs.json"),
    "sdf": ("sdf.py", "sdf.json"),
    "scipy": ("scipy_filters.py", "scipy_*.json"),
    "newey-west": ("statsmodels_newey_west.py", "statsmodels_newey_west.json"),
    "statsmodels": ("statsmodels_estimators.py", "statsmodels_estimators.json"),
    "robust": ("statsmodels_robust.py", "statsmodels_robust.json"),
    "formats": ("formats.py", "formats/*.json"),
    "cvxpy": ("cvxpy_physical.py", "cvxpy_*.json"),
}


def numbers(x):
    """The numbers of a nested list, or None if it contains anything else."""
    if isinstance(x, bool) or not isinstance(x, (int, float, list)):
        return None
    if not isinstance(x, list):
        return [float(x)]
    parts = [numbers(v) for v in x]
    return None if any(p is None for p in parts) else [v for p in parts for v in p]


def shape(x):
    return [shape(v) for v in x] if isinstance(x, list) else 0


def differences(old, new, where, limit=RELATIVE, solved=None):
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            if key not in old or key not in new:
                yield f"{where}.{key}: only in the {'committed' if key in old else 'new'} file"
            else:
                own = solved[1] if solved and key == solved[0] else limit
                yield from differences(old[key], new[key], f"{where}.{key}", own, solved)
        return
    a, b = numbers(old), numbers(new)
    if a is None or b is None:
        if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
            for i, (x, y) in enumerate(zip(old, new)):
                yield from differences(x, y, f"{where}[{i}]", limit, solved)
        elif old != new:
            yield f"{where}: {old!r} changed to {new!r}"
    elif shape(old) != shape(new):
        yield f"{where}: the shape changed"
    elif a:
        error = max(abs(x - y) for x, y in zip(a, b))
        # Quantities are in SI units of a human-sized arm; arrays with all entries below 1e-3 are compared absolutely.
        scale = max(max(map(abs, a)), 1e-3)
        if not error <= limit * scale:
            yield f"{where}: differs by {error:.3g}, {error / scale:.3g} of its largest entry (limit {limit:g})"


def check(name, folder):
    """Differences between the committed files of one generator and its new files in `folder`."""
    script, pattern = GENERATORS[name]
    if not (HERE / script).exists():
        return [f"golden/{script}: missing, but listed in the table of golden/check.py"]
    made = subprocess.run([sys.executable, str(HERE / script), "--out", str(folder)], capture_output=True, text=True)
    if made.returncode:
        return [f"golden/{script}: exit status {made.returncode}\n{made.stderr.strip()}"]
    old = {p.relative_to(HERE) for p in HERE.glob(pattern)}
    new = {p.relative_to(folder) for p in folder.glob(pattern)}
    found = [f"golden/{p}: only {'committed' if p in old else 'new'}" for p in sorted(old ^ new)]
    if not new:
        found.append(f"golden/{script}: created no file {pattern}")
    for path in sorted(old & new):
        a, b = (json.loads((root / path).read_text(encoding="utf-8")) for root in (HERE, folder))
        found += list(differences(a, b, f"golden/{path}", solved=SOLVED.get(path.name)))
    return found


def main():
    names = sys.argv[1:] or list(GENERATORS)
    unknown = [n for n in names if n not in GENERATORS]
    if unknown:
        sys.exit(f"unknown: {', '.join(unknown)} (known: {', '.join(GENERATORS)})")
    failed = False
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            found = check(name, Path(folder))
        failed |= bool(found)
        for line in found[:20]:
            print(line)
        if len(found) > 20:
            print(f"... and {len(found) - 20} more")
        print(f"{name}: {'differs' if found else 'agrees'}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
