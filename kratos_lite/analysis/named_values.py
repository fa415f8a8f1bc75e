"""Named values: what a result holds, by the short names with which pictures are asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import InputError, nearest
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array
from kratos_lite.view.scene import Values

SIZES = ("largest", "middle", "smallest")
NAMES = {
    "displacement": "displacement",
    **{f"u{axis}": f"displacement along {axis}" for axis in "xyz"},
    "reaction": "reaction",
    "von_mises": "von Mises stress",
    "tresca": "Tresca stress",
    **{f"s{i}": f"{size} principal stress" for i, size in enumerate(SIZES, 1)},
    **{f"s{name.lower()}": f"stress {name.lower()}" for name in voigt.NAMES},
    **{f"e{i}": f"{size} principal strain" for i, size in enumerate(SIZES, 1)},
    **{
        f"e{name.lower()}": f"{'shear ' if name[0] != name[1] else ''}strain {name.lower()}"
        for name in voigt.NAMES
    },
    "error": "estimated error of each element in the energy norm",
}
"""What each name means."""
MOTIONS = ("displacement", "ux", "uy", "uz")
"""Those that need nothing but displacements."""


@runtime_checkable
class Fields(Protocol):
    """What a result offers."""

    mesh: Mesh
    u: Array
    reactions: Array

    def stress(self, at: str) -> Any:
        """Return stresses (n, 6) in Pa."""

    def strain(self, at: str) -> Any:
        """Return strains (n, 6)."""

    def error(self) -> Any:
        """Return the estimate of the error."""


def named_values(result: Fields, name: str) -> Values:
    """Return the values of a result by a name of `NAMES`; InputError for another."""
    if name not in NAMES:
        known = ", ".join(NAMES)
        raise InputError(f"there are no values {name!r}; there are {known}.{nearest(name, list(NAMES), 1)}")
    if name == "error":
        return Values(result.error().per_element, NAMES[name], "√J", log=True)
    if name == "reaction":
        return Values(np.linalg.norm(result.reactions, axis=1), NAMES[name], "N")
    return local_values(name, result.u, lambda: result.strain("node"), lambda: result.stress("node"))


def local_values(name: str, u: Array, strain: Callable[[], Array], stress: Callable[[], Array]) -> Values:
    """Return the values of displacements (n, 3), or of strains or stresses (n, 6), made if needed."""
    if name in MOTIONS:
        return motion_values(u, name)
    if name[0] == "e":
        halves = np.array([1, 1, 1, 0.5, 0.5, 0.5]) if name[1].isdigit() else 1.0  # of engineering shear
        return Values(_component(strain() * halves, name[1:]), NAMES[name])
    return Values(_component(stress(), name if len(name) > 3 else name[1:]), NAMES[name], "Pa")


def motion_values(u: Array, name: str) -> Values:
    """Return the values of displacements (n, 3) by a name of `MOTIONS`."""
    numbers = np.linalg.norm(u, axis=1) if name == "displacement" else u[:, "xyz".index(name[1])]
    return Values(numbers, NAMES[name], "m")


def _component(tensor: Array, name: str) -> Array:
    """Return a component, principal value or equivalent of (n, 6)."""
    if name == "von_mises":
        return voigt.von_mises(tensor)
    if name == "tresca":
        return voigt.tresca(tensor)
    if name.isdigit():
        return voigt.principal_values(tensor)[:, int(name) - 1]
    return tensor[:, voigt.NAMES.index(name.upper())]
