"""What laws share that begin as Isotropic3D."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

from kratos_lite.errors import MaterialError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.materials.material import Material

ELASTIC = Isotropic3D.variables
"""Variables of the constants of Isotropic3D, which other laws have, too."""


def check_friction(law: Any) -> None:
    """Check the angle of friction of a law."""
    if not 0 < law.friction < 90:
        raise MaterialError(f"{law._name('friction')} {law.friction:g} must lie in 0° … 90°")


def check_angles(law: Any) -> None:
    """Check the angles of friction and dilatancy of a law."""
    check_friction(law)
    if not 0 <= law.dilatancy <= law.friction:
        text = f"must lie in 0° … {law.friction:g}°, the friction"
        raise MaterialError(f"{law._name('dilatancy')} {law.dilatancy:g} {text}")


class IsotropicLaw(Material, family=True):
    """A law that is Isotropic3D for small steps from rest."""

    E: float
    nu: float

    isotropic: ClassVar[bool] = True

    @cached_property
    def elastic(self) -> Isotropic3D:
        """The law of small steps from rest."""
        return Isotropic3D(self.E, self.nu)

    def check(self) -> None:
        """Check E and nu."""
        self.elastic.check()
