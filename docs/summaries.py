"""The short tables and the pictures of the book's comparison pages, from the CSV files in docs/src/data.

python3 docs/summaries.py           prints the tables and writes the pictures into docs/src/images
python3 docs/summaries.py --check   says whether pages and pictures are as the data say; exit status 1 if not
"""
import csv
import math
import pathlib
import statistics
import sys

SOURCE = pathlib.Path(__file__).parent / "src"
NOISE = ["standard", "low-position", "high-position", "high-torque", "both-high", "coloured", "long-coloured", "quantised", "outliers"]
INK, GRID, BAR, DOT = "#333333", "#d8d8d8", "#9db8d9", "#1f4e8c"


def data(name):
    with open(SOURCE / "data" / name, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def table(header, rows):
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def estimators():
    """One row an estimator: the largest error of the four robots at each level, coverage and median time over all cells."""
    cells = data("estimators.csv")
    names = list(dict.fromkeys(cell["estimator"] for cell in cells))
    rows = []
    for name in names:
        own = [cell for cell in cells if cell["estimator"] == name]
        row = [f"`{name}`"]
        for noise in NOISE:
            errors = [float(cell["rmse_over_bound"]) for cell in own if cell["noise"] == noise and cell["rmse_over_bound"]]
            row.append(f"{max(errors):.2f}" if errors else "")
        covered = [float(cell["coverage_percent"]) for cell in own if cell["coverage_percent"]]
        row.append(f"{min(covered):.0f} to {max(covered):.0f}" if covered else "")
        row.append(f"{statistics.median(float(cell['time_ms']) for cell in own):.3g}")
        rows.append(row)
    return table(["estimator", *NOISE, "cover %", "ms"], rows)


def estimators_picture():
    cells = [cell for cell in data("estimators.csv") if cell["rmse_over_bound"]]
    ranges = {}
    for cell in cells:
        ranges.setdefault(cell["estimator"], []).append((float(cell["rmse_over_bound"]), cell["noise"]))
    # Variants that differ in their error bars alone would repeat their neighbour's line.
    bars = {"weighted-white", "weighted-segments", "weighted-newey-west", "weighted-bootstrap"}
    shown = sorted((name for name in ranges if name not in bars), key=lambda name: statistics.median(value for value, _ in ranges[name]))
    left, right, top, step = 250, 700, 46, 24
    highest = max(value for name in shown for value, _ in ranges[name])
    decades = math.log10(highest / 0.8)

    def x(value):
        return left + (right - left) * math.log10(value / 0.8) / decades

    bottom = top + step * len(shown)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 720 {bottom + 40}" font-family="sans-serif" font-size="13">',
        f'<rect width="720" height="{bottom + 40}" fill="white"/>',
        f'<text x="12" y="22" fill="{INK}" font-size="14">Error over the Cramér-Rao bound: four robots, nine levels of noise</text>',
    ]
    for tick in [1, 2, 5, 10, 20, 50, 100]:
        if tick <= highest:
            out.append(f'<line x1="{x(tick):.1f}" y1="{top - 8}" x2="{x(tick):.1f}" y2="{bottom}" stroke="{GRID}"/>')
            out.append(f'<text x="{x(tick):.1f}" y="{bottom + 18}" fill="{INK}" text-anchor="middle">{tick}</text>')
    for number, name in enumerate(shown):
        y = top + step * number + step / 2
        calm = [value for value, noise in ranges[name] if noise != "outliers"]
        gross = [value for value, noise in ranges[name] if noise == "outliers"]
        out.append(f'<text x="{left - 12}" y="{y + 4:.1f}" fill="{INK}" text-anchor="end">{name}</text>')
        out.append(f'<line x1="{x(min(calm)):.1f}" y1="{y:.1f}" x2="{x(max(calm)):.1f}" y2="{y:.1f}" stroke="{BAR}" stroke-width="9"/>')
        out.append(f'<circle cx="{x(statistics.median(calm)):.1f}" cy="{y:.1f}" r="4" fill="{DOT}"/>')
        for value in gross:
            out.append(f'<path d="M{x(value) - 3:.1f} {y - 3:.1f}l6 6m0 -6l-6 6" stroke="#b03030" stroke-width="1.5"/>')
    out.append(f'<text x="{left}" y="{bottom + 34}" fill="{INK}" font-size="12">bar: least to largest without gross outliers; dot: median; cross: with outliers</text>')
    return "\n".join(out + ["</svg>", ""])


def differentiators():
    """One table a motion: bias without fault and with a shape that is 0.1 % off, and noise at 1e-3 degrees, of q̇ and q̈."""
    cells = data("differentiators.csv")
    tables = []
    for motion in dict.fromkeys(cell["motion"] for cell in cells):
        rows = []
        for way in dict.fromkeys(cell["way"] for cell in cells):
            row = [way]
            for unit in ("rad/s", "rad/s²"):
                [cell] = [c for c in cells if (c["motion"], c["way"]) == (motion, way) and c["quantity"].split(", ")[1] == unit]
                row += [cell["bias_none"], cell["bias_shape_0.1_percent"], cell["std_1e-3_deg"]]
            rows.append(row)
        header = [motion.split(" (")[0]]
        for quantity in ("q̇", "q̈"):
            header += [f"{quantity}: bias", "shape off by 0.1 %", "noise at 1e-3°"]
        tables.append(table(header, rows))
    return "\n\n".join(tables)


def designs(robots, suffix):
    """One row a family: log det where that was looked for, condition number where this was."""
    cells = data("designs.csv")
    rows = []
    for family in dict.fromkeys(cell["family"] for cell in cells if cell["robot"] == robots[0] + suffix):
        row = [family]
        for robot in robots:
            of = {cell["criterion"]: cell for cell in cells if (cell["robot"], cell["family"]) == (robot + suffix, family)}
            row += [of["d-optimal"]["log_det"], of["condition-number"]["condition_number"]]
        rows.append(["none" if cell in ("", "none inside the limits") else cell for cell in row])
    header = ["family" + suffix]
    for robot in robots:
        header += [f"{robot}: log det", "condition"]
    return table(header, rows)


ARMS = ["ur10", "panda", "iiwa14"]
TABLES = {
    "estimators-compared.md": [estimators],
    "differentiators.md": [differentiators],
    "designs-compared.md": [lambda: designs(ARMS, ""), lambda: designs(ARMS, ", cell"), lambda: designs(ARMS, ", friction")],
}
PICTURES = {"estimators.svg": estimators_picture}

wrong = []
for page, tables in TABLES.items():
    text = (SOURCE / page).read_text(encoding="utf-8")
    for made in (one() for one in tables):
        if made not in text:
            wrong.append(page)
            print(f"{page}:\n\n{made}\n")
for name, picture in PICTURES.items():
    path = SOURCE / "images" / name
    if not path.exists() or path.read_text(encoding="utf-8") != picture():
        wrong.append(name)
        if "--check" not in sys.argv:
            path.write_text(picture(), encoding="utf-8")
if "--check" in sys.argv:
    print(f"not as the data say: {', '.join(wrong)}" if wrong else "pages and pictures are as the data say")
    sys.exit(1 if wrong else 0)
