"""Material: what every constitutive law is, linear or not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from functools import cached_property
from sys import float_info
from typing import Any, ClassVar, TypeAlias

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError, SolveError, nearest
from kratos_lite.registry import Registry
from kratos_lite.tabular import names_of
from kratos_lite.typing import Array
from kratos_lite.validation import Axes, finite

MAX_FLOAT = float_info.max

MATERIALS: Registry[type[Material]] = Registry("material")
"""Every material by its class name and by the names of Kratos."""

GaussState: TypeAlias = "dict[str, Array]"
"""Internal variables (..., size) at Gauss points by name."""
Response: TypeAlias = "tuple[Array, Array | None, GaussState]"
"""Stress (..., 6) in Pa, its tangent (..., 6, 6) in Pa or None, and the internal variables after the step."""

SHORT = 1e-9
"""Step in s over which a law is elastic."""
STRAIN_STEP = 1e-3
"""Strain from which on steps of differences grow with it: that of metals at their yield stress."""


class Material:
    """A constitutive law: from strain and internal variables to stress, tangent and new internal variables.

    A subclass is a frozen dataclass of its constants that defines `response`; it registers itself under its
    class name and its `aliases`.

    Attributes
    ----------
    density : kg/m³, ≥ 0.
    aliases : further names, such as those of Kratos' constitutive laws.
    variables : field name → name of the variable in `.mdpa` and JSON files.
    strain_measure : ``"small"``; or ``"finite"``: the strain is Green's, the stress the second of Piola and
        Kirchhoff, and elements are total Lagrangian.
    positive, not_negative : constants that must be > 0 or ≥ 0 → their units.
    tables : constants that are arrays, kept as tuples → their shapes, a word for any length.
    words : constants that are words → those that they may be.
    internal_variables : name → numbers at each Gauss point, 0 at the beginning; ``element_length``
        and ``element_radius`` are cube root of the volume and farthest node from the center, in m.
    symmetric_tangent : whether the tangent is symmetric.
    keeps_volume : whether the stress is bounded but for its mean, as in plastic flow of metals.
    rate_dependent : whether the stress depends on the length of a step.

    Raises
    ------
    MaterialError
        If a constant is not finite or no number (or table), or the density is negative.

    Notes
    -----
    Voigt order xx yy zz xy yz zx, engineering shear.  Contract: Simo & Hughes, Computational Inelasticity
    (1998), ch. 3: a law is driven by the strain at the end of a step.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import kratos_lite as kl
    >>> @dataclass(frozen=True)
    ... class Cubic(kl.Material):  # stiffens with the strain; its tangent is found by differences
    ...     E: float
    ...     density: float = 0.0
    ...
    ...     def response(self, strain, state, dt):
    ...         return self.E * (strain + 100 * strain**3), None, {}
    >>> stress, tangent, _ = Cubic(E=2e9).evaluate(np.full(6, 0.1), {}, 1.0)
    >>> float(stress[0]), f"{tangent[0, 0]:.4g}"
    (400000000.0, '8e+09')
    """

    density: float
    aliases: ClassVar[tuple[str, ...]] = ()
    variables: ClassVar[dict[str, str]] = {"density": "DENSITY"}
    strain_measure: ClassVar[str] = "small"
    positive: ClassVar[Mapping[str, str]] = {}
    not_negative: ClassVar[Mapping[str, str]] = {}
    tables: ClassVar[Mapping[str, Axes]] = {}
    words: ClassVar[Mapping[str, Sequence[str]]] = {}
    internal_variables: ClassVar[Mapping[str, int]] = {}
    symmetric_tangent: ClassVar[bool] = True
    keeps_volume: ClassVar[bool] = False
    rate_dependent: ClassVar[bool] = False
    is_linear: ClassVar[bool] = False

    def __init_subclass__(cls, family: bool = False, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if family:
            return
        if cls.is_linear and not any("elasticity" in vars(base) for base in cls.__mro__):
            raise MaterialError(
                f"{cls.__name__}.is_linear is for a LinearMaterial; derive from that, or leave it out"
            )
        if cls.strain_measure not in ("small", "finite"):
            raise MaterialError(
                f"{cls.__name__}.strain_measure is 'small' or 'finite'; got {cls.strain_measure!r}"
            )
        sizes = cls.internal_variables
        if not isinstance(sizes, Mapping) or not all(isinstance(size, int) for size in sizes.values()):
            raise MaterialError(
                f"{cls.__name__}.internal_variables is name → numbers at each Gauss point, such as "
                f"{{'plastic_strain': 6}}; got {sizes!r}"
            )
        MATERIALS.add(cls.__name__, cls, cls.__dict__.get("aliases", ()))

    def __new__(cls, *constants: Any, **named: Any) -> Any:
        """Refuse constants that the law does not have."""
        known = names_of(cls)
        if known and (unknown := sorted(named.keys() - set(known))):
            hint = nearest(unknown[0], known)
            raise MaterialError(f"{cls.__name__} has no {unknown[0]!r}.{hint} It has {', '.join(known)}")
        if (constants or named) and cls.__init__ is object.__init__:
            if cls.__name__ not in MATERIALS:
                raise MaterialError(f"{cls.__name__} is a base of laws; derive one with the constants it has")
            raise TypeError(f"{cls.__name__}() takes no arguments")  # as Python says it
        return super().__new__(cls)

    def __post_init__(self) -> None:
        for name in names_of(type(self)):
            value = getattr(self, name)
            if name in self.tables:
                array = finite(value, self._name(name), error=MaterialError)
                if array.size:
                    finite(array, self._name(name), self.tables[name], error=MaterialError)
                vars(self)[name] = _tuples(array.tolist())
                continue
            if name in self.words:
                if value not in self.words[name]:
                    words = ", ".join(filter(None, self.words[name]))
                    raise MaterialError(f"{self._name(name)} must be one of {words}; got {value!r}")
                continue
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
                raise MaterialError(f"{self._name(name)} must be a number; got {value!r}")
            size: Any = abs(value)
            if not size <= MAX_FLOAT:
                raise MaterialError(f"{self._name(name)} must be finite; got {value}")
        if not hasattr(self, "density"):
            raise MaterialError(
                f"{type(self).__name__} has no density: add density: float = 0.0 to its constants"
            )
        if self.density < 0:
            raise MaterialError(
                f"{self._name('density')} {self.density:g} must be ≥ 0 kg/m³; reverse gravity instead"
            )
        for bound, units in ((">", self.positive), ("≥", self.not_negative)):
            for name, unit in units.items():
                value = getattr(self, name)
                if not (value > 0 or (value == 0 and bound == "≥")):
                    raise MaterialError(f"{self._name(name)} {value:g} must be {bound} 0 {unit}")
        self.check()

    @classmethod
    def _name(cls, field: str) -> str:
        variable = cls.variables.get(field)
        return f"{field} ({variable})" if variable else field

    def check(self) -> None:
        """Check the constants; subclasses check their own bounds here.

        Raises
        ------
        MaterialError
            If one is beyond its bounds.
        """

    @property
    def expansion(self) -> Array:
        """Thermal strain (6,) in 1/K: the constant `alpha` in all directions, if the law has it."""
        return getattr(self, "alpha", 0.0) * voigt.UNIT

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress, tangent and internal variables at the end of a step; subclasses define it.

        Parameters
        ----------
        strain : (..., 6), at the end of the step.
        state : internal variables (..., size) by name, at its start; not to be changed.
        dt : s, its length.

        Returns
        -------
        stress : (..., 6) Pa.
        tangent : (..., 6, 6) Pa, its derivative by the strain; None to have it found by differences.
        state : internal variables at the end of the step, new arrays.

        Raises
        ------
        TypeError
            The subclass does not define it.
        """
        raise TypeError(f"{type(self).__name__} must define response(strain, state, dt)")

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return the stored energy, unless a law defines another.

        Without internal variables it is ∫ σ:dε from rest, else ½ σ:C⁻¹:σ, the energy of the elastic strain.

        Parameters
        ----------
        strain, stress, state : (..., 6), (..., 6) and internal variables at the end of a step.

        Returns
        -------
        (...) J/m³
        """
        if self.internal_variables or self.is_linear:
            return np.asarray((stress @ np.linalg.inv(self.C) * stress).sum(axis=-1) / 2)
        places, weights = np.polynomial.legendre.leggauss(8)
        parts = [self.evaluate((1 + x) / 2 * strain, {}, SHORT, tangent=False)[0] for x in places]
        return np.asarray(sum(w / 2 * (s * strain).sum(axis=-1) for w, s in zip(weights, parts, strict=True)))

    def initial_state(self, *shape: int) -> GaussState:
        """Return the internal variables at the beginning, 0.

        Parameters
        ----------
        shape : leading axes, such as elements and Gauss points.

        Returns
        -------
        dict of arrays (shape, size)
        """
        return {name: np.zeros((*shape, size)) for name, size in self.internal_variables.items()}

    def evaluate(
        self, strain: Array, state: GaussState, dt: float, *, tangent: bool = True
    ) -> tuple[Array, Array, GaussState]:
        """Return the response, checked, with a tangent by differences where the law gives none.

        Parameters
        ----------
        strain, state, dt : as for `response`.
        tangent : False where it is not needed; it is empty then.

        Returns
        -------
        stress, tangent, state : as by `response`.

        Raises
        ------
        MaterialError
            The law returns something else than its contract says.
        SolveError
            It returns numbers that are not finite: a step is cut then.
        """
        strain = np.array(strain, dtype=float)  # a copy, which a law cannot spoil
        if strain.shape[-1:] != (6,) or not dt >= 0:
            raise MaterialError(
                f"a strain has six components xx yy zz xy yz zx, and a step dt ≥ 0 s; got shape "
                f"{strain.shape} and dt = {dt}"
            )
        answer = self._response(strain, state, dt)
        if not isinstance(answer, tuple) or len(answer) != 3:
            found = f"{len(answer)} values" if isinstance(answer, tuple) else type(answer).__name__
            raise MaterialError(
                f"{type(self).__name__}.response must return stress, tangent (or None) and state; got {found}"
            )
        stress, D, new = answer
        self._check_shape("stress", stress, strain.shape)
        self._check_state(new, strain.shape[:-1])
        if not tangent:
            return stress, np.zeros(0), new
        if D is None:
            D = self._tangent(strain, state, dt, stress)
        D = np.broadcast_to(D, (*strain.shape, 6)) if np.shape(D) == (6, 6) else D
        self._check_shape("tangent", D, (*strain.shape, 6))
        return stress, D, new

    def _response(self, strain: Array, state: GaussState, dt: float) -> Any:
        """Return what the law returns; its arguments cannot be written, as a step may be taken again."""
        arrays = strain, *state.values()
        views = [array.view() for array in arrays]
        for view in views:
            view.flags.writeable = False
        try:
            return self.response(views[0], dict(zip(state, views[1:], strict=True)), dt)
        except KeyError as error:
            name, law = str(error.args[0]), type(self).__name__
            have = ", ".join(self.internal_variables) or "none"
            cure = "start with its initial_state()"
            if name not in self.internal_variables:
                cure = f"add it to internal_variables of the class.{nearest(name, self.internal_variables)}"
            elif name in state:
                raise
            raise MaterialError(
                f"{law}.response takes the internal variable {name!r}, which its state does not have; "
                f"declared are {have}; {cure}"
            ) from error
        except ValueError as error:
            if "read-only" not in str(error):
                raise
            raise MaterialError(
                f"{type(self).__name__}.response changes its strain or state in place; work on copies and "
                "return new arrays, as a step that fails is taken again"
            ) from None

    def _tangent(self, strain: Array, state: GaussState, dt: float, stress: Array) -> Array:
        """Return ∂σ/∂ε (..., 6, 6) from one-sided differences, six more evaluations."""
        size = np.maximum(np.abs(strain).max(axis=-1), STRAIN_STEP)
        # Rounding is that of the strain, or at large strains that of 1 + 2 E.
        h = np.sqrt(np.finfo(float).eps * size * (size if self.strain_measure == "small" else 1.0))
        D = np.empty((*strain.shape, 6))
        for column in range(6):
            moved = strain.copy()
            moved[..., column] += h
            exact = moved[..., column] - strain[..., column]  # what rounding has made of h
            D[..., column] = (self._response(moved, state, dt)[0] - stress) / exact[..., None]
        return D

    def _check_shape(self, what: str, values: Any, shape: tuple[int, ...]) -> None:
        if np.shape(values) != shape:
            raise MaterialError(
                f"{type(self).__name__}.response: the {what} must have shape {shape} here; "
                f"got {np.shape(values)}"
            )
        if not np.isfinite(values).all():
            at = np.argwhere(~np.isfinite(values))[0].tolist()
            raise SolveError(f"{type(self).__name__}.response: the {what} is not finite at {at}")

    def _check_state(self, state: Any, lead: tuple[int, ...]) -> None:
        names = dict(self.internal_variables)
        if not isinstance(state, dict) or state.keys() != names.keys():
            found = ", ".join(state) if isinstance(state, dict) else type(state).__name__
            raise MaterialError(
                f"{type(self).__name__}.response must return the internal variables "
                f"{', '.join(names) or 'as an empty dict'}; got {found or 'none'}"
            )
        for name, size in names.items():
            self._check_shape(f"internal variable {name}", state[name], (*lead, size))

    @cached_property
    def C(self) -> Array:
        """Elasticity matrix (6, 6) in Pa: the symmetric part of the tangent at rest, over a short step.

        Raises
        ------
        MaterialError
            The response needs it itself, or breaks its contract.
        """
        if "_making_C" in vars(self):
            raise MaterialError(
                f"{type(self).__name__}.response uses self.C, which is its own tangent at rest; make the "
                "elasticity of the constants, such as kl.Isotropic3D(self.E, self.nu).C"
            )
        vars(self)["_making_C"] = True
        try:
            C = np.array(self.evaluate(np.zeros(6), self.initial_state(), SHORT)[1])
        finally:
            del vars(self)["_making_C"]
        C = (C + C.T) / 2
        C.setflags(write=False)
        return C

    @classmethod
    def from_variables(cls, values: dict[str, Any]) -> Material:
        """Make the material from the variables of a file, such as YOUNG_MODULUS.

        Parameters
        ----------
        values : variables by name; those of constants that have a default may be missing.

        Returns
        -------
        Material

        Raises
        ------
        MaterialError
            If a variable is missing or outside its bounds.
        """
        file_names = {f.name: cls.variables.get(f.name, f.name) for f in fields(cls)}  # type: ignore[arg-type]
        constants = {field: values[name] for field, name in file_names.items() if name in values}
        needed = {f.name for f in fields(cls) if f.default is MISSING} - {"density"}  # type: ignore[arg-type]
        missing = [f"{field} ({file_names[field]})" for field in sorted(needed - constants.keys())]
        if missing:
            raise MaterialError(f"{cls.__name__} needs {', '.join(missing)}")
        return cls(**constants)


def _tuples(value: Any) -> Any:
    """Return lists in lists as tuples, which can be hashed."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
