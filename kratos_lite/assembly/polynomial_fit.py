"""Polynomials fitted to values at points by least squares, one for each patch, compiled or in NumPy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.assembly.element_groups import as_double
from kratos_lite.native import kernels
from kratos_lite.typing import Array, Ints, Mask, Numbers

MONOMIALS = (1, 4, 10, 20)
"""Their number up to each degree."""
DEPENDENT, NOTHING, UNTOLD, FLAT, ALIGNED = 1e-3, 1e-6, 1e-2, 1e-12, 1e-6
"""See ``native/recovery.hpp``."""


@dataclass(frozen=True, eq=False)
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
            return Lists(*module.taken(*map(integers, (self.start, self.entries, rows))))
        lengths = self.lengths[rows]
        start = np.concatenate([[0], np.cumsum(lengths)])
        within = np.arange(start[-1]) - np.repeat(start[:-1], lengths)
        return Lists(start, self.entries[np.repeat(self.start[rows], lengths) + within])


def lists(owner: Numbers, entries: Ints, n: int) -> Lists:
    """Return entries as rows, by the row of each, in their order."""
    if module := kernels("recovery"):
        return Lists(*module.dealt(integers(owner), integers(entries), n))
    start = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=n))])
    return Lists(start, entries[np.argsort(owner, kind="stable")])


def distinct(owner: Numbers, entries: Numbers, n: int) -> tuple[Ints, Ints, Ints]:
    """Return row and entry of the distinct entries of n rows, ascending, and how often each occurs."""
    if module := kernels("recovery"):
        rows, values, count = module.distinct(integers(owner), integers(entries), n)
        return rows, values, count
    most = int(entries.max(initial=0)) + 1
    codes, count = np.unique(owner * most + entries, return_counts=True)
    return codes // most, codes % most, count


def integers(numbers: Numbers) -> Ints:
    """Return numbers of rows as kernels that make rows take them."""
    return np.ascontiguousarray(numbers, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Samples:
    """Values at points of elements."""

    places: Array  # (s, 3) m
    values: Array  # (s, 6)
    offset: Ints  # (m + 1,) first sample of each element


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Fitted polynomials."""

    frame: Array  # (p, 12) origin in m, and the rows of the map to local coordinates in 1/m
    terms: Array  # (p, t, 6) coefficients of the monomials in local coordinates, by degree

    def at(self, places: Array, chosen: Lists) -> Array:
        """Return at each place (n, 3) the mean of some of the polynomials there, (n, 6)."""
        if module := kernels("recovery"):
            return module.evaluate(
                self.frame, self.terms, as_double(places), as_rows(chosen.start), as_rows(chosen.entries)
            )
        return self._mean(places[:, None], chosen)[:, 0]

    def residuals(self, places: Array, values: Array, E: Array, nodes: Ints, chosen: Lists) -> Array:
        """Return the residuals of values (m, s, 6), extrapolated to the nodes by E (k, s), (m, k, 6)."""
        if module := kernels("recovery"):
            tables = (as_double(places), as_double(values), as_double(E), as_rows(nodes))
            return module.residuals(
                self.frame, self.terms, *tables, as_rows(chosen.start), as_rows(chosen.entries)
            )
        residuals = [values - self._mean(places, chosen.take(column)) for column in nodes.T]
        return np.stack([row @ off for row, off in zip(E, residuals, strict=True)], axis=1)

    def _mean(self, places: Array, chosen: Lists) -> Array:
        """Return the mean of the polynomials chosen for each row of places (m, s, 3), (m, s, 6)."""
        owner, rows = chosen.owner, chosen.entries
        y = _local(self.frame[rows], places[owner])
        total = np.zeros((*places.shape[:2], 6))
        np.add.at(total, owner, _monomials(y, MONOMIALS.index(self.terms.shape[1])) @ self.terms[rows])
        return total / np.maximum(chosen.lengths, 1)[:, None, None]


def fit(samples: Samples, patches: Lists, weights: Array, degree: Ints, means: Ints) -> Polynomials:
    """Return the polynomial of each patch."""
    # A monomial that the points of a patch cannot tell from those before it is left out. What means cannot
    # tell, as across a single layer, is then fitted to the residuals of all samples.
    if module := kernels("recovery"):
        numbers = (as_rows(samples.offset), as_rows(patches.start), as_rows(patches.entries))
        tables = (as_double(weights), as_rows(degree), as_rows(means))
        values = as_double(samples.places), as_double(samples.values)
        return Polynomials(*module.fit(*values, *numbers, *tables))
    return _fit(samples, patches, weights, degree, means)


def as_rows(numbers: Numbers) -> Ints:
    """Return row numbers as kernels take them."""
    return np.ascontiguousarray(numbers, dtype=np.int32)


# ---- the reference of the kernel -----------------------------------------------------------------------


def _fit(samples: Samples, patches: Lists, weights: Array, degree: Ints, means: Ints) -> Polynomials:
    """Return the polynomials of patches of all sizes."""
    every = Lists(samples.offset, np.arange(len(samples.places)))
    centers = [np.add.reduceat(v, every.start[:-1]) for v in (samples.places, samples.values)]
    count = every.lengths
    sizes = np.bincount(patches.owner, weights=count[patches.entries], minlength=len(patches))
    keys = np.column_stack([sizes.astype(int), patches.lengths, degree, means])
    frame, terms = np.zeros((len(patches), 12)), np.zeros((len(patches), MONOMIALS[degree.max(initial=0)], 6))
    for key in sorted(set(map(tuple, keys.tolist()))):
        alike = np.flatnonzero((keys == key).all(axis=1))
        size, members, order, simple = key
        for part in np.array_split(alike, 1 + len(alike) * size // 100_000):
            at = patches.start[part, None] + np.arange(members)
            elements, weight = patches.entries[at], weights[at]
            rows = every.take(elements.ravel()).entries.reshape(len(part), size)
            frame[part] = _frames(samples.places[rows])
            fits = _Fits(frame[part], order)
            if simple:
                X, values = (v[elements] / count[elements][..., None] for v in centers)
                fits.add(X, values, weight, UNTOLD)
            weight = np.repeat(weight.ravel(), count[elements.ravel()]).reshape(len(part), size)
            fits.add(samples.places[rows], samples.values[rows], weight, DEPENDENT * NOTHING)
            terms[part, : MONOMIALS[order]] = fits.terms
    return Polynomials(frame, terms)


class _Fits:
    """Coefficients of patches of the same size, and which are known."""

    def __init__(self, frame: Array, degree: int) -> None:
        self.frame, self.degree = frame, degree
        self.terms = np.zeros((len(frame), MONOMIALS[degree], 6))
        self.known = np.zeros(self.terms.shape[:2], dtype=bool)

    def add(self, X: Array, values: Array, weight: Array, nothing: float) -> None:
        """Fit the monomials not yet known to the residuals of values (p, s, 6) at places (p, s, 3)."""
        if self.known.all():
            return
        P = _monomials(_local(self.frame, X), self.degree)
        weighted = np.swapaxes(P, 1, 2) * weight[:, None]
        terms, used = _solve(weighted @ P, weighted @ (values - P @ self.terms), nothing, self.known)
        self.terms += terms
        self.known |= used


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


def _solve(M: Array, b: Array, nothing: float, known: Mask) -> tuple[Array, Mask]:
    """Return the solutions of normal equations (p, n, n) for monomials not yet known, and which were used."""
    M, b, n = M.copy(), b.copy(), M.shape[1]
    diagonal = np.einsum("pii->pi", M).copy()
    used = np.zeros(M.shape[:2], dtype=bool)
    for i in range(n):
        least = np.maximum(DEPENDENT * diagonal[:, i], nothing * diagonal[:, 0])
        used[:, i] = ~known[:, i] & (M[:, i, i] > least)
        inverse = np.where(used[:, i], 1 / np.where(used[:, i], M[:, i, i], 1.0), 0.0)
        factor = M[:, i, i + 1 :] * inverse[:, None]
        M[:, i + 1 :, i + 1 :] -= factor[:, :, None] * M[:, i, None, i + 1 :]
        b[:, i + 1 :] -= factor[:, :, None] * b[:, i, None]
    x = np.zeros_like(b)
    for i in range(n - 1, -1, -1):
        y = b[:, i] - (M[:, i, None, i + 1 :] @ x[:, i + 1 :])[:, 0]
        x[:, i] = np.where(used[:, i, None], y / np.where(used[:, i], M[:, i, i], 1.0)[:, None], 0.0)
    return x, used
