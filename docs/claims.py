"""Checks the table of figures in docs/src/claims.md.

python3 docs/claims.py   exit status 1 if a row names a missing page, file or test, if its figure is not on its page, or if README has a
                         measured figure without a row

A row has three cells: a link to the page, the figure as text of one line of that page (" … " stands for other text of the line), and
the source. The source names at least one file of the repository in backticks; `FILE::NAME` also requires the text NAME (a test, for
example) in that file.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "src" / "claims.md"

# Percentages, durations, ratios and sizes of README; a row must contain each of them.
MEASURED = re.compile(r"\b\d[\d.]*(?: (?:%|s|MB|processor minutes)(?!\w))|\b1e-\d+|\babout \d+")


def plain(text):
    """Text without links, emphasis and repeated spaces."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"\s+", " ", text.replace("**", "").replace("`", ""))


def contains(page, figure):
    """Whether a line of the page contains the parts of the figure in their order."""
    pattern = ".*?".join(map(re.escape, plain(figure).split(" … ")))
    return any(re.search(pattern, plain(line)) for line in page.splitlines())


def rows(text):
    """Line number and cells of each row of a table."""
    for number, line in enumerate(text.splitlines(), 1):
        cells = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
        if line.startswith("|") and cells[0].startswith("["):
            yield number, cells


def faults(cells):
    """Errors of a row."""
    if len(cells) != 3:
        return [f"{len(cells)} cells instead of 3"]
    target = re.search(r"\]\(([^)#]*)", cells[0])[1]
    page = PAGE.parent / target
    if not page.is_file():
        return [f"no page {target}"]
    wrong = []
    if not contains(page.read_text(encoding="utf-8"), cells[1]):
        wrong.append(f"{target} does not contain: {plain(cells[1])}")
    spans = re.findall(r"`([^`]*)`", cells[2])
    sources = [word.split("::") for span in spans for word in span.split() if "/" in word]
    files = [(ROOT / name, *names) for name, *names in sources if (ROOT / name).exists()]
    wrong += [f"no file {name}" for name, *_ in sources if not (ROOT / name).exists()]
    wrong += [] if sources else ["no file as source"]
    for file, *names in files:
        text = file.read_text(encoding="utf-8") if names else ""
        wrong += [f"{file.name} does not contain {name}" for name in names if name not in text]
    return wrong


def main():
    found = list(rows(PAGE.read_text(encoding="utf-8")))
    wrong = [f"line {number}: {fault}" for number, cells in found for fault in faults(cells)]
    stated = " ".join(plain(cells[1]) for _, cells in found if "README" in cells[0])
    readme = plain((ROOT / "README.md").read_text(encoding="utf-8"))
    wrong += [f"README: no row for {figure}" for figure in sorted(set(MEASURED.findall(readme))) if figure not in stated]
    for fault in wrong:
        print(f"docs/src/claims.md: {fault}")
    print(f"{len(found)} figures, {len(wrong)} errors")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
