"""Structure: a mesh with materials, supports, loads and motion, which is what is analyzed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.attached import Attached
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import PatternCache
from kratos_lite.errors import InputError, MeshError, ModelError, nearest
from kratos_lite.materials import Material
from kratos_lite.mesh import Mesh, Where
from kratos_lite.model import checks
from kratos_lite.model.attachments import AddedMass, AttachedMatrix, Attachment, Place
from kratos_lite.model.free_motions import FreeMotions, free_motions
from kratos_lite.model.joints import check_coincident, check_joints
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.model.loads.base import key_of, warnings_of
from kratos_lite.model.local_axes import Cartesian, LocalAxes, normal_of_plane
from kratos_lite.model.locking import check_locking
from kratos_lite.model.matching import BoltForce, Cut, Periodic
from kratos_lite.model.remote_point import RemotePoint
from kratos_lite.model.solid import Solid
from kratos_lite.model.spurious_modes import check_rules, check_spurious_modes
from kratos_lite.model.supports import AXES, DirichletCondition, Supports, axis_numbers
from kratos_lite.model.ties import Tie, name_of
from kratos_lite.time_series import Factor
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import finite, function_or_none, instance, number, short

ROWS = 20
"""Of one kind that a summary has."""


class Structure(Solid):
    """What is analyzed: a solid with supports, loads and motion; `Model` adds the analyses."""

    def __init__(
        self,
        mesh: Mesh,
        material: Material | Mapping[Any, Material] | None = None,
        formulation: str | None = None,
        units: str | None = None,
    ) -> None:
        super().__init__(mesh, material, formulation, None if units == "auto" else units)
        self.supports = Supports(mesh)
        self.attachments: list[AttachedMatrix] = []  # springs and added masses
        self.attached: Attached | None = None  # their matrices
        self.loads: list[Load] = []  # the list may be changed
        self._named: dict[str, Load] = {}
        self._motion: Attachment | None = None
        self.notes: list[str] = []  # what readers of files remarked, for the report
        self.patterns = PatternCache()
        if units == "auto":
            self.recognize_units()

    def recognize_units(self) -> None:
        """Use the units that E and density of the materials tell, and note which, or that they tell none."""
        used = self._used_materials()
        units = checks.recognized_units(used) if used else None
        if units is None:
            self.notes.append(f"units: not recognized from E and density of the materials; {self.units}")
        else:
            self.mesh.use_units(units)
            named = ", ".join(map(str, used[:3])) + " …" * (len(used) > 3)
            self.notes.append(f"units: {', '.join(units.split())} (recognized from E and density of {named})")

    @property
    def is_nonlinear(self) -> bool:
        """Whether a law is not linear, an element has large displacements, or a load follows the body."""
        loads = (getattr(load, "load", load) for load in self.loads)  # that of one with an amplitude
        return super().is_nonlinear or any(getattr(load, "follower", False) for load in loads)

    @property
    def version(self) -> tuple[int, int]:
        """Change counters of everything that affects the equations except prescribed values and loads."""
        return self._changes, self.supports.version

    # ---- supports ------------------------------------------------------------------------------

    def fix(
        self,
        where: Where,
        axes: str = "xyz",
        value: ArrayLike | Callable[[float], Any] = 0.0,
        *,
        field: Callable[[Array], ArrayLike] | None = None,
        override: bool = False,
        name: str | None = None,
        local: LocalAxes | None = None,
    ) -> None:
        """Prescribe the displacement of nodes.

        Parameters
        ----------
        where : part name, point (x, y, z) in m, predicate on the points (n, 3), mask or node indices.
        axes : some of ``"x"``, ``"y"``, ``"z"``, such as ``"xz"``.
        value : m; one number, one per axis, or one row per node; or a `TimeSeries` or function of time in s,
            which statics take at the time 0.  A function returns a number, or (n,) for all nodes; in
            quasi-static analysis also None, where the support does not act.
        field : in place of a value, a function of places (k, 3) in m that returns one row per node or one
            number per axis in m.  A mesh that is made finer takes its values, others are interpolated.
        override : let this value win over an earlier one for the same degree of freedom, and this support
            replace the one of its name.
        name : by which `release` knows the support.
        local : axes such as `Cylindrical`, whose letters ``axes`` are then; values are constant, and the
            support is released by its name alone.

        Raises
        ------
        ModelError
            If no node is chosen, a degree of freedom gets two different values, or another support has
            the name.
        InputError
            The axes or the value make no sense.
        MeshError
            There is no such part or node.
        """
        nodes = self.mesh.nodes(where)
        if self.mesh.whole and not len(nodes):
            what = f"part {where!r} has no nodes" if isinstance(where, str) else "no node is chosen"
            raise ModelError(f"cannot fix {axes}: {what}")
        function_or_none(field, "field must be a function of places (k, 3)")
        if name is not None:
            instance(name, "the name of a support", str, "'clamp'")
        if local is not None:
            instance(local, "local", LocalAxes, "kl.Cylindrical()")
        self.supports.add(DirichletCondition(where, nodes, axes, value, field, override, name, local=local))

    def symmetry(self, where: Where, *, anti: bool = False, name: str | None = None) -> None:
        """Hold a plane of symmetry: no displacement across it; of antisymmetry: none along it.

        Parameters
        ----------
        where : its nodes, as for `fix`; those of a part whose faces lie in one plane.
        anti : whether the body moves antisymmetrically.
        name : by which `release` knows the support.

        Raises
        ------
        ModelError
            The nodes lie in no plane, or on a line.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.symmetry("x-")
        >>> model.supports.fixed[:, 0].sum(), model.supports.fixed[:, 1:].any()
        (np.int64(4), np.False_)
        """
        nodes = self.mesh.nodes(where)
        normal = normal_of_plane(self.mesh.points[nodes], name_of(where, nodes))
        across, local = AXES[normal.argmax()], None
        if np.count_nonzero(normal) > 1:
            across, local = "x", Cartesian(normal)
        self.fix(where, AXES.replace(across, "") if anti else across, name=name, local=local)

    def release(self, where: Where, axes: str = "xyz") -> None:
        """Take supports away: one by its name, or whatever holds some nodes along axes.

        Parameters
        ----------
        where : name of a support; what others prescribe on its nodes stays.  Or nodes, as for `fix`.
        axes : of the nodes, such as ``"xz"``.

        Raises
        ------
        InputError
            The axes make no sense.
        MeshError
            There is no such support, part or node.
        ModelError
            Nothing is prescribed there.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.fix("x-", name="clamp")
        >>> model.fix("z-", "z")
        >>> print(model.supports)
        clamp: x-, xyz = 0 m
        z-, z = 0 m
        >>> model.release("clamp")
        >>> int(model.supports.fixed.sum())
        4
        """
        named = self.supports.named
        if isinstance(where, str) and where in named:
            self.supports.drop(named[where])
            return
        try:
            nodes = self.mesh.nodes(where)
        except MeshError as error:
            if not (named and isinstance(where, str)):
                raise
            hint = nearest(where, named)
            raise MeshError(f"{error}; named supports are {', '.join(named)}.{hint}") from None
        fixed = self.supports.fixed[np.ix_(nodes, np.array(axis_numbers(axes)))]
        if self.mesh.whole and not fixed.any():
            raise ModelError(f"nothing is prescribed along {axes} there, so that nothing is released")
        self.supports.add(DirichletCondition(where, nodes, axes, released=True))

    def constrain(
        self,
        dependents: tuple[int, str] | ArrayLike,
        independents: Mapping[tuple[int, str], float] | ArrayLike,
        constant: ArrayLike = 0.0,
        *,
        weights: ArrayLike = 1.0,
    ) -> None:
        """Tie degrees of freedom to others: u[dependent] = Σ weight · u[independent] + constant.

        Parameters
        ----------
        dependents : (node index, axis letter); or (c,) int, degrees of freedom 3·node + axis.
        independents : weights by (node index, axis letter); or (c,) or (c, k) int, k for each dependent.
        constant : m; one, or (c,).
        weights : of independents in arrays; one, or (c, k).

        Raises
        ------
        InputError
            A degree of freedom, weight or constant is invalid.

        Examples
        --------
        >>> import numpy as np, kratos_lite as kl
        >>> model = kl.Model(kl.box((2.0, 1.0, 1.0), (2, 1, 1)), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.constrain((0, "x"), {(3, "x"): 1.0})  # u_x of node 0 is that of node 3
        >>> left, right = (np.flatnonzero(model.mesh.points[:, 0] == x) for x in (0.0, 2.0))
        >>> model.constrain(3 * left + 1, 3 * right + 1)  # u_y of both ends alike, node by node
        >>> len(model.supports.constraints)
        5
        """
        self.supports.constrain(dependents, independents, weights, constant)

    def tie(self, a: Where, b: Where, *, tolerance: float | None = None) -> None:
        """Tie two parts of the surface, whose nodes need not match: in the mean over faces both move alike.

        The nodes of the finer part depend on those of the other, or those of the part that the other covers.
        Constant stress passes through plane faces to rounding, and rigid motions leave no force where faces
        are curved or apart.  Supports and other constraints of dependent nodes stay.

        Parameters
        ----------
        a, b : parts, as for `fix`, with faces and without common nodes.
        tolerance : m, distance up to which faces are tied; 0.2 of the radius of the larger face if not given.

        Raises
        ------
        ModelError
            A part has no faces, nodes are in both or hang, or neither part covers the other.
        MeshError
            There is no such part or node.

        Notes
        -----
        Mortar method with dual multipliers: Puso, Int. J. Numer. Meth. Eng. 59 (2004) 315-336; Popp,
        Wohlmuth, Gee & Wall, SIAM J. Sci. Comput. 34 (2012) B421-B446.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> lower, upper = kl.box((1, 1, 1), (2, 2, 2)), kl.box((1, 1, 1), (3, 3, 3), origin=(0, 0, 1))
        >>> model = kl.Model(kl.join({"lower": lower, "upper": upper}), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.tie("lower.z+", "upper.z-")
        >>> model.fix("z-")
        >>> model.add(kl.Traction("z+", (0, 0, 1e6)))
        >>> round(float(model.solve().reaction("z-")[:, 2].sum()))
        -1000000
        """
        self.supports.add_tie(Tie(self.mesh, a, b, tolerance))

    def periodic(self, a: Where, b: Where, *, strain: ArrayLike | None = None) -> None:
        """Make opposite parts periodic, but for the mean strain of the cell: u_b - u_a = E (x_b - x_a).

        A cell may have three pairs of parts with common edges, and supports that hold some of their nodes.

        Parameters
        ----------
        a, b : parts, as for `fix`, whose nodes lie opposite one another.
        strain : of all pairs, one for a cell: (6,), in the order xx yy zz xy yz zx with engineering shear, or
            (3, 3), the gradient of displacements.  The last one that is given holds; 0 if there is none.

        Raises
        ------
        ModelError
            The nodes do not lie opposite one another.
        InputError
            The strain has another shape, or is not finite.
        MeshError
            There is no such part or node.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.0))
        >>> for a, b in (("x-", "x+"), ("y-", "y+"), ("z-", "z+")):
        ...     model.periodic(a, b, strain=(1e-3, 0, 0, 0, 0, 0))
        >>> round(float(model.solve().stress()[0, 0, 0]))
        1000000
        """
        old = next((tie for tie in self.supports.ties if isinstance(tie, Periodic)), None)
        E = np.zeros((3, 3)) if old is None else old.strain
        if strain is not None:
            E = finite(strain, "a mean strain")
            if E.shape not in ((6,), (3, 3)):
                raise InputError(f"a mean strain is xx yy zz xy yz zx, or (3, 3); got {short(strain)}")
            E = E if E.shape != (6,) else voigt.tensor(E * voigt.HALF_SHEAR)
        if old is None or not old.has(a, b):
            old = Periodic(self.mesh, [*(old.parts if old else []), (a, b)], E)
        self.supports.add_tie(old.strained(E))

    def pretension(
        self,
        a: Where,
        b: Where,
        *,
        force: float | None = None,
        length: float | None = None,
        amplitude: Factor | None = None,
        name: str | None = None,
    ) -> None:
        """Pull the two sides of a cut together, as a nut tightens a bolt: by a force, or by a length.

        Both sides move alike but for one common way along the normal of the cut.  Said again for the same
        cut, the new one holds: a bolt is tightened by a force, then locked by the length that this takes.

        Parameters
        ----------
        a, b : the sides, parts with faces whose nodes lie at the same places, as of ``kl.split``.
        force : N, tension in the bolt: a load; in load cases without it the bolt is loose.
        length : m, by which the bolt becomes shorter.
        amplitude : of the force, as for `add`.
        name : of the load, as for `add`.

        Raises
        ------
        InputError
            There is not one of force and length.
        ModelError
            A side has no faces, their nodes do not lie at the same places, or another load has the name.
        MeshError
            There is no such part or node.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bolt = kl.split(kl.box(cells=(1, 1, 4)), lambda X: X[:, 2] == 0.5)
        >>> model = kl.Model(bolt, kl.Isotropic3D(E=1e9, nu=0.0))
        >>> model.fix("z-")
        >>> model.fix("z+")
        >>> model.pretension("cut-", "cut+", force=1e6)
        >>> result = model.solve()
        >>> print(f"{result.stress()[0, 0, 2]:.6g} Pa")
        1e+06 Pa
        >>> way = (result.displacement("cut-") - result.displacement("cut+"))[0, 2]
        >>> model.pretension("cut-", "cut+", length=way)
        >>> print(f"{model.solve().reaction('cut-')[:, 2].sum():.6g} N")
        1e+06 N
        """
        if (force is None) == (length is None):
            raise InputError("a pretension is a force in N or a length in m; give one of them")
        if name is not None:
            instance(name, "the name of a load", str, "'bolt'")
        length = None if length is None else number(length, "the length of a pretension", least=-np.inf)
        load = None if force is None else BoltForce(a, b, force)
        cut = Cut(self.mesh, a, b, length)
        self.loads[:] = [other for other in self.loads if not cut.is_pulled_by(getattr(other, "load", other))]
        if load is not None:
            self.add(load, amplitude=amplitude, name=name)
        self.supports.add_tie(cut)

    def rigid(self, where: Where, point: ArrayLike) -> RemotePoint:
        """Let all nodes of a part follow a point rigidly, by small rotations.

        Parameters
        ----------
        where : nodes, as for `fix`, that do not lie on a line.
        point : (3,) m; it need not be a node.

        Returns
        -------
        RemotePoint
            By which the part is loaded, held and read; as long as it is not held, it is free to move.

        Raises
        ------
        ModelError
            There is no node.
        MeshError
            There is no such part or node.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box((4.0, 1, 1), (4, 2, 2)), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.fix("x-")
        >>> end = model.rigid("x+", (6.0, 0.5, 0.5))
        >>> model.add(end.load((0, 0, -100.0)))
        >>> result = model.solve()
        >>> bool(end.displacement(result)[2] < result.displacement("x+")[:, 2].min() < 0)
        True
        """
        return self._remote(where, point, rigid=True)

    def distribute(self, where: Where, point: ArrayLike) -> RemotePoint:
        """Let a point move as the faces of a part do in the mean; they stay flexible.

        Parameters
        ----------
        where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
        point : (3,) m; it need not be a node.

        Returns
        -------
        RemotePoint
            Force and moment on it are spread over the faces; what is prescribed of it, their mean does.

        Raises
        ------
        ModelError
            There is no face.
        MeshError
            There is no such part or node.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box((4.0, 1, 1), (4, 2, 2)), kl.Isotropic3D(E=1e9, nu=0.3))
        >>> model.distribute("x-", (0, 0.5, 0.5)).fix("x")
        >>> model.distribute("x+", (4.0, 0.5, 0.5)).fix("x", 1e-3)
        >>> [model.fix(side, axis) for side, axis in (("y-", "y"), ("z-", "z"))]
        [None, None]
        >>> float(model.solve().stress("element")[:, 0].mean().round(3))
        250000.0
        """
        return self._remote(where, point, rigid=False)

    def _remote(self, where: Where, point: ArrayLike, rigid: bool) -> RemotePoint:
        new = RemotePoint(self.supports, where, point, rigid)
        self.supports.add_tie(new)
        return new

    @property
    def remote_points(self) -> list[RemotePoint]:
        """The remote points; see `rigid` and `distribute`."""
        return [tie for tie in self.supports.ties if isinstance(tie, RemotePoint)]

    def add_mass(self, where: Place, mass: float, inertia: ArrayLike | None = None) -> None:
        """Add mass, which has weight under gravity on the whole body.

        Parameters
        ----------
        where : a point (x, y, z) in m, a `RemotePoint`, or a part over whose faces it is spread by area.
        mass : kg.
        inertia : (3, 3) kg m² about a remote point; none if not given.

        Raises
        ------
        InputError
            Mass or inertia make no sense.
        MeshError, ModelError
            There is no such part, or it has no faces.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
        >>> model.fix("z-")
        >>> model.add_mass("z+", 500.0)
        >>> model.add(kl.Gravity((0, 0, -10.0)))
        >>> float(model.solve().reactions[:, 2].sum().round(6))
        15000.0
        """
        self.add(AddedMass(where, mass, inertia))

    def reactions(self, residual: Array, u: Array) -> Array:
        """Return the forces of supports, constraints and springs on the body.

        Parameters
        ----------
        residual : (n, 3) N, internal and inertia forces less loads.
        u : (n, 3) m.

        Returns
        -------
        (n, 3) N, 0 where none of them acts.
        """
        forces = self.supports.supported(residual)
        return forces + self.supports.on_independents(self.attached.forces(u)) if self.attached else forces

    # ---- loads and motion ----------------------------------------------------------------------

    @property
    def motion(self) -> Attachment | None:
        """Motion of the material through the mesh, or None; `add` takes one, None takes it away."""
        return self._motion

    @motion.setter
    def motion(self, value: None) -> None:
        if value is not None:
            raise ModelError("a motion also ties or fixes boundaries: give it to model.add(...)")
        self._motion = None

    def add(
        self,
        load: Load | Attachment,
        *,
        amplitude: Factor | None = None,
        name: str | None = None,
        override: bool = False,
    ) -> None:
        """Add a load (loads add up), springs, or the motion of the material through the mesh (there is one).

        Parameters
        ----------
        load : such as `Gravity` or `Traction`; `ElasticSupport`; or a motion such as
            `kratos_lite.ale.Rotation`.
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
                text = "a motion (its rate may be a function of time) or a spring"
                raise InputError(f"{text} takes no amplitude nor name")
            load.attach(self)
            return
        if not isinstance(load, Load):
            hint = ", which acts on bodies" if type(load).__module__.startswith("kratos_lite.bodies") else ""
            what = f"the class {load.__name__}: call it" if isinstance(load, type) else type(load).__name__
            raise InputError(f"a load such as Gravity or Traction is needed; got {what}{hint}")
        load = load if amplitude is None else ScaledLoad(load, amplitude)
        load.check(self.mesh)
        if name is not None:
            instance(name, "the name of a load", str, "'wind'")
        if name in self._named and (old := self.named_loads.get(name)) is not None:
            if key_of(old) == key_of(load):
                return
            if not override:
                raise ModelError(
                    f"there is another load {name!r} already, {old!r}; replace it by override=True, "
                    f"or take it away by model.remove({name!r})"
                )
            self.loads[:] = [load if other is old else other for other in self.loads]
        else:
            self.loads.append(load)
        if name is not None:
            self._named[name] = load

    @property
    def named_loads(self) -> dict[str, Load]:
        """The loads that have a name, by their names."""
        there = set(map(id, self.loads))
        return {name: load for name, load in self._named.items() if id(load) in there}

    def _label(self, load: Load) -> str:
        """Return what stands before a load: its name and a colon, or nothing."""
        return next((f"{name}: " for name, named in self._named.items() if named is load), "")

    def _said(self, load: Load, words: Callable[[Load], str] = repr) -> str:
        """Return a load with its name and unit."""
        return f"{self._label(load)}{words(load)}{getattr(load, 'load', load).unit}"

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
        places = [i for i, other in enumerate(self.loads) if wanted in (other, getattr(other, "load", other))]
        if not places:
            names = f"; the names are {', '.join(named)}" if named else "; none has a name"
            hint = nearest(load, named) if isinstance(load, str) else ""
            raise ModelError(f"there is no load {load!r}{names}.{hint}")
        del self.loads[places[-1]]

    # ---- checks -------------------------------------------------------------------------------

    def check_geometry(self) -> list[str]:
        """Return warnings of coordinates, node lists and det J of all elements, whatever their material.

        Raises
        ------
        MeshError, InputError
            With every element that is wrong.
        """
        return checks.check_geometry(self.mesh, self.formulation)

    def checked(self, *, loads: bool = True) -> tuple[list[ElementGroup], list[str]]:
        """Return element groups and warnings of a model that passes all checks but that of `free_motions`.

        Parameters
        ----------
        loads : whether functions of its loads are checked for jumps, too.

        Returns
        -------
        list of ElementGroup, list of str

        Raises
        ------
        MeshError, ModelError, InputError
            With every element or part that is wrong.
        """
        warnings, groups = self.check_geometry(), self.element_groups()
        if self.initial_displacement is not None and any(group.element.finite for group in groups):
            raise ModelError(
                "a stress-free displacement is for small strains; move the nodes of the mesh instead"
            )
        warnings += [text for check in CHECKS for text in check(self, groups)]
        return groups, warnings + (warnings_of(self.loads, self.mesh, groups) if loads else [])

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
        """Return what readers of files noted, and constants that no material has in SI, as in no units."""
        return [*self.notes, *(self._unusual_constants() if self.units == "SI" else [])]

    def _unusual_constants(self) -> list[str]:
        return list(dict.fromkeys(checks.unusual_constants(self._used_materials(), self.units)))

    # ---- summary ------------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return labels and values of a summary."""
        without = int((self._material_of < 0).sum())
        rows = [*self.mesh.table(), *([] if self.units == "SI" else [("units", self.units)])]
        rows += [("formulation", text)] if (text := self.chosen()) else []
        rows += [("material", str(material)) for material in self._used_materials()]
        rows += [("material", f"none for {without} elements")] if without else []
        if self._factors is not None:
            span = f"{self._factors.min():g} … {self._factors.max():g}"
            rows.append(("stiffness", f"times {span}, a factor for each element"))
        rows.append(("fixed", f"{self.supports.fixed.sum()} components"))
        rows += _first([("support", str(condition)) for condition in self.supports.conditions])
        rows += _first([(tie.title, str(tie)) for tie in self.supports.ties])
        rows += _first([("attached", repr(attachment)) for attachment in self.attachments])
        if len(self.supports.constraints):
            rows.append(("constraints", str(len(self.supports.constraints))))
        rows += _first([("load", self._said(load)) for load in self.loads])
        rows += [] if self.motion is None else [("motion", str(self.motion))]
        return rows + [("note", note) for note in self.remarks()]

    def __repr__(self) -> str:
        name = type(self).__name__
        return f"{name}({self.mesh.n_nodes} nodes, {self.mesh.n_elements} elements, {len(self.loads)} loads)"


def _first(rows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the first rows of a kind, and how many more there are."""
    more = len(rows) - ROWS
    return rows if more <= 0 else [*rows[:ROWS], (rows[0][0], f"and {more} more")]


CHECKS: tuple[Callable[[Structure, Sequence[ElementGroup]], Iterable[str]], ...] = (
    lambda model, groups: check_rules(model.mesh, groups),
    lambda model, groups: check_joints(model.mesh),
    lambda model, groups: check_coincident(model.mesh, model.supports),
    lambda model, groups: checks.check_scales(model.mesh, groups),
    lambda model, groups: [] if model.units == "SI" else model._unusual_constants(),
    lambda model, groups: check_locking(model.mesh, groups),
    lambda model, groups: check_spurious_modes(model.mesh, groups, model.supports),
    lambda model, groups: checks.check_nodes(model.mesh, model.supports.added),
    lambda model, groups: model.supports.check_used(),
    lambda model, groups: [text for tie in model.supports.ties for text in tie._check(groups, model.motion)],
    lambda model, groups: checks.check_attached(any(one.is_mass for one in model.attachments), model.motion),
)
"""What is checked of each model with sound cells: a check returns warnings, or raises an error."""
