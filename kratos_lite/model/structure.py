"""Structure: a solid with supports, loads and motion, which is what is analyzed; it knows no analysis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import PatternCache
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh, Where
from kratos_lite.model import checks, connected_bodies
from kratos_lite.model import rigid_body_modes as rigid_body_mode_check
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.model.locking import check_locking
from kratos_lite.model.solid import Solid
from kratos_lite.model.supports import AXES, Fixing, Supports
from kratos_lite.records import Tabular
from kratos_lite.solvers.constraint_map import MultiPointConstraint, rigid_modes
from kratos_lite.time_series import Factor
from kratos_lite.typing import Array
from kratos_lite.validation import finite, function_or_none

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Attachment(ABC):
    """What `Structure.add` takes besides loads, such as the motions of `kratos_lite.ale`."""

    @abstractmethod
    def attach(self, structure: Structure) -> None:
        """Become the motion of a structure: check it, and set what it needs.

        Parameters
        ----------
        structure : that it is added to.

        Raises
        ------
        ModelError
            It does not fit the structure.
        """


class Structure(Solid, Tabular):
    """What is analyzed: a solid with supports, loads and motion.

    Parameters
    ----------
    mesh : points, elements and named parts.
    material : one material for all elements, or materials by part name or property id.
    formulation : of the elements, in place of what their names in the mesh say; see `Solid.formulation`.

    Attributes
    ----------
    supports : what is prescribed; see `fix` and `constrain`.
    loads : those added; the list may be changed.
    notes : what readers of files found, for the report.

    Raises
    ------
    InputError
        `mesh` is not a Mesh, `material` not a material, or an element of the mesh has no such formulation.
    MeshError
        A part or property of `material` does not exist.
    """

    def __init__(
        self,
        mesh: Mesh,
        material: LinearMaterial | Mapping[Any, LinearMaterial] | None = None,
        formulation: str | None = None,
    ) -> None:
        super().__init__(mesh, material, formulation)
        self.supports = Supports(mesh)
        self.loads: list[Load] = []
        self._motion: Attachment | None = None
        self.notes: list[str] = []
        self.patterns = PatternCache()

    @property
    def version(self) -> tuple[int, int]:
        """Change counters of everything that affects the equations except prescribed values and loads."""
        return self._changes, self.supports.version

    @property
    def motion(self) -> Attachment | None:
        """Motion of the material through the mesh, or None; `add` takes one, None takes it away."""
        return self._motion

    @motion.setter
    def motion(self, value: None) -> None:
        if value is not None:
            raise ModelError("a motion also ties or fixes boundaries: give it to model.add(...)")
        self._motion = None

    # ---- supports and loads -------------------------------------------------------------------

    def fix(
        self,
        where: Where,
        axes: str = "xyz",
        value: ArrayLike | Callable[[float], float] = 0.0,
        *,
        field: Callable[[Array], ArrayLike] | None = None,
        override: bool = False,
    ) -> None:
        """Prescribe the displacement of nodes.

        Parameters
        ----------
        where : part name, point (x, y, z) in m, predicate on the points (n, 3), mask or node rows.
        axes : some of ``"x"``, ``"y"``, ``"z"``, such as ``"xz"``.
        value : m; one number, one per axis, or one row per node; or a `TimeSeries` or function of time in s,
            which statics take at the time 0.
        field : in place of a value, a function of places (k, 3) in m that returns one row per node or one
            number per axis in m.  A mesh that is made finer takes its values, others are interpolated.
        override : let this value win over an earlier one for the same degree of freedom.

        Raises
        ------
        ModelError
            If no node is chosen, or a degree of freedom gets two different values.
        InputError
            The axes or the value make no sense.
        MeshError
            There is no such part or node.
        """
        rows = self.mesh.nodes(where)
        if not len(rows):
            what = f"part {where!r} has no nodes" if isinstance(where, str) else "no node is chosen"
            raise ModelError(f"cannot fix {axes}: {what}")
        function_or_none(field, "field must be a function of places (k, 3)")
        known = where if isinstance(where, str) or callable(where) else None
        self.supports.apply(Fixing(known, rows, axes, value, field, override))

    def constrain(
        self,
        slave: tuple[int, str],
        masters: Mapping[tuple[int, str], float],
        constant: float = 0.0,
    ) -> None:
        """Tie a degree of freedom to others: u[slave] = Σ weight · u[master] + constant.

        Parameters
        ----------
        slave : (node row, axis letter).
        masters : weights by (node row, axis letter).
        constant : m.

        Raises
        ------
        InputError
            A degree of freedom, weight or constant is invalid.
        """
        if not isinstance(masters, Mapping):
            raise InputError(f"masters must map (node row, axis letter) to a weight; got {masters!r}")
        weights = finite(list(masters.values()), "weights of a constraint").tolist()
        offset = float(finite(constant, "the constant of a constraint"))
        constraint = MultiPointConstraint(
            self._dof(slave), tuple(map(self._dof, masters)), tuple(weights), offset
        )
        self.supports.constraints = (*self.supports.constraints, constraint)

    def _dof(self, where: tuple[int, str]) -> int:
        """Return the number of a degree of freedom (node row, axis letter)."""
        node, axis = where if isinstance(where, tuple) and len(where) == 2 else (None, None)
        known = isinstance(node, (int, np.integer)) and 0 <= node < self.mesh.n_nodes
        if not known or axis not in tuple(AXES):
            raise InputError(f"a degree of freedom is (node row, axis letter); got {where!r}")
        return 3 * int(where[0]) + AXES.index(where[1])

    def add(self, load: Load | Attachment, *, amplitude: Factor | None = None) -> None:
        """Add a load (loads add up), or the motion of the material through the mesh (there is one).

        Parameters
        ----------
        load : such as `Gravity` or `Traction`; or a motion such as `kratos_lite.ale.Rotation`.
        amplitude : number, `TimeSeries` or function of time in s that multiplies the load; statics uses its
            value at t = 0.

        Raises
        ------
        InputError
            `load` is neither a load nor a motion, or the amplitude is invalid.
        MeshError
            There is no such part or node, or the point of a load lies outside the mesh.
        ModelError
            The motion does not fit the model, or there is one already.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
        >>> model.add(kl.Gravity((0, 0, -9.81)), amplitude=kl.TimeSeries([0.0, 1.0], [0.0, 2.0]))
        >>> model.loads[0].amplitude(0.5)
        1.0
        """
        if isinstance(load, Attachment):
            if amplitude is not None:
                raise InputError("a motion takes no amplitude; its rate may be a function of time")
            load.attach(self)
            self._motion = load
            return
        if not isinstance(load, Load):
            raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
        load = load if amplitude is None else ScaledLoad(load, amplitude)
        load.check(self.mesh)
        self.loads.append(load)

    def rigid_modes(self) -> Array:
        """Return the rigid-body modes of all nodes.

        Returns
        -------
        (3n, 6): translations in x, y and z, rotations about x, y and z.
        """
        return rigid_modes(self.mesh.points)

    # ---- checks -------------------------------------------------------------------------------

    def check(self) -> list[str]:
        """Check the model as a static solution does, without solving.

        Returns
        -------
        Warnings, one sentence each.

        Raises
        ------
        MeshError, ModelError, InputError
            With every element or part that is wrong.
        """
        return self.checked()[2]

    def checked(self, *, free: bool = False) -> tuple[list[ElementGroup], NDArray[np.int64], list[str]]:
        """Return what a static solution starts from, of a model that passes all checks.

        Parts are numbered from 0; they share neither nodes nor constraints.  Nodes without elements have -1.

        Parameters
        ----------
        free : let rigid-body modes be free, as inertia holds what supports do not; then there is one part.

        Returns
        -------
        Element groups, the part of each node (n,), and warnings.

        Raises
        ------
        MeshError, ModelError, InputError
            With every element or part that is wrong.
        """
        mesh = self.mesh
        warnings = self.check_geometry()
        groups = self.element_groups()
        used, faces = mesh.used_nodes(), mesh.all_faces
        if not all(group.is_proven for group in groups):
            from kratos_lite.model.hourglass_modes import check_rules  # rarely needed

            warnings += check_rules(mesh, groups)
        warnings += rigid_body_mode_check.check_joints(mesh, faces)
        warnings += checks.check_coincident(mesh, used, self.supports.constraints)
        warnings += checks.check_scales(mesh, groups)
        warnings += check_locking(mesh, groups, self.supports, faces)
        if any(group.element.spurious_modes for group in groups):
            from kratos_lite.model.spurious_modes import check_spurious_modes  # rarely needed

            check_spurious_modes(mesh, groups, self.supports, faces)
        if not used.all():
            lost = mesh.node_ids[~used]
            shown = " ".join(map(str, lost[:5])) + (" …" if len(lost) > 5 else "")
            warnings.append(f"{len(lost)} nodes belong to no element and carry no equations: {shown}")
        part: NDArray[np.int64] = np.where(used, 0, -1)
        if not free:
            bodies = connected_bodies.bodies(mesh, faces)
            part = rigid_body_mode_check.check_supports(mesh, self.supports, bodies)
        self.supports.check_used(used)
        return groups, part, warnings

    # ---- summary ------------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of a summary.

        Returns
        -------
        Labels and values.
        """
        used = [m for i, m in enumerate(self._materials) if (self._material_of == i).any()]
        without = int((self._material_of < 0).sum())
        rows = self.mesh.table()
        rows += [("formulation", text)] if (text := self.chosen()) else []
        rows += [("material", str(material)) for material in used]
        rows += [("material", f"none for {without} elements")] if without else []
        rows.append(("fixed", f"{int(self.supports.fixed.sum())} components"))
        if self.supports.constraints:
            rows.append(("constraints", str(len(self.supports.constraints))))
        rows += [("load", type(load).__name__) for load in self.loads]
        rows += [] if self.motion is None else [("motion", str(self.motion))]
        return rows + [("note", note) for note in self.notes]

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}({self.mesh.n_nodes} nodes, {self.mesh.n_elements} elements, {len(self.loads)} loads)"
