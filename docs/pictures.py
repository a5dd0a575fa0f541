"""Makes the pictures and films of the book and of README from the real output of the commands.

python3 docs/pictures.py DYNIDENT CHROMIUM           writes all pictures into docs/src/images
python3 docs/pictures.py DYNIDENT CHROMIUM --check   compares the text of the sessions with the output of the commands, except for
                                                     numbers; exit status 1 if they differ

DYNIDENT is the program, CHROMIUM a browser (CHROMIUM is not needed for --check). The public recordings are read from the folder
DYNIDENT_DATA, by default ../shared/data next to the repository. The pictures of sessions hold their text as text.
"""

import base64
import html
import io
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "src" / "images"
DATA = pathlib.Path(os.environ.get("DYNIDENT_DATA", ROOT.parent / "shared" / "data"))
sys.path.insert(0, str(ROOT / ".ci"))

# Geometry of a session, px.
FONT, ADVANCE, LINE, EDGE = 13, 7.8, 18, 16

COLOURS = """
  text { white-space: pre }
  .page { fill: #f6f8fa; stroke: #d0d7de } .ink { fill: #1f2328 } .prompt { fill: #0550ae; font-weight: bold } .left { fill: #59636e }
  @media (prefers-color-scheme: dark) {
    .page { fill: #0d1117; stroke: #30363d } .ink { fill: #e6edf3 } .prompt { fill: #79c0ff } .left { fill: #9198a1 }
  }"""

# Places of the upper part of the report, up to the first plot, and of the held-out torque of the second joint.
REPORT = """(async () => {
  const place = (top, bottom) => ({ x: 0, y: scrollY + top - 4, width: innerWidth, height: bottom - top + 8, scale: 1 });
  const plots = [...document.querySelectorAll("section.plot")];
  const torque = plots.find((one) => one.querySelector("h3")?.textContent.startsWith("shoulder_lift_joint")).getBoundingClientRect();
  return { report: place(4 - scrollY, plots[0].getBoundingClientRect().bottom), torque: place(torque.top, torque.bottom) };
})()"""

# The robot in the middle of its designed motion, with the limits of its joints.
DESIGN = """(async () => {
  const slider = document.querySelector("input[type=range]");
  slider.value = slider.max * 0.45;
  slider.dispatchEvent(new Event("input"));
  await new Promise((done) => setTimeout(done, 500));
  const [stage, gauges] = [".stage", ".gauges"].map((name) => document.querySelector(name).getBoundingClientRect());
  return { "design-robot": { x: 0, y: scrollY + stage.top - 4, width: innerWidth, height: gauges.bottom - stage.top + 8, scale: 1 } };
})()"""

# Frames of a film, time of each, and size of the file.
FILM_FRAMES, FILM_FRAME_MS, MAX_FILM_BYTES = 60, 100, 400_000

# Place of the robot in its page.
STAGE = """(async () => {
  document.querySelector(".view").scrollIntoView();
  for (let k = 0; k < 200 && !document.querySelector(".view").posesAt; k++) await new Promise((done) => setTimeout(done, 20));
  const stage = document.querySelector(".stage");
  for (let k = 0; k < 3; k++) stage.dispatchEvent(new KeyboardEvent("keydown", { key: "+" }));
  await new Promise((done) => setTimeout(done, 500));
  const { x, y, width, height } = stage.getBoundingClientRect();
  return { x: x + scrollX, y: y + scrollY, width, height };
})()"""

# Shows the robot at a share of the first six seconds of its motion.
FRAME = """(async (share) => {
  const slider = document.querySelector(".view input[type=range]");
  slider.value = Number(slider.min) + share * Math.min(6, slider.max - slider.min);
  slider.dispatchEvent(new Event("input"));
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
})"""

# A mistake for `check`: the sign of the third torque.
MISTAKE = ('torque = { columns = "tau{1..6}_Nm" }', 'torque = { columns = "tau{1..6}_Nm", sign = [1, 1, -1, 1, 1, 1] }')

# Name, title, command and number of shown lines of each session.
SESSIONS = [
    ("identify", "Output of dynident identify for the recording of a UR10", "dynident identify examples/ur10.toml --data recordings --out result", 32),
    ("check", "Output of dynident check for a study with a wrong sign", "dynident check study.toml", 40),
    ("design", "Output of dynident design for a UR10 in a cell", "dynident design examples/design_ur10_cell.toml --out ur10_motion --to ros2", 60),
    ("iterate", "Output of dynident iterate for a simulated UR10", "dynident iterate examples/iterate_ur10.toml --out iteration", 14),
]


def folder_of_commands(folder):
    """Makes a folder in which the commands of the pictures run as printed."""
    for name in ("examples", "robots"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "recordings").symlink_to(DATA)
    study = (ROOT / "examples" / "ur10_simulated.toml").read_text(encoding="utf-8").replace("../robots", "robots").replace('"ur10_simulated/', '"examples/ur10_simulated/')
    if MISTAKE[0] not in study:
        raise SystemExit(f"examples/ur10_simulated.toml does not contain {MISTAKE[0]}")
    (folder / "study.toml").write_text(study.replace(*MISTAKE), encoding="utf-8")


def output(program, command, folder):
    """Lines that a command prints, without the duration, which depends on the machine."""
    words = command.split()[1:]
    done = subprocess.run([program, *words], cwd=folder, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{command}\n{done.stderr}")
    return re.sub(r" in [\d.]+ s\b", "", done.stdout).rstrip("\n").split("\n")


def session(title, command, lines, most):
    """SVG of a terminal with a command and the first lines of its output."""
    shown = [("prompt", "$ " + command)] + [("ink", line) for line in lines[:most]]
    if len(lines) > most:
        shown.append(("left", f"[{len(lines) - most} more lines]"))
    width = 2 * EDGE + ADVANCE * max(len(text) for _, text in shown)
    height = 2 * EDGE + LINE * len(shown)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height}" viewBox="0 0 {width:.0f} {height}" role="img">',
        f"<title>{html.escape(title)}</title>",
        f"<style>{COLOURS}\n</style>",
        f'<rect class="page" x="0.5" y="0.5" width="{width - 1:.0f}" height="{height - 1}" rx="6"/>',
        f'<g font-family="ui-monospace, SFMono-Regular, Menlo, Consolas, DejaVu Sans Mono, monospace" font-size="{FONT}">',
    ]
    for number, (kind, text) in enumerate(shown):
        if text.strip():
            y = EDGE + LINE * number + FONT
            # The length keeps columns aligned in every font.
            length = f'xml:space="preserve" textLength="{ADVANCE * len(text):.1f}" lengthAdjust="spacingAndGlyphs"'
            out.append(f'<text class="{kind}" x="{EDGE}" y="{y}" {length}>{html.escape(text, quote=False)}</text>')
    return "\n".join([*out, "</g>", "</svg>", ""])


def words(svg):
    """Text of a session without its numbers."""
    text = " ".join(html.unescape(line) for line in re.findall(r"<text[^>]*>([^<]*)</text>", svg))
    return re.sub(r"\s+", " ", re.sub(r"[-+]?\d[\d.,e+-]*", "#", text))


def photograph(chromium, page, places):
    """Writes parts of a report as WebP."""
    from pages import SCROLL, Browser

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(chromium, profile)
        browser.call("Emulation.setScrollbarsHidden", hidden=True)
        browser.size(1000, 900)
        browser.scheme("light")
        browser.call("Page.navigate", url=page.resolve().as_uri())
        browser.wait_for("Page.loadEventFired")
        # Draw all plots first, because drawing changes their places.
        browser.value(SCROLL)
        browser.value("new Promise((done) => setTimeout(done, 1500))")
        for name, clip in browser.value(places).items():
            shot = browser.call("Page.captureScreenshot", format="webp", quality=85, clip=clip, captureBeyondViewport=True)
            (IMAGES / f"{name}.webp").write_bytes(base64.b64decode(shot["data"]))
        browser.close()


def film(chromium, page, name):
    """Writes the robot of a page, which plays its first motion, as an animated WebP."""
    from PIL import Image
    from pages import Browser

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(chromium, profile)
        browser.size(640, 700)
        browser.scheme("light")
        browser.call("Page.navigate", url=page.resolve().as_uri())
        browser.wait_for("Page.loadEventFired")
        clip, frames = browser.value(STAGE), []
        for number in range(FILM_FRAMES):
            browser.value(f"{FRAME}({number / FILM_FRAMES})")
            shot = browser.call("Page.captureScreenshot", format="png", clip={**clip, "scale": 1}, captureBeyondViewport=True)
            frames.append(Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB"))
        browser.close()
    path = IMAGES / f"{name}.webp"
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=FILM_FRAME_MS, loop=0, quality=60, method=6)
    if path.stat().st_size > MAX_FILM_BYTES:
        raise SystemExit(f"{path.name}: {path.stat().st_size} bytes, at most {MAX_FILM_BYTES}: reduce frames or quality")


def main():
    arguments = [word for word in sys.argv[1:] if word != "--check"]
    check = "--check" in sys.argv
    program = str(pathlib.Path(arguments[0]).resolve())
    wrong = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        folder_of_commands(folder)
        for name, title, command, most in SESSIONS:
            made = session(title, command, output(program, command, folder), most)
            path = IMAGES / f"session-{name}.svg"
            if not check:
                path.write_text(made, encoding="utf-8")
            elif not path.exists() or words(path.read_text(encoding="utf-8")) != words(made):
                wrong.append(path.name)
        if not check:
            (IMAGES / "motion.svg").write_bytes((folder / "ur10_motion" / "path.svg").read_bytes())
            photograph(arguments[1], folder / "result" / "report.html", REPORT)
            photograph(arguments[1], folder / "ur10_motion" / "report.html", DESIGN)
            film(arguments[1], folder / "result" / "report.html", "identify-robot")
            view = ["view", "robots/ur10.urdf", "ur10_motion/trajectory.csv", "--out", "view.html"]
            subprocess.run([program, *view, "--quiet"], cwd=folder, check=True)
            film(arguments[1], folder / "view.html", "view-robot")
    if check:
        print(f"differs from the output of the commands: {', '.join(wrong)}" if wrong else "the sessions agree with the output of the commands")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
