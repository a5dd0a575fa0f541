"""JSON format of all golden files: sorted keys, vectors on one line, matrices with one row per line, floats from
repr (the shortest text with an exact round trip), no NaN and no negative zero."""
import json
import math

import numpy as np


def plain(x):
    """Converts NumPy arrays and scalars to Python lists and numbers."""
    if isinstance(x, np.ndarray):
        return plain(x.tolist())
    if isinstance(x, dict):
        return {str(k): plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [plain(v) for v in x]
    if isinstance(x, (np.integer, np.floating)):
        x = x.item()
    if isinstance(x, float):
        if not math.isfinite(x):
            raise ValueError("a golden value is not finite")
        return x + 0.0
    return x


def text(x, indent=0):
    pad, inner = " " * indent, " " * (indent + 1)
    if isinstance(x, dict) and x:
        rows = [f"{inner}{json.dumps(k)}: {text(x[k], indent + 1)}" for k in sorted(x)]
        return "{\n" + ",\n".join(rows) + f"\n{pad}}}"
    if isinstance(x, list) and any(isinstance(v, (list, dict)) for v in x):
        return "[\n" + ",\n".join(inner + text(v, indent + 1) for v in x) + f"\n{pad}]"
    if isinstance(x, list):
        return "[" + ", ".join(text(v) for v in x) + "]"
    # Integers are written without a fraction, which saves space because regressors contain mostly zeros.
    if isinstance(x, float) and x.is_integer() and abs(x) < 1e15:
        return str(int(x))
    return json.dumps(x, allow_nan=False)


def write(path, value):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text(plain(value)) + "\n", encoding="utf-8", newline="\n")
