#!/usr/bin/env python3
"""screenshots.py CHROMIUM SCRATCH [--write]: compares pages with their stored structure and pictures in .ci/screenshots.

SCRATCH/commands has the outputs of commands.sh. The structure is exact: headings, sections, plots and columns of tables in their order. Pictures are compared by
the means of blocks of pixels. Text is drawn in the font of the figures, so that the result does not depend on the fonts of the machine. `--write` stores structure
and pictures again: look at them before you commit them.
"""

import base64
import json
import pathlib
import sys
import tempfile

import pages

ROOT = pathlib.Path(__file__).resolve().parent.parent
STORED = ROOT / ".ci" / "screenshots"
FONT = ROOT / "crates/dynident-report/vendor/dejavu/DejaVuSansCondensed.ttf"

# Versions of a browser place edges and glyphs up to a pixel apart, and the stored pictures are compressed. In a block of 16 by 16 pixels an edge that moves by a
# pixel changes the mean by at most 1/16 of the full scale, 16 of 255; two edges and the compression give 40. A robot in another pose or colour, a missing plot
# or another layout change many blocks by more.
BLOCK = 16
LARGEST_BLOCK_DIFFERENCE = 40
# Share of blocks that may differ more: lines of text that break at another word.
LARGEST_SHARE = 0.01

# Page, part of it (CSS selector; None for the upper part of the page), width, height of the upper part, colours, share of the motion.
VIEWS = {
    "view": ("view.html", ".stage", 1000, None, "light", None),
    "gallery": ("gallery.html", ".view", 1000, None, "light", 0.25),
    "identify": ("result/report.html", ".view", 1000, None, "dark", 0.3),
    "paper": ("paper/report.html", ".stage", 1000, None, "light", 0.5),
    "report": ("result/report.html", None, 1400, 1500, "light", 0.3),
    "report-phone": ("result/report.html", None, 390, 1500, "light", 0.3),
}

PREPARE = """(async ([font, share]) => {
  const own = await new FontFace("own", `url(data:font/ttf;base64,${font})`).load();
  document.fonts.add(own);
  document.head.append(Object.assign(document.createElement("style"), { textContent: "* { font-family: own !important }" }));
  const view = document.querySelector(".view");
  view?.scrollIntoView();
  for (let k = 0; k < 200 && view && !view.posesAt; k++) await new Promise((done) => setTimeout(done, 20));
  const slider = view?.querySelector("input[type=range]");
  if (share != null) {
    slider.value = Number(slider.min) + share * (slider.max - slider.min);
    slider.dispatchEvent(new Event("input"));
  }
  scrollTo(0, 0);
  dispatchEvent(new Event("resize"));
  await new Promise((done) => setTimeout(done, 500));
  return Boolean(view?.posesAt);
})"""

# Kind, heading, curves of a plot, columns of a table, and names of controls; not texts and numbers.
STRUCTURE = """[...document.querySelectorAll("h1, h2, section")].map((part) => part.tagName !== "SECTION" ? `${part.tagName.toLowerCase()}: ${part.textContent}` : [
  part.className,
  part.querySelector("h2, h3")?.textContent ?? "",
  [...part.querySelectorAll("thead th")].map((cell) => cell.textContent).join(", "),
  [...part.querySelectorAll(".bar label, .bar button")].map((control) => control.firstChild.textContent.trim()).join(", "),
].filter((text) => text).join(": "))"""


def seen(browser, commands, view):
    """Structure and picture (WebP) of a view."""
    page, part, width, height, scheme, share = view
    browser.events.clear()
    browser.size(width, height or 900)
    browser.scheme(scheme)
    browser.call("Page.navigate", url=(commands / page).resolve().as_uri())
    browser.wait_for("Page.loadEventFired")
    font = base64.b64encode(FONT.read_bytes()).decode()
    if not browser.value(f"{PREPARE}({json.dumps([font, share])})"):
        raise SystemExit(f"{page}: the still picture of the robot was not replaced")
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
    if part:
        clip |= browser.value(f'(({{ x, y, width, height }}) => ({{ x: x + scrollX, y: y + scrollY, width, height }}))(document.querySelector("{part}").getBoundingClientRect())')
    shot = browser.call("Page.captureScreenshot", format="webp", quality=80, clip=clip, captureBeyondViewport=True)
    return browser.value(STRUCTURE), base64.b64decode(shot["data"])


def differences(name, browser, structure, picture):
    wrong = []
    for number, (before, after) in enumerate(zip(json.loads((STORED / f"{name}.json").read_text(encoding="utf-8")) + [None], structure + [None])):
        if before != after:
            wrong.append(f"part {number} was `{before}`, is `{after}`")
            break
    found = pages.compared(browser, "webp", (STORED / f"{name}.webp").read_bytes(), picture, BLOCK)
    apart = found["apart"]
    share = sum(difference > LARGEST_BLOCK_DIFFERENCE for difference in apart) / len(apart)
    if share > LARGEST_SHARE:
        wrong.append(f"{100 * share:.1f} % of the blocks differ, sizes {found['sizes']}")
    print(f"{name}: {len(structure)} parts, {found['sizes'][1]} pixels, {100 * share:.2f} % of the blocks differ, mean difference {sum(apart) / len(apart):.2f} of 255")
    return wrong


def main():
    program, scratch = [word for word in sys.argv[1:] if word != "--write"]
    write = "--write" in sys.argv
    failed = False
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True, dir=scratch) as folder:
        browser = pages.Browser(program, folder)
        browser.call("Emulation.setScrollbarsHidden", hidden=True)
        for name, view in VIEWS.items():
            structure, picture = seen(browser, pathlib.Path(scratch) / "commands", view)
            if write:
                STORED.mkdir(exist_ok=True)
                (STORED / f"{name}.json").write_text(json.dumps(structure, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
                (STORED / f"{name}.webp").write_bytes(picture)
                continue
            for finding in differences(name, browser, structure, picture):
                failed = True
                print(f"    {name}: {finding}")
                (pathlib.Path(scratch) / f"{name}.webp").write_bytes(picture)
        browser.close()
    sys.exit(failed)


if __name__ == "__main__":
    main()
