"""Pages and values that fit on a screen."""

from __future__ import annotations

import html
from collections.abc import Iterable


class Page(str):
    """An HTML page: a text that a notebook shows as the page.

    >>> from dynident._page import Page
    >>> Page("<html><body>report</body></html>")
    Page(32 characters; write it to a file, or show it in a notebook)
    """

    HEIGHT_PX = 600

    def _repr_html_(self) -> str:
        page = html.escape(self, quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: {self.HEIGHT_PX}px; border: 1px solid #ccc"></iframe>'

    def __repr__(self) -> str:
        return f"Page({len(self)} characters; write it to a file, or show it in a notebook)"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """An HTML table of escaped cells."""

    def row(cells: Iterable[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return "<table>" + row(head, "th") + "".join(row(cells, "td") for cells in rows) + "</table>"


def problem(text: str) -> str:
    """A line of HTML that names a problem."""
    return f"<div style='color:#b00'>PROBLEM: {html.escape(text)}</div>"
