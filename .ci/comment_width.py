"""Lists comment lines in the sources that are longer than 120 columns. Exit status 1 if there are any.

The stable settings of rustfmt do not check comments. Table rows, lines with a URL and fenced code are exempt.
"""
import pathlib
import sys

LIMIT = 120
long = []
for path in sorted(pathlib.Path("crates").glob("**/*.rs")):
    fenced = False
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        text = line.strip()
        if not text.startswith("//"):
            fenced = False
        elif text.lstrip("/! ").startswith("```"):
            fenced = not fenced
        if fenced:
            continue
        if text.startswith("//") and len(line) > LIMIT and "://" not in line and not text.lstrip("/! ").startswith("|"):
            long.append(f"{path}:{number}: {len(line)} columns")
print("\n".join(long) or "all comment lines are within the limit")
sys.exit(1 if long else 0)
