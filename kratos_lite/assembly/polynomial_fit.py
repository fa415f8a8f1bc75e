"""Polynomials fitted to values at points by least squares, one for each patch, compiled or in NumPy."""

from __future__ import annotations

import numpy as np

from kratos_lite.assembly.element_groups import floats
from kratos_lite.native import kernels
from kratos_lite.records import record
from kratos_lite.typing import Array, Ints, Mask, Numbers

MONOMIALS = (1, 4, 10, 20)
"""Their number up to each degree."""
DEPENDENT, NOTHING, FLAT, ALIGNED = 1e-3, 1e-6, 1e-12, 1e-6
"""See ``native/recovery.hpp``."""


@record(frozen=True, eq=False)
class Lists:
    """Rows of numbers of any length, one after another: row i is ``entries[start[i] : start[i + 1]]``."""

    start: Ints
    entries: Ints

    def __len__(self) -> int:
        return len(self.start) - 1

    @property
    def lengths(self) -> Ints:
        """How many entries each row has."""
        return np.diff(self.start)

    @property
    def owner(self) -> Ints:
        """The row of each entry."""
        return np.repeat(np.arange(len(self)), self.lengths)

    def take(self, rows: Ints) -> Lists:
        """Return some of the rows."""
        if module := kernels("recovery"):
            return Lists(*module.taken(*map(_integers, (self.start, self.entries, rows))))
        lengths = self.lengths[rows]
        start = np.concatenate([[0], np.cumsum(lengths)])
        within = np.arange(start[-1]) - np.repeat(start[:-1], lengths)
        return Lists(start, self.entries[np.repeat(self.start[rows], lengths) + within])


def lists(owner: Numbers, entries: Ints, n: int) -> Lists:
    """Return entries as rows, by the row of each, in their order."""
    if module := kernels("recovery"):
        return Lists(*module.dealt(_integers(owner), _integers(entries), n))
    start = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=n))])
    return Lists(start, entries[np.argsort(owner, kind="stable")])


def distinct(owner: Numbers, entries: Numbers, n: int) -> tuple[Ints, Ints, Ints]:
    """Return row and entry of the distinct entries of n rows, ascending, and how often each occurs."""
    if module := kernels("recovery"):
        rows, found, count = module.distinct(_integers(owner), _integers(entries), n)
        return rows, found, count
    most = int(entries.max(initial=0)) + 1
    codes, count = np.unique(owner * most + entries, return_counts=True)
    return codes // most, codes % most, count


def _integers(numbers: Numbers) -> Ints:
    return np.ascontiguousarray(numbers, dtype=np.int64)


@record(frozen=True, eq=False)
class Samples:
    """Values at points of elements.

    Attributes
    ----------
    places : (s, 3) m.
    values : (s, 6).
    offset : (m + 1,) first sample of each element.
    """

    places: Array
    values: Array
    offset: Ints


@record(frozen=True, eq=False)
class Polynomials:
    """Fitted polynomials.

    Attributes
    ----------
    frame : (p, 12) origin in m, and the rows of the map to local coordinates in 1/m.
    terms : (p, t, 6) coefficients of the monomials in local coordinates, by degree.
    """

    frame: Array
    terms: Array

    def at(self, places: Array, chosen: Lists) -> Array:
        """Return at each place (n, 3) the mean of some of the polynomials there, (n, 6)."""
        if module := kernels("recovery"):
            return module.evaluate(
                self.frame, self.terms, floats(places), as_rows(chosen.start), as_rows(chosen.entries)
            )
        owner, rows = chosen.owner, chosen.entries
        y = _local(self.frame[rows], places[owner][:, None])
        values = (_monomials(y, MONOMIALS.index(self.terms.shape[1])) @ self.terms[rows])[:, 0]
        total = np.zeros((len(places), 6))
        np.add.at(total, owner, values)
        return total / np.maximum(chosen.lengths, 1)[:, None]


def fit(samples: Samples, patches: Lists, weights: Array, degree: Ints, means: Ints) -> Polynomials:
    """Return the polynomial of each patch.

    Parameters
    ----------
    samples : values at points of all elements.
    patches : the elements of each patch.
    weights : of each of these.
    degree : (p,) of the polynomials, 0 … 3.
    means : (p,) 1 for patches that take the means of their elements where there are enough of them.

    Notes
    -----
    A monomial that the points of a patch cannot tell from those before it is left out.
    """
    if module := kernels("recovery"):
        numbers = (as_rows(samples.offset), as_rows(patches.start), as_rows(patches.entries))
        tables = (floats(weights), as_rows(degree), as_rows(means))
        return Polynomials(*module.fit(floats(samples.places), floats(samples.values), *numbers, *tables))
    frame, terms = _nothing(len(patches), degree)
    left = np.ones(len(patches), dtype=bool)
    if means.any():
        chosen = np.flatnonzero(means)
        found = _fit(
            _means(samples), patches.take(chosen), weights[_positions(patches, chosen)], degree[chosen]
        )
        frame[chosen], terms[chosen, : found[1].shape[1]] = found[:2]
        left[chosen] = ~found[2]
    chosen = np.flatnonzero(left)
    every = _fit(samples, patches.take(chosen), weights[_positions(patches, chosen)], degree[chosen])
    frame[chosen], terms[chosen, : every[1].shape[1]] = every[:2]
    return Polynomials(frame, terms)


def as_rows(numbers: Numbers) -> Ints:
    """Return row numbers as kernels take them."""
    return np.ascontiguousarray(numbers, dtype=np.int32)


def _positions(rows: Lists, chosen: Ints) -> Ints:
    """Return the positions of the entries of some rows."""
    return Lists(rows.start, np.arange(len(rows.entries))).take(chosen).entries


def _means(samples: Samples) -> Samples:
    """Return one sample for each element."""
    first, count = samples.offset[:-1], np.diff(samples.offset)[:, None]
    places, values = (np.add.reduceat(v, first) / count for v in (samples.places, samples.values))
    return Samples(places, values, np.arange(len(first) + 1))


# ---- the reference of the kernel -----------------------------------------------------------------------


def _fit(samples: Samples, patches: Lists, weights: Array, degree: Ints) -> tuple[Array, Array, Mask]:
    """Return frames, coefficients, and whether no monomial was left out, for patches of all sizes."""
    every = Lists(samples.offset, np.arange(len(samples.places)))
    counts = every.lengths[patches.entries]
    rows = every.take(patches.entries).entries
    weight = np.repeat(weights, counts)
    sizes = np.bincount(patches.owner, weights=counts, minlength=len(patches)).astype(int)
    points = Lists(np.concatenate([[0], np.cumsum(sizes)]), np.arange(len(rows)))
    frame, terms = _nothing(len(patches), degree)
    complete = np.zeros(len(patches), dtype=bool)
    for size, order in sorted(set(zip(sizes.tolist(), degree.tolist(), strict=True))):
        alike = np.flatnonzero((sizes == size) & (degree == order))
        for part in np.array_split(alike, 1 + len(alike) * size // 100_000):
            at = points.take(part).entries.reshape(len(part), size)
            X = samples.places[rows[at]]
            frame[part] = _frames(X)
            P = _monomials(_local(frame[part], X), order)
            weighted = np.swapaxes(P, 1, 2) * weight[at][:, None, :]
            found, complete[part] = _solve(weighted @ P, weighted @ samples.values[rows[at]])
            terms[part, : found.shape[1]] = found
    return frame, terms, complete


def _nothing(n: int, degree: Ints) -> tuple[Array, Array]:
    """Return frames and coefficients of n patches, to be filled."""
    return np.zeros((n, 12)), np.zeros((n, MONOMIALS[degree.max(initial=0)], 6))


def _frames(X: Array) -> Array:
    """Return origins and maps to the principal axes of points (p, s, 3), in units of their spread."""
    center = X.mean(axis=1, keepdims=True)
    A = np.swapaxes(X - center, 1, 2) @ (X - center) / X.shape[1]
    d = np.sqrt(np.einsum("pii->pi", A))
    A[np.abs(A) <= ALIGNED * d[:, :, None] * d[:, None, :]] = 0
    for i in range(3):
        A[:, i, i] = d[:, i] ** 2
    spread, axes = np.linalg.eigh(A)
    spread = np.maximum(spread[:, ::-1], FLAT * spread[:, -1:])
    scale = np.divide(1.0, np.sqrt(spread), out=np.zeros_like(spread), where=spread > 0)
    maps = np.swapaxes(axes, 1, 2)[:, ::-1] * scale[:, :, None]
    return np.concatenate([center[:, 0], maps.reshape(-1, 9)], axis=1)


def _local(frame: Array, X: Array) -> Array:
    """Return local coordinates of points (p, s, 3)."""
    return (X - frame[:, None, :3]) @ np.swapaxes(frame[:, 3:].reshape(-1, 3, 3), 1, 2)


def _monomials(y: Array, degree: int) -> Array:
    """Return the monomials (..., n) at local coordinates (..., 3), by degree."""
    x = [y[..., i] for i in range(3)]
    p = [np.ones_like(x[0])]
    if degree >= 1:
        p += x
    if degree >= 2:
        p += [x[i] * x[i] for i in range(3)] + [x[i] * x[(i + 1) % 3] for i in range(3)]
    if degree >= 3:
        p += [x[i] ** 3 for i in range(3)]
        p += [x[i] ** 2 * x[j] for i in range(3) for j in range(3) if i != j]
        p.append(x[0] * x[1] * x[2])
    return np.stack(p, axis=-1)


def _solve(M: Array, b: Array) -> tuple[Array, Mask]:
    """Return the solutions of normal equations (p, n, n), and whether all monomials were used."""
    M, b, n = M.copy(), b.copy(), M.shape[1]
    diagonal = np.einsum("pii->pi", M).copy()
    used = np.zeros(M.shape[:2], dtype=bool)
    for i in range(n):
        least = np.maximum(diagonal[:, i], NOTHING * diagonal[:, 0])
        used[:, i] = M[:, i, i] > DEPENDENT * least
        inverse = np.where(used[:, i], 1 / np.where(used[:, i], M[:, i, i], 1.0), 0.0)
        factor = M[:, i, i + 1 :] * inverse[:, None]
        M[:, i + 1 :, i + 1 :] -= factor[:, :, None] * M[:, i, None, i + 1 :]
        b[:, i + 1 :] -= factor[:, :, None] * b[:, i, None]
    x = np.zeros_like(b)
    for i in range(n - 1, -1, -1):
        rest = b[:, i] - (M[:, i, None, i + 1 :] @ x[:, i + 1 :])[:, 0]
        x[:, i] = np.where(used[:, i, None], rest / np.where(used[:, i], M[:, i, i], 1.0)[:, None], 0.0)
    return x, np.asarray(used.all(axis=1))
