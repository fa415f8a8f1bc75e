"""Shape: the geometry of one reference cell and its shape functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.registry import Registry
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SHAPES: Registry[type[Shape]] = Registry("shape")
"""Every shape by its class name."""
LINEAR: Registry[type[Shape]] = Registry("cell")
"""The shape of the corners alone, by family of cells."""


class Shape:
    """A reference cell: node coordinates, shape functions N and their derivatives dN.

    A subclass states the data below and writes two functions; it registers itself.
    Nodes stand in Kratos order: corners, then mid-edge nodes in the order of `edges`,
    then face nodes, then the center.

    Attributes
    ----------
    cell : family of the cell: ``point line triangle quadrilateral tetrahedron hexahedron wedge pyramid``.
    nodes : (n, d) float, reference coordinates of the nodes.
    corners : number of corner nodes (they come first).
    degree : highest degree of the complete polynomials that the functions span on an affine cell.
    edges : corner pairs; the mid-edge node of edge e, if there is one, is node ``corners + e``.
    faces : node tuples of the faces, corners first, counter-clockwise from outside.
    vtk : VTK cell type number.
    to_vtk, to_gmsh : ``target[i] = kratos[perm[i]]``.
    gmsh : Gmsh element type number.
    """

    cell: ClassVar[str]
    nodes: ClassVar[Array]
    corners: ClassVar[int]
    degree: ClassVar[int]
    edges: ClassVar[tuple[tuple[int, int], ...]] = ()
    faces: ClassVar[tuple[tuple[int, ...], ...]] = ()
    vtk: ClassVar[int] = 0
    gmsh: ClassVar[int] = 0
    to_vtk: ClassVar[tuple[int, ...]] = ()
    to_gmsh: ClassVar[tuple[int, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "nodes" not in cls.__dict__:
            return
        cls.nodes = np.array(cls.nodes, dtype=float)
        cls.nodes.setflags(write=False)
        same = tuple(range(len(cls.nodes)))
        cls.to_vtk = cls.to_vtk or same
        cls.to_gmsh = cls.to_gmsh or same
        SHAPES.add(cls.__name__, cls)

    @classmethod
    def linear(cls) -> type[Shape] | None:
        """Return the shape of the corners alone; None for a cell that kratos_lite does not know."""
        return LINEAR[cls.cell] if cls.cell in LINEAR else None

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the shape functions at points.

        Parameters
        ----------
        xi : (..., d) float, reference coordinates.

        Returns
        -------
        (..., n) float

        Raises
        ------
        TypeError
            If the subclass does not define it.
        """
        raise TypeError("a shape must define N(xi); see docs/howto/own-element.md")

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return the derivatives dN_a/dxi_j at points.

        Parameters
        ----------
        xi : (..., d) float, reference coordinates.

        Returns
        -------
        (..., n, d) float

        Raises
        ------
        TypeError
            If the subclass does not define it.
        """
        raise TypeError("a shape must define dN(xi); see docs/howto/own-element.md")


def at_points(function: Callable[[ArrayLike], Array], points: Array) -> Array:
    """Return N or dN of a shape at points (g, d); those of users, which may not broadcast, one by one."""
    if function.__module__.startswith("kratos_lite.shapes."):
        return function(points)
    return np.array([function(xi) for xi in points])


def mid_edges(corners: ArrayLike, edges: tuple[tuple[int, int], ...]) -> Array:
    """Return the corners (n, d) followed by the middles of `edges`."""
    X = np.asarray(corners, dtype=float)
    return np.vstack([X, X[np.array(edges)].mean(axis=1)])


def quadratic_faces(
    faces: tuple[tuple[int, ...], ...],
    edges: tuple[tuple[int, int], ...],
    corners: int,
    centers: tuple[int, ...] = (),
) -> tuple[tuple[int, ...], ...]:
    """Append to each corner face its mid-edge nodes and, where given, its center node."""
    middle = {frozenset(edge): corners + e for e, edge in enumerate(edges)}
    full = []
    for f, face in enumerate(faces):
        mids = tuple(middle[frozenset(pair)] for pair in zip(face, face[1:] + face[:1], strict=True))
        full.append(face + mids + centers[f : f + 1])
    return tuple(full)
