"""LinearMaterial: what every linear elastic law shares."""

from __future__ import annotations

from functools import cached_property
from sys import float_info
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.errors import InputError, MaterialError
from kratos_lite.registry import Registry
from kratos_lite.tabular import names_of
from kratos_lite.typing import Array
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MAX_FLOAT = float_info.max

MATERIALS: Registry[type[LinearMaterial]] = Registry("material")
"""Every material by its class name and by the names of Kratos."""


class LinearMaterial:
    """A linear elastic material: stress = C strain in Voigt order xx yy zz xy yz zx.

    A subclass is a frozen dataclass of its constants that defines `compliance` (or overrides
    `elasticity`); it registers itself under its class name and its `aliases`.

    Attributes
    ----------
    density : kg/m³, ≥ 0.
    aliases : further names, such as those of Kratos' constitutive laws.
    variables : field name → name of the variable in `.mdpa` and JSON files.

    Raises
    ------
    MaterialError
        If a constant is not a finite number, the density is negative, or C is not (6, 6), symmetric and
        positive definite.
    """

    density: float
    aliases: ClassVar[tuple[str, ...]] = ()
    variables: ClassVar[dict[str, str]] = {"density": "DENSITY"}

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.stress is not LinearMaterial.stress:
            raise MaterialError(
                f"{cls.__name__} overrides stress, which is C strain, as materials are linear; override "
                "compliance() or elasticity(), which gives C"
            )
        MATERIALS.add(cls.__name__, cls, cls.__dict__.get("aliases", ()))

    def __post_init__(self) -> None:
        for name in names_of(type(self)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
                raise MaterialError(f"{self._name(name)} must be a number; got {value!r}")
            size: Any = abs(value)
            if not size <= MAX_FLOAT:
                raise MaterialError(f"{self._name(name)} must be finite; got {value}")
        if self.density < 0:
            raise MaterialError(
                f"{self._name('density')} {self.density:g} must be ≥ 0 kg/m³; reverse gravity instead"
            )
        self.check()

    @classmethod
    def _name(cls, field: str) -> str:
        variable = cls.variables.get(field)
        return f"{field} ({variable})" if variable else field

    def check(self) -> None:
        """Check that C is symmetric and positive definite; subclasses check their own bounds here.

        Raises
        ------
        MaterialError
            If it is not, or not (6, 6) and finite.
        """
        if self.C.shape != (6, 6) or not np.isfinite(self.C).all():
            found = f"got shape {self.C.shape}" if self.C.shape != (6, 6) else "it holds nan or inf"
            raise MaterialError(f"{type(self).__name__}: C must be (6, 6), finite; {found}")
        scale = np.sqrt(np.abs(np.diag(self.C)))
        scales = np.outer(scale, scale)  # a C that was turned has round-off in place of zeros
        if not (np.abs(self.C - self.C.T) <= 1e-10 * scales).all():
            raise MaterialError(f"{type(self).__name__}: C is not symmetric; check the Poisson ratios")
        if not (scale > 0).all() or not np.linalg.eigvalsh(self.C / scales)[0] > 0:
            raise MaterialError(f"{type(self).__name__}: C must be positive definite; {self.why_unstable()}")

    def why_unstable(self) -> str:
        """Return which bound the constants violate."""
        return "the strain energy of some strain is not positive"

    def compliance(self) -> Array:
        """Return the compliance S (6, 6) in 1/Pa, strain = S stress; subclasses define it.

        Raises
        ------
        TypeError
            If the subclass defines neither this nor `elasticity`.
        """
        raise TypeError(f"{type(self).__name__} must define compliance() or elasticity()")

    def elasticity(self) -> Array:
        """Return the elasticity matrix C (6, 6) in Pa, by default the inverse of the compliance.

        Raises
        ------
        MaterialError
            If the compliance is singular, or not (6, 6).
        """
        S = np.asarray(self.compliance(), dtype=float)
        if S.shape != (6, 6):
            raise MaterialError(f"{type(self).__name__}: the compliance must be (6, 6); got shape {S.shape}")
        try:
            return np.linalg.inv(S)
        except np.linalg.LinAlgError:
            raise MaterialError(f"{type(self).__name__}: the compliance is singular") from None

    @cached_property
    def C(self) -> Array:
        """Elasticity matrix (6, 6) in Pa, read-only."""
        C = np.asarray(self.elasticity(), dtype=float)
        C.setflags(write=False)
        return C

    def stress(self, strain: ArrayLike) -> Array:
        """Return the stress C strain; a class that overrides this is refused.

        Parameters
        ----------
        strain : (..., 6) float.

        Returns
        -------
        (..., 6) float, Pa

        Raises
        ------
        InputError
            The strain has another shape, or is not finite.
        """
        e = finite(strain, "a strain")
        if e.shape[-1:] != (6,):
            raise InputError(f"a strain has six components xx yy zz xy yz zx; got shape {e.shape}")
        return e @ self.C.T

    @classmethod
    def from_variables(cls, values: dict[str, Any]) -> LinearMaterial:
        """Make the material from the variables of a file, such as YOUNG_MODULUS.

        Parameters
        ----------
        values : variables by name; the density may be missing and is 0 then.

        Returns
        -------
        LinearMaterial

        Raises
        ------
        MaterialError
            If a variable is missing or outside its bounds.
        """
        constants = {field: values[name] for field, name in cls.variables.items() if name in values}
        needed = {name for name in names_of(cls) if name != "density"}
        absent = sorted(needed - constants.keys())
        missing = [f"{field} ({cls.variables.get(field, field)})" for field in absent]
        if missing:
            raise MaterialError(f"{cls.__name__} needs {', '.join(missing)}")
        return cls(**constants)
