"""Bodies of a mesh that ranks share: one number for each on all ranks; and what holds them, in few rows."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh import Mesh, components, distinct
from kratos_lite.mesh.shared_faces import SharedFaces, places_of
from kratos_lite.typing import Array, Ints

LAST = np.iinfo(np.int64).max


def numbered(mesh: Mesh, body: Ints, count: int) -> tuple[Ints, int]:
    """Return bodies numbered over ranks, from those (m,) of the elements of this rank, and how many.

    A rank asks those that keep its elements which bodies of theirs they belong to; what is the same has one
    number, in the order of the first elements.
    """
    shared, ranks = SharedFaces(mesh), mesh.ranks
    counts = np.array(ranks.gather(count))
    first = int(counts[: ranks.rank].sum())
    label = first + body
    asked = np.flatnonzero(shared.element_keepers != ranks.rank)
    theirs = ranks.ask(
        shared.element_keepers[asked],
        shared.element_keys[asked],
        lambda keys: label[places_of(keys, shared.element_keys)],
    )
    links = np.stack([label[asked], theirs], axis=1)
    links = np.unique(links, axis=0)
    same = components(int(counts.sum()), np.concatenate(ranks.gather(links)))
    root = distinct(same)
    mine = np.searchsorted(root, same)
    block, ids = _first_elements(mesh, mine[label], len(root))
    place = np.empty(len(root), dtype=np.int64)
    place[np.lexsort((ids, block))] = np.arange(len(root))
    return place[mine[label]], len(root)


def _first_elements(mesh: Mesh, body: Ints, count: int) -> tuple[Ints, Ints]:
    """Return number of the block and id of the first element of each body."""
    number = np.repeat(np.arange(len(mesh.blocks)), [len(block) for block in mesh.blocks])
    block, ids = np.full(count, LAST), np.full(count, LAST)
    np.minimum.at(block, body, number)
    block = mesh.ranks.min(block)
    in_first = number == block[body]
    np.minimum.at(ids, body[in_first], mesh.element_ids[in_first])
    return block, mesh.ranks.min(ids)


def compressed(row: Ints, body: Ints, values: Array) -> list[tuple[tuple[int, ...], Array]]:
    """Return equations on rigid modes as few rows with the same singular values, by the bodies they concern.

    Parameters
    ----------
    row, body : (k,) int, equation and body of each entry.
    values : (k, 6), what the modes of the body are in it.

    Returns
    -------
    Pairs of b bodies and (r, 6 b) rows, r ≤ 6 b.
    """
    rows = distinct(row)
    at = np.searchsorted(rows, row)
    most = np.full(len(rows), -1)
    least = np.full(len(rows), LAST)
    np.maximum.at(most, at, body)
    np.minimum.at(least, at, body)
    alone = most == least
    sets: dict[tuple[int, ...], Ints] = {
        (int(b),): np.flatnonzero(alone & (most == b)) for b in distinct(most[alone])
    }
    several: dict[int, set[int]] = {}
    for r, b in zip(at.tolist(), body.tolist(), strict=True) if not alone.all() else ():
        several.setdefault(r, set()).add(b)
    joint: dict[tuple[int, ...], list[int]] = {}
    for r, members in several.items():
        if len(members) > 1:
            joint.setdefault(tuple(sorted(members)), []).append(r)
    sets |= {members: np.array(chosen) for members, chosen in joint.items()}
    return [(members, _triangle(members, chosen, at, body, values)) for members, chosen in sets.items()]


def _triangle(members: tuple[int, ...], chosen: Ints, at: Ints, body: Ints, values: Array) -> Array:
    """Return R of C = Q R, with C the chosen equations on the modes of their bodies."""
    place = np.full(int(at.max()) + 1, -1)
    place[chosen] = np.arange(len(chosen))
    mine = np.flatnonzero(place[at] >= 0)
    C = np.zeros((len(chosen), 6 * len(members)))
    columns = 6 * np.searchsorted(members, body[mine])[:, None] + np.arange(6)
    np.add.at(C, (place[at[mine]][:, None], columns), values[mine])
    return np.asarray(np.linalg.qr(C, mode="r"))
