"""MassProperties: mass, volume, mass center and second moments of bodies.

Source: Solfec-1.0 theory, shape mass_properties; Goldstein, Classical Mechanics, ch. 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, by_mass_rule
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.typing import Array, ArrayLike, Csr, Mask
from kratos_lite.validation import finite, instance, reals

SYMMETRIC = 1e-10
"""How far, relative to its largest entry, a tensor may be from symmetric, or two values from each other."""
SINGULAR = 1e-15
"""Ratio of the smallest to the largest eigenvalue down to which a tensor counts as positive definite."""


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass properties of one body, or of many through leading axes (...) that broadcast.

    Attributes
    ----------
    mass : (...) float, kg, > 0.
    inertia : (..., 3, 3) float, kg m²; J = tr(E0) 1 - E0, symmetric positive definite.
    volume : (...) float, m³, > 0; nan where it was not given.
    center : (..., 3) float, m; the mass center, at the origin if not given.
    euler : (..., 3, 3) float, kg m²; E0 = ∫ ρ (X - X̄)(X - X̄)^T dV about the mass center.

    Raises
    ------
    InputError
        A value is not finite or has the wrong shape; neither or only contradicting tensors are given.
    ModelError
        A mass or volume is not positive, or an inertia not symmetric positive definite.

    Notes
    -----
    One of `inertia` and `euler` gives the other, E0 = tr(J)/2 1 - J.  An inertia that violates
    the triangle inequality (J_xx > J_yy + J_zz) belongs to no distribution of mass, but a rigid body may
    have it; `check_deformable` refuses it.

    Examples
    --------
    >>> top = MassProperties(mass=1.0, inertia=np.diag([5.0, 10.0, 1.0]))
    >>> top.euler.diagonal().tolist(), top.center.tolist()
    ([3.0, -2.0, 7.0], [0.0, 0.0, 0.0])
    """

    mass: Array
    inertia: Array
    volume: Array
    center: Array
    euler: Array

    def __init__(
        self,
        mass: ArrayLike,
        inertia: ArrayLike | None = None,
        volume: ArrayLike = np.nan,
        center: ArrayLike = (0.0, 0.0, 0.0),
        euler: ArrayLike | None = None,
    ) -> None:
        J, E = _tensors(inertia, euler)
        values = {
            "mass": (_positive(mass, "mass", "kg"), 0),
            "inertia": (J, 2),
            "volume": (_volume(volume), 0),
            "center": (finite(center, "the center of a body", ("...", 3)), 1),
            "euler": (E, 2),
        }
        try:
            many = np.broadcast_shapes(*(v.shape[: v.ndim - tail] for v, tail in values.values()))
        except ValueError:
            shapes = ", ".join(f"{name} {value.shape}" for name, (value, _) in values.items())
            raise InputError(f"the leading axes of a body's values must agree; got {shapes}") from None
        for name, (value, tail) in values.items():
            full = np.broadcast_to(value, (*many, *(3,) * tail)).copy()
            full.setflags(write=False)
            object.__setattr__(self, name, full[()])

    def with_(self, **changes: ArrayLike) -> MassProperties:
        """Return the body with single values replaced; all others stay as they are.

        A new mass alone leaves the inertia as it is; a new `inertia` brings its own `euler`, and the
        other way round.

        Parameters
        ----------
        changes : values by their names.

        Returns
        -------
        A new body.

        Raises
        ------
        InputError
            A body has no value of such a name.

        Examples
        --------
        >>> body = MassProperties.box((1.0, 1.0, 1.0), density=6.0).with_(mass=2.0)
        >>> float(body.mass), body.inertia.diagonal().tolist()
        (2.0, [1.0, 1.0, 1.0])
        """
        values: dict[str, Any] = dict(vars(self))
        if unknown := changes.keys() - values.keys():
            raise InputError(f"a body has no {sorted(unknown)[0]!r}; its values are {', '.join(values)}")
        if "inertia" in changes or "euler" in changes:
            values["inertia"] = values["euler"] = None
        return MassProperties(**{**values, **changes})

    def check_deformable(self) -> None:
        """Show that the body can deform: the volume is known and E0 positive definite.

        Raises
        ------
        ModelError
            It cannot.
        """
        if np.isnan(self.volume).any():
            raise ModelError("a body that deforms needs its volume in m³; give volume=…")
        smallest, bad = _smallest(self.euler)
        if bad.any():
            raise ModelError(
                f"a body that deforms needs a positive definite Euler tensor; its smallest eigenvalue is "
                f"{smallest[bad][0]:.3g} kg m²: the body is flat, or its inertia violates the triangle "
                "inequality, as that of no distribution of mass does"
            )

    # ---- where they come from ------------------------------------------------------------------

    @classmethod
    def stack(cls, bodies: Sequence[MassProperties]) -> MassProperties:
        """Return many bodies as one, along a new first axis.

        Parameters
        ----------
        bodies : one or more with the same leading axes.

        Returns
        -------
        All of them.

        Raises
        ------
        InputError
            There are none, or their leading axes differ.
        """
        if not bodies or len({body.mass.shape for body in bodies}) > 1:
            shapes = [body.mass.shape for body in bodies]
            raise InputError(f"bodies to stack must have the same leading axes; got {shapes or 'none'}")
        return cls(**{name: np.stack([getattr(b, name) for b in bodies]) for name in vars(bodies[0])})

    @classmethod
    def box(cls, sides: ArrayLike, density: ArrayLike) -> MassProperties:
        """Return boxes centered at the origin.

        Parameters
        ----------
        sides : (..., 3) in m.
        density : (...) in kg/m³.

        Returns
        -------
        The mass properties (...).

        Examples
        --------
        >>> MassProperties.box((0.4, 0.6, 1.0), 1000.0).inertia.diagonal().round(9).tolist()
        [27.2, 23.2, 10.4]
        """
        lengths = _positive(sides, "side", "m", ("...", 3))
        volume = lengths.prod(axis=-1)
        mass = np.asarray(_positive(density, "density", "kg/m³") * volume)
        return cls(mass, volume=volume, euler=(mass[..., None] * lengths**2 / 12)[..., None] * np.eye(3))

    @classmethod
    def ball(cls, radius: ArrayLike, density: ArrayLike) -> MassProperties:
        """Return balls centered at the origin.

        Parameters
        ----------
        radius : (...) in m.
        density : (...) in kg/m³.

        Returns
        -------
        The mass properties (...).
        """
        r = _positive(radius, "radius", "m")
        volume = 4 * np.pi / 3 * r**3
        mass = np.asarray(_positive(density, "density", "kg/m³") * volume)
        return cls(mass, volume=volume, euler=(mass * r**2 / 5)[..., None, None] * np.eye(3))

    @classmethod
    def of(
        cls, points: Any, groups: Sequence[ElementGroup] | None = None, added: Csr | None = None
    ) -> MassProperties:
        """Return the mass properties of a model with its added masses, or of a mesh.

        They are exact for every shape, also for warped faces and curved quadratic cells, and lose no
        digits far from the origin beyond those that the coordinates have lost.

        Parameters
        ----------
        points : a model, alone; or (n, 3) nodes in m.
        groups : the elements with their materials.
        added : (3n, 3n) kg, of added masses: ``model.attached.M``.

        Returns
        -------
        Those of one body.

        Raises
        ------
        MeshError
            There are no elements, or one has no positive volume.
        ModelError
            A material has no density.

        Examples
        --------
        >>> from kratos_lite import Isotropic3D, Model, box
        >>> model = Model(box((0.4, 0.6, 1.0)), Isotropic3D(E=1e6, nu=0.3, density=1000.0))
        >>> body = MassProperties.of(model)
        >>> round(float(body.mass), 9), body.center.round(9).tolist()
        (240.0, [0.2, 0.3, 0.5])
        """
        if groups is None:
            model = instance(points, "what has mass", Structure, "kl.Model(mesh, material)")
            points, groups = model.mesh.points, model.element_groups()
            added = model.attached.M if model.attached else None
        X = finite(points, "the points of a mesh", ("...", 3))
        groups = [group for group in groups if len(group)]
        if not groups:
            raise MeshError("the mesh has no elements, so no volume; a body needs at least one")
        for group in groups:
            if not group.material.density > 0:
                raise ModelError(
                    f"{type(group.material).__name__} has density {group.material.density:g}, but what "
                    "moves needs mass; give each material a density > 0"
                )
        center, mass, volume = X[groups[0].nodes[0, 0]], 0.0, 0.0
        second = np.zeros((3, 3))
        for _ in range(2):  # about a node, then about the center
            mass, volume, first, second = _moments(X - center, groups)
            if added is not None:  # of its rigid modes: m 1, m [c]×ᵀ and J
                R = rigid_modes(X - center, np.zeros(3))
                G = R.T @ (added @ R)
                mass, first = mass + G[0, 0], first + np.array([G[1, 5], G[2, 3], G[0, 4]])
                second = second + np.trace(G[3:, 3:]) / 2 * np.eye(3) - G[3:, 3:]
            center = center + first / mass
        return cls(mass, volume=volume, center=center, euler=(second + second.T) / 2)


# ---- integrals over a mesh -------------------------------------------------------------------------


def _moments(X: Array, groups: Sequence[ElementGroup]) -> tuple[float, float, Array, Array]:
    """Return ∫ρ, ∫1, ∫ρX (3,) and ∫ρXX^T (3, 3) over the elements."""
    mass, volume = 0.0, 0.0
    first, second = np.zeros(3), np.zeros((3, 3))
    for group in (part for whole in groups for part in by_mass_rule(X, whole, 2)):
        rho = group.material.density
        for chunk in group.chunks():
            element = group.at(X, chunk)
            dV = element._volumes(group.rule)
            volumes = dV.sum(axis=1)
            for bad in np.flatnonzero(~(volumes > 0))[:1]:
                raise MeshError(
                    f"the element of index {group.rows[chunk][bad]} ({group.element.__name__}) has volume "
                    f"{volumes[bad]:.3g} m³; it must be > 0; mesh.reoriented() fixes inverted elements"
                )
            x, w = element.gauss_points().reshape(-1, 3), dV.ravel()
            wx = w[:, None] * x
            mass, volume = mass + rho * float(w.sum()), volume + float(w.sum())
            first += rho * wx.sum(axis=0)
            second += rho * (wx.T @ x)
    return mass, volume, first, second


# ---- values from the caller ------------------------------------------------------------------------


def _positive(value: ArrayLike, what: str, unit: str, shape: tuple[int | str, ...] | None = None) -> Array:
    array = finite(value, f"the {what} of a body", shape)
    if (array <= 0).any():
        raise ModelError(f"the {what} of a body must be > 0 {unit}; got {array.min():g}")
    return array


def _volume(value: ArrayLike) -> Array:
    """Return volumes; nan stands for one that is not known."""
    volumes = reals(value, "the volume of a body")
    known = _positive(np.where(np.isnan(volumes), 1.0, volumes), "volume", "m³")
    return np.where(np.isnan(volumes), np.nan, known)


def _tensors(inertia: ArrayLike | None, euler: ArrayLike | None) -> tuple[Array, Array]:
    """Return inertia and Euler tensor, one from the other where only one is given, both checked."""
    E = None if euler is None else _symmetric(euler, "Euler tensor")
    J = None if inertia is None else _symmetric(inertia, "inertia")
    if J is None:
        if E is None:
            raise InputError("a body needs its inertia=… or its Euler tensor euler=…, (3, 3) in kg m²")
        J = _from_euler(E)
    elif E is None:
        E = np.trace(J, axis1=-2, axis2=-1)[..., None, None] / 2 * np.eye(3) - J
    elif J.shape != E.shape or _differ(J, _from_euler(E)):
        raise InputError(
            "the inertia and the Euler tensor contradict each other: J must be tr(E0) 1 - E0; "
            "give one of them, or replace one by with_(inertia=…) or with_(euler=…)"
        )
    smallest, bad = _smallest(J)
    if bad.any():
        raise ModelError(
            f"the inertia of a body must be positive definite; its smallest eigenvalue is "
            f"{smallest[bad][0]:.3g} kg m²; a body that is not a straight line has three positive ones"
        )
    return J, E


def _from_euler(E: Array) -> Array:
    """Return tr(E) 1 - E with each diagonal entry as a sum of two, so that none cancels."""
    x, y, z = np.moveaxis(np.diagonal(E, axis1=-2, axis2=-1), -1, 0)
    J = -E
    for i, entry in enumerate((y + z, z + x, x + y)):
        J[..., i, i] = entry
    return J


def _differ(A: Array, B: Array) -> bool:
    """Return whether two tensors (..., 3, 3) differ by more than rounding of given figures."""
    size = np.abs(A).max(axis=(-2, -1), keepdims=True)
    return bool((np.abs(A - B) > SYMMETRIC * size).any())


def _symmetric(value: ArrayLike, what: str) -> Array:
    A = finite(value, f"the {what} of a body", ("...", 3, 3))
    T = np.swapaxes(A, -1, -2)
    if _differ(A, T):
        error = np.abs(A - T).max()
        raise ModelError(f"the {what} of a body must be symmetric; entries differ by {error:.3g} kg m²")
    return (A + T) / 2


def _smallest(A: Array) -> tuple[Array, Mask]:
    """Return the smallest eigenvalues (...) and a mask of those that are not positive."""
    values = np.linalg.eigvalsh(A)
    smallest = np.asarray(values[..., 0])
    return smallest, np.asarray(~(smallest > SINGULAR * np.abs(values).max(axis=-1)))
