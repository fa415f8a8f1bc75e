"""Local axes of supports and results: Cartesian ones that are turned, cylindrical, spherical."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import InputError, ModelError
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import finite

BESIDE = 1e-9
"""Way off the axis, of the size of the places, at which results on the axis take their directions."""


class LocalAxes(ABC):
    """Three orthogonal directions at each place, each with a letter.

    On the axis or at the center, where r has none, supports and loads are refused; components of results are
    those beside it, along the coordinate axis that is farthest from it.
    """

    letters: ClassVar[str]

    @abstractmethod
    def directions(self, points: ArrayLike) -> Array:
        """Return unit vectors along the axes at places.

        Parameters
        ----------
        points : (..., 3) m.

        Returns
        -------
        (..., 3, 3), a row for each axis.

        Raises
        ------
        InputError
            An axis has no direction there, as on the axis of a cylinder.
        """

    def vectors(self, values: ArrayLike, points: ArrayLike) -> Array:
        """Return the components of vectors along the axes.

        Parameters
        ----------
        values : (..., 3), such as the displacements of a result.
        points : (..., 3) m, where they are.

        Returns
        -------
        (..., 3)
        """
        values, R = self._both(values, 3, self._beside(points))
        return (R @ values[..., None])[..., 0]

    def globally(self, values: ArrayLike, points: ArrayLike) -> Array:
        """Return along x y z vectors that are given by their components along the axes.

        Parameters
        ----------
        values : (..., 3) along the axes, such as a traction.
        points : (..., 3) m, where they are.

        Returns
        -------
        (..., 3)
        """
        values, R = self._both(values, 3, points)
        return np.asarray((values[..., None, :] @ R)[..., 0, :])

    def stresses(self, values: ArrayLike, points: ArrayLike) -> Array:
        """Return the components of stresses along the axes 1, 2, 3: 11, 22, 33, 12, 23, 31.

        Parameters
        ----------
        values : (..., 6) in Voigt order, such as ``result.stress("node")``.
        points : (..., 3) m, where they are.

        Returns
        -------
        (..., 6)
        """
        values, R = self._both(values, 6, self._beside(points))
        return voigt.vector(R @ voigt.tensor(values) @ np.swapaxes(R, -1, -2))

    def _beside(self, points: ArrayLike) -> Array:
        """Return places (..., 3), those without directions moved to where there are some."""
        return _places(points)

    def _both(self, values: ArrayLike, size: int, points: ArrayLike) -> tuple[Array, Array]:
        """Return values (..., size) and the axes (..., 3, 3) there; InputError if they do not fit."""
        values, R = finite(values, "values in local axes", ("...", size)), self.directions(points)
        try:
            np.broadcast_shapes(values.shape[:-1], R.shape[:-2])
        except ValueError:
            there = f"values {values.shape} and places {(*R.shape[:-2], 3)}"
            raise InputError(f"{there} must have the same leading axes") from None
        return values, R

    def __repr__(self) -> str:
        values = (f"{name}=({', '.join(f'{x:g}' for x in value)})" for name, value in vars(self).items())
        return f"{type(self).__name__}({', '.join(values)})"


class Cartesian(LocalAxes):
    """The same axes everywhere, x' along a vector.

    Parameters
    ----------
    x : (3,) along x'.
    y : (3,), y' is its part across x'; some direction across if not given.

    Raises
    ------
    InputError
        A vector has no length, or y lies along x.

    Examples
    --------
    >>> Cartesian((0, 0, 2.0)).directions((1.0, 1.0, 1.0))[0]
    array([0., 0., 1.])
    """

    letters = "xyz"

    def __init__(self, x: ArrayLike, y: ArrayLike | None = None) -> None:
        self.x = finite(x, "the axis x", (3,))
        across = np.eye(3)[int(np.abs(self.x).argmin())] if y is None else finite(y, "the axis y", (3,))
        self.y = across - (across @ _unit(self.x)) * _unit(self.x)
        self.directions(np.zeros(3))

    def directions(self, points: ArrayLike) -> Array:
        """Return x', y', z' (..., 3, 3) at places (..., 3)."""
        x, y = _unit(self.x), _unit(self.y)
        return np.broadcast_to(np.stack([x, y, np.cross(x, y)]), (*_places(points).shape[:-1], 3, 3))


class AroundAxis(LocalAxes):
    """Axes around a line through a center (3,) in m, along an axis (3,)."""

    def __init__(self, center: ArrayLike = (0, 0, 0), axis: ArrayLike = (0, 0, 1)) -> None:
        self.center, self.axis = finite(center, "the center", (3,)), finite(axis, "the axis", (3,))
        _unit(self.axis)

    def _beside(self, points: ArrayLike) -> Array:
        """Return places (..., 3), those on the axis moved along the coordinate axis farthest from it."""
        places, z = _places(points), _unit(self.axis)
        out, across = places - self.center, np.eye(3)[int(np.abs(z).argmin())]
        size = float(np.abs(out).max(initial=0.0)) or 1.0
        there = np.linalg.norm(np.cross(z, out), axis=-1, keepdims=True) <= 1e-3 * BESIDE * size
        return np.where(there, places + BESIDE * size * across, places)


class Cylindrical(AroundAxis):
    """Axes r, t (around the axis) and z.

    Parameters
    ----------
    center : (3,) m, on the axis.
    axis : (3,) along z.

    Raises
    ------
    InputError
        The axis has no length.

    Examples
    --------
    A sector of a tube, cut through its axis at 0° and 30°:

    >>> import numpy as np, kratos_lite as kl
    >>> box = kl.box((1.0, 1.0, 0.1), (4, 4, 1), "KinematicLinear3D20N")
    >>> r, t = 1 + box.points[:, 0], np.pi / 6 * box.points[:, 1]
    >>> mesh = box.replace(points=np.stack([r * np.cos(t), r * np.sin(t), box.points[:, 2]], axis=1))
    >>> model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3))
    >>> around = kl.Cylindrical()
    >>> model.fix(np.flatnonzero((box.points[:, 1] == 0) | (box.points[:, 1] == 1)), "t", local=around)
    >>> model.fix(np.arange(mesh.n_nodes), "z")
    >>> model.add(kl.Pressure(np.flatnonzero(box.points[:, 0] == 0), 3e6))
    >>> stress = around.stresses(model.solve().stress("node"), mesh.points)
    >>> print(f"hoop stress inside {stress[r == 1, 1].mean() / 1e6:.2f} MPa")  # 3 (b² + a²)/(b² - a²) = 5
    hoop stress inside 5.01 MPa
    """

    letters = "rtz"

    def directions(self, points: ArrayLike) -> Array:
        """Return r, t, z (..., 3, 3) at places (..., 3)."""
        z, out = _unit(self.axis), _places(points) - self.center
        r = _unit(out - (out @ z)[..., None] * z)
        return np.stack([r, np.cross(z, r), np.broadcast_to(z, r.shape)], axis=-2)


class Spherical(AroundAxis):
    """Axes r, t (away from the axis) and p (around it).

    Parameters
    ----------
    center : (3,) m.
    axis : (3,) through the center, from which t leads away.

    Raises
    ------
    InputError
        The axis has no length.
    """

    letters = "rtp"

    def directions(self, points: ArrayLike) -> Array:
        """Return r, t, p (..., 3, 3) at places (..., 3)."""
        r = _unit(_places(points) - self.center)
        p = _unit(np.cross(self.axis, r))
        return np.stack([r, np.cross(p, r), p], axis=-2)


def _places(points: ArrayLike) -> Array:
    """Return places (..., 3) in m."""
    return finite(points, "places of local axes", ("...", 3))


def _unit(v: Array) -> Array:
    """Return vectors (..., 3) brought to length 1; InputError for those without a direction."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    if not (length > 1e-12 * max(float(length.max(initial=0.0)), 1e-300)).all():
        raise InputError("local axes need directions: a vector is 0, or a place lies on the axis or center")
    return np.asarray(v / length)


def normal_of_plane(points: Array, what: str) -> Array:
    """Return the normal (3,) of the plane through points, its largest component > 0; ModelError for none."""
    if len(points) > 2:
        _, sizes, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        if sizes[1] > 1e-9 * sizes[0] and sizes[2] <= 1e-9 * sizes[0]:
            normal = np.where(np.abs(axes[2]) < 1e-12, 0.0, axes[2])
            return np.asarray(normal * np.sign(normal[np.abs(normal).argmax()]) + 0.0)
    text = "a plane of symmetry needs three or more nodes that lie in one plane, and on no line"
    raise ModelError(f"{what}: {text}")
