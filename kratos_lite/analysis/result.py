"""Result: displacements, reactions, strains, stresses and the report of a solution."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, overload

import numpy as np

from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.fields import data_frame, fields, known, nodal_columns
from kratos_lite.analysis.peak import peak
from kratos_lite.analysis.report import Report, element_counts, sizes, vector
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, Where, WhereElements
from kratos_lite.model.loads import Load
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.tabular import Tabular, in_units
from kratos_lite.typing import Array, ArrayLike, Numbers
from kratos_lite.validation import finite, flag, instance, whole_number

if TYPE_CHECKING:
    from pathlib import Path

    from kratos_lite.analysis.error_estimate import ErrorEstimate, QuantityError
    from kratos_lite.analysis.point_values import LineValues, PointValues
    from kratos_lite.analysis.quantities_of_interest import Quantity
    from kratos_lite.analysis.section import Section
    from kratos_lite.mesh.locate import Located
    from kratos_lite.model.local_axes import LocalAxes


MEASURES = {"accumulated_plastic_strain": "plastic strain", "damage": "damage"}
"""Internal variables in a summary, as it calls them."""


class Analysis(Protocol):
    """What has solved a structure, and solves it for other loads."""

    model: Structure

    def adjoint(self, load: Array, motion: Array, tolerance: float | None = None) -> Array:
        """Return the displacement (n, 3) under a load alone, with supports displaced by a motion alone."""


class Result(ElementFields, Tabular):
    """Displacements and all that follows from them; strains and stresses are made when requested.

    Analyses make results.

    Parameters
    ----------
    mesh : of n nodes and m elements.
    groups : the elements with their materials.
    u : (n, 3) displacements in m.
    reactions, loads : (n, 3) nodal forces in N.
    report : what was solved, how, and how well.
    u0 : (n, 3) displacements in m without stress; none if not given.
    analysis : what solved it, for the errors of quantities.
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
        analysis: Analysis | None = None,
    ) -> None:
        super().__init__(mesh, groups, u, u0)
        self.reactions = reactions
        self.loads = loads
        for array in (reactions, loads):
            array.setflags(write=False)  # others are made of them later
        self.report = report
        report.units = mesh.units
        report.warnings, report.notes = (
            [in_units(text, mesh.units) for text in texts] for texts in (report.warnings, report.notes)
        )
        self._analysis = analysis
        self._version = analysis.model.version if analysis else None
        self._acting: Sequence[Load] = ()  # loads of a static analysis

    @property
    def units(self) -> str:  # type: ignore[override]
        """Set of units of the mesh, which all numbers are in."""
        return self.mesh.units

    # ---- nodal values --------------------------------------------------------------------------

    def displacement(self, where: Where | None = None) -> Array:
        """Return the displacements of nodes.

        Parameters
        ----------
        where : nodes by part, predicate, mask or indices; all if not given.

        Returns
        -------
        (n, 3) in m, or (k, 3) of some.

        Raises
        ------
        MeshError
            There is no such part or node.
        """
        return self.u if where is None else self.u[self.mesh.nodes(where)]

    def reaction(self, where: Where | None = None) -> Array:
        """Return the reactions of nodes: forces of the supports on the body, 0 where nothing is fixed.

        Parameters
        ----------
        where : nodes by part, predicate, mask or indices; all if not given.

        Returns
        -------
        (n, 3) in N, or (k, 3) of some.
        """
        return self.reactions if where is None else self.reactions[self.mesh.nodes(where)]

    # ---- anywhere in the mesh --------------------------------------------------------------------

    def at(self, points: ArrayLike | Located, *, recovered: bool = False) -> PointValues:
        """Return displacements, strains and stresses at points anywhere in the mesh.

        Parameters
        ----------
        points : (..., 3) in m of the undeformed mesh, or what ``mesh.locate`` has found of them.
        recovered : interpolate the stresses recovered at the nodes, which are continuous in each material and
            closer at surfaces, as a rule; otherwise they are C B u of the element that holds the point.

        Returns
        -------
        PointValues

        Raises
        ------
        InputError
            The points are not finite, or were located in another mesh.
        MeshError
            A point lies outside the mesh.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
        >>> values = bar.solve().at([[0.2, 0.3, 0.9], [0.5, 0.5, 0.5]])
        >>> values.stress[:, 2].round(9).tolist(), values.displacement[1, 2].round(9).tolist()
        ([5.0, 5.0], 2.5e-06)
        """
        from kratos_lite.analysis.point_values import PointValues  # a quick start for results

        return PointValues(self, self._located(points), flag(recovered, "recovered"))

    def along(self, a: ArrayLike, b: ArrayLike, n: int = 51, *, recovered: bool = False) -> LineValues:
        """Return the same along a line, with the distance and the membrane and bending parts of the stress.

        Parameters
        ----------
        a, b : (3,) m, where the line begins and ends in the undeformed mesh.
        n : number of points, at equal distances.
        recovered : as for `at`.

        Returns
        -------
        LineValues

        Raises
        ------
        InputError
            An end is no point, or both are the same.
        MeshError
            A point lies outside the mesh.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> beam = kl.Model(kl.box((1, 1, 1), element="KinematicLinear3D20N"), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> y = beam.mesh.points[:, 1]
        >>> beam.fix("x-", "xyz")
        >>> beam.fix("x+", "x", 1e-3 * (y[beam.mesh.nodes("x+"), None] - 0.25))
        >>> line = beam.solve().along((0.5, 0, 0.5), (0.5, 1, 0.5), n=3)
        >>> line
        LineValues at points (3, 3): displacement, strain, stress, von_mises, ...
        >>> line.distance.tolist(), line.stress[:, 0].round(6).tolist()
        ([0.0, 0.5, 1.0], [-250.0, 250.0, 750.0])
        >>> line.membrane[0].round(6).tolist(), line.bending[0].round(6).tolist()
        (250.0, -500.0)
        """
        from kratos_lite.analysis.point_values import LineValues  # a quick start for results

        ends = np.array(
            [finite(end, f"the {name} of a line", (3,)) for end, name in ((a, "beginning"), (b, "end"))]
        )
        if (ends[0] == ends[1]).all():
            raise InputError(f"a line needs two ends; both are {ends[0].tolist()}")
        return LineValues(self, ends, whole_number(n, "n", least=2), flag(recovered, "recovered"))

    def section(self, where: Any, *, part: WhereElements = None, recovered: bool = True) -> Section:
        """Return a cut by a plane or around a part: force, moment, area, centroid and the stress on it.

        Force and moment are sums of internal nodal forces, whose virtual work with a rigid motion of what
        lies beyond the cut vanishes in elements that are not cut: Σ f and Σ (x - c) × f, c the centroid.
        They balance the loads and reactions beyond the cut, in a transient those of inertia and damping too.

        Source: Bathe, Finite Element Procedures (1996), section 4.2.1, element nodal point forces.

        Parameters
        ----------
        where : a plane, ``("x", 0.5)`` or a normal (3,) and an offset in m, beyond which n·X is larger; or
            elements by part name, property id, mask or indices, which lie beyond a cut around them, through
            their faces to others and to what they are tied to.
        part : the elements through which a plane cuts, as those of one bolt; all if not given.
        recovered : the stress is that recovered at nodes, as for `at`; otherwise C B u.

        Returns
        -------
        Section

        Raises
        ------
        InputError
            The plane is none, or `part` is given without.
        MeshError
            It misses the body or part, there are no such elements or no others beside them, or this process
            has only a part of the mesh.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> beam = kl.Model(kl.box((4, 1, 1), (8, 2, 2)), kl.Isotropic3D(E=1e6, nu=0.3))
        >>> beam.fix("x-")
        >>> beam.add(kl.Traction("x+", (0, 0, 5.0)))
        >>> cut = beam.solve().section(("x", 1.3))
        >>> print(f"{cut.force[2]:.6f} N, {cut.moment[1]:.6f} N m, {cut.area:.6f} m²")  # My = -F (L - x)
        5.000000 N, -13.500000 N m, 1.000000 m²
        """
        from kratos_lite.analysis.section import section  # a quick start for results

        return section(self, where, part, flag(recovered, "recovered"))

    def energy(self) -> float:
        """Return the strain energy ½ ∫ ε:C:ε dV in J, of the elastic strain, and ½ u·K u of springs."""
        u = self.u.ravel()
        return super().energy() + (0.0 if self._springs is None else float(u @ (self._springs @ u)) / 2)

    def _located(self, points: ArrayLike | Located) -> Located:
        """Return where points lie in the mesh; raise MeshError if one lies outside."""
        from kratos_lite.mesh.locate import Located

        if not isinstance(points, Located):
            return self.mesh.locate(points, required=True)
        if points.mesh is not self.mesh:
            raise InputError(
                "these points were located in another mesh; locate them in that of the result, as in "
                "result.at(result.mesh.locate(points))"
            )
        return points.require()

    # ---- error ---------------------------------------------------------------------------------

    @overload
    def error(self, of: None = None) -> ErrorEstimate: ...

    @overload
    def error(self, of: Quantity) -> QuantityError: ...

    def error(self, of: Quantity | None = None) -> ErrorEstimate | QuantityError:
        """Return an estimate of the error in the energy norm, or of the error of a quantity.

        By recovery, the recovered nodal stresses take the place of the exact ones.  The error of a quantity
        takes another solution, of the adjoint; an analysis that is kept has its matrix ready:
        ``model.static()``.

        Sources: Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24 (1987) 337-357; Becker & Rannacher, Acta
        Numerica 10 (2001) 1-102.

        Parameters
        ----------
        of : a quantity such as `DisplacementAt`, `ReactionOf` or `StressAt`; the energy norm if not given.

        Returns
        -------
        ErrorEstimate or QuantityError
            In total, relative and of each element, with what speaks against trusting it.

        Raises
        ------
        InputError
            `of` is no quantity, or the result is not that of a static analysis.
        MeshError, ModelError
            The quantity does not fit, or the model has changed since.

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
        >>> 0.05 < result.error().relative < 0.3
        True
        """
        self._check_linear("the estimate of the error")
        if of is None:
            return self._error
        analysis = self._current_analysis("the error of a quantity")
        from kratos_lite.analysis.error_estimate import error_of
        from kratos_lite.analysis.quantities_of_interest import Quantity

        quantity = instance(of, "of", Quantity, "kl.DisplacementAt((1, 0, 0), 'z')")
        how = analysis.adjoint, analysis.model, self._strained, self._recovery
        return error_of(self, quantity, *how)

    def gradient(self, of: Quantity, wrt: str = "stiffness") -> Array:
        """Return the derivative of a quantity by what the model is made of, by one adjoint solution.

        An analysis that is kept has its matrix ready, ``model.static()``; `Compliance` takes no solution
        where the supports are at rest and nothing is stressed without loads.

        Parameters
        ----------
        of : a quantity such as `DisplacementAt`, `ReactionOf`, `StressAt` or `Compliance`.
        wrt : by what: ``"stiffness"``, a factor of the stiffness of each element; ``"E"``, Young's modulus
            of each element; ``"density"`` of each element, by its weight; ``"loads"``, a factor of each load;
            ``"coordinates"`` of each node: prescribed displacements, nodal forces and temperatures stay with
            their nodes, points move with their elements.

        Returns
        -------
        (m,) of elements, in the unit of the quantity, or that per Pa or kg/m³; (l,) of the loads of this
        solution in their order; (n, 3) in that unit per m.

        Raises
        ------
        InputError
            `of` is no quantity, there is no such `wrt`, a law is not linear or has no E, or the result is not
            that of a static analysis.
        MeshError, ModelError
            The quantity does not fit, the model has changed since, the supports leave rigid motions free, or
            a load or support has no derivative by coordinates.

        Notes
        -----
        dQ/dp = ∂Q/∂p + z·∂(f - ∫ B^T σ dV)/∂p with the adjoint K z = ∂Q/∂u.
        Source: Haftka & Gürdal, Elements of Structural Optimization (1992), section 7.2.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
        >>> result, mean = bar.solve(), kl.MeanDisplacement("z+", "z")
        >>> result.gradient(mean, wrt="E").round(15).tolist()  # -F L / E² A
        [-5e-12]
        >>> result.gradient(mean, wrt="loads").round(9).tolist()
        [5e-06]
        """
        from kratos_lite.analysis.adjoint import gradient_of  # rarely needed
        from kratos_lite.analysis.quantities_of_interest import Quantity

        quantity = instance(of, "of", Quantity, "kl.DisplacementAt((1, 0, 0), 'z')")
        self._check_linear("a gradient")
        analysis = self._current_analysis("a gradient")
        return gradient_of(self, quantity, wrt, analysis.model, analysis.adjoint)

    def _current_analysis(self, what: str) -> Analysis:
        """Return the analysis that solved this; an error where it has none, or its model has changed."""
        analysis = self._analysis
        if analysis is None:
            text = "needs the model and the matrix of a static analysis"
            raise InputError(f"{what} {text}; this result has none")
        if self._version != analysis.model.version:
            raise ModelError("the model has changed since this solution; solve it again")
        return analysis

    def _check_linear(self, what: str) -> None:
        """Raise InputError where a law is not linear."""
        if laws := sorted({type(g.material).__name__ for g in self.groups if not g.is_linear}):
            raise InputError(
                f"{what} is one of linear elasticity, and {', '.join(laws)} is not linear "
                "here; compare with a finer mesh: kl.compare(coarse, fine)"
            )

    @cached_property
    def _error(self) -> ErrorEstimate:
        from kratos_lite.analysis.error_estimate import energy_error  # as for the recovery

        squares = self._recovery.products(self._strained, self._strained, self.mesh.n_elements)
        return energy_error(*squares, self.norm**2, self.groups, self.mesh)

    def _stated_error(self) -> str:
        """Return the error for the table: the one that was requested, which its meshes have corrected."""
        report = self.report
        if report.error is None:
            return str(self._error)
        n = len(report.history)
        return f"{report.error:.2%} of {report.error_of}, from {n} mesh{'es' * (n > 1)}"

    # ---- for other programs ----------------------------------------------------------------------

    def columns(self, local: LocalAxes | None = None) -> dict[str, Numbers]:
        """Return ids, places, displacements, reactions and recovered stresses of the nodes.

        They are (n,) by headers with units; ``kl.write("nodes.csv", result)`` writes them.

        Parameters
        ----------
        local : axes of the components, such as ``stress rr [Pa]`` of `Cylindrical`; x y z if not given.

        Returns
        -------
        dict of str to (n,) array
        """
        return nodal_columns(self, local)

    def to_dataframe(self, local: LocalAxes | None = None) -> Any:
        """Return the columns as a data frame of pandas, one row for each node.

        Parameters
        ----------
        local : as for `columns`.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        KratosLiteError
            pandas is not installed.
        """
        return data_frame(self.columns(local))

    def to_pyvista(self) -> Any:
        """Return the mesh with all fields of nodes and elements as a grid of PyVista.

        Returns
        -------
        pyvista.UnstructuredGrid
            With DISPLACEMENT, REACTION, CAUCHY_STRESS_VECTOR (xx yy zz xy yz xz), VON_MISES_STRESS, …

        Raises
        ------
        KratosLiteError
            PyVista is not installed.
        """
        from kratos_lite.mesh.vtk import pyvista_grid

        return pyvista_grid(self.mesh, *fields(self))

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

    def largest_displacement(self) -> tuple[float, int, Array]:
        """Return the largest displacement of a node: its size in m, the id of the node, and u (3,) in m."""
        length = np.linalg.norm(self.u, axis=1)
        node = int(length.argmax())
        return float(length[node]), int(self.mesh.node_ids[node]), self.u[node]

    def largest_von_mises(self) -> tuple[float, int, Array]:
        """Return the largest von Mises stress of Gauss points in Pa, id and center (3,) of its element."""
        _, mises, row = self._totals
        return mises, *self._element(row)

    def largest_variables(self) -> dict[str, tuple[float, int, Array]]:
        """Return the largest plastic strain and damage of Gauss points, as `largest_von_mises` does."""
        largest = {}
        for name in MEASURES:
            if name in known(self.groups):
                values = np.array([np.max(points) for points in self.field(name)])
                row = int(values.argmax())
                largest[name] = (float(values[row]), *self._element(row))
        return largest

    def _element(self, row: int) -> tuple[int, Array]:
        """Return the id and the center (3,) of an element."""
        (nodes,) = (group.nodes[group.rows == row] for group in self.groups if row in group.rows)
        return int(self.mesh.element_ids[row]), self.mesh.points[nodes[0]].mean(axis=0)

    @property
    def is_linear(self) -> bool:
        """Whether laws and strains are linear, so that the error can be estimated."""
        return all(group.is_linear for group in self.groups)

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary, labels and values."""
        mesh, report = self.mesh, self.report
        counts = mesh.n_nodes, element_counts(mesh, self.groups, report.formulation)
        extremes = self.largest_displacement(), self.energy(), self.largest_von_mises()
        size = float(np.abs(self.loads).sum() + np.abs(self.reactions).sum())
        error = [("estimated error", self._stated_error())] if self.is_linear else []
        for name, (value, element, center) in self.largest_variables().items():
            place = f"in element {element} around {vector(center)} m"
            error.append((MEASURES[name], f"up to {value:.6e} (at a Gauss point) {place}"))
        rows = self._summary(counts, extremes, error, size, str(peak(self) or ""))
        rows[2:2] = sizes(mesh.points, self.groups)
        if not self.is_linear:
            return rows
        return rows + [("warning", text) for text in self._error.warnings if text not in report.warnings]

    def _summary(
        self,
        counts: tuple[int, dict[str, int]],
        extremes: tuple[tuple[float, int, Array], float, tuple[float, int, Array]],
        error: Sequence[tuple[str, str]] = (),
        size: float = 0.0,
        near: str = "",
    ) -> list[tuple[str, str]]:
        """Return the rows of a summary from numbers of nodes and elements, largest values and energy."""
        (length, node, u), energy, (mises, element, center) = extremes
        place = f"in element {element} around {vector(center)} m{near}"
        return [
            ("nodes", str(counts[0])),
            ("elements", ", ".join(f"{count} {name}" for name, count in counts[1].items())),
            *self.report.load_rows(size),
            ("largest displacement", f"{length:.6e} m at node {node}, {vector(u)} m"),
            ("strain energy", f"{energy:.6e} J{', with springs' * (self._springs is not None)}"),
            *error,
            ("largest von Mises", f"{mises:.6e} Pa (at a Gauss point) {place}"),
            *self.report.solution_rows(),
        ]


R = TypeVar("R", bound=Result)


def result_of(
    kind: type[R],
    analysis: Analysis | None,
    model: Structure,
    groups: Sequence[ElementGroup],
    fields: tuple[Array, Array, Array],
    solution: Solution,
    balance: tuple[float | None, float | None] = (None, None),
    **report: Any,
) -> R:
    """Return the result of a solution of a model from u, reactions and loads (n, 3), with its report.

    `balance` is what forces and moments miss to equilibrium; `report` has the unknowns, notes and warnings.
    """
    u, reactions, loads = fields
    made = Report(
        total_load=loads.sum(axis=0),
        total_reaction=reactions.sum(axis=0),
        solver=solution.method,
        reason=solution.reason,
        iterations=solution.iterations,
        backward_error=solution.backward_error,
        force_error=balance[0],
        moment_error=balance[1],
        formulation=model.chosen(groups),
        **{**report, "notes": [*model.remarks(), *report.get("notes", ())]},
    )
    result = kind(model.mesh, groups, u, reactions, loads, made, model.initial_displacement, analysis)
    result._springs, result._ties = model.supports.springs, model.supports.ties
    return result
