"""Checks of laws that are not linear: their contract, tangent, and what thermodynamics demands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kratos_lite import voigt
from kratos_lite.materials import Material
from kratos_lite.materials.material import GaussState
from kratos_lite.testing.report import Measured, difference, largest
from kratos_lite.typing import Array

POINTS = 12
"""Gauss points of each check."""
DT = 0.7
LENGTH = 1e-3
"""Length in m of the elements for laws that ask for it: short, so that nothing snaps back."""
SMALLEST, GREATEST = 1e-7, {"small": 0.3, "finite": 0.1}
"""Strains between which a law is looked at."""
BEYOND = (0.3, 0.97, 1.05, 3.0)
"""Strains, in parts of that where the law ceases to be elastic."""


def start(law: Material, *shape: int) -> GaussState:
    """Return the internal variables at the beginning."""
    state = law.initial_state(*shape)
    if "element_length" in state:
        state["element_length"][...] = LENGTH
    return state


def limits(law: Material, ways: Array) -> Array:
    """Return the strains (k, 1) up to which a law is elastic along ways (k, 6), or the largest looked at."""
    low, high = np.full(len(ways), SMALLEST), np.full(len(ways), GREATEST[law.strain_measure])
    if law.rate_dependent or not law.internal_variables:
        return high[:, None] / 3
    for _ in range(2):  # the second time between the two strains where it ceases to be elastic
        sizes = np.geomspace(low, high, 40)
        before = start(law, *sizes.shape)
        _, tangent, after = law.evaluate(sizes[..., None] * ways, before, DT)
        softer = np.abs(tangent - law.C).max(axis=(-2, -1)) > 1e-6 * np.abs(law.C).max()
        beyond = softer & (_moved(before, after) > 1e-9 * sizes)
        first = beyond.argmax(axis=0)
        low, high = (np.take_along_axis(sizes, i[None], axis=0)[0] for i in (np.maximum(first - 1, 0), first))
    return np.where(beyond.any(axis=0), high, GREATEST[law.strain_measure] / 3)[:, None]


def _moved(before: GaussState, after: GaussState) -> Array:
    """Return the largest change of an internal variable at each point."""
    return np.asarray(np.abs(np.concatenate([after[n] - before[n] for n in after], axis=-1)).max(axis=-1))


def _directions() -> Array:
    """Return strains (POINTS, 6) of size 1 in all directions."""
    ways = np.random.default_rng(5).normal(size=(POINTS, 6))
    return ways / np.abs(ways).max(axis=1, keepdims=True)


def _paths(law: Material) -> Iterator[tuple[str, Array, GaussState]]:
    """Yield where a law is, a strain (POINTS, 6) and the state before: from rest, and on from there."""
    size, state = limits(law, _directions()), start(law, POINTS)
    for factor in BEYOND:
        strain = factor * size * _directions()
        yield f"{factor:g} times the elastic limit", strain, state
        new = law.evaluate(strain, state, DT)[2]
        yield f"back from {factor:g} times the elastic limit", -0.6 * np.roll(strain, 1, axis=0), new


def contract(law: Material) -> Measured:
    """Check that the response has its shapes for one point and many, and leaves its arguments as they are."""
    sizes = np.geomspace(SMALLEST, GREATEST[law.strain_measure] / 3, POINTS)  # some points yield
    strain, state = sizes[:, None] * _directions(), start(law, POINTS)
    faults: dict[str, float] = {}
    stress = law.evaluate(strain, state, DT)[0]
    for i in (0, POINTS - 1):
        alone = law.evaluate(strain[i], {name: v[i] for name, v in state.items()}, DT)[0]
        text = "one point alone has another stress than among many: use [..., i] for components"
        faults[text] = max(faults.get(text, 0.0), difference(alone, stress[i]))
    return largest(faults, 1e-10)


def rest(law: Material) -> Measured:
    """Check that there is no stress without strain."""
    stress = law.evaluate(np.zeros(6), start(law), DT)[0]
    text = "stress at rest is " + ", ".join(f"{s:.4g}" for s in stress) + " Pa"
    return Measured(float(np.abs(stress).max() / np.abs(law.C).max()), 1e-12, text)


def tangent(law: Material) -> Measured:
    """Check that the tangent is the derivative of the stress, inside and beyond the elastic limit."""
    errors = {}
    for place, strain, state in _paths(law):
        stress, D, new = law.evaluate(strain, state, DT)
        scale = np.abs(law.C).max()
        h = 1e-5 * np.abs(strain).max(axis=-1)[:, None]
        steps = np.stack([np.eye(6), -np.eye(6)])[:, :, None] * h  # (sign, component, point, 6)
        many = {name: np.broadcast_to(v, (*steps.shape[:-1], v.shape[-1])) for name, v in state.items()}
        plus, minus = law.evaluate(strain + steps, many, DT)[0]
        numeric = [np.moveaxis(part / h, 0, -1) for part in (plus - stress, stress - minus)]
        smooth = np.abs(numeric[0] - numeric[1]).max(axis=(-2, -1)) < 1e-2 * scale  # no kink between
        known = (numeric[0] + numeric[1]) / 2
        error = np.where(smooth[:, None, None], np.abs(known - D), 0.0) / scale
        at = p, i, j = np.unravel_index(error.argmax(), error.shape)
        text = (
            f"∂σ_{voigt.NAMES[i]}/∂ε_{voigt.NAMES[j]} is {D[at]:.4g} Pa, against differences {known[at]:.4g}"
        )
        if new:
            text += ", where it is elastic" if _moved(state, new)[p] == 0 else ", where its state changes"
        same = ": it is the C of elasticity" if difference(D[p], law.C) < 1e-9 else ""
        errors[f"{text}, {place}{same}"] = float(error[at])
    return largest(errors, 1e-5)


def symmetric_tangent(law: Material) -> Measured | str:
    """Check that the tangent is symmetric, as the law claims."""
    if not law.symmetric_tangent:
        return f"{type(law).__name__} claims no symmetry"
    errors = {}
    for place, strain, state in _paths(law):
        D = law.evaluate(strain, state, DT)[1]
        text = (
            f"D against D^T, {place}; is a factor 2 of shear missing in a norm or in the flow? A law whose "
        )
        text += "flow is not that of its yield surface says symmetric_tangent = False in the class"
        errors[text] = difference(D, np.swapaxes(D, -1, -2))
    return largest(errors, 1e-6)


def elastic_strain(law: Material) -> Measured | str:
    """Check that the stress is C (ε - plastic strain)."""
    if dict(law.internal_variables).get("plastic_strain") != 6:
        return f"{type(law).__name__} has no plastic_strain of six components"
    errors = {}
    for place, strain, state in _paths(law):
        stress, _, new = law.evaluate(strain, state, DT)
        text = f"σ against C (ε - ε_p), {place}; ε_p has engineering shear, and changes as the stress does"
        errors[text] = difference(stress, (strain - new["plastic_strain"]) @ law.C.T)
    return largest(errors, 1e-8)


def staying(law: Material) -> Measured | str:
    """Check that the same strain once more changes nothing."""
    if law.rate_dependent:
        return f"{type(law).__name__} depends on the rate"
    errors = {}
    for place, strain, state in _paths(law):
        stress, _, new = law.evaluate(strain, state, DT)
        again, _, same = law.evaluate(strain, new, DT)
        errors[f"stress of the same strain again, {place}"] = difference(again, stress)
        for name in new:
            size = max(
                np.abs(values).max(initial=0.0) for values in (new[name], strain)
            )  # 0 but for rounding
            change = np.abs(same[name] - new[name]).max(initial=0.0) / size
            errors[f"{name} at the same strain again, {place}"] = float(change)
    return largest(errors, 1e-8)


def one_step_or_two(law: Material) -> Measured | str:
    """Check that a proportional strain in one step or in two gives the same stress."""
    if law.rate_dependent:
        return f"{type(law).__name__} depends on the rate"
    strain = BEYOND[-1] * limits(law, _proportional()) * _proportional()
    once = law.evaluate(strain, start(law, POINTS), DT)
    half = law.evaluate(0.7 * strain, start(law, POINTS), DT)[2]
    twice = law.evaluate(strain, half, DT)
    text = "after one step against two: is a variable updated twice?"
    errors = {f"stress {text}": difference(once[0], twice[0])}
    for name in once[2]:
        errors[f"{name} {text}"] = difference(twice[2][name], once[2][name])
    return largest(errors, 1e-8)


def _proportional() -> Array:
    """Return strains without change of volume, over which the stress of an isotropic law is proportional."""
    ways = _directions()
    ways[:, :3] -= ways[:, :3].mean(axis=1, keepdims=True)
    return ways


def rate(law: Material) -> Measured:
    """Check that the length of the step matters where the law depends on the rate, and nowhere else."""
    strain = BEYOND[-1] * limits(law, _directions()) * _directions()
    fast, slow = (law.evaluate(strain, start(law, POINTS), dt)[0] for dt in (1e-12, 1e12))
    changes = difference(fast, slow) > 1e-9
    text = "the stress depends on dt: rate_dependent = True in the class says so"
    if law.rate_dependent:
        text = "the stress of a step of 1e-12 s is that of 1e12 s: is dt ignored?"
    return Measured(float(changes != law.rate_dependent), 0, text)


def dissipation(law: Material) -> Measured:
    """Check that no closed path of strains gives energy, and that an elastic one costs none."""
    factors, rng = np.array(BEYOND[1:]), np.random.default_rng(7)
    corners = rng.normal(size=(5, 1, POINTS, 6))
    corners = corners * (factors * limits(law, _directions()).min() / np.abs(corners).max())[:, None, None]
    corners[-1] = 0.0
    state = start(law, len(factors), POINTS)
    before = s_before = np.zeros(corners.shape[1:])
    work = gross = np.zeros(corners.shape[1:-1])
    for corner in corners:
        begin = before
        for i in range(1, 33):
            strain = begin + (corner - begin) * (i / 32)
            stress, _, state = law.evaluate(strain, state, DT, tangent=False)
            part = ((stress + s_before) / 2 * (strain - before)).sum(axis=-1)
            work, gross = work + part, gross + np.abs(part)
            before, s_before = strain, stress
    gained = ((law.energy(before, s_before, state) - work) / gross).max(axis=-1)
    text = "energy gained over closed paths up to {:g} times the elastic limit"
    return largest({text.format(f): float(g) for f, g in zip(factors, gained, strict=True)}, 5e-3)


def isotropy(law: Material) -> Measured | str:
    """Check that a turned strain gives the turned stress."""
    if not getattr(type(law), "isotropic", False):
        return f"{type(law).__name__} claims no isotropy; isotropic = True in the class would"
    Q = np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))[0]
    strain = BEYOND[-1] * limits(law, _directions()) * _directions()
    turned = voigt.turned_strain(strain, Q)
    stress, of_turned = (law.evaluate(e, start(law, POINTS), DT)[0] for e in (strain, turned))
    expected = voigt.vector(Q @ voigt.tensor(stress) @ Q.T)
    return Measured(difference(of_turned, expected), 1e-9, "stress of a turned strain against the turned one")


CHECKS = (
    rest, tangent, symmetric_tangent, elastic_strain, staying, one_step_or_two, rate, dissipation, isotropy,
)  # fmt: skip
