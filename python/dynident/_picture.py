"""Figures in the style of ``dynident plot``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike, fspath


@dataclass(frozen=True)
class Picture:
    """A figure, which notebooks show."""

    svg: str = field(repr=False)
    """The figure as SVG."""

    def _repr_svg_(self) -> str:
        return self.svg


def files(out: str | PathLike[str] | Sequence[str | PathLike[str]] | None) -> list[str]:
    """Lists the files that ``out`` names: none, one or several."""
    if out is None:
        return []
    return [fspath(out)] if isinstance(out, (str, PathLike)) else [fspath(one) for one in out]
