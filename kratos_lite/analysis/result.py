"""Result: displacements, reactions, strains, stresses and the report of a solution."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.report import Report, element_counts, vector
from kratos_lite.assembly.element_groups import ElementGroup, group_of_element
from kratos_lite.assembly.gauss_point_fields import at_gauss, in_order, totals
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.typing import Array
from kratos_lite.validation import choice, instance

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike

    from kratos_lite.analysis.error_estimate import ErrorEstimate, Origin, QuantityError
    from kratos_lite.analysis.quantities import Quantity
    from kratos_lite.assembly.recovery import Recovery
    from kratos_lite.mesh.locate import Located

At: TypeAlias = "str | ArrayLike | Located"
"""Gauss points, elements or nodes by the names of `PLACES`; or points (..., 3) in m, or where they lie."""
PLACES = ("gauss", "element", "node", "averaged", "raw")
METHODS = ("recovery", "equilibrated")


class Result:
    """Displacements and all that follows from them; strains and stresses are made when asked for.

    Analyses make results.

    Parameters
    ----------
    mesh : of n nodes and m elements.
    groups : the elements with their materials.
    u : (n, 3) displacements in m.
    reactions, loads : (n, 3) nodal forces in N.
    report : what was solved, how, and how well.
    u0 : (n, 3) displacements in m without stress; none if not given.
    origin : what was solved, for bounds of the error and the errors of quantities.
    """

    def __init__(
        self,
        mesh: Mesh,
        groups: Sequence[ElementGroup],
        u: Array,
        reactions: Array,
        loads: Array,
        report: Report,
        u0: Array | None = None,
        origin: Origin | None = None,
    ) -> None:
        self.mesh = mesh
        self.groups = list(groups)
        self.u = u
        self.reactions = reactions
        self.loads = loads
        for array in (u, reactions, loads):
            array.setflags(write=False)  # strains and stresses are made of them later
        self.report = report
        self._strained = u if u0 is None else u - u0
        self._origin = origin

    # ---- nodal values --------------------------------------------------------------------------

    def displacement(self, where: Where | None = None, *, at: ArrayLike | Located | None = None) -> Array:
        """Return the displacements of nodes, or at points anywhere in the mesh.

        Parameters
        ----------
        where : nodes by part, predicate, mask or rows; all if not given.
        at : in their place, points (..., 3) in m of the undeformed mesh, or what ``mesh.locate`` has found.

        Returns
        -------
        (n, 3) in m, (k, 3) of some, or (..., 3) at points.

        Raises
        ------
        InputError
            Both nodes and points are given, or points are not finite.
        MeshError
            A point lies outside the mesh, or there is no such part or node.
        """
        if at is not None:
            if where is not None:
                raise InputError("ask for displacements of nodes (where) or at points (at), not both")
            return self._located(at).interpolate(self.u)
        return self.u if where is None else self.u[self.mesh.nodes(where)]

    def reaction(self, where: Where | None = None) -> Array:
        """Return the reactions of nodes: forces of the supports on the body, 0 where nothing is fixed.

        Parameters
        ----------
        where : nodes by part, predicate, mask or rows; all if not given.

        Returns
        -------
        (n, 3) in N, or (k, 3) of some.
        """
        return self.reactions if where is None else self.reactions[self.mesh.nodes(where)]

    # ---- element values ------------------------------------------------------------------------

    def _field(self, at: At, stress: bool) -> Any:
        if not (at is None or isinstance(at, str)):
            from kratos_lite.assembly.point_fields import at_located  # as for the recovery

            return at_located(self.groups, self._located(at), self._strained, stress=stress)
        place = choice(at, "at", PLACES)
        if place == "gauss":
            points, u = self.mesh.points, self._strained
            return in_order(self.groups, [at_gauss(points, g, u, stress=stress) for g in self.groups])
        if place == "raw":
            from kratos_lite.assembly.nodal_values import extrapolated

            points, u = self.mesh.points, self._strained
            return in_order(self.groups, [extrapolated(points, g, u, stress=stress) for g in self.groups])
        if place == "node":
            return self._recovery.nodal(self._strained, stress=stress)
        return self._averages(stress)[place == "averaged"]

    @cached_property
    def _recovery(self) -> Recovery:
        from kratos_lite.assembly.recovery import Recovery  # a quick start for results

        return Recovery(self.mesh, self.groups)

    def _located(self, at: ArrayLike | Located) -> Located:
        """Return where points lie in the mesh; raise MeshError if one lies outside."""
        from kratos_lite.mesh.locate import Located  # as for the recovery

        if not isinstance(at, Located):
            return self.mesh.locate(at, required=True)
        if at.mesh is not self.mesh:
            raise InputError(
                "these points were located in another mesh; locate them in that of the result, as in "
                "result.stress(at=result.mesh.locate(points))"
            )
        return at.require()

    def _averages(self, stress: bool) -> tuple[Array, Array]:
        """Return the mean over the volume of each element (m, 6) and averaged nodal values (n, 6)."""
        from kratos_lite.assembly.nodal_values import averages  # as for the recovery

        m = self.mesh.n_elements
        return averages(self.mesh.points, self.groups, self._strained, m, stress=stress)

    def strain(self, at: At = "gauss") -> Any:
        """Return strains in Voigt order xx yy zz xy yz zx, with engineering shear.

        Parameters
        ----------
        at : ``"gauss"`` for Gauss points; ``"element"`` for means over the volume; ``"node"`` for recovered
            values, the most accurate at nodes; ``"averaged"`` for values extrapolated to the nodes of each
            element and averaged there; ``"raw"`` for these of each element; or points (..., 3) in m anywhere
            in the undeformed mesh, or what ``mesh.locate`` has found of them.

        Returns
        -------
        (m, g, 6) at Gauss points, or a list of (g, 6) where elements have different rules; (m, 6) of
        elements; (n, 6) of nodes; raw (m, k, 6) of k nodes each, or a list of (k, 6) where these differ; or
        (..., 6) at points, B(ξ) u of the element that contains the point.  On a face between elements,
        where strains jump, that is the element in the lowest row.

        Raises
        ------
        InputError
            There is no such place, or points are not finite.
        MeshError
            A point lies outside the mesh.
        """
        return self._field(at, stress=False)

    def stress(self, at: At = "gauss") -> Any:
        """Return stresses in Voigt order xx yy zz xy yz zx.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        In Pa, shaped as by `strain`.

        Raises
        ------
        InputError
            There is no such place, or points are not finite.
        MeshError
            A point lies outside the mesh.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
        >>> stress = bar.solve().stress(at=[[0.2, 0.3, 0.9], [0.5, 0.5, 0.5]])
        >>> stress[:, 2].round(9).tolist()
        [5.0, 5.0]
        """
        if isinstance(at, str) and at == "node":
            return self._nodal_stress
        return self._field(at, stress=True)

    @cached_property
    def _nodal_stress(self) -> Array:
        return np.asarray(self._field("node", stress=True))

    def stress_of_material(self, row: int) -> Array:
        """Return recovered stresses at the nodes of one material, which those of its neighbors do not change.

        Parameters
        ----------
        row : of an element of this material.

        Returns
        -------
        (n, 6) in Pa, 0 at nodes that no element of this material has.
        """
        stress = np.zeros((self.mesh.n_nodes, 6))
        for region, values in self._recovery.by_region(self._strained):
            if any((group.rows == row).any() for group in region.groups):
                stress[region.nodes] = values
        return stress

    def von_mises(self, at: At = "gauss") -> Any:
        """Return von Mises stresses.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        (m, g), (m,), (n,) or (...) in Pa.

        Raises
        ------
        InputError
            There is no such place, or points are not finite.
        MeshError
            A point lies outside the mesh.
        """
        stress = self.stress(at)
        if isinstance(stress, list):
            return [voigt.von_mises(s) for s in stress]
        return voigt.von_mises(stress)

    def at_integration_points(self, name: str, element: int | None = None) -> Any:
        """Return a quantity at the integration points by its name in Kratos.

        It is what ``CalculateOnIntegrationPoints`` of KinematicLinear or SmallDisplacementElement returns.
        Strains are small: the Green-Lagrange strain is the linear one, and all stress measures agree.

        Parameters
        ----------
        name : one of

            - ``CAUCHY_STRESS_VECTOR``, ``PK2_STRESS_VECTOR``, ``STRESSES`` (6,), ``CAUCHY_STRESS_TENSOR``,
              ``PK2_STRESS_TENSOR`` (3, 3), ``VON_MISES_STRESS``: Pa, with the prestress;
            - ``GREEN_LAGRANGE_STRAIN_VECTOR``, ``STRAIN`` (6,), ``GREEN_LAGRANGE_STRAIN_TENSOR`` (3, 3);
            - ``STRAIN_ENERGY``: ½ ε:C:ε in J/m³;
            - ``CONSTITUTIVE_MATRIX``: C (6, 6) in Pa;
            - ``STRAIN_INTERPOLATION_OPERATOR``: B (6, 3k) in 1/m of k nodes;
            - ``JACOBIAN``, ``JACOBIAN_0``: det J in m³, ``INTEGRATION_WEIGHT``: weight times det J in m³;
            - ``INTEGRATION_COORDINATES``, ``INTEGRATION_POINT_GLOBAL``: X (3,) in m,
              ``INTEGRATION_POINT_LOCAL``: ξ (3,), ``DISPLACEMENT``: (3,) in m.

            Vectors have the order xx yy zz xy yz xz of Kratos, strains engineering shear; strain tensors
            hold half of it.
        element : id of an element; all elements if not given.

        Returns
        -------
        (g, ...) of one element with g points, points in the order of its rule; or (m, g, ...) of all, in the
        order of the mesh; or a list of (g, ...) where elements have different rules.

        Raises
        ------
        InputError
            There is no such name.
        MeshError
            There is no such element, or several have this id.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
        >>> result = bar.solve()
        >>> result.at_integration_points("CAUCHY_STRESS_VECTOR", element=2)[:, 2].round(9).tolist()
        [5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0]
        >>> weight = result.at_integration_points("INTEGRATION_WEIGHT")
        >>> energy = (result.at_integration_points("STRAIN_ENERGY") * weight).sum()
        >>> bool(abs(energy / result.energy() - 1) < 1e-12)
        True
        """
        from kratos_lite.analysis.integration_point_values import QUANTITIES, GaussPoints  # rarely needed

        quantity = QUANTITIES[choice(name, "a quantity at integration points", QUANTITIES)]
        groups = self.groups if element is None else [group_of_element(self.mesh, self.groups, element)]
        made = [quantity(GaussPoints(self.mesh.points, g, self.u, self._strained)) for g in groups]
        return in_order(groups, made) if element is None else made[0][0]

    # ---- totals --------------------------------------------------------------------------------

    @cached_property
    def _totals(self) -> tuple[float, float, int]:
        """Strain energy in J, largest von Mises stress at a Gauss point in Pa, row of its element."""
        return totals(self.mesh.points, self.groups, self._strained)

    def totals(self) -> tuple[float, float, int]:
        """Return what one pass over the elements gives.

        Returns
        -------
        Strain energy in J, largest von Mises stress at a Gauss point in Pa, and the row of its element.
        """
        return self._totals

    def energy(self) -> float:
        """Return the strain energy ½ ∫ ε:C:ε dV.

        Returns
        -------
        In J.
        """
        return self._totals[0]

    # ---- error ---------------------------------------------------------------------------------

    @overload
    def error(self, of: None = None, *, method: str = "recovery") -> ErrorEstimate: ...

    @overload
    def error(self, of: Quantity) -> QuantityError: ...

    def error(self, of: Quantity | None = None, *, method: str = "recovery") -> ErrorEstimate | QuantityError:
        """Return an estimate of the error in the energy norm, or of the error of a quantity.

        By recovery, the recovered nodal stresses take the place of the exact ones.  The error of a quantity
        takes another solution, of the adjoint; an analysis that is kept has its matrix ready:
        ``model.static()``.

        Stresses in equilibrium with the loads give an upper bound, up to what prescribed displacements and
        curved faces differ from those of the mesh.  They are sought in polynomials three degrees above
        those of the elements, which is enough in practice, but no proof.  It takes longer than a solution.

        Sources: Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24 (1987) 337-357; Becker & Rannacher, Acta
        Numerica 10 (2001) 1-102; Ladevèze & Pelle, Mastering Calculations in Linear and Nonlinear Mechanics
        (2005).

        Parameters
        ----------
        of : a quantity such as `DisplacementAt`, `ReactionOf` or `StressAt`; the energy norm if not given.
        method : ``"recovery"``, or ``"equilibrated"`` for an upper bound in the energy norm.

        Returns
        -------
        ErrorEstimate or QuantityError
            In total, relative and of each element, with what speaks against trusting it.

        Raises
        ------
        InputError
            `of` is no quantity, there is no such method for it, or the result is not that of a static
            analysis.
        MeshError, ModelError
            The quantity does not fit, the model has changed since, or it has no bound by equilibrium.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> mesh = kl.box((4, 1, 1), (8, 2, 2), "KinematicLinear3D20N")
        >>> bar = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
        >>> bar.fix("x-")
        >>> bar.add(kl.Traction("x+", (0, 0, 1.0)))
        >>> result = bar.solve()
        >>> 0 < result.error(of=kl.MeanDisplacement("x+", "z")).relative < 0.05
        True
        >>> result.error().relative < result.error(method="equilibrated").relative < 0.3
        True
        """
        choice(method, "method", METHODS)
        if of is None and method == "recovery":
            return self._error
        if self._origin is None:
            raise InputError(
                "the error of a quantity and the bound of an error need the model and the matrix of a static "
                "analysis; this result has none"
            )
        if of is None:
            from kratos_lite.analysis.error_bound import error_bound  # a quick start for results

            return error_bound(self._origin, self.groups, self._strained, self.energy())
        from kratos_lite.analysis.adjoint import error_of
        from kratos_lite.analysis.quantities import Quantity

        quantity = instance(of, "of", Quantity, "kl.DisplacementAt((1, 0, 0), 'z')")
        if method != "recovery":
            raise InputError(f"the error of a quantity is estimated by recovery; got method={method!r}")
        return error_of(self, self._origin, quantity, self._strained, self._recovery)

    @cached_property
    def _error(self) -> ErrorEstimate:
        from kratos_lite.analysis.error_estimate import energy_error  # as for the recovery

        squares = self._recovery.squared_errors(self._strained, self.mesh.n_elements)
        return energy_error(*squares, 2 * self.energy(), self.groups)

    def _stated_error(self) -> str:
        """Return the error for the table: the one that was asked for, which its meshes have corrected."""
        report = self.report
        if report.error is None:
            return str(self._error)
        return f"{report.error:.2%} of {report.error_of}, from {len(report.history)} meshes"

    def plot(
        self, path: str | Path | None = None, values: ArrayLike | str | None = None, **options: Any
    ) -> Any:
        """Draw the deformed body, colored; a notebook shows it, and it is written if a path is given.

        Parameters
        ----------
        path : picture to write; .png, .pdf or .svg.
        values : what colors it, ``"von_mises"`` if not given; see `kratos_lite.plot`.
        options : those of `kratos_lite.plot`, with the same errors.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from kratos_lite.analysis.plot import plot  # a quick start for results

        return plot(self, path, values=values, **options)

    # ---- out -----------------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary.

        Returns
        -------
        Labels and values.
        """
        mesh, report = self.mesh, self.report
        length = np.linalg.norm(self.u, axis=1)
        top = int(length.argmax())
        energy, mises, row = self._totals
        kinds = element_counts(mesh, self.groups, report.formulation)
        largest = f"{length[top]:.6e} m at node {mesh.node_ids[top]}, {vector(self.u[top])} m"
        forces = float(np.abs(self.loads).sum() + np.abs(self.reactions).sum())
        return [
            ("nodes", f"{mesh.n_nodes}"),
            ("elements", ", ".join(f"{count} {name}" for name, count in kinds.items())),
            *report.load_rows(forces),
            ("largest displacement", largest),
            ("strain energy", f"{energy:.6e} J"),
            ("estimated error", self._stated_error()),
            ("largest von Mises", f"{mises:.6e} Pa (at a Gauss point) in element {mesh.element_ids[row]}"),
            *report.solution_rows(),
            *[("warning", text) for text in self._error.warnings],
        ]

    def __str__(self) -> str:
        rows = self.table()
        width = max(len(label) for label, _ in rows)
        return "\n".join(f"{label:<{width}}  {value}" for label, value in rows)
