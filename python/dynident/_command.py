"""The command `dynident`."""

from __future__ import annotations

import signal
import sys

from ._native import _command


def main() -> int:
    """Runs the command line of this process."""
    # The command listens for Ctrl-C itself, or is ended by it as any program.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _command(["dynident", *sys.argv[1:]])
