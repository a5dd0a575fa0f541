#!/usr/bin/env python3
"""book.py CHROMIUM BOOK: checks the built book (`mdbook build docs`, folder BOOK).

Every link must lead to a file and heading of the book. In the browser no page may scroll sideways at 1400 px and at 390 px, lack an image, write to the console or
request anything outside of the folder, and the search must find a page.
"""

import html.parser
import json
import pathlib
import sys
import tempfile
import urllib.parse

from pages import Browser

# Width and height of the window, and whether it is a phone.
SCREENS = [(1400, 900, False), (390, 844, True)]

BROKEN_IMAGES = "[...document.images].filter((image) => !image.complete || !image.naturalWidth).map((image) => image.src)"

# Wide tables and code scroll inside of their own box; the page and its content must not scroll sideways.
WIDER = """(() => {
  const limit = document.documentElement.clientWidth + 1;
  const scrolls = [document.documentElement, ...document.querySelectorAll(".content, main")].some((one) => one.scrollWidth > one.clientWidth + 1);
  const boxed = (element) => {
    for (let above = element.parentElement; above && above.tagName !== "MAIN"; above = above.parentElement)
      if (getComputedStyle(above).overflowX !== "visible") return true;
    return false;
  };
  const wide = [...document.querySelectorAll("main *")].filter((one) => one.getBoundingClientRect().right > limit && !boxed(one));
  const named = wide.slice(0, 3).map((one) => `<${one.tagName.toLowerCase()}> ${one.textContent.trim().slice(0, 60)}`);
  return scrolls || wide.length ? [named.join("; ") || "the page scrolls"] : [];
})()"""

# Types a word into the search field and returns the number of results.
SEARCH = """(async () => {
  const find = (name) => document.getElementById("mdbook-" + name) ?? document.getElementById(name);
  find("search-toggle").click();
  for (let attempt = 0; attempt < 100; attempt++) {
    const bar = find("searchbar");
    if (bar) {
      bar.value = "Coulomb friction";
      for (const kind of ["input", "keyup"]) bar.dispatchEvent(new Event(kind, { bubbles: true }));
    }
    await new Promise((done) => setTimeout(done, 100));
    const results = find("searchresults");
    if (results?.children.length) return results.children.length;
  }
  return 0;
})()"""


class Links(html.parser.HTMLParser):
    """Targets of the links and images of a page, and the identifiers in it."""

    def __init__(self):
        super().__init__()
        self.targets, self.names = [], set()

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.names |= {values[name] for name in ("id", "name") if values.get(name)}
        self.targets += [values[name] for name in ("href", "src") if values.get(name)]


def read(page):
    links = Links()
    links.feed(page.read_text(encoding="utf-8"))
    return links


def broken_links(pages):
    """Links that lead to no file or heading, with their page."""
    known = {page.resolve(): read(page) for page in pages}
    wrong = []
    for page, links in known.items():
        for target in links.targets:
            parts = urllib.parse.urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            file = (page.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else page
            heading = urllib.parse.unquote(parts.fragment)
            if not file.is_file():
                wrong.append(f"{page.name}: no file for the link {target}")
            elif heading and file in known and heading not in known[file].names:
                wrong.append(f"{page.name}: no heading for the link {target}")
    return wrong


def loaded(browser, page):
    browser.events.clear()
    browser.call("Page.navigate", url=page.resolve().as_uri())
    browser.wait_for("Page.loadEventFired")


def outside(browser):
    """Addresses that the page requested outside of its folder."""
    requests = [message["params"]["request"]["url"] for message in browser.events if message.get("method") == "Network.requestWillBeSent"]
    return [address for address in requests if not address.startswith(("file:", "data:", "blob:"))]


def checked(browser, page):
    wrong = []
    for width, height, phone in SCREENS:
        browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        loaded(browser, page)
        wrong += [f"{width} px: wider than the window: {found}" for found in browser.value(WIDER)]
        wrong += [f"{width} px: broken image {address}" for address in browser.value(BROKEN_IMAGES)]
        wrong += [f"{width} px: request {address}" for address in outside(browser)]
        wrong += [f"{width} px: console: {message}" for message in browser.console()]
    return [f"{page.name}: {finding}" for finding in wrong]


def main():
    program, book = sys.argv[1], pathlib.Path(sys.argv[2])
    pages = sorted(page for page in book.glob("*.html") if page.name != "toc.html")
    if len(pages) < 10:
        raise SystemExit(f"{book} has {len(pages)} pages: build the book with `mdbook build docs`")
    wrong = broken_links([page for page in pages if page.name != "404.html"])
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(program, folder)
        browser.call("Network.enable")
        # 404.html has addresses of a server; print.html is all pages together, with the same content.
        for page in pages:
            if page.name not in ("404.html", "print.html"):
                wrong += checked(browser, page)
        browser.call("Emulation.setDeviceMetricsOverride", width=1400, height=900, deviceScaleFactor=1, mobile=False)
        loaded(browser, book / "index.html")
        results = browser.value(SEARCH)
        wrong += [] if results else ["the search finds nothing"]
        wrong += [f"search: {json.dumps(message)[:300]}" for message in browser.console()]
        browser.close()
    print(f"{book}: {len(pages)} pages, {results} results of the search, {len(wrong)} findings")
    for finding in wrong:
        print(f"    {finding}")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
