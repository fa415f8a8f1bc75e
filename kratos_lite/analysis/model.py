"""Model: mesh, materials, supports and loads, solved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.ale.checks import attach
from kratos_lite.ale.motion import Motion
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.static import StaticAnalysis, solve_static
from kratos_lite.assembly.element_groups import ElementGroup, element_groups_of
from kratos_lite.assembly.sparsity_pattern import PatternCache
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh, Where, WhereElements
from kratos_lite.model import checks
from kratos_lite.model import rigid_body_modes as rigid_body_mode_check
from kratos_lite.model.loads import Load
from kratos_lite.quadrature import Rule
from kratos_lite.solvers.supports import AXES, MultiPointConstraint, Supports, rigid_modes
from kratos_lite.typing import Array, Complexes, Progress
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from kratos_lite.analysis import Transient


class Model:
    """A body under load.

    Parameters
    ----------
    mesh : points, elements and named parts.
    material : one material for all elements, or materials by part name or property id.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    >>> for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
    ...     model.fix(side, axis)
    >>> model.add(kl.Gravity((0.0, 0.0, -9.81)))
    >>> result = model.solve()
    >>> print(f"{result.displacement('z+')[:, 2].mean():.7e} m")
    -1.3221478e-04 m
    """

    def __init__(
        self, mesh: Mesh, material: LinearMaterial | Mapping[Any, LinearMaterial] | None = None
    ) -> None:
        self.mesh = checks.checked_mesh(mesh)
        self.supports = Supports(mesh)
        self.loads: list[Load] = []
        self.motion: Motion | None = None
        self.patterns = PatternCache()
        self.notes: list[str] = []
        self.initial_displacement: Array | None = None
        self.prestress: Array | None = None
        self._materials: list[LinearMaterial] = []
        self._material_of = np.full(mesh.n_elements, -1)
        self._rules: dict[int, Rule | int] = {}
        self._rule_of = np.full(mesh.n_elements, -1)
        if isinstance(material, Mapping):
            for where, one in material.items():
                self.assign(one, where)
        elif material is not None:
            self.assign(material)

    # ---- what the model is made of -----------------------------------------------------------

    def assign(self, material: LinearMaterial, where: WhereElements = None) -> None:
        """Give elements a material: all, those of a part, of a property id, or of given rows."""
        checks.checked_material(material)
        rows = self.mesh.elements(where)
        self._materials.append(material)
        self._material_of[rows] = len(self._materials) - 1

    def use_rule(self, rule: Rule | int, where: WhereElements = None) -> None:
        """Replace the quadrature rule of elements by a Rule or an INTEGRATION_ORDER 1 … 5."""
        if isinstance(rule, bool) or not isinstance(rule, (int, Rule)):
            raise InputError(f"a Rule or an INTEGRATION_ORDER 1 … 5 is needed; got {rule!r}")
        number = len(self._rules)
        self._rules[number] = rule
        self._rule_of[self.mesh.elements(where)] = number

    def fix(
        self,
        where: Where,
        axes: str = "xyz",
        value: ArrayLike | Callable[[float], float] = 0.0,
        *,
        override: bool = False,
    ) -> None:
        """Prescribe the displacement of nodes.

        Parameters
        ----------
        where : part name, predicate on the points (n, 3), mask or node rows.
        axes : some of ``"x"``, ``"y"``, ``"z"``, e.g. ``"xz"``.
        value : m; one number, one per axis, or one row per node; or a `TimeSeries` or function of the time in
            s for transients, which statics take at the time 0.
        override : let this value win over an earlier one for the same degree of freedom.

        Raises
        ------
        ModelError
            If no node is chosen, or a degree of freedom gets two different values.
        """
        rows = self.mesh.nodes(where)
        if not len(rows):
            what = f"part {where!r} has no nodes" if isinstance(where, str) else "no node is chosen"
            raise ModelError(f"cannot fix {axes}: {what}")
        if callable(value):
            self.supports.move(rows, axes, value, override)
        else:
            self.supports.fix(rows, axes, value, override)

    def constrain(
        self,
        slave: tuple[int, str],
        masters: Mapping[tuple[int, str], float],
        constant: float = 0.0,
    ) -> None:
        """Tie a degree of freedom to others: u[slave] = Σ weight · u[master] + constant.

        Degrees of freedom are (node row, axis letter) pairs.
        """

        def dof(where: tuple[int, str]) -> int:
            node, axis = where if isinstance(where, tuple) and len(where) == 2 else (None, None)
            known = isinstance(node, (int, np.integer)) and 0 <= node < self.mesh.n_nodes
            if not known or axis not in tuple(AXES):
                raise InputError(f"a degree of freedom is (node row, axis letter); got {where!r}")
            return 3 * int(where[0]) + AXES.index(where[1])

        if not isinstance(masters, Mapping):
            raise InputError(f"masters must map (node row, axis letter) to a weight; got {masters!r}")
        weights = finite(list(masters.values()), "weights of a constraint").tolist()
        offset = float(finite(constant, "the constant of a constraint"))
        self.supports.link(
            [MultiPointConstraint(dof(slave), tuple(map(dof, masters)), tuple(weights), offset)]
        )

    def add(self, load: Load | Motion) -> None:
        """Add a load (loads add up), or the motion of the material through the mesh (there is one)."""
        if isinstance(load, Motion):
            self._move(load)
            return
        if not isinstance(load, Load):
            raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
        self.loads.append(load)

    def _move(self, motion: Motion) -> None:
        """Take over a motion, and what the ends of a window do."""
        if self.motion is not None:
            raise ModelError("the model has a motion already; there is one")
        attach(motion, self)
        self.motion = motion

    def stress_free_at(self, displacement: ArrayLike) -> None:
        """Make the body stress-free at a displacement u0 (n, 3) in m: strain comes from u - u0."""
        u0 = finite(displacement, "the initial displacement")
        if u0.shape != self.mesh.points.shape:
            raise InputError(f"the initial displacement needs shape {self.mesh.points.shape}; got {u0.shape}")
        self.initial_displacement = u0

    def add_prestress(self, stress: ArrayLike, where: WhereElements = None) -> None:
        """Add a stress (6,) or (m, 6) in Pa that elements carry before they are strained."""
        s, rows = finite(stress, "a prestress"), self.mesh.elements(where)
        if s.shape not in ((6,), (len(rows), 6)):
            raise InputError(
                f"a prestress has six components xx yy zz xy yz zx, or shape ({len(rows)}, 6); "
                f"got shape {s.shape}"
            )
        if self.prestress is None:
            self.prestress = np.zeros((self.mesh.n_elements, 6))
        self.prestress[rows] += s

    def rigid_modes(self) -> Array:
        """Return the six rigid modes (3n, 6) of all nodes: translations x y z, rotations about x y z."""
        return rigid_modes(self.mesh.points)

    # ---- groups -------------------------------------------------------------------------------

    def element_groups(self) -> list[ElementGroup]:
        """Return the elements grouped by kind, rule and material.

        Raises ModelError for elements without material and InputError for unknown kinds.
        """
        return element_groups_of(
            self.mesh, self._materials, self._material_of, self._rules, self._rule_of, self.prestress
        )

    # ---- solving -------------------------------------------------------------------------------

    def check_geometry(self) -> list[str]:
        """Check coordinates, node lists and det J of all elements, whatever their material; return warnings.

        Raises
        ------
        MeshError, InputError
            With every element that is wrong.
        """
        return checks.check_geometry(self.mesh)

    def check(self) -> list[str]:
        """Check the model as `solve` does, without solving; return the warnings.

        Raises
        ------
        MeshError, ModelError, InputError
            With every element or part that is wrong.
        """
        return self.checked()[2]

    def checked(self, *, free: bool = False) -> tuple[list[ElementGroup], NDArray[np.int64], list[str]]:
        """Return the groups, the part of each node and the warnings of a model that passes all checks.

        Parts are numbered from 0; they neither share nodes nor constraints.  Nodes without elements have -1.
        Where rigid motions may be `free`, as inertia holds what supports do not, all nodes are of one part.
        """
        mesh = self.mesh
        warnings = self.check_geometry()
        groups = self.element_groups()
        used, faces = mesh.used_nodes(), mesh.all_faces(anew=True)
        warnings += checks.check_rules(mesh, groups)
        warnings += rigid_body_mode_check.check_joints(mesh, faces)
        warnings += checks.check_coincident(mesh, used)
        warnings += checks.check_scales(mesh, groups)
        if not used.all():
            lost = mesh.node_ids[~used]
            shown = " ".join(map(str, lost[:5])) + (" …" if len(lost) > 5 else "")
            warnings.append(f"{len(lost)} nodes belong to no element and carry no equations: {shown}")
        if free:
            return groups, np.where(used, 0, -1), warnings
        bodies = rigid_body_mode_check.bodies(mesh, faces)
        return groups, rigid_body_mode_check.check_supports(mesh, self.supports, bodies), warnings

    def solve(
        self, solver: str = "auto", tolerance: float = 1e-10, progress: Progress | None = None
    ) -> Result:
        """Check the model and solve it.

        Parameters
        ----------
        solver : ``auto``, ``dense``, ``direct`` or ``amg``.
        tolerance : relative residual at which the iterative solver stops.
        progress : called with the phase and the share done, 0 … 1.

        Returns
        -------
        Result
            Displacements, reactions, stresses and a report.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken or its supports leave rigid motions free.
        SolveError
            If the accuracy asked for cannot be reached.
        """
        if self.motion is not None:
            from kratos_lite.analysis.steady import solve_steady

            return solve_steady(self, solver, tolerance, progress)
        return solve_static(self, solver, tolerance, progress)

    def system(
        self, solver: str = "auto", tolerance: float = 1e-10, progress: Progress | None = None
    ) -> StaticAnalysis:
        """Check the model and make it ready to be solved for many load sets; arguments as for `solve`.

        ``system.solve(loads)`` is `solve` with these loads in place of those of the model; matrix, factors
        or multigrid are made once.

        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.0, density=1000.0))
        >>> model.fix("z-")
        >>> system = model.system()
        >>> pull, push = (system.solve([kl.Traction("z+", (0, 0, t))]) for t in (1e6, -2e6))
        >>> print(f"{pull.u[:, 2].max():.1e} m, {push.u[:, 2].min():.1e} m")
        1.0e-03 m, -2.0e-03 m
        """
        return StaticAnalysis(self, solver, tolerance, progress)

    def solve_cases(
        self,
        cases: Mapping[str, Sequence[Load]],
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
    ) -> dict[str, Result]:
        """Solve the model for several load cases: each has the loads given, not those of the model.

        Returns the result of each case by its name; other arguments and errors as for `solve`.
        """
        return StaticAnalysis(self, solver, tolerance, progress).solve_cases(cases)

    # ---- in time -----------------------------------------------------------------------------------

    def transient(self, **options: Any) -> Transient:
        """Return the model ready to move in time; options as of `kratos_lite.Transient`.

        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Gravity((0, 0, -9.81)))
        >>> moments = list(bar.transient().march(dt=1e-3, steps=10, every=5))
        >>> [round(moment.time, 6) for moment in moments]
        [0.005, 0.01]
        """
        from kratos_lite.analysis import Transient

        return Transient(self, **options)

    def modes(self, count: int = 6, *, lumped: bool = False) -> tuple[Array, Array]:
        """Return natural frequencies (count,) in rad/s, ascending, and shapes (count, n, 3).

        Supports hold what they hold, at zero.  A motion of the material is left out: see `complex_modes`.
        """
        from kratos_lite.analysis.modal import natural_modes

        return natural_modes(self, count, lumped)

    def complex_modes(self, count: int = 6) -> tuple[Complexes, Complexes]:
        """Return eigenvalues λ (count,) in 1/s of λ² M + λ C + K, nearest to 0 first, and their shapes.

        C and K hold what the motion of the material adds at the time 0; shapes are (count, n, 3), complex.
        """
        from kratos_lite.analysis.modal import complex_modes

        return complex_modes(self, count)

    def state(self) -> list[Any]:
        """Return copies of all that matters to the equations of the model, but for prescribed values."""
        mesh, arrays = self.mesh, [self._material_of, self._rule_of, self.supports.fixed]
        arrays += [mesh.points, *(block.nodes for block in mesh.blocks)]
        arrays += [array for array in (self.prestress, self.initial_displacement) if array is not None]
        things = [block.name for block in mesh.blocks], self.prestress is None, tuple(self.supports.links)
        return [*(array.copy() for array in arrays), things, tuple(self._materials), dict(self._rules)]

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of a summary: label and value."""
        mesh = self.mesh
        used = [m for i, m in enumerate(self._materials) if (self._material_of == i).any()]
        without = int((self._material_of < 0).sum())
        rows = [("nodes", str(mesh.n_nodes))]
        rows += [("elements", f"{len(block)} {block.name}") for block in mesh.blocks if len(block)]
        rows += [("material", str(material)) for material in used]
        rows += [("material", f"none for {without} elements")] if without else []
        rows.append(("fixed", f"{int(self.supports.fixed.sum())} components"))
        if self.supports.links:
            rows.append(("constraints", str(len(self.supports.links))))
        rows += [("load", type(load).__name__) for load in self.loads]
        rows += [] if self.motion is None else [("motion", str(self.motion))]
        for name, part in mesh.parts.items():
            sizes = (
                f"{len(part.nodes)} nodes, {len(part.elements)} elements, {len(part.conditions)} conditions"
            )
            rows.append(("part", f"{name}: {sizes}"))
        return rows + [("note", note) for note in self.notes]

    def __str__(self) -> str:
        return "\n".join(f"{label:<12}{value}" for label, value in self.table())

    def __repr__(self) -> str:
        return f"Model({self.mesh.n_nodes} nodes, {self.mesh.n_elements} elements, {len(self.loads)} loads)"
