"""Recovered stresses over ranks: those of each rank's grown subdomain, which reaches as far as patches do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, Kinds
from kratos_lite.assembly.recovery import Recovery, Region
from kratos_lite.distributed.grown import Grown
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array

LAYERS = 3
"""Elements around the nodes of own elements that recovered values there depend on.

A node on an edge has those of its ends, one on the surface that of a neighbor inside: of two layers.  Among
linear hexahedra, one more is added.
"""


class SharedRecovery(Recovery):
    """Recovered stresses and strains of a mesh that ranks share; all of them make it and ask together.

    Parameters
    ----------
    mesh : with a subdomain.
    groups : its elements.
    kinds : of the elements of all ranks.
    """

    def __init__(self, mesh: Mesh, groups: Sequence[ElementGroup], kinds: Kinds) -> None:
        assert mesh.subdomain is not None
        self._share, self._own = mesh.subdomain, mesh.own_elements
        self._grown = Grown(mesh, groups, kinds, LAYERS)
        self._displacements: tuple[Array, Array] | None = None
        super().__init__(self._grown.mesh, self._grown.groups)

    def nodal(self, u: Array, *, stress: bool = True) -> Array:
        """Return recovered stresses with prestress in Pa, or strains, at the nodes (n, 6) of this rank."""
        found = super().nodal(self._all(u), stress=stress)
        return np.asarray(self._share.fetch(found[: self._grown.n]))

    def by_region(self, u: Array, *, stress: bool = True) -> Iterator[tuple[Region, Array]]:
        """Yield each region of the grown subdomain with the values at its nodes (k, 6)."""
        if self._displacements is None or u is not self._displacements[1]:
            raise ModelError(
                "recovered stresses of one material, or at points, need the whole mesh on one process; take "
                "those at nodes, or of elements"
            )
        yield from super().by_region(u, stress=stress)

    def squared_errors(self, u: Array, n_elements: int) -> tuple[Array, Array]:
        """Return ∫ (σ* - σ) : C⁻¹ : (σ* - σ) dV of each own element, (m,) in J, 0 of others."""
        both = super().squared_errors(self._all(u), self._grown.mesh.n_elements)
        found = np.zeros((2, n_elements))
        for rows, grown in self._grown.rows:
            found[:, rows] = np.stack(both)[:, grown]
        found[:, ~self._own] = 0.0
        return found[0], found[1]

    def _all(self, u: Array) -> Array:
        """Return displacements of the grown subdomain; those asked for last are kept."""
        if self._displacements is None or self._displacements[0] is not u:
            self._displacements = u, self._grown.values(u)
        return self._displacements[1]
