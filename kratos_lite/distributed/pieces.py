"""Pieces: what each rank has of a mesh before it is shared: by ids, and with whatever it happens to know."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kratos_lite.distributed.directory import Asked, all_of
from kratos_lite.distributed.lookup import Lookup, merged
from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import MeshError
from kratos_lite.mesh import NO_ROWS, Block, Part
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Rows


@dataclass(frozen=True, eq=False)
class Kind:
    """Cells of one kind by the ids of their nodes: what is a `Block` once the nodes are here.

    Parameters
    ----------
    name : as of a block.
    nodes : (m, k) int, ids of nodes.
    ids, properties : (m,) int.
    shape : the reference cell; if not given, that of the registered element of this name, or None.
    lines : (m,) int, line of each cell in the file, or None; the cells of a block stand in the order of the
        lines, or else of the ids.
    place : number by which the blocks stand in order, such as the line where the block begins in the file.
        Kinds of several ranks that agree in name and place are one block.
    """

    name: str
    nodes: Ints
    ids: Ints
    properties: Ints
    shape: type[Shape] | None = None
    lines: Ints | Rows | None = None
    place: int = 0

    def __post_init__(self) -> None:
        if self.shape is None and self.name in ELEMENTS:
            vars(self)["shape"] = ELEMENTS[self.name].shape

    @property
    def table(self) -> Ints:
        """(m, 3 + k) int, all of it in one array: ids, properties, lines and nodes."""
        lines = np.full(len(self.ids), -1) if self.lines is None else self.lines
        return np.column_stack([self.ids, self.properties, lines, self.nodes])

    def with_table(self, table: Ints) -> Kind:
        """Return the kind of other cells, in order."""
        has_lines = self.lines is not None
        table = table[np.lexsort((table[:, 0], table[:, 2]))]
        return replace(
            self,
            ids=table[:, 0],
            properties=table[:, 1],
            lines=table[:, 2] if has_lines else None,
            nodes=table[:, 3:],
        )

    def block(self, rows: Ints) -> Block:
        """Return the block with rows (m, k) of nodes."""
        return Block(self.name, rows.astype(np.int32), self.ids, self.properties, self.shape, self.lines)


@dataclass(frozen=True, eq=False)
class Piece:
    """What one rank has of a mesh, by ids.

    Parameters
    ----------
    elements : own elements; each element is given by one rank.
    conditions : of any elements; each is given by one rank.
    node_ids, points : (n,) int and (n, 3) float in m, the nodes that this rank knows, whether or not it needs
        them; several ranks may know the same.
    owners : (n,) int, the rank that is to own each of these nodes, -1 if any; or None.
    parts : named parts, with ids of nodes, elements and conditions where those of a mesh have rows; each rank
        knows any share of a part.
    wanted : (w,) int, ids of nodes that are to be here in any case, as ghosts unless they are own.
    """

    elements: tuple[Kind, ...] = ()
    conditions: tuple[Kind, ...] = ()
    node_ids: Ints = field(default_factory=lambda: NO_ROWS)
    points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    owners: Ints | Rows | None = None
    parts: dict[str, Part] = field(default_factory=dict)
    wanted: Ints = field(default_factory=lambda: NO_ROWS)


def aligned(ranks: Alone, kinds: tuple[Kind, ...]) -> tuple[Kind, ...]:
    """Return the kinds that any rank has, the same ones in the same order on all ranks; some are empty.

    A kind without cells on any rank is left out.
    """
    mine = [(k.place, k.name, k.shape, k.nodes.shape[1], k.lines is not None) for k in kinds if len(k.ids)]
    found: dict[tuple[int, str], Any] = {}
    for all_of_rank in ranks.gather(mine):
        for place, name, *rest in all_of_rank:
            found.setdefault((place, name), rest)
    out = []
    for (place, name), (shape, width, has_lines) in sorted(found.items(), key=lambda one: one[0][0]):
        none = np.zeros((0, width), dtype=np.int64)
        empty = Kind(name, none, NO_ROWS, NO_ROWS, shape, NO_ROWS if has_lines else None, place)
        same = [kind.table for kind in kinds if (kind.place, kind.name) == (place, name) and len(kind.ids)]
        out.append(empty.with_table(np.concatenate([empty.table, *same])))
    return tuple(out)


def cell_ids(kinds: tuple[Kind, ...]) -> Ints:
    """Return the ids of all cells, in order."""
    return np.concatenate([NO_ROWS, *(kind.ids for kind in kinds)])


def check_once(ranks: Alone, kinds: tuple[Kind, ...], word: str) -> None:
    """Raise MeshError if the id of a cell is given twice, by one rank or by several."""
    asked = Asked(ranks, cell_ids(kinds))
    counts = np.bincount(asked.rows, minlength=len(asked.known))
    if counts.max(initial=0) > 1:
        row = int(np.argmax(counts > 1))
        who = " and ".join(map(str, asked.sources[asked.rows == row].tolist()))
        raise MeshError(f"{word} {asked.known[row]} is given by the ranks {who}; each gives its own {word}s")


def parts_here(ranks: Alone, parts: dict[str, Part], have: dict[str, Ints]) -> dict[str, Part]:
    """Return the parts that any rank knows, with the rows of what this rank has, ascending.

    Parameters
    ----------
    parts : with ids in place of rows.
    have : ids of the nodes, elements and conditions that are here.
    """
    all_of_ranks = ranks.gather({name: (p.properties, p.tables, p.data) for name, p in parts.items()})
    names = list(dict.fromkeys(name for known in all_of_ranks for name in known))
    rows = {what: _members(ranks, names, parts, what, ids) for what, ids in have.items()}
    out = {}
    for number, name in enumerate(names):
        known = [of_rank[name] for of_rank in all_of_ranks if name in of_rank]
        properties, tables = (tuple(dict.fromkeys(i for one in known for i in one[n])) for n in (0, 1))
        data: dict[str, Any] = {}
        for one in reversed(known):
            data |= one[2]
        mine = {what: found[number] for what, found in rows.items()}
        out[name] = replace(parts.get(name, Part()), properties=properties, tables=tables, data=data, **mine)
    return out


def _members(ranks: Alone, names: list[str], parts: dict[str, Part], what: str, ids: Ints) -> list[Ints]:
    """Return the rows of the nodes, elements or conditions of each part."""
    given = [getattr(parts[name], what) if name in parts else NO_ROWS for name in names]
    if not ranks.any(any(map(len, given))):
        return [NO_ROWS] * len(names)
    numbers = np.repeat(np.arange(len(names)), [len(one) for one in given])
    found, part = all_of(ranks, np.concatenate(given), numbers[:, None], ids)
    rows = Lookup(ids).rows(found)
    pairs = merged(part[:, 0] * max(len(ids), 1) + rows)
    ends = np.searchsorted(pairs, np.arange(1, len(names)) * max(len(ids), 1))
    return [one % max(len(ids), 1) for one in np.split(pairs, ends)]
