#!/usr/bin/env python3
"""pages.py CHROMIUM LIBRARIES PAGE.html...: checks the reports in a browser.

Every plot must be visible before scrolling, the console must be empty, axe-core must find no violation (light and dark, wide and narrow, before and after
scrolling), and in print each headline must be on the page of its plot or table. LIBRARIES is a folder with axe_playwright_python (for its axe.min.js) and pypdf.

The script controls the browser with the DevTools protocol over two pipes and needs no further package.
"""

import base64
import io
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

# Maximum time for a response, s.
PATIENCE = 60.0
# Exit status if the browser has crashed or hangs. It says nothing about the pages, so the caller may repeat the check.
BROWSER_LOST = 75

# A plot is visible if its static SVG or its canvas is not empty. Every section with a headline has an SVG or a canvas. Folded plots are opened.
UNSEEN = """(() => {
  document.querySelectorAll("section.picture > details").forEach((fold) => { fold.open = true; });
  const shown = (element) => {
    const box = element.getBoundingClientRect();
    return box.width > 100 && box.height > 15 && getComputedStyle(element).visibility === "visible";
  };
  const drawn = (svg) => [...svg.querySelectorAll("path, rect")].some((part) => {
    const box = part.getBoundingClientRect();
    return box.width > 5 || box.height > 5;
  });
  const inked = (canvas) => {
    // Use a copy: reading the original canvas causes a browser warning on the console, which is checked below.
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const pen = copy.getContext("2d", { willReadFrequently: true });
    pen.drawImage(canvas, 0, 0);
    const data = pen.getImageData(0, 0, copy.width, copy.height).data;
    for (let i = 3; i < data.length; i += 4) if (data[i]) return true;
    return false;
  };
  return [...document.querySelectorAll("section.plot, section.picture")].filter((section) => {
    const stills = [...section.querySelectorAll("svg")].some((svg) => shown(svg) && drawn(svg));
    return !stills && ![...section.querySelectorAll("canvas")].some((canvas) => shown(canvas) && inked(canvas));
  }).map((section) => section.querySelector("h3")?.textContent ?? section.id);
})()"""

# Every interactive plot can be reached with the tab key and has a label.
WITHOUT_KEYS = """[...document.querySelectorAll("section.plot .chart")].filter((chart) =>
  chart.tabIndex !== 0 || !chart.getAttribute("aria-label")).map((chart) => chart.id)"""

SCROLL = """(async () => {
  for (let y = 0; y < document.body.scrollHeight; y += 600) {
    scrollTo(0, y);
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  }
  scrollTo(0, 0);
  return document.querySelectorAll(".chart:not(.live)").length;
})()"""

AXE = """axe.run(document, { resultTypes: ["violations"] }).then((found) => found.violations.flatMap((rule) =>
  rule.nodes.map((node) => `${rule.id}: ${node.target.join(" ")}: ${node.failureSummary}`)))"""

# Marker words for finding positions in the PDF: one in each headline, one at each end of its plot or table.
MARK = """(() => {
  const marks = [];
  document.querySelectorAll("section.plot, section.picture, section:has(.wide > table)").forEach((section, number) => {
    const head = section.querySelector("h3");
    if (!head) return;
    head.append(` QQH${number}Q`);
    const svg = section.querySelector("svg");
    if (svg) {
      const { width, height } = svg.viewBox.baseVal;
      for (const [end, y] of [["A", 12], ["Z", height - 2]]) {
        const text = document.createElementNS("http://www.w3.org/2000/svg", "text");
        text.setAttribute("x", width / 2);
        text.setAttribute("y", y);
        text.textContent = `QQ${end}${number}Q`;
        svg.append(text);
      }
      marks.push([head.textContent, `QQH${number}Q`, [`QQA${number}Q`, `QQZ${number}Q`]]);
    } else {
      const cell = section.querySelector("tbody td");
      if (!cell) return;
      cell.append(` QQA${number}Q`);
      marks.push([head.textContent, `QQH${number}Q`, [`QQA${number}Q`]]);
    }
  });
  return marks;
})()"""

# Means of all colours in blocks of two pictures: differences in the order of size, largest first, and the share of blocks of each picture that are not white.
COMPARE = """(async ([first, second, block]) => {
  const means = async (source) => {
    const image = new Image();
    image.src = source;
    await image.decode();
    const [columns, rows] = [image.width, image.height].map((length) => Math.floor(length / block));
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.width, image.height];
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    pen.drawImage(image, 0, 0);
    const { data: pixels, width } = pen.getImageData(0, 0, image.width, image.height);
    const sums = Array.from({ length: 3 * columns * rows }, () => 0);
    for (let y = 0; y < rows * block; y++) for (let x = 0; x < columns * block; x++) for (let part = 0; part < 3; part++) {
      sums[3 * (Math.floor(y / block) * columns + Math.floor(x / block)) + part] += pixels[4 * (y * width + x) + part];
    }
    return { size: [image.width, image.height], means: sums.map((sum) => sum / (block * block)) };
  };
  const [a, b] = [await means(first), await means(second)];
  const used = (of) => of.means.filter((mean) => mean < 250).length / of.means.length;
  const apart = a.means.length === b.means.length ? a.means.map((mean, k) => Math.abs(mean - b.means[k])).sort((p, q) => q - p) : [255];
  return { sizes: [a.size, b.size], apart, used: [used(a), used(b)] };
})"""


class Browser:
    """A headless Chromium with one page."""

    def __init__(self, program, folder):
        to_browser, ours_to = os.pipe()
        ours_from, from_browser = os.pipe()
        # Containers often have only 64 MB in /dev/shm, which large pages exceed.
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader"]
        options += ["--remote-debugging-pipe", f"--user-data-dir={folder}"]
        # The protocol uses file descriptors 3 and 4.
        command = f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}'
        self.process = subprocess.Popen(
            ["bash", "-c", command, program, *options],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self.writer, self.reader = ours_to, ours_from
        os.set_blocking(self.reader, False)
        self.rest, self.number, self.session, self.events, self.method = b"", 0, None, [], "start"
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Inspector"):
            self.call(f"{domain}.enable")
        # The content security policy of the page would block the injected axe-core.
        self.call("Page.setBypassCSP", enabled=True)

    def message(self, deadline):
        while b"\0" not in self.rest:
            if self.process.poll() is not None:
                self.lost(f"it ended with status {self.process.returncode}")
            if time.monotonic() > deadline:
                self.lost(f"no answer in {PATIENCE:.0f} s")
            try:
                self.rest += os.read(self.reader, 1 << 20)
            except BlockingIOError:
                time.sleep(0.005)
        message, self.rest = self.rest.split(b"\0", 1)
        message = json.loads(message)
        if message.get("method") == "Inspector.targetCrashed":
            self.lost("the process of the page crashed")
        return message

    def lost(self, reason):
        """Ends the check, because the browser can no longer be used."""
        print(f"the browser was lost at {self.method}: {reason}", file=sys.stderr)
        self.process.kill()
        sys.exit(BROWSER_LOST)

    def call(self, method, **parameters):
        self.number += 1
        self.method = method
        request = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            request["sessionId"] = self.session
        data = json.dumps(request).encode() + b"\0"
        while data:
            data = data[os.write(self.writer, data):]
        deadline = time.monotonic() + PATIENCE
        while True:
            message = self.message(deadline)
            if message.get("id") == self.number:
                if "error" in message:
                    raise SystemExit(f"{method}: {message['error']}")
                return message["result"]
            self.events.append(message)

    def wait_for(self, event):
        self.method = event
        deadline = time.monotonic() + PATIENCE
        while not any(message.get("method") == event for message in self.events):
            self.events.append(self.message(deadline))

    def value(self, script):
        result = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            raise SystemExit(f"a check failed: {result['exceptionDetails']}")
        return result["result"].get("value")

    def size(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def scheme(self, name):
        self.call("Emulation.setEmulatedMedia", media="", features=[{"name": "prefers-color-scheme", "value": name}])

    def close(self):
        self.call("Browser.close")
        self.process.wait(PATIENCE)

    def console(self):
        kinds = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")
        found = [json.dumps(message["params"])[:400] for message in self.events if message.get("method") in kinds]
        # These checks read the pixels of the pictures, which the page itself does not.
        return [message for message in found if "GPU stall due to ReadPixels" not in message]


def compared(browser, form, first, second, block):
    """Compares two pictures (bytes) of a form such as `png`; see COMPARE."""
    sources = [f"data:image/{form};base64,{base64.b64encode(picture).decode()}" for picture in (first, second)]
    return browser.value(f"{COMPARE}({json.dumps([*sources, block])})")


def checked(browser, page, axe, reader):
    """Returns the errors of a page, and its number of plots and printed sheets."""
    wrong = []
    browser.events.clear()
    browser.size(1200, 900)
    browser.scheme("light")
    browser.call("Page.navigate", url=page.resolve().as_uri())
    browser.wait_for("Page.loadEventFired")
    plots = browser.value('document.querySelectorAll("section.plot, section.picture").length')
    wrong += [f"not visible before scrolling: {title}" for title in browser.value(UNSEEN)]
    wrong += [f"not reachable by keyboard: {name}" for name in browser.value(WITHOUT_KEYS)]
    browser.value(axe + ";0")
    for width, scheme, scrolled in [(400, "light", False), (1200, "light", False), (1200, "light", True), (1200, "dark", True), (400, "light", True)]:
        browser.size(width, 900)
        browser.scheme(scheme)
        if scrolled:
            left = browser.value(SCROLL)
            wrong += [f"{left} plots were not drawn after scrolling"] if left else []
            wrong += [f"not visible after scrolling: {title}" for title in browser.value(UNSEEN)]
        wrong += [f"axe-core, {width} px, {scheme}: {finding}" for finding in browser.value(AXE)]
    browser.size(1200, 900)
    marks = browser.value(MARK)
    pdf = base64.b64decode(browser.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"])
    sheets = [sheet.extract_text() for sheet in reader(io.BytesIO(pdf)).pages]
    where = lambda mark: [number for number, text in enumerate(sheets, 1) if mark in text]
    for title, head, ends in marks:
        headed = where(head)
        for end in ends:
            if not headed or where(end)[:1] != headed[:1]:
                wrong.append(f"in print: headline `{title}` is on sheet {headed}, its content on {where(end)}")
    wrong += [f"console: {message}" for message in browser.console()]
    return wrong, plots, len(sheets)


def main():
    program, libraries, *pages = sys.argv[1:]
    sys.path.insert(0, libraries)
    from pypdf import PdfReader

    axe = (pathlib.Path(libraries) / "axe_playwright_python" / "axe.min.js").read_text(encoding="utf-8")
    failed = False
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(program, folder)
        for page in map(pathlib.Path, pages):
            wrong, plots, sheets = checked(browser, page, axe, PdfReader)
            print(f"{page}: {plots} plots, {sheets} sheets of paper, {len(wrong)} findings")
            for finding in wrong:
                print(f"    {finding}")
            failed |= bool(wrong)
        browser.close()
    sys.exit(failed)


if __name__ == "__main__":
    main()
