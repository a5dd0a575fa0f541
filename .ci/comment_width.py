"""Comment lines of the sources that are longer than 120 columns, one a line; exit status 1 if there are any.

rustfmt's stable settings do not look at comments. Rows of tables, lines with an address and code between fences are let through.
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
print("\n".join(long) or "no comment line is too long")
sys.exit(1 if long else 0)
