"""User-defined functions in a study: callables in place of names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

DIFFERENTIATOR_KEYS = ("context_samples", "minimum_samples", "smooth")
"""Keys of ``motion.differentiator`` that are passed with the function and not written into the study."""


class FunctionWarning(UserWarning):
    """A part of the study is a Python function: slow, and not included in files.

    >>> import dynident, warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", dynident.FunctionWarning)  # in an experiment
    """


class Functions:
    """The functions of a study, by their names in its sections."""

    def __init__(self) -> None:
        self.named: dict[str, dict[str, Any]] = {}

    def _name(self, function: Callable[..., object], further: Mapping[str, Any]) -> str:
        own = {"function": function, **{key: value for key, value in further.items() if value is not None}}
        first = str(getattr(function, "__qualname__", type(function).__qualname__))
        name, count = first, 1
        while name in self.named and self.named[name] != own:
            count += 1
            name = f"{first} #{count}"
        self.named[name] = own
        return name

    def _section(self, section: Mapping[str, Any], defaults: Mapping[str, Any], keys: tuple[str, ...] = ()) -> dict[str, Any]:
        """Replaces the function of a section with its name."""
        further = {key: section[key] for key in keys if key in section}
        rest = {key: value for key, value in section.items() if key not in keys}
        return {**defaults, **rest, "function": self._name(section["function"], further)}

    def taken_from(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Sections of a study with names in place of functions."""
        found = dict(content)
        torques = found.get("torque")
        if isinstance(torques, (list, tuple)):
            found["torque"] = [self._section(own, {}) if _is_own(own) else own for own in torques]
        motion = found.get("motion")
        if isinstance(motion, Mapping) and "differentiator" in motion:
            own = _mapping(motion["differentiator"])
            if _is_own(own):
                own = self._section(own, {"method": "function"}, DIFFERENTIATOR_KEYS)
                found["motion"] = {**motion, "differentiator": own}
        own = _mapping(found.get("estimator"))
        if _is_own(own):
            found["estimator"] = self._section(own, {"method": "function"})
        design = found.get("design")
        if isinstance(design, Mapping) and "family" in design:
            found["design"] = {**design, "family": self._family(design["family"])}
        return found

    def _family(self, family: Any) -> Any:
        if not isinstance(family, Mapping):
            return family
        if _is_own(family):
            return self._section(family, {"kind": "function"})
        if "parts" in family:
            return {**family, "parts": [self._family(part) for part in family["parts"]]}
        return family


def _mapping(value: Any) -> Any:
    """Treats a callable as a section that contains only this function."""
    return {"function": value} if callable(value) else value


def _is_own(section: Any) -> bool:
    return isinstance(section, Mapping) and callable(section.get("function"))
