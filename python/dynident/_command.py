"""The command `dynident`."""

from __future__ import annotations

import signal
import sys

from ._native import _command


def main() -> int:
    """Runs the command with the arguments of this process."""
    # The command handles Ctrl-C; otherwise the default handler must end it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _command(["dynident", *sys.argv[1:]])
