#!/usr/bin/env python3
"""plot.py DYNIDENT CHROMIUM LIBRARIES SCRATCH: checks the figures for papers in all forms.

The PDF must contain every text of the SVG, as pypdf extracts it, on a page of the same size. The PNG must have the stated size and look like the SVG as the browser
draws it in the same font. LIBRARIES is that of pages.py; SCRATCH/commands has the outputs of commands.sh.
"""

import base64
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import pages

ROOT = pathlib.Path(__file__).resolve().parent.parent
FONT = ROOT / "crates/dynident-report/vendor/dejavu/DejaVuSansCondensed.ttf"
DPI = 150
POINTS_PER_MM = 72.0 / 25.4
# Both programs round sizes to a thousandth of a point or a tenth of a millimetre.
LARGEST_SIZE_ERROR_PT = 0.2
# Two rasterisers place edges up to half a pixel apart. A line of two pixels next to the side of a block of 8 by 8 pixels then changes its mean by 1/16 of the
# full scale, or 16 of 255; a block of text has at most three such edges.
BLOCK = 8
# Share of blocks that are not white: less is an empty picture.
LEAST_USED = 0.02
LARGEST_BLOCK_DIFFERENCE = 48

def drawn(browser, svg, width, height, folder):
    """The SVG as the browser draws it in the font of PDF and PNG, as PNG."""
    font = base64.b64encode(FONT.read_bytes()).decode()
    page = pathlib.Path(folder) / "figure.html"
    page.write_text(
        f'<!DOCTYPE html><meta charset="utf-8"><style>@font-face {{ font-family: own; src: url("data:font/ttf;base64,{font}") }} body {{ margin: 0 }}'
        f"svg, svg * {{ font-family: own !important; text-rendering: geometricPrecision }} body > svg {{ display: block; width: {width}px; height: {height}px }}"
        f"</style>{svg}",
        encoding="utf-8",
    )
    browser.size(width, height)
    browser.call("Page.navigate", url=page.resolve().as_uri())
    browser.wait_for("Page.loadEventFired")
    browser.events.clear()
    browser.value("document.fonts.ready.then(() => document.fonts.size)")
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
    return base64.b64decode(browser.call("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=True)["data"])


def checked(browser, reader, dynident, figure, result, more, folder):
    """Returns the errors of a figure."""
    svg, pdf, png = (pathlib.Path(folder) / f"{figure}.{form}" for form in ("svg", "pdf", "png"))
    files = [word for file in (svg, pdf, png) for word in ("--out", str(file))]
    subprocess.run([dynident, "plot", result, "--figure", figure, "--dpi", str(DPI), "--quiet", *files, *more], check=True)
    text = svg.read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)
    size_mm = [float(root.get(side).removesuffix("mm")) for side in ("width", "height")]
    wrong = []

    (sheet,) = reader(pdf).pages
    for side, found in zip(size_mm, (sheet.mediabox.width, sheet.mediabox.height)):
        if abs(side * POINTS_PER_MM - float(found)) > LARGEST_SIZE_ERROR_PT:
            wrong.append(f"PDF of {found} points, SVG of {side} mm")
    solid = lambda words: "".join(words.split())
    texts = [solid("".join(element.itertext())) for element in root.iter("{http://www.w3.org/2000/svg}text")]
    extracted = solid(sheet.extract_text())
    wrong += [f"the PDF lacks the text {own}" for own in texts if own not in extracted]
    if sorted("".join(texts)) != sorted(extracted):
        wrong.append("the characters of PDF and SVG differ")

    # PNG: eight bytes of signature, eight of a chunk header, width and height.
    head = png.read_bytes()[16:24]
    size = [int.from_bytes(head[:4], "big"), int.from_bytes(head[4:], "big")]
    if any(abs(pixels - side / 25.4 * DPI) > 1.0 for pixels, side in zip(size, size_mm)):
        wrong.append(f"PNG of {size} pixels, SVG of {size_mm} mm")
    found = pages.compared(browser, "png", png.read_bytes(), drawn(browser, text, *size, folder), BLOCK)
    apart = found["apart"][0]
    if apart > LARGEST_BLOCK_DIFFERENCE or found["sizes"][0] != found["sizes"][1] or min(found["used"]) < LEAST_USED:
        wrong.append(f"PNG and browser: difference {apart}, sizes {found['sizes']}, used {found['used']}")
    print(f"{figure}: {len(texts)} texts, {size[0]} x {size[1]} pixels, largest difference of a block {apart:.0f} of 255, "
          f"{100 * found['used'][0]:.0f} % of the blocks used, {len(wrong)} findings")
    return [f"{figure}: {one}" for one in wrong]


def main():
    dynident, program, libraries, scratch = sys.argv[1:]
    sys.path.insert(0, libraries)
    from pypdf import PdfReader

    result, iteration = (str(pathlib.Path(scratch) / "commands" / name) for name in ("result", "iteration"))
    figures = [("parameters", result, []), ("friction", result, ["--width-mm", "180"]), ("residuals", result, ["--study", str(ROOT / "examples/ur10_simulated.toml")]),
               ("convergence", iteration, [])]
    wrong = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True, dir=scratch) as folder:
        browser = pages.Browser(program, folder)
        for figure, place, more in figures:
            wrong += checked(browser, PdfReader, dynident, figure, place, more, folder)
        browser.close()
    for finding in wrong:
        print(finding)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
