"""Creates the short tables and the pictures of the comparison pages of the book from the CSV files in docs/src/data.

python3 docs/summaries.py           prints the tables and writes the pictures into docs/src/images
python3 docs/summaries.py --check   checks pages and pictures against the data; exit status 1 if they differ
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
    """One row per estimator: the largest error of the four robots at each level, coverage and median time over all cells."""
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
    # Omit variants that differ only in their error bars, because their lines would be identical.
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
    """One table per motion: bias of q̇ and q̈ without fault and with a shape error of 0.1 %, and noise at 1e-3 degrees."""
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
    """One row per family: log det of the D-optimal design and condition number of the design with minimum condition number."""
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


def default_motion(cell):
    noise = f"{cell['encoder_bits']} bits" if cell["encoder_bits"] else f"{float(cell['position_noise_rad']):.0e} rad".replace("e-0", "e-")
    torque = f"{100 * float(cell['torque_noise']):g} %"
    colour = f", {1000 * float(cell['torque_colour_s']):g} ms" if float(cell["torque_colour_s"]) else ""
    outliers = ", outliers" if float(cell["outlier_share"]) else ""
    return f"{cell['harmonics']} × 0.1 Hz, {cell['length_s']} s, {cell['rate_hz']} Hz", f"{noise}, {torque}{colour}{outliers}"


def default_names():
    return [column.removesuffix("_settled") for column in data("default.csv")[0] if column.endswith("_settled")]


def percent(part, whole):
    return f"{100 * int(part) / int(whole):.0f}" if int(whole) else "-"


def default_cases():
    """One row per case: the default compared with known true settings and with plain least squares; error bars, friction laws and lag."""
    rows = []
    for cell in data("default.csv"):
        motion, noise = default_motion(cell)
        default, stated, best = (float(cell[f"{name}_percent"]) for name in ("default", "laws_stated", "best"))
        row = [cell["robot"], motion, cell["friction"], noise, f"{float(cell['lag_ms']):g}"]
        row += [f"{default:.2f}", f"{stated:.2f}", f"{best:.2f}", f"{default / best:.2f}", f"{stated / best:.2f}"]
        row += [f"{float(cell['plain_percent']):.1f}", f"{float(cell['plain_weighted_percent']):.1f}"]
        row.append(f"{float(cell['error_over_bound']):.2f}" if cell["error_over_bound"] else "-")
        row += [percent(cell["bodies_covered"], cell["bodies_intervals"]), percent(cell["friction_covered"], cell["friction_intervals"])]
        row.append(f"{cell['law_told']} of {cell['law_tellable']}")
        row.append(f"{float(cell['lag_found_ms']):.1f}" if cell["lag_found_ms"] else "-")
        rows.append([entry.replace("-0.0", "0.0") if entry == "-0.0" else entry for entry in row])
    header = ["robot", "motion", "friction", "noise", "lag, ms", "default, %", "laws stated, %", "best, %", "over best", "laws stated over best"]
    header += ["plain, %", "plain weighted, %", "over bound", "bodies cover, %", "friction covers, %", "law chosen", "lag found, ms"]
    return table(header, rows)


def default_goals():
    """Targets of the default settings, one row per target, as in crates/dynident-benchmark/src/default_study/table.rs."""
    cells = data("default.csv")

    def ratios(what, over):
        return [float(cell[what]) / float(cell[over]) for cell in cells]

    def within(what, values, most):
        inside = sum(value <= most for value in values)
        counts = f"{inside} of {len(values)} cases, median {statistics.median(values):.2f}, worst {max(values):.3g}"
        return [what, f"at most {most}", counts, "reached" if inside == len(values) else "**missed**"]

    def total(column):
        return sum(int(cell[column]) for cell in cells)

    def covered(what, name):
        share = 100 * total(f"{name}_covered") / total(f"{name}_intervals")
        verdict = "reached" if 93 <= share <= 97 else "**missed**, too wide" if share > 97 else "**missed**, too narrow"
        return [f"95 % intervals of {what} hold the truth", "93 to 97 %", f"{share:.1f} % of {total(f'{name}_intervals')}", verdict]

    told, tellable = total("law_told"), total("law_tellable")
    wins = [min(float(cell["plain_percent"]), float(cell["plain_weighted_percent"])) > float(cell["default_percent"]) for cell in cells]
    ordinary = sum(float(cell["plain_percent"]) > float(cell["default_percent"]) for cell in cells)
    bounds = [float(cell["error_over_bound"]) for cell in cells if cell["error_over_bound"]]
    rows = [
        within("cut-off and lag: laws stated over best", ratios("laws_stated_percent", "best_percent"), 1.15),
        within("laws chosen: default over laws stated", ratios("default_percent", "laws_stated_percent"), 1.3),
        within("all by default: default over best", ratios("default_percent", "best_percent"), 1.15),
        within("error of the bodies over the Cramér-Rao bound", bounds, 1.2),
        covered("bodies", "bodies"),
        covered("friction whose laws are chosen as they are", "friction"),
    ]
    chosen = f"{told} of {tellable}, {100 * told / tellable:.0f} %"
    rows.append(["law chosen where it can be told", "at least 90 %", chosen, "reached" if told >= 0.9 * tellable else "**missed**"])
    won = f"{sum(wins)} of {len(cells)} cases (ordinary alone: {ordinary})"
    rows.append(["better than plain least squares, ordinary and weighted", "all cases", won, "reached" if all(wins) else "**missed**"])
    rows.append(["95 % bar of the lag holds it", "", f"{total('lag_held_runs')} of {total('runs')} recordings", ""])
    return table(["", "to reach", "reached", ""], rows)


def default_estimators():
    """One row per named estimator: its error relative to the default, for cases in which it converged in all runs."""
    cells, rows = data("default.csv"), []
    for name in default_names():
        asked = [cell for cell in cells if cell[f"{name}_settled"]]
        settled = [cell for cell in asked if cell[f"{name}_settled"] == cell["runs"]]
        ratios = [float(cell[f"{name}_percent"]) / float(cell["default_free_percent"]) for cell in settled]
        row = [f"`{name}`", f"{len(settled)} of {len(asked)}"]
        row += [f"{value:.2f}" for value in (statistics.geometric_mean(ratios), min(ratios), max(ratios))] if ratios else ["-"] * 3
        row += [str(sum(ratio < 0.95 for ratio in ratios)), str(sum(ratio > 1.05 for ratio in ratios))]
        rows.append(row)
    return table(["estimator", "settled in", "over default", "least", "largest", "better by 5 %", "worse by 5 %"], rows)


def default_picture():
    """Error of the default relative to the best for each case, with those of stated laws, plain least squares and the best named estimator."""
    cells = sorted(data("default.csv"), key=lambda cell: float(cell["default_percent"]) / float(cell["best_percent"]))
    left, right, top, step = 330, 700, 62, 17
    lowest, highest = 0.7, 400.0

    def x(value):
        value = min(max(value, lowest), highest)
        return left + (right - left) * math.log(value / lowest) / math.log(highest / lowest)

    bottom = top + step * len(cells)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 720 {bottom + 56}" font-family="sans-serif" font-size="11">',
        f'<rect width="720" height="{bottom + 56}" fill="white"/>',
        f'<text x="12" y="22" fill="{INK}" font-size="14">Error of the model over the best with the truth in hand</text>',
        f'<text x="12" y="40" fill="{INK}">laws, lag and best cut-off stated: 1</text>',
    ]
    for tick in [1, 2, 5, 10, 20, 50, 100, 200]:
        out.append(f'<line x1="{x(tick):.1f}" y1="{top - 6}" x2="{x(tick):.1f}" y2="{bottom}" stroke="{GRID}"/>')
        out.append(f'<text x="{x(tick):.1f}" y="{bottom + 16}" fill="{INK}" text-anchor="middle">{tick}</text>')
    for number, cell in enumerate(cells):
        y = top + step * number + step / 2
        motion, noise = default_motion(cell)
        best = float(cell["best_percent"])
        default, stated = float(cell["default_percent"]) / best, float(cell["laws_stated_percent"]) / best
        plain = min(float(cell["plain_percent"]), float(cell["plain_weighted_percent"])) / best
        label = f"{cell['robot']}, {cell['friction']}, {cell['length_s']} s, {noise}, {float(cell['lag_ms']):g} ms"
        out.append(f'<text x="{left - 10}" y="{y + 4:.1f}" fill="{INK}" text-anchor="end">{label}</text>')
        out.append(f'<line x1="{x(1):.1f}" y1="{y:.1f}" x2="{x(default):.1f}" y2="{y:.1f}" stroke="{BAR}" stroke-width="7"/>')
        out.append(f'<circle cx="{x(default):.1f}" cy="{y:.1f}" r="4" fill="{DOT}"/>')
        out.append(f'<line x1="{x(stated):.1f}" y1="{y - 6:.1f}" x2="{x(stated):.1f}" y2="{y + 6:.1f}" stroke="#2e7d32" stroke-width="2"/>')
        out.append(f'<path d="M{x(plain) - 3:.1f} {y - 3:.1f}l6 6m0 -6l-6 6" stroke="#b03030" stroke-width="1.5"/>')
    words = "dot: default; green: true laws stated, all else by default; cross: plain least squares, the better of ordinary and weighted"
    out.append(f'<text x="12" y="{bottom + 40}" fill="{INK}">{words}</text>')
    return "\n".join(out + ["</svg>", ""])


GROWTH_PANELS = [
    ("identify: rows of a Panda arm's log", "s of the processor", 1.0, [("rows", "identify"), ("log", "reading alone")], 3),
    ("identify: logs of 2,000 rows", "s of the processor", 1.0, [("logs", "identify")], 3),
    ("peak memory of identify, by rows", "MiB", None, [("rows", "rows of one log")], 5),
    ("peak memory of identify, by logs", "MiB", None, [("logs", "logs of 2,000 rows")], 5),
    ("identify: joints of a chain, 4,000 rows", "s of the processor", 1.0, [("identify", "identify")], 3),
    ("one call: joints of a chain", "µs", 1e6, [("rnea", "rnea"), ("crba", "crba"), ("aba", "aba"), ("rnea_derivatives", "derivatives"), ("joint_torque_regressor", "regressor")], 3),
    ("a sample of a batch: joints of a chain", "µs", 1e6, [("rnea_batch", "rnea"), ("crba_batch", "crba"), ("rnea_derivatives_batch", "derivatives"), ("regressor_batch", "regressor")], 3),
]
LINES = ["#1f4e8c", "#b03030", "#2e7d32", "#8a5a00", "#6a3d9a"]


def growth_picture():
    """Logarithmic panels of the results of benchmarks/growth.py; a thin grey line shows proportional growth."""
    cells = [cell for cell in data("growth.csv") if cell["threads"] == "1"]
    wide, high, left, top = 330, 230, 52, 30
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * wide + 60} {4 * high + 20}" font-family="sans-serif" font-size="11">',
        f'<rect width="{2 * wide + 60}" height="{4 * high + 20}" fill="white"/>',
    ]
    for number, (title, unit, scale, curves, field) in enumerate(GROWTH_PANELS):
        x0, y0 = (number % 2) * (wide + 30) + left, (number // 2) * high + top
        width, height = wide - left - 70, high - top - 34
        name = "memory_mib" if scale is None else "processor_s"
        lines = {label: [(float(c["number"]), (scale or 1.0) * float(c[name])) for c in cells if c["curve"] == curve] for curve, label in curves}
        xs, ys = ([point[k] for points in lines.values() for point in points] for k in (0, 1))
        low_x, high_x = math.floor(math.log10(min(xs)) * 2) / 2, math.ceil(math.log10(max(xs)) * 2) / 2
        low_y, high_y = math.floor(math.log10(min(ys))), math.ceil(math.log10(max(ys)))

        def place(x, y):
            across, up = (math.log10(x) - low_x) / (high_x - low_x), (math.log10(y) - low_y) / (high_y - low_y)
            return f"{x0 + width * across:.1f},{y0 + height * (1 - up):.1f}"

        out.append(f'<text x="{x0 - left + 8}" y="{y0 - 12}" fill="{INK}" font-size="12">{title}, {unit}</text>')
        for decade in range(math.ceil(low_x), math.floor(high_x) + 1):
            (x, y), end = place(10.0**decade, 10.0**low_y).split(","), y0
            out.append(f'<line x1="{x}" y1="{end}" x2="{x}" y2="{y}" stroke="{GRID}"/>')
            out.append(f'<text x="{x}" y="{float(y) + 15:.1f}" fill="{INK}" text-anchor="middle">{10**decade:,}</text>')
        for decade in range(low_y, high_y + 1):
            x, y = place(10.0**low_x, 10.0**decade).split(",")
            out.append(f'<line x1="{x}" y1="{y}" x2="{x0 + width}" y2="{y}" stroke="{GRID}"/>')
            out.append(f'<text x="{x0 - 6}" y="{float(y) + 4:.1f}" fill="{INK}" text-anchor="end">{10.0**decade:g}</text>')
        taken = []
        for colour, (label, points) in zip(LINES, lines.items()):
            path = " ".join(place(x, y) for x, y in points)
            out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
            out += [f'<circle cx="{p.split(",")[0]}" cy="{p.split(",")[1]}" r="2" fill="{colour}"/>' for p in path.split()]
            x, y = map(float, path.split()[-1].split(","))
            while any(abs(y - other) < 11 for other in taken):
                y += 3
            taken.append(y)
            out.append(f'<text x="{x + 6:.1f}" y="{y + 4:.1f}" fill="{colour}" font-size="10">{label}</text>')
        # Proportional growth from the lowest first point to the edge of the panel.
        first = min((points[0] for points in lines.values()), key=lambda point: point[1])
        reach = min(10**high_x / first[0], 10**high_y / first[1])
        ends = f"{place(*first)} {place(first[0] * reach, first[1] * reach)}"
        out.append(f'<polyline points="{ends}" fill="none" stroke="#888888" stroke-dasharray="3 3"/>')
    return "\n".join(out + ["</svg>", ""])


ARMS = ["ur10", "panda", "iiwa14"]
TABLES = {
    "estimators-compared.md": [estimators],
    "default-compared.md": [default_goals, default_estimators],
    "default-cases.md": [default_cases],
    "differentiators.md": [differentiators],
    "designs-compared.md": [lambda: designs(ARMS, ""), lambda: designs(ARMS, ", cell"), lambda: designs(ARMS, ", friction")],
}
PICTURES = {"estimators.svg": estimators_picture, "default.svg": default_picture, "growth.svg": growth_picture}

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
    print(f"differs from the data: {', '.join(wrong)}" if wrong else "pages and pictures agree with the data")
    sys.exit(1 if wrong else 0)
