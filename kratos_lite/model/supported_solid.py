"""Supported solid: a solid with prescribed displacements and multi-point constraints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.errors import InputError, MeshError, ModelError, nearest
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh, Where
from kratos_lite.model.fixing import AXES, Fixing
from kratos_lite.model.solid import Solid
from kratos_lite.model.supports import Supports
from kratos_lite.solvers.constraint_map import MultiPointConstraint, rigid_modes
from kratos_lite.typing import Array
from kratos_lite.validation import finite, function_or_none, instance

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class SupportedSolid(Solid):
    """A solid with supports.

    Parameters
    ----------
    mesh, material, formulation : as for a `Solid`, with the same errors.

    Attributes
    ----------
    supports : what is prescribed; see `fix`, `release` and `constrain`.
    """

    def __init__(
        self,
        mesh: Mesh,
        material: LinearMaterial | Mapping[Any, LinearMaterial] | None = None,
        formulation: str | None = None,
    ) -> None:
        super().__init__(mesh, material, formulation)
        self.supports = Supports(mesh)

    @property
    def version(self) -> tuple[int, int]:
        """Change counters of everything that affects the equations except prescribed values and loads."""
        return self._changes, self.supports.version

    def fix(
        self,
        where: Where,
        axes: str = "xyz",
        value: ArrayLike | Callable[[float], float] = 0.0,
        *,
        field: Callable[[Array], ArrayLike] | None = None,
        override: bool = False,
        name: str | None = None,
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
        override : let this value win over an earlier one for the same degree of freedom, and this support
            replace the one of its name.
        name : by which `release` knows the support.

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
        rows = self.mesh.nodes(where)
        if self.mesh.whole and not len(rows):
            what = f"part {where!r} has no nodes" if isinstance(where, str) else "no node is chosen"
            raise ModelError(f"cannot fix {axes}: {what}")
        function_or_none(field, "field must be a function of places (k, 3)")
        known = where if isinstance(where, str) or callable(where) else None
        fixing = Fixing(known, rows, axes, value, field, override, name)
        if name is not None:
            instance(name, "the name of a support", str, "'clamp'")
        if old := self.supports.named.get(name or ""):
            if old.key == fixing.key:
                return
            if not override:
                raise ModelError(
                    f"there is another support {name!r} already, {old}; replace it by override=True, or take "
                    f"it away by model.release({name!r})"
                )
        self.supports.apply(fixing)
        if old:
            self.supports.drop(old)

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
            rows = self.mesh.nodes(where)
        except MeshError as error:
            if not (named and isinstance(where, str)):
                raise
            hint = nearest(where, named)
            raise MeshError(f"{error}; named supports are {', '.join(named)}.{hint}") from None
        known = where if isinstance(where, str) or callable(where) else None
        self.supports.release(known, rows, axes)

    def constrain(
        self,
        dependent: tuple[int, str],
        independents: Mapping[tuple[int, str], float],
        constant: float = 0.0,
    ) -> None:
        """Tie a degree of freedom to others: u[dependent] = Σ weight · u[independent] + constant.

        Parameters
        ----------
        dependent : (node row, axis letter).
        independents : weights by (node row, axis letter).
        constant : m.

        Raises
        ------
        InputError
            A degree of freedom, weight or constant is invalid.
        """
        if not isinstance(independents, Mapping):
            raise InputError(
                f"independents must map (node row, axis letter) to a weight; got {independents!r}"
            )
        weights = finite(list(independents.values()), "weights of a constraint").tolist()
        offset = float(finite(constant, "the constant of a constraint"))
        constraint = MultiPointConstraint(
            self._dof(dependent), tuple(map(self._dof, independents)), tuple(weights), offset
        )
        self.supports.constraints = (*self.supports.constraints, constraint)

    def _dof(self, where: tuple[int, str]) -> int:
        """Return the number of a degree of freedom (node row, axis letter)."""
        node, axis = where if isinstance(where, tuple) and len(where) == 2 else (None, None)
        known = isinstance(node, (int, np.integer)) and 0 <= node < self.mesh.n_nodes
        if not known or axis not in tuple(AXES):
            raise InputError(f"a degree of freedom is (node row, axis letter); got {where!r}")
        return 3 * int(where[0]) + AXES.index(where[1])

    def rigid_modes(self) -> Array:
        """Return the rigid-body modes of all nodes.

        Returns
        -------
        (3n, 6): translations in x, y and z, rotations about x, y and z.
        """
        return rigid_modes(self.mesh.points)
