"""A law driven at one Gauss point: the first thing to do with a law of one's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.fields import COMPONENTS
from kratos_lite.errors import InputError, SolveError
from kratos_lite.materials import Material
from kratos_lite.typing import Array, Mask, Numbers
from kratos_lite.validation import choice, finite, flag, instance, number, whole_number

if TYPE_CHECKING:
    from pathlib import Path

ITERATIONS = 50
BALANCED = 1e-10
"""Fraction of the largest stress so far by which stresses may miss what is asked for."""


@dataclass(frozen=True, eq=False)
class MaterialPath:
    """What a law does along a path at one point; `material_point` makes it.

    Attributes
    ----------
    law : the material.
    time : (k,) s.
    strain, stress : (k, 6) and (k, 6) in Pa; the first row is the start, without strain.
    variables : internal variables (k, size) by name.
    tangent : (6, 6) Pa, at the end.
    """

    law: Material
    time: Array
    strain: Array
    stress: Array
    variables: dict[str, Array]
    tangent: Array

    def __repr__(self) -> str:
        return f"MaterialPath({self.law!r}, {len(self.time) - 1} steps to t = {self.time[-1]:g} s)"

    def columns(self) -> dict[str, Numbers]:
        """Return time, strains, stresses and internal variables, by headers with units.

        Returns
        -------
        dict of str to (k,) array
            ``kl.write("path.csv", path)`` writes them.
        """
        columns: dict[str, Numbers] = {"time [s]": self.time}
        for name, values, unit in (("strain", self.strain, ""), ("stress", self.stress, "Pa")):
            columns |= {f"{name} {c} [{unit}]": values[:, i] for i, c in enumerate(COMPONENTS)}
        for name, values in self.variables.items():
            size = values.shape[1]
            columns |= {f"{name} {i + 1}" if size > 1 else name: values[:, i] for i in range(size)}
        return columns

    def plot(
        self, path: str | Path | None = None, component: str = "xx", *, title: str = "", **options: Any
    ) -> Any:
        """Draw a stress over its strain.

        Parameters
        ----------
        path : picture to write; .png, .pdf or .svg.
        component : ``xx``, ``yy``, ``zz``, ``xy``, ``yz`` or ``zx``.
        title : above the picture.
        options : `size` in inches.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InputError
            There is no such component, or the file cannot be written.
        KratosLiteError
            matplotlib is missing.
        """
        from kratos_lite.view.canvas import checked_size, label, new_plot, saved
        from kratos_lite.view.curves import BLUE

        i = COMPONENTS.index(choice(component, "component", COMPONENTS))
        figure, axes = new_plot(checked_size(options.get("size")) or (6, 4), "", "Pa")
        axes.plot(self.strain[:, i], self.stress[:, i], color=BLUE, lw=1.8)
        label(axes, f"strain {component}", f"stress {component}", title or type(self.law).__name__)
        return saved(figure, path)


def material_point(
    law: Material,
    strain: Mapping[str, Sequence[float]] | None = None,
    stress: Mapping[str, Sequence[float]] | None = None,
    *,
    steps: int = 50,
    duration: float = 1.0,
    confined: bool = False,
) -> MaterialPath:
    """Drive a law at one point along a path of strains and stresses.

    Parameters
    ----------
    law : any material.
    strain : targets by component, such as ``{"xx": [0.01, -0.01]}``: from 0 to the first, from there to the
        next, and so on.  Green's strain of a law of finite strains.
    stress : targets in Pa by component, of components that have no strain prescribed.
    steps : from one target to the next.
    duration : s, from one target to the next.
    confined : whether the other components have no strain; otherwise they have no stress.

    Returns
    -------
    MaterialPath

    Raises
    ------
    InputError
        The targets do not fit together.
    MaterialError
        The law breaks its contract.
    SolveError
        No strain has the stresses asked for.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> steel = kl.J2Plasticity3D(E=200e9, nu=0.3, yield_stress=200e6, hardening=2e9)
    >>> path = kl.material_point(steel, {"xx": [0.01, -0.01]})
    >>> print(f"{path.stress[50, 0] / 1e6:.1f} MPa, {path.stress[-1, 0] / 1e6:.1f} MPa")
    217.8 MPa, -253.1 MPa
    """
    instance(law, "a law", Material, "kl.J2Plasticity3D(…)")
    steps, duration = whole_number(steps, "steps"), number(duration, "duration", least=0.0, unit="s")
    strains, stresses = _targets(strain, "strain"), _targets(stress, "stress")
    if both := sorted(strains.keys() & stresses.keys()):
        raise InputError(f"{', '.join(both)} has a strain and a stress prescribed; give one of them")
    prescribed = strains | stresses
    counts = {len(values) for values in prescribed.values()}
    if len(counts) != 1 or 0 in counts:
        raise InputError("give targets, such as strain={'xx': [0.01, -0.01]}, as many for each component")
    confined = flag(confined, "confined")
    held = np.array([name in strains or (confined and name not in stresses) for name in COMPONENTS])
    wanted = np.array([prescribed.get(name, np.zeros(counts.copy().pop())) for name in COMPONENTS]).T
    e, s, state = np.zeros(6), np.zeros(6), law.initial_state()
    tangent = np.array(law.C)
    rows, first, scale = [(0.0, e, s, state)], np.zeros(6), 0.0
    for number_of_target, target in enumerate(wanted):
        for i in range(1, steps + 1):
            goal = first + (target - first) * (i / steps)
            e, s, tangent, state = _step(law, e, goal, held, state, duration / steps, tangent, scale)
            scale = max(scale, float(np.abs(s).max()))
            rows.append((duration * (number_of_target + i / steps), e, s, state))
        first = target
    time, e_all, s_all, states = zip(*rows, strict=True)
    variables = {name: np.array([state[name] for state in states]) for name in law.internal_variables}
    return MaterialPath(law, np.array(time), np.array(e_all), np.array(s_all), variables, tangent)


def _targets(targets: Mapping[str, Sequence[float]] | None, what: str) -> dict[str, Array]:
    """Return targets (k,) by component."""
    if targets is None:
        return {}
    if not isinstance(targets, Mapping):
        raise InputError(f"{what} is given by component, such as {{'xx': [0.01]}}; got {targets!r}")
    for name in targets:
        choice(name, f"a component of the {what}", COMPONENTS)
    return {name: np.atleast_1d(finite(values, f"the {what} {name}")) for name, values in targets.items()}


def _step(
    law: Material,
    e: Array,
    goal: Array,
    held: Mask,
    state: dict[str, Array],
    dt: float,
    tangent: Array,
    scale: float,
) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Return strain, stress, tangent and state after a step to strains where held, and stresses elsewhere."""
    free, change = ~held, np.where(held, goal - e, 0.0)
    e = e + change
    if free.any():  # where the tangent of the last step would take the others
        e[free] -= np.linalg.lstsq(tangent[np.ix_(free, free)], tangent[free] @ change, rcond=None)[0]
    for _ in range(ITERATIONS):
        s, D, new = law.evaluate(e, state, dt)
        r = (s - goal)[free]
        size = max(scale, float(np.abs(s).max()), float(np.abs(goal[free]).max(initial=0.0)))
        if not free.any() or np.abs(r).max() <= BALANCED * size:
            return e, s, D, new
        e = e.copy()
        e[free] -= np.linalg.lstsq(D[np.ix_(free, free)], r, rcond=None)[0]
        if not np.isfinite(e).all():
            break
    raise SolveError(
        f"{type(law).__name__}: no strain gives the requested stresses; take more steps, or "
        "prescribe strains beyond the strength of the law"
    )
