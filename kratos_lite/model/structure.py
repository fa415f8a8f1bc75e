"""Structure: a solid with supports, loads and motion, which is what is analyzed; it knows no analysis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import PatternCache
from kratos_lite.errors import InputError, ModelError, nearest
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh, distinct
from kratos_lite.model import checks
from kratos_lite.model.coincident_nodes import check_coincident
from kratos_lite.model.equal import key_of
from kratos_lite.model.free_motions import FreeMotions
from kratos_lite.model.hourglass_modes import check_rules
from kratos_lite.model.joints import check_joints
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.model.locking import check_locking
from kratos_lite.model.rigid_body_modes import free_motions
from kratos_lite.model.spurious_modes import check_spurious_modes
from kratos_lite.model.supported_solid import SupportedSolid
from kratos_lite.tabular import Tabular
from kratos_lite.time_series import Factor
from kratos_lite.validation import instance

if TYPE_CHECKING:
    pass


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


class Structure(SupportedSolid, Tabular):
    """What is analyzed: a solid with supports, loads and motion.

    Parameters
    ----------
    mesh : points, elements and named parts.
    material : one material for all elements, or materials by part name or property id.
    formulation : of the elements, in place of what their names in the mesh say; see `Solid.formulation`.

    Attributes
    ----------
    supports : what is prescribed; see `fix`, `release` and `constrain`.
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
        self.loads: list[Load] = []
        self._named: dict[str, Load] = {}
        self._keys: dict[Hashable, Load] = {}
        self._motion: Attachment | None = None
        self.notes: list[str] = []
        self.patterns = PatternCache()

    @property
    def motion(self) -> Attachment | None:
        """Motion of the material through the mesh, or None; `add` takes one, None takes it away."""
        return self._motion

    @motion.setter
    def motion(self, value: None) -> None:
        if value is not None:
            raise ModelError("a motion also ties or fixes boundaries: give it to model.add(...)")
        self._motion = None

    # ---- loads --------------------------------------------------------------------------------

    def add(
        self,
        load: Load | Attachment,
        *,
        amplitude: Factor | None = None,
        name: str | None = None,
        override: bool = False,
    ) -> None:
        """Add a load (loads add up), or the motion of the material through the mesh (there is one).

        Parameters
        ----------
        load : such as `Gravity` or `Traction`; or a motion such as `kratos_lite.ale.Rotation`.
        amplitude : number, `TimeSeries` or function of time in s that multiplies the load; statics uses its
            value at t = 0.
        name : by which `remove` and `named_loads` know the load.  An equal one of this name is added once.
        override : let the load replace the one of its name.

        Raises
        ------
        InputError
            `load` is neither a load nor a motion, or the amplitude is invalid.
        MeshError
            There is no such part or node, or the point of a load lies outside the mesh.
        ModelError
            The motion does not fit the model, there is one already, or another load has the name.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
        >>> model.add(kl.Gravity((0, 0, -9.81)), amplitude=kl.TimeSeries([0.0, 1.0], [0.0, 2.0]))
        >>> model.loads[0].amplitude(0.5)
        1.0
        """
        if isinstance(load, Attachment):
            if amplitude is not None or name is not None:
                raise InputError("a motion takes no amplitude (its rate may be a function of time) nor name")
            load.attach(self)
            self._motion = load
            return
        if not isinstance(load, Load):
            raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
        load = load if amplitude is None else ScaledLoad(load, amplitude)
        load.check(self.mesh)
        key, named = key_of(load), self.named_loads
        if name is not None:
            instance(name, "the name of a load", str, "'wind'")
        if name in named:
            if key_of(named[name]) == key:
                return
            if not override:
                raise ModelError(
                    f"there is another load {name!r} already, {named[name]!r}; replace it by override=True, "
                    f"or take it away by model.remove({name!r})"
                )
            self.loads[:] = [load if other is named[name] else other for other in self.loads]
        else:
            self._tell_equal(load, key)
            self.loads.append(load)
        self._keys[key] = load
        if name is not None:
            self._named[name] = load

    def _tell_equal(self, load: Load, key: Hashable) -> None:
        """Log a warning if an equal load is there already; the report has it, too."""
        if _place(self.loads, self._keys.get(key)) is not None:
            import logging  # a quick start without it

            logging.getLogger("kratos_lite").warning(
                "an equal load %r is there already; both act.  If one alone is meant, as where a cell of a "
                "notebook is run twice, give it a name: model.add(load, name=...)",
                load,
            )

    @property
    def named_loads(self) -> dict[str, Load]:
        """The loads that have a name, by their names."""
        there = set(map(id, self.loads))
        return {name: load for name, load in self._named.items() if id(load) in there}

    def remove(self, load: str | Load) -> None:
        """Take a load away.

        Parameters
        ----------
        load : its name, or the load itself; the last one if it was added several times.

        Raises
        ------
        ModelError
            There is no such load.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.add(kl.Traction("x+", (0.0, 2e3, 0.0)), name="wind")
        >>> model.named_loads
        {'wind': Traction(where='x+', traction=(0, 2000, 0))}
        >>> model.remove("wind")
        >>> model.loads
        []
        """
        named = self.named_loads
        wanted = named.get(load) if isinstance(load, str) else load
        place = _place(self.loads, wanted)
        if place is None:
            names = f"; the names are {', '.join(named)}" if named else "; none has a name"
            hint = nearest(load, named) if isinstance(load, str) else ""
            raise ModelError(f"there is no load {load!r}{names}.{hint}")
        del self.loads[place]

    # ---- checks -------------------------------------------------------------------------------

    def checked(self) -> tuple[list[ElementGroup], list[str]]:
        """Return what a solution starts from, of a model that passes all checks but that of `free_motions`.

        Returns
        -------
        Element groups and warnings.

        Raises
        ------
        MeshError, ModelError, InputError
            With every element or part that is wrong.
        """
        warnings, groups = self.check_geometry(), self.element_groups()
        return groups, [*warnings, *(text for check in CHECKS for text in check(self, groups))]

    def free_motions(self, groups: list[ElementGroup]) -> FreeMotions:
        """Return the rigid motions that supports leave free, part by part.

        Parameters
        ----------
        groups : the elements, as `checked` returns them.

        Returns
        -------
        FreeMotions
        """
        return free_motions(self.mesh, self.supports, groups)

    def remarks(self) -> list[str]:
        """Return what readers of files noted, and constants of materials that no engineering material has.

        Returns
        -------
        Notes, one sentence each.
        """
        return [*self.notes, *checks.unusual_constants(self._used_materials())]

    def _used_materials(self) -> list[LinearMaterial]:
        used = distinct(self._material_of)
        return [self._materials[i] for i in used[used >= 0]]

    # ---- summary ------------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of a summary.

        Returns
        -------
        Labels and values.
        """
        without = int((self._material_of < 0).sum())
        rows = self.mesh.table()
        rows += [("formulation", text)] if (text := self.chosen()) else []
        rows += [("material", str(material)) for material in self._used_materials()]
        rows += [("material", f"none for {without} elements")] if without else []
        rows.append(("fixed", f"{self.supports.fixed.sum()} components"))
        rows += [("support", str(fixing)) for fixing in self.supports.named.values()]
        if self.supports.constraints:
            rows.append(("constraints", str(len(self.supports.constraints))))
        names = {id(load): f"{name}: " for name, load in self.named_loads.items()}
        rows += [("load", f"{names.get(id(load), '')}{load!r}") for load in self.loads]
        rows += [] if self.motion is None else [("motion", str(self.motion))]
        return rows + [("note", note) for note in self.remarks()]

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}({self.mesh.n_nodes} nodes, {self.mesh.n_elements} elements, {len(self.loads)} loads)"


CHECKS: tuple[Callable[[Structure, Sequence[ElementGroup]], list[str]], ...] = (
    lambda model, groups: check_rules(model.mesh, groups),
    lambda model, groups: check_joints(model.mesh),
    lambda model, groups: check_coincident(model.mesh, model.supports.constraints),
    lambda model, groups: checks.check_scales(model.mesh, groups),
    lambda model, groups: check_locking(model.mesh, groups),
    lambda model, groups: check_spurious_modes(model.mesh, groups, model.supports),
    lambda model, groups: checks.check_nodes(model.mesh),
    lambda model, groups: model.supports.check_used(model.mesh.used_nodes()),
    lambda model, groups: [text for load in model.loads for text in load.warnings(model.mesh, groups)],
)
"""What is checked of each model with sound cells: a check returns warnings, or raises an error."""


def _place(loads: list[Load], wanted: object) -> int | None:
    """Return where a load stands in a list, the last one if it does several times, or None."""
    found = [i for i, load in enumerate(loads) if wanted in (load, getattr(load, "load", load))]
    return found[-1] if found else None
