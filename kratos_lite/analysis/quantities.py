"""Quantities of interest: one number of a result, linear in its displacements, whose error is estimated."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from kratos_lite.analysis.fields import COMPONENTS, Fields
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.assembly.gauss_point_fields import body_force, volumes
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Where
from kratos_lite.model.loads.surface import Traction
from kratos_lite.model.supports import AXES
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import choice, finite


class Quantity(ABC):
    """A number Q(u) of a result, linear in u but for a constant.  One of your own needs these methods.

    Attributes
    ----------
    unit : of the value.
    """

    unit: ClassVar[str] = ""

    @abstractmethod
    def value(self, result: Fields) -> float:
        """Return the value in a result.

        Parameters
        ----------
        result : of any analysis.

        Returns
        -------
        float

        Raises
        ------
        MeshError, ModelError, InputError
            The quantity does not fit the mesh.
        """

    def load(self, result: Fields) -> Array:
        """Return the load of the adjoint solution; 0 if the class has none.

        It is ∂Q/∂u; for a stress at a point, whose adjoint is too singular, that of the mean around it.

        Parameters
        ----------
        result : of any analysis.

        Returns
        -------
        (n, 3) in the unit of the value per m.
        """
        return np.zeros_like(result.u)

    def motion(self, result: Fields) -> Array:
        """Return by how much the adjoint solution displaces supports; 0 if the class does not.

        Parameters
        ----------
        result : of any analysis.

        Returns
        -------
        (n, 3), read where a displacement is prescribed.
        """
        return np.zeros_like(result.u)

    def local(self, result: Fields) -> Array:
        """Return what the error of Q has beyond that of the mean that `load` is of; 0 if the class has none.

        Parameters
        ----------
        result : of any analysis.

        Returns
        -------
        (m,) of each element, in the unit of the value.
        """
        return np.zeros(result.mesh.n_elements)

    def spread(self, result: Fields) -> float:
        """Return how far Q may be from the mean that `load` is of; 0 if the class has none.

        Parameters
        ----------
        result : of any analysis.

        Returns
        -------
        float, in the unit of the value.
        """
        return 0.0

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(_text, vars(self).values()))})"


def _text(value: object) -> str:
    """Return a point, an axis or a part as text for messages."""
    return (
        repr(value)
        if isinstance(value, str)
        else str(value.tolist())
        if isinstance(value, np.ndarray)
        else "…"
    )


class DisplacementAt(Quantity):
    """The displacement of a point along an axis, as ``result.at(point).displacement``.

    Parameters
    ----------
    point : (3,) m, anywhere in the undeformed mesh.
    axis : ``"x"``, ``"y"`` or ``"z"``.

    Raises
    ------
    InputError
        The point is no point, or there is no such axis.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((4, 1, 1), (8, 2, 2)), kl.Isotropic3D(E=1e6, nu=0.3))
    >>> bar.fix("x-")
    >>> bar.add(kl.Traction("x+", (0, 0, 1.0)))
    >>> tip = kl.DisplacementAt((4, 0.5, 0.5), "z")
    >>> result = bar.solve()
    >>> bool(abs(tip.value(result) / result.at((4, 0.5, 0.5)).displacement[2] - 1) < 1e-12)
    True
    """

    unit = "m"

    def __init__(self, point: ArrayLike, axis: str) -> None:
        self.point = finite(point, "a point", (3,))
        self.axis = choice(axis, "axis", AXES)

    def value(self, result: Fields) -> float:
        """Return the displacement in m."""
        return float(
            result.mesh.locate(self.point, required=True).interpolate(result.u)[AXES.index(self.axis)]
        )

    def load(self, result: Fields) -> Array:
        """Return N (n, 3) of the element that contains the point, along the axis."""
        load = np.zeros_like(result.u)
        nodes, weights = result.mesh.locate(self.point, required=True).nodes_and_weights()
        load[nodes, AXES.index(self.axis)] = weights
        return load


class MeanDisplacement(Quantity):
    """The mean displacement of a part along an axis: over its faces, or over the volume of its elements.

    Parameters
    ----------
    part : nodes by part name, predicate, mask or indices.  The faces on the boundary among them count; a part
        without any counts by the elements that have all their nodes in it.
    axis : ``"x"``, ``"y"`` or ``"z"``.

    Raises
    ------
    InputError
        There is no such axis.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
    >>> print(f"{kl.MeanDisplacement('z+', 'z').value(bar.solve()):.1e} m")
    5.0e-06 m
    """

    unit = "m"

    def __init__(self, part: Where, axis: str) -> None:
        self.part, self.axis = part, choice(axis, "axis", AXES)

    def value(self, result: Fields) -> float:
        """Return the mean displacement in m."""
        return float((self.load(result) * result.u).sum())

    def load(self, result: Fields) -> Array:
        """Return ∫ N dA / A (n, 3) along the axis, or ∫ N dV / V.

        Raises
        ------
        ModelError
            The part has neither a face on the boundary nor an element.
        """
        mesh, direction = result.mesh, np.eye(3)[AXES.index(self.axis)]
        if mesh.faces(self.part):
            load = Traction(self.part, direction).forces(mesh, result.groups)
            return load / load.sum()
        inside = np.zeros(mesh.n_nodes, dtype=bool)
        inside[mesh.nodes(self.part)] = True
        load = np.zeros_like(result.u)
        for group in result.groups:
            chosen = np.asarray(inside[group.nodes].all(axis=1))
            if chosen.any():
                load += body_force(mesh.points, group.take(chosen), direction)
        if not load.any():
            raise ModelError(
                f"{self}: the part has neither a face on the boundary nor an element; a mean needs one, "
                "DisplacementAt takes a point"
            )
        return load / load.sum()


class ReactionOf(Quantity):
    """The force of the supports of a part on the body along an axis.

    It is the sum of nodal reactions, which is the virtual work for a unit displacement of the part: as
    accurate as the energy, far more than an integral of stresses over the surface.

    Parameters
    ----------
    part : nodes by part name, predicate, mask or indices.
    axis : ``"x"``, ``"y"`` or ``"z"``.

    Raises
    ------
    InputError
        There is no such axis.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
    >>> print(f"{kl.ReactionOf('z-', 'z').value(bar.solve()):.3f} N")
    -5.000 N
    """

    unit = "N"

    def __init__(self, part: Where, axis: str) -> None:
        self.part, self.axis = part, choice(axis, "axis", AXES)

    def value(self, result: Fields) -> float:
        """Return the force in N."""
        return float(result.reactions[result.mesh.nodes(self.part), AXES.index(self.axis)].sum())

    def motion(self, result: Fields) -> Array:
        """Return the displacement of the part by one, against the axis."""
        motion = np.zeros_like(result.u)
        motion[result.mesh.nodes(self.part), AXES.index(self.axis)] = -1.0
        return motion


class StressAt(Quantity):
    """A component of the stress at a point, as ``result.at(point).stress``.

    It is that of the element which holds the point.  Recovered stresses at nodes are closer, as a rule, and
    the estimate of the error goes by them.

    Parameters
    ----------
    point : (3,) m, anywhere in the undeformed mesh.
    component : one of ``xx yy zz xy yz zx``, in either order.

    Raises
    ------
    InputError
        The point is no point, or there is no such component.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
    >>> print(f"{kl.StressAt((0.2, 0.3, 0.9), 'zz').value(bar.solve()):.3f} Pa")
    5.000 Pa
    """

    unit = "Pa"

    def __init__(self, point: ArrayLike, component: str) -> None:
        self.point = finite(point, "a point", (3,))
        turned = component[::-1] if isinstance(component, str) else component
        known = isinstance(turned, str) and turned in COMPONENTS
        self.component = choice(turned if known else component, "component", COMPONENTS)

    def value(self, result: Fields) -> float:
        """Return the stress in Pa."""
        return float(result.at(self.point).stress[COMPONENTS.index(self.component)])

    def load(self, result: Fields) -> Array:
        """Return ∫ B^T C dV / V (n, 3) of the component, of the elements around the point."""
        load, component = np.zeros_like(result.u), COMPONENTS.index(self.component)
        group = self._around(result)
        placed, C = group.at(result.mesh.points), group.material.C
        stress = np.broadcast_to(C[component] / placed.dV.sum(), (*placed.dV.shape, 6))
        add_nodal(load, group.nodes, placed.internal_force(stress, C))
        return load

    def local(self, result: Fields) -> Array:
        """Return the difference of the error at the point, by recovered stresses, from its mean around."""
        c, located = COMPONENTS.index(self.component), result.mesh.locate(self.point, required=True)
        group, recovered, smooth, volume = self._recovered(result)
        at_point = float(located.interpolate(recovered)[c]) - self.value(result)
        off = smooth[..., c] - result.field("stress", "element")[group.rows, None, c]
        out = np.zeros(result.mesh.n_elements)
        out[located.rows] = at_point - (off * volume).sum() / volume.sum()
        return out

    def spread(self, result: Fields) -> float:
        """Return the root mean square of recovered less own stresses at Gauss points around the point.

        A component that happens to be recovered without a difference has half of the largest one's.
        """
        group, _, smooth, volume = self._recovered(result)
        squares = (smooth - result.stress_in(group)) ** 2 * volume[..., None]
        spread = np.sqrt(squares.sum(axis=(0, 1)) / volume.sum())
        return float(max(spread[COMPONENTS.index(self.component)], spread.max() / 2))

    def _recovered(self, result: Fields) -> tuple[ElementGroup, Array, Array, Array]:
        """Return the elements around, recovered stresses at nodes and Gauss points, and volumes of these."""
        group = self._around(result)
        nodal = result.stress_of_material(int(result.mesh.locate(self.point, required=True).rows))
        N, _ = tabulate(group.element.shape, group.rule)
        return group, nodal, N @ nodal[group.nodes], volumes(result.mesh.points, group)

    def _around(self, result: Fields) -> ElementGroup:
        """Return the elements that share a corner with that of the point, of the same group."""
        row = result.mesh.locate(self.point, required=True).rows
        group = next(group for group in result.groups if (group.rows == row).any())
        corners = group.nodes[:, : group.element.shape.corners]
        return group.take(np.asarray(np.isin(corners, corners[group.rows == row]).any(axis=1)))
