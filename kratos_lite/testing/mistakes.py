"""Mistakes in one's own classes that Python lets pass: a base or a decorator left out, a name taken."""

from __future__ import annotations

import sys
from dataclasses import is_dataclass
from inspect import get_annotations
from math import inf
from pathlib import Path
from typing import Any

from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.shapes import SHAPES, Shape
from kratos_lite.testing.report import Finding

BASES = {
    LinearMaterial: (("compliance",), ("elasticity",)),
    Shape: (("N", "dN"),),
    KinematicLinear: (("shape", "rule"),),
}
"""What a class defines that is meant to be a subclass of each of these."""

FROZEN = "@dataclass(frozen=True)"


def names() -> dict[tuple[str, str], Any]:
    """Return what stands in the registries: (kind, name or alias) to class."""
    return {
        (registry.kind, name): registry[name]
        for registry in (ELEMENTS, SHAPES, MATERIALS)
        for own in registry
        for name in (own, *registry.aliases(own))
    }


def replaced(kind: type, before: dict[tuple[str, str], Any], path: Path) -> list[Finding]:
    """Return a finding if a class took names of the library; its own file may define it."""
    now = names()
    lost = {key: old for key, old in before.items() if now[key] is kind and old is not kind}
    homes = {Path(sys.modules[old.__module__].__file__ or "").resolve() for old in lost.values()}
    if not lost or homes == {path.resolve()}:
        return []
    taken = ", ".join(name for _, name in lost)
    text = f"the library has {taken} already; importing this file would replace it: choose another name"
    return [Finding("name", False, inf, 0, text)]


def mistakes(kind: type) -> list[Finding]:
    """Return findings for a class that lacks its base class or its decorator."""
    if not issubclass(kind, tuple(BASES)):
        for base, signs in BASES.items():
            if any(all(name in vars(kind) for name in sign) for sign in signs):
                what = " and ".join(next(sign for sign in signs if sign[0] in vars(kind)))
                text = f"{kind.__name__} has {what} but is no {base.__name__}, so nothing uses it: "
                text += f"write class {kind.__name__}({base.__name__})"
                return [Finding("base class", False, inf, 0, text)]
    if lacks_decorator(kind):
        return [
            Finding("dataclass", False, inf, 0, f"{kind.__name__} lists constants: add {FROZEN} above it")
        ]
    return []


def lacks_decorator(kind: type) -> bool:
    """Return whether a material lists constants of its own but is not made a dataclass of them."""
    own = [a for a in get_annotations(kind).values() if "ClassVar" not in str(a)]
    return issubclass(kind, LinearMaterial) and bool(own) and not _is_own_dataclass(kind)


def _is_own_dataclass(kind: type) -> bool:
    return is_dataclass(kind) and "__dataclass_fields__" in vars(kind)


def cure(error: BaseException, defined: dict[str, Any]) -> str:
    """Return what to do about an error that a decorator left out has led to, or an empty text."""
    if not isinstance(error, TypeError):
        return ""
    if "non-frozen dataclass" in str(error):
        return f"; write {FROZEN}"
    kinds = [v for v in defined.values() if isinstance(v, type) and lacks_decorator(v)]
    named = [kind.__name__ for kind in kinds if kind.__name__ in str(error)]
    return f"; add {FROZEN} above class {named[0]}" if named else ""
