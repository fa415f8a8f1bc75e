"""Convergence study: a number on a family of meshes, its order, and where it goes with its band.

Of values f_1, f_2, f_3 on meshes of sizes h_1 > h_2 > h_3, f = f_0 + a h^p gives the observed order p by
(f_1 - f_2) / (f_2 - f_3) = (h_1^p - h_2^p) / (h_2^p - h_3^p), and f_0 by Richardson's extrapolation.

Sources: Roache, J. Fluids Eng. 116 (1994) 405-413 (grid convergence index); Eça & Hoekstra, J. Comput. Phys.
262 (2014) 104-130 (values that are not in the asymptotic range).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.analysis.adaptive import check_geometry, check_quantity
from kratos_lite.analysis.quantities_of_interest import Quantity
from kratos_lite.errors import InputError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.refined import refined
from kratos_lite.model.structure import Structure
from kratos_lite.tabular import Tabular, unit_name
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import finite, function_or_none, instance, number, short, whole_number

SAFE, UNSAFE = 1.25, 3.0  # factors of the band in the asymptotic range, and beyond it
LEAST, MOST = 0.5, 20.0  # order there, and any
AGREE = 0.3  # difference of the last two orders at most, as fraction of the last
ROUNDING = 1e-9  # change of values that is rounding, as fraction of them


@dataclass(frozen=True, eq=False)
class ConvergenceStudy(Tabular):
    """Values on a family of meshes and where they go; it prints as a table.

    Attributes
    ----------
    of, unit : what the values are.
    sizes : (k,) of elements, relative to those of the first mesh where it is refined uniformly.
    unknowns : (k,) free degrees of freedom.
    values : (k,) on the meshes, the last one the finest.
    orders : (k,) observed order with the two meshes before; nan for the first two and where there is none.
    extrapolated : Richardson's value f_0; outside the asymptotic range the last value.
    band : the exact value lies by that much beside the last value, on the safe side: the grid convergence
        index, 1.25 times the distance of f_0 and f_3; outside the asymptotic range three times the range
        of the last three values.
    warning : why the values are not in the asymptotic range; "" where they are.
    """

    of: str
    unit: str
    sizes: Array
    unknowns: Array
    values: Array
    orders: Array
    extrapolated: float
    band: float
    warning: str

    @property
    def interval(self) -> tuple[float, float]:
        """Lowest and highest exact value by the band."""
        return float(self.values[-1] - self.band), float(self.values[-1] + self.band)

    @property
    def _limit(self) -> str:
        """What the extrapolated value is, in words."""
        return "last value" if self.warning else "extrapolated"

    def table(self) -> list[tuple[str, str]]:
        """Return a row for each mesh and the value with its band."""
        rows = [("quantity", self.of)]
        changes = np.diff(self.values, prepend=np.nan)
        for n, value, change, p in zip(self.unknowns, self.values, changes, self.orders, strict=True):
            words = f"{value:.8g} {self.unit}".rstrip()
            words += f", change {change:+.3e}" if np.isfinite(change) else ""
            rows.append((f"{n:g} unknowns", words + (f", order {p:.2f}" if np.isfinite(p) else "")))
        low, high = self.interval
        rows.append((self._limit, f"{self.extrapolated:.8g}, between {low:.8g} and {high:.8g} {self.unit}"))
        return rows + ([("warning", self.warning)] if self.warning else [])

    def plot(self, path: str | Path | None = None, *, size: tuple[float, float] = (6, 4)) -> Any:
        """Draw the values against unknowns, with the extrapolated one and its band.

        Parameters
        ----------
        path : picture to write; .png, .pdf or .svg.
        size : width and height in inches, at 150 dots per inch.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from kratos_lite.view.canvas import checked_size, saved  # pictures alone need these
        from kratos_lite.view.curves import study_figure

        ends, labels = (self.extrapolated, *self.interval), (self._limit, self.of)
        x, inches = self.unknowns, checked_size(size) or size
        return saved(study_figure(x, self.values, ends, self.unit, labels, inches), path)


def converge(
    model: Structure | Callable[[float], Structure],
    quantity: Quantity | Callable[[Any], float],
    meshes: int | ArrayLike = 3,
    *,
    solve: Callable[[Any], Any] | None = None,
    geometry: Mapping[str, Callable[[Array], Array]] | None = None,
) -> ConvergenceStudy:
    """Solve a model on a family of meshes; return a number on each, its order and its limit with a band.

    The values are in the asymptotic range where they change by ever less in one direction with an observed
    order of at least ½, of four and more meshes with two orders that agree.

    Parameters
    ----------
    model : that is refined uniformly, each element into 8; or a function that returns a model for a size h.
    quantity : such as ``kl.DisplacementAt(point, "z")``, or a function that returns a number of what `solve`
        returns, as a rule a `Result`.
    meshes : number of meshes, at least 3; with a function, their sizes h in m, one after the other smaller.
    solve : function of a model in place of ``model.solve()``, such as ``lambda model: model.modes(1)``.
    geometry : of a model that is refined: by part, a function that takes places (k, 3) in m near its true
        surface onto it.

    Returns
    -------
    ConvergenceStudy

    Raises
    ------
    InputError
        There are less than three meshes, their sizes do not fall, or the quantity is none.
    MeshError, ModelError, SolveError
        As for `Model.solve`; a model with a motion is not refined.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> def beam(h):
    ...     model = kl.Model(kl.box((4, 1, 1), [round(a / h) for a in (4, 1, 1)]), kl.Isotropic3D(1e6, 0.3))
    ...     model.fix("x-")
    ...     model.add(kl.Traction("x+", (0, 0, 5.0)))
    ...     return model
    >>> study = kl.converge(beam, kl.MeanDisplacement("x+", "z"), (1 / 2, 1 / 3, 1 / 4))
    >>> low, high = study.interval
    >>> low < study.extrapolated < high, study.warning
    (True, '')
    """
    if not (isinstance(quantity, Quantity) or callable(quantity)):
        text = "a quantity must be one such as kl.DisplacementAt, or a function"
        raise InputError(f"{text}; got {short(quantity)}")
    function_or_none(solve, "solve must be a function of a model")
    uniform = isinstance(model, Structure)
    if not (uniform or (callable(model) and geometry is None)):
        raise InputError(
            "a model, with its geometry, or a function of h that returns one, without, is needed"
        )
    if uniform:
        count = whole_number(meshes, "meshes of a model, unlike sizes of a function of h,", least=3, most=20)
        h = np.asarray(0.5 ** np.arange(count), float)
        check_quantity(quantity if isinstance(quantity, Quantity) else None)
        check_geometry(geometry, model.mesh)  # type: ignore[union-attr]
    else:
        h = finite(meshes, "meshes, the sizes for a function,", ("k",))
        if len(h) < 3 or not (np.diff(h) < 0).all() or h[-1] <= 0:
            raise InputError(f"meshes must be three or more sizes > 0 that fall; got {short(meshes)}")
    values, unknowns = np.zeros((2, len(h)))
    measure = quantity.value if isinstance(quantity, Quantity) else quantity
    last: Any = model
    for i, size in enumerate(h.tolist()):
        if not uniform:
            last = instance(model(size), f"the model of size {size:g}", Structure)  # type: ignore[operator]
        elif i:
            last = refined(last, refine(last.mesh).onto(geometry or {}))
        values[i] = number(measure(solve(last) if solve else last.solve()), "the value of the quantity")
        unknowns[i] = (~last.supports.fixed[last.mesh.used_nodes()]).sum() - len(last.supports.dependents())
    of, unit = getattr(quantity, "__name__", str(quantity)), getattr(quantity, "unit", "")
    of = "value" if of == "<lambda>" else of
    unit = unit_name(unit, last.units)
    return ConvergenceStudy(of, unit, h, unknowns, values, *limit_of(h, values))


def limit_of(h: Array, f: Array) -> tuple[Array, float, float, str]:
    """Return the orders (k,) of values on meshes of sizes h (k,), the limit, its band, and what is wrong."""
    orders = np.array([np.nan, np.nan, *(_order(h[i : i + 3], f[i : i + 3]) for i in range(len(f) - 2))])
    p, spread, wrong = orders[-1], float(np.ptp(f[-3:])), ""
    if spread <= ROUNDING * np.abs(f).max():
        return orders, float(f[-1]), UNSAFE * spread, ""
    if np.isnan(p):
        wrong = "the values go to and fro, or change by more from mesh to mesh"
    elif p < LEAST:
        wrong = f"the order {p:.2f} is below {LEAST}, as where the exact value is infinite"
    elif len(f) > 3 and not abs(orders[-2] - p) <= AGREE * p:
        wrong = "the last two orders differ"
    if wrong:
        wrong = f"not in the asymptotic range: {wrong}; take finer meshes"
        return orders, float(f[-1]), UNSAFE * spread, wrong
    error = float((f[-1] - f[-2]) / ((h[-2] / h[-1]) ** p - 1))
    return orders, float(f[-1]) + error, SAFE * abs(error), ""


def _order(h: Array, f: Array) -> float:
    """Return the order of three values; nan if there is none."""
    from scipy.optimize import brentq  # rarely needed

    if np.ptp(f) <= ROUNDING * np.abs(f).max():
        return np.nan

    (a, b), (r, s) = np.diff(f), np.log(h[:2] / h[2])
    try:
        return float(brentq(lambda p: a * np.expm1(s * p) - b * (np.exp(r * p) - np.exp(s * p)), 1e-3, MOST))
    except ValueError:
        return np.nan
