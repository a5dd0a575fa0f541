"""Code of one's own in a study: callables in the place of names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

DIFFERENTIATOR_KEYS = ("context_samples", "minimum_samples", "smooth")
"""Keys of ``motion.differentiator`` that go with its function, and not into the study."""


class FunctionWarning(UserWarning):
    """A part of a study is a function of Python: called again and again, slow, and in no file."""


class Functions:
    """The functions of a study, by the names that its sections give them."""

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
        """A section with the name of its function in place of the function."""
        further = {key: section[key] for key in keys if key in section}
        rest = {key: value for key, value in section.items() if key not in keys}
        return {**defaults, **rest, "function": self._name(section["function"], further)}

    def taken_from(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Sections of a study in which names stand in place of functions."""
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
    """A function alone is a section of nothing but the function."""
    return {"function": value} if callable(value) else value


def _is_own(section: Any) -> bool:
    return isinstance(section, Mapping) and callable(section.get("function"))
