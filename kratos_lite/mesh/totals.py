"""Totals: how many nodes, elements and conditions all processes have that share a mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block, Part, with_rows
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Mask

KINDS = ("nodes", "elements", "conditions")


class Totals:
    """How many nodes and cells a mesh has: each counts where it is own; all processes make this together.

    Parameters
    ----------
    ranks : the processes.
    elements, conditions : blocks of this one.
    own : masks of its own nodes, elements and conditions.
    parts : named parts of this one.

    Attributes
    ----------
    counts : how many nodes, elements and conditions there are.
    blocks : how many elements, and how many conditions, each block has.
    parts : how many nodes, elements and conditions each part has.

    Raises
    ------
    MeshError
        The processes have different blocks or parts.
    """

    def __init__(
        self,
        ranks: Alone,
        elements: Sequence[Block],
        conditions: Sequence[Block],
        own: tuple[Mask, Mask, Mask],
        parts: Mapping[str, Part],
    ) -> None:
        self._ranks, self._own = ranks, own
        _check_names(ranks, [*(block.name for block in (*elements, *conditions)), *parts])
        self.blocks = {
            what: self._sums([[int(mask[at].sum())] for _, at in with_rows(blocks)])
            for what, blocks, mask in zip(KINDS[1:], (elements, conditions), own[1:], strict=True)
        }
        counts = self._sums([[int(mask.sum())] for mask in own])
        self.counts = {what: count for what, (count,) in zip(KINDS, counts, strict=True)}
        self.parts: dict[str, list[int]] = {}
        self.add(parts)

    def add(self, parts: Mapping[str, Part]) -> None:
        """Count parts as well; all processes do so."""
        own = dict(zip(KINDS, self._own, strict=True))
        mine = [[int(own[what][getattr(part, what)].sum()) for what in KINDS] for part in parts.values()]
        self.parts |= dict(zip(parts, self._sums(mine), strict=True))

    def _sums(self, counts: list[list[int]]) -> list[list[int]]:
        """Return the sums over ranks."""
        return self._ranks.sum(np.array(counts, dtype=np.int64)).tolist() if counts else []


def _check_names(ranks: Alone, names: list[str]) -> None:
    """Raise MeshError where names of blocks or parts, or their order, are not the same everywhere."""
    if ranks.size == 1:
        return
    from zlib import crc32

    number = crc32("\n".join(names).encode())
    if not ranks.all(number == ranks.min(number)):
        found = ranks.gather(names)
        other = next(rank for rank, one in enumerate(found) if one != found[0])
        raise MeshError(
            f"ranks that share a mesh need the same blocks and parts; rank 0 has {', '.join(found[0])}, "
            f"rank {other} {', '.join(found[other]) or 'none'}"
        )
