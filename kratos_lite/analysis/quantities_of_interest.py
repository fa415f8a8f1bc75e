"""Quantities of interest: one number of a result, linear in its displacements, whose error is estimated."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from kratos_lite.analysis.fields import COMPONENTS, Fields
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.assembly.gauss_point_fields import volumes
from kratos_lite.assembly.nodal_extrapolation import at_located, strain_of
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Where, mask_of
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.model.loads.surface import Traction
from kratos_lite.model.loads.temperature import heated
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

    def derivative(self, result: Fields) -> Array:
        """Return ∂Q/∂u itself; `load` if the class has nothing else.

        Parameters
        ----------
        result : of any analysis.

        Returns
        -------
        (n, 3) in the unit of the value per m.
        """
        return self.load(result)

    def explicit(self, result: Any, wrt: str, of_loads: Callable[[Array], Array]) -> Array | float:
        """Return the derivative of Q where the displacements stay; 0 if the class has none.

        Parameters
        ----------
        result : of a static analysis.
        wrt : as of `Result.gradient`.
        of_loads : takes v (n, 3) in m, and returns that of the work v·f of the loads.

        Returns
        -------
        As `Result.gradient` does.
        """
        return 0.0

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
    if isinstance(value, np.ndarray):
        return str(value.tolist())
    return repr(value) if isinstance(value, str) else "…"


class DisplacementAt(Quantity):
    """The displacement of a point along an axis, as ``result.at(point).displacement``.

    In derivatives by coordinates the point moves with its element.

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
        u = result.mesh.locate(self.point, required=True).interpolate(result.u)
        return float(u[AXES.index(self.axis)])

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
        """Return ∫ N dA / A (n, 3) along the axis, or ∫ N dV / V."""
        load = self._over_part(result).forces(result.mesh, result.groups)
        return load / load.sum()

    def explicit(self, result: Any, wrt: str, of_loads: Callable[[Array], Array]) -> Array | float:
        """Return ∂(∫ u dA / A), of coordinates alone."""
        if wrt != "coordinates":
            return 0.0
        over, known = self._over_part(result), (result.mesh, result.groups)
        return over.by_coordinates(*known, result.u - self.value(result)) / over.forces(*known).sum()

    def _over_part(self, result: Fields) -> Load:
        """Return the load of 1 along the axis over the faces of the part, or the volume of its elements."""
        mesh, direction = result.mesh, np.eye(3)[AXES.index(self.axis)]
        if mesh.faces(self.part):
            return Traction(self.part, direction)
        inside = mask_of(mesh.nodes(self.part), mesh.n_nodes)
        rows = [group.rows[inside[group.nodes].all(axis=1)] for group in result.groups]
        if not any(map(len, rows)):
            raise ModelError(
                f"{self}: the part has neither a face on the boundary nor an element; a mean needs one, "
                "DisplacementAt takes a point"
            )
        return BodyForce(direction, where=np.concatenate(rows))


class Compliance(Quantity):
    """The work f·u of the loads on the displacements: twice the strain energy where loads alone act.

    Where the supports are at rest and nothing is stressed without loads, u itself is its adjoint.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
    >>> result = bar.solve()
    >>> print(f"{kl.Compliance().value(result):.3e} J, {2 * result.energy():.3e} J")
    2.500e-05 J, 2.500e-05 J
    """

    unit = "J"

    def value(self, result: Fields) -> float:
        """Return f·u in J."""
        return float((result.loads * result.u).sum())

    def load(self, result: Fields) -> Array:
        """Return the loads f (n, 3) in N."""
        return result.loads

    def explicit(self, result: Any, wrt: str, of_loads: Callable[[Array], Array]) -> Array | float:
        """Return u·∂f, the derivative of the loads where the displacements stay."""
        return of_loads(result.u)


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
    the estimate of the error goes by them.  In derivatives by coordinates the point moves with its element.

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
        stress = group.scaled(np.broadcast_to(C[component] / placed.dV.sum(), (*placed.dV.shape, 6)))
        add_nodal(load, group.nodes, placed.internal_force(stress, C))
        return load

    def derivative(self, result: Fields) -> Array:
        """Return the row of C B (n, 3) in Pa/m at the point."""
        group, X, xi = self._holder(result)
        k = group.nodes.shape[1]
        unit = np.eye(3 * k).reshape(3 * k, k, 3)
        stress = self._stress(group, np.repeat(X, 3 * k, axis=0), xi, unit)
        load = np.zeros_like(result.u)
        load[group.nodes[0]] = stress.reshape(k, 3)
        return load

    def explicit(self, result: Any, wrt: str, of_loads: Callable[[Array], Array]) -> Array | float:
        """Return ∂(C ε) of the element around the point: of its stiffness, its nodes, or temperatures."""
        located, c = result.mesh.locate(self.point, required=True), COMPONENTS.index(self.component)
        group, X, xi = self._holder(result)
        if wrt == "stiffness":
            out, elastic = np.zeros(result.mesh.n_elements), replace(group, prestress=None)
            out[group.rows] = at_located([replace(elastic, factors=None)], located, result._strained)[c]
            return out
        if wrt == "coordinates":
            X, u = X - X.mean(axis=1), result._strained[group.nodes]
            step = 1e-5 * np.ptp(X, axis=1).min()
            moves = step * np.eye(X.size).reshape(-1, *X.shape[1:])
            there, back = (self._stress(group, X + s * moves, xi, u) for s in (1, -1))
            out = np.zeros_like(result.u)
            out[group.nodes[0]] = ((there - back) / (2 * step)).reshape(-1, 3)
            return out
        if wrt == "loads":
            cold, rest = [group.without_initial], np.zeros_like(result.u)
            warm = [heated(result.mesh, cold, load.acting(0.0)) for load in result._acting]
            return np.array([at_located(groups, located, rest)[c] for groups in warm])
        return 0.0

    def _holder(self, result: Fields) -> tuple[ElementGroup, Array, Array]:
        """Return the element that holds the point, its nodes X (1, k, 3) and ξ (3,)."""
        located = result.mesh.locate(self.point, required=True)
        group = next(g for g in result.groups if (g.rows == located.rows).any())
        group = group.take(np.asarray(group.rows == located.rows))
        return group, result.mesh.points[group.nodes], located.xi

    def _stress(self, group: ElementGroup, X: Array, xi: Array, u: Array) -> Array:
        """Return the component (p,) of C B u at ξ of elements X (p, k, 3) under u (p, k, 3)."""
        strain = strain_of(group, X, np.broadcast_to(xi, (len(X), 3)), np.broadcast_to(u, X.shape))
        return np.asarray(group.elastic(strain, [0] * len(X))[:, COMPONENTS.index(self.component)])

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
        """Return the root mean square of recovered less own stresses at Gauss points around the point."""
        # A component that happens to be recovered without a difference has half of the largest one's.
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
