"""Progress display on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

Progress = Callable[[str, int, int | None], None]

PATIENCE_S = 1.0
WIDTH = 78


class Line:
    """A status line, updated in place once a job takes longer than one second."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._stage: tuple[str, float] = ("", self._begin)
        self._shown = False

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        now = time.monotonic()
        # A stage may contain the name of a log, which may contain any character.
        stage = "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in stage)
        if self._stage[0] != stage:
            self._stage = (stage, now)
        if now - self._begin < PATIENCE_S:
            return
        elapsed = now - self._stage[1]
        if total and done:
            share = min(1.0, done / total)
            left = elapsed * (1.0 - share) / share
            text = f"{stage}: {100 * share:.0f} %, {left:.0f} s left"
        else:
            text = f"{stage}: {elapsed:.0f} s"
        sys.stderr.write("\r" + text[:WIDTH].ljust(WIDTH))
        sys.stderr.flush()
        self._shown = True

    def end(self) -> None:
        if self._shown:
            sys.stderr.write("\r" + " " * WIDTH + "\r")
            sys.stderr.flush()


def is_watched() -> bool:
    """Whether the output is a terminal or a notebook."""
    try:
        if sys.stderr.isatty():
            return True
    except (AttributeError, ValueError):
        return False
    return "ipykernel" in sys.modules
