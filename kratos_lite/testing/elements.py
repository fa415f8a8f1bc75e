"""Checks of one element: its matrices and loads against theory, on the ideal and on distorted cells."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements import KinematicLinear, custom
from kratos_lite.errors import InputError
from kratos_lite.quadrature import Rule
from kratos_lite.shapes import Shape
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.testing import patches
from kratos_lite.testing.patches import C_ISOTROPIC, affine, anisotropic, distorted, linear_field, rotations
from kratos_lite.testing.report import Finding, Measured, difference, largest, run, run_after, worst
from kratos_lite.testing.rules import check_rule
from kratos_lite.testing.shapes import check_functions, problems, unsaved
from kratos_lite.typing import Array
from kratos_lite.validation import short

Element = type[KinematicLinear]
EPS = float(np.finfo(float).eps)


def check_element(element: Element) -> list[Finding]:
    """Check an element: its shape, its rules, the element alone, and patches of it.

    Parameters
    ----------
    element : the class.

    Returns
    -------
    list of Finding; those of the rules are named ``rule …`` and ``mass rule …``.

    Notes
    -----
    Source of the set of checks: Irons' patch test; MacNeal & Harder, Finite Elements in Analysis
    and Design 1 (1985) 3-20.

    Examples
    --------
    >>> from kratos_lite import KinematicLinear3D6N
    >>> findings = check_element(KinematicLinear3D6N)
    >>> [finding.check for finding in findings if not finding.passed]
    ['mid edges', 'quadratic patch']
    """
    if not isinstance(element, type):
        raise InputError(f"check_element takes the class of an element; got {short(element)}")
    findings = run((definition,), element)
    if _wrong(element):
        return findings
    shape = check_functions(element.shape)
    rule, mass = (
        [replace(f, check=f"{name} {f.check}") for f in check_rule(element.shape.cell, r)] if r else []
        for name, r in (("rule", element.rule), ("mass rule", element.mass_rule))
    )
    causes = [f for f in shape if f.check in ("derivatives", "broadcasting", "kronecker")] + rule
    findings += shape + rule + mass
    findings += run_after(causes, SINGLE + patches.CHECKS, element)
    return findings + run_after(causes + mass, MASS, element)


def definition(element: Element) -> Measured:
    """Check that the class states a solid shape, with its VTK number, and a rule."""
    wrong = _wrong(element) or [
        f"has the shape {element.shape.__name__}, which {why}" for why in unsaved(element.shape)
    ]
    text = f"{element.__name__} {'; '.join(wrong) or 'states a shape and a rule'}"
    return Measured(np.inf if wrong else 0, 0, text)


def _wrong(element: Element) -> list[str]:
    """Return what is missing or wrong in a class, so that nothing can be checked."""
    shape, wrong = getattr(element, "shape", None), []
    if not (isinstance(shape, type) and issubclass(shape, Shape)):
        wrong.append(
            "states no shape: write a Shape with cell, nodes, corners, degree, N and dN, and shape = it"
        )
    elif getattr(shape, "nodes", np.zeros((0, 3))).shape[1:] != (3,):
        wrong.append(
            f"has the shape {shape.__name__}, which is not a solid: it needs nodes (n, 3) and a known cell"
        )
    else:
        wrong += [f"has the shape {shape.__name__}, which {why}" for why in problems(shape)]
    for name in ("rule", "mass_rule"):
        value = getattr(element, name, None)
        if not isinstance(value, Rule) and (name == "rule" or value is not None):
            wrong.append(f"states no {name}: write for example {name} = hexahedron(degree=3)")
    return wrong


# ---- checks ------------------------------------------------------------------------------------


def volume(element: Element) -> Measured:
    """Check that the volume of a sheared cell is det A times that of the reference cell."""
    X, exact = affine(element)
    cell = element(X)
    value = max(float(cell.volume()), float(cell.dV.sum()), key=lambda value: abs(value - exact))
    text = f"volume of a sheared cell is {value:.15g}; exact is {exact:.15g}"
    return Measured(abs(value / exact - 1), 1e-13, text)


def strain_operator(element: Element) -> Measured:
    """Check that B u and strain(u) of a linear field are its strain at all points of a distorted cell."""
    X = distorted(element)
    u, exact = linear_field(X)
    cell = element(X)
    strain = cell.strain(u, C_ISOTROPIC)
    by_B = cell.strain_at(element.rule.points, u, C_ISOTROPIC)
    miss = np.maximum(np.abs(by_B - exact), np.abs(strain - exact))
    g, row = np.unravel_index(int(np.argmax(miss)), miss.shape)
    text = f"strain {voigt.NAMES[row]} at Gauss point {g}: B u gives {by_B[g, row]:.6g}, strain(u) "
    text += f"{strain[g, row]:.6g}; exact is {exact[row]:.6g} (shear is engineering strain)"
    other = int(np.argmin(np.abs(exact - by_B[g, row])))
    if other != row and abs(exact[other] - by_B[g, row]) < 1e-9:
        text += f"; it is that of {voigt.NAMES[other]}: rows of B are {', '.join(voigt.NAMES)}"
    return Measured(float(miss[g, row]), 1e-13, text)


def stiffness(element: Element) -> Measured:
    """Check K = Σ B^T C B dV, or that of its own local system, of one cell and of a batch."""
    X = distorted(element)
    cell, batch = element(X), element(np.stack([X, affine(element)[0]]))
    system = "local_system" in element.custom
    errors = {}
    for name, C in (("isotropic", C_ISOTROPIC), ("general", anisotropic())):
        strains = cell.strain(np.eye(X.size).reshape(-1, *X.shape), C)
        hand = np.einsum("igk,kl,jgl,g->ij", strains, C, strains, cell.dV, optimize=True)
        if system:
            hand, _ = custom.system(cell, C, np.zeros_like(X))
        for whose, K in (("", cell.stiffness(C)), (" of a batch", batch.stiffness(C)[0])):
            text = f"stiffness(C){whose}, {name} C, against "
            text += "K of local_system of one cell" if system else "Σ B^T C B γ det J of one cell"
            errors[text] = difference(K, hand)
    return largest(errors, 1e-13)


def symmetry(element: Element) -> Measured:
    """Check K = K^T."""
    cell = element(distorted(element))
    errors = {}
    for name, C in (("an isotropic", C_ISOTROPIC), ("a general", anisotropic())):
        K = cell.stiffness(C)
        errors[f"K of {name} C against its transpose on a distorted cell"] = difference(K, K.T)
    return largest(errors, 1e-14)


def rank(element: Element) -> Measured:
    """Check that K has no eigenvalue ≤ 1e-9 of the largest but the six rigid and the stated spurious ones."""
    cells = (element(X) for X in (element.shape.nodes, distorted(element)))
    counts = [_zeros(cell.stiffness(C_ISOTROPIC)) for cell in cells]
    spurious = element.spurious_modes
    text = (
        f"{counts[0]} zero-energy modes on the reference cell, {counts[1]} on a distorted one; expected are "
    )
    text += (
        f"the 6 rigid ones{f' and {spurious} spurious ones' if spurious else ''}; more come of a wrong row "
    )
    text += "of B or of too few Gauss points, fewer of a B in which rigid motions strain"
    wrong = max(abs(count - 6 - spurious) for count in counts)
    if spurious and not wrong and not patches.unbuildable(element.shape):
        wrong = _zeros(patches.assemble(element, *patches.patch(element.shape, (2, 2, 2), move=0.1))) - 6
        text += f"; {wrong} spurious modes in a patch of 2x2x2 bricks"
    return Measured(abs(wrong), 0, text)


def _zeros(K: Array) -> int:
    values = np.linalg.eigvalsh(K)
    return int((~(values > 1e-9 * values[-1])).sum())


def stretched(element: Element) -> Measured:
    """Check cells flattened to a hundredth: as many modes without energy; u·K u = Σ σ·ε dV of linear u."""
    errors, zeros = {}, _zeros(element(distorted(element)).stiffness(C_ISOTROPIC))
    for axis, C in product(range(3), (C_ISOTROPIC, anisotropic())):
        X = distorted(element)
        X[:, axis] *= 0.01
        cell, u = element(X), linear_field(X)[0]
        K, where = cell.stiffness(C), f"of a cell flattened along {'xyz'[axis]}"
        size = 1 / np.sqrt(np.abs(np.diag(K)))
        values = np.sort(np.abs(np.linalg.eigvalsh(size[:, None] * K * size)))
        rounding, error = len(values) * EPS * values[-1], 0.0  # of each eigenvalue, by Weyl's theorem
        if 0 < zeros < len(values) and values[zeros]:
            error = max(1e6 * (values[zeros - 1] - rounding), 100 * rounding) / values[zeros]
        text = f"1e6 times zero, or 100 times its rounding, over the first elastic eigenvalue {where}"
        errors[text] = float(error)
        energy = float(((cell.strain(u, C) * cell.stress(C, u)).sum(axis=-1) * cell.dV).sum())
        work, terms = (float(v @ k @ v) for v, k in ((u.ravel(), K), (np.abs(u).ravel(), np.abs(K))))
        errors[f"error of u·K u {where}, by 10 ε |u|·|K| |u|"] = abs(work - energy) / (10 * EPS * terms)
    return largest(errors, 1.0)


def rigid_motions(element: Element) -> Measured:
    """Check that six rigid motions need no force: K r = 0."""
    errors = {}
    for name, X in (("the reference", element.shape.nodes), ("a distorted", distorted(element))):
        K, R = element(X).stiffness(C_ISOTROPIC), rigid_modes(X)
        miss = np.abs(K @ R).max(axis=0) / (np.abs(K).max() * np.abs(R).max(axis=0))
        mode = int(np.argmax(miss))
        kind = "translation along" if mode < 3 else "rotation about"
        text = f"|K r| / |K| |r| of {name} cell is largest for the {kind} {'xyz'[mode % 3]}"
        errors[text] = float(miss[mode])
    return largest(errors, 1e-13)


def frame_invariance(element: Element) -> Measured:
    """Check that a rotated cell has the rotated K."""
    X = distorted(element)
    Q, _ = np.linalg.qr(np.random.default_rng(17).uniform(-1, 1, (3, 3)))
    Q *= np.sign(np.linalg.det(Q))
    T = np.kron(np.eye(len(X)), Q)
    K, turned = (element(Y).stiffness(C_ISOTROPIC) for Y in (X, X @ Q.T))
    return Measured(difference(turned, T @ K @ T.T), 1e-13, "K of a rotated cell against the rotated K")


def numbering_invariance(element: Element) -> Measured:
    """Check that a cell whose nodes are listed from another corner has the same K, reordered."""
    X, _ = affine(element)
    K = element(X).stiffness(C_ISOTROPIC)
    orders, errors = rotations(element.shape), {}
    for order, turned in zip(orders, element(X[orders]).stiffness(C_ISOTROPIC), strict=True):
        dofs = (3 * order[:, None] + np.arange(3)).ravel()
        errors[tuple(order.tolist())] = difference(turned, K[np.ix_(dofs, dofs)])
    error, listed = worst(errors)
    text = f"K with its nodes listed as {listed}, a rotation of the cell, against K reordered"
    return Measured(error, 1e-13, text)


def length_scaling(element: Element) -> Measured:
    """Check K(s X) = s K for s = 1e-9 … 1e9: no absolute tolerance hides in the element."""
    X = distorted(element)
    K = element(X).stiffness(C_ISOTROPIC)
    errors = {}
    for k in range(-9, 10, 3):
        text = f"K of a cell with all lengths × 1e{k} against 1e{k} K of the cell"
        errors[text] = difference(element(10.0**k * X).stiffness(C_ISOTROPIC), 10.0**k * K)
    return largest(errors, 1e-13)


def offset(element: Element) -> Measured:
    """Check that far from the origin K loses no more digits than the coordinates themselves."""
    X = distorted(element)
    K = element(X).stiffness(C_ISOTROPIC)
    loss = [difference(element(X + c).stiffness(C_ISOTROPIC), K) / (EPS * c) for c in (1e3, 1e6)]
    text = "error of K at a distance c from the origin, in units of the rounding of c"
    return Measured(max(loss), 20, text)


def internal_force(element: Element) -> Measured:
    """Check that local_system gives K, and r_int = ∫ B^T σ(u) dV or its own, with r_int = K u."""
    X, C = distorted(element), anisotropic()
    u = np.random.default_rng(19).uniform(-1, 1, X.shape)
    cell = element(X)
    expected = cell.stiffness(C)
    K, r = custom.system(cell, C, u)
    errors = {
        "K of local_system(C, u) against stiffness(C)": difference(K, expected),
        "r_int of local_system(C, u) against stiffness(C) u": difference(r.ravel(), expected @ u.ravel()),
    }
    return largest(errors, 1e-13)


def body_force(element: Element) -> Measured:
    """Check that a constant body force adds up to V b and has no moment about the centroid."""
    X, V = affine(element)
    b = np.array([1.0, -2.0, 3.0])
    center = element(X).gauss_points().T @ element(X).dV / V
    f = element(X).body_force(b)
    force = difference(f.sum(axis=0), V * b)
    moment = float(np.abs(np.cross(X - center, f).sum(axis=0)).max() / (V * np.abs(b).max()))
    nodal = difference(element(X).body_force(np.tile(b, (len(X), 1))), f)
    text = f"total against V b: {force:.3g}; moment: {moment:.3g}; nodal b against constant b: "
    return Measured(float(np.max([force, moment, nodal])), 1e-13, text + f"{nodal:.3g}")


def mass_total(element: Element) -> Measured:
    """Check that consistent and lumped mass add up to density × volume on a sheared cell."""
    X, V = affine(element)
    cell, rho = element(X), 3.0
    totals = [float(cell.mass(rho)[::3, ::3].sum()), float(cell.lumped_mass(rho).sum())]
    error = float(np.max(np.abs(np.array(totals) / (rho * V) - 1)))
    text = f"consistent mass {totals[0]:.15g}, lumped mass {totals[1]:.15g}; exact is {rho * V:.15g}"
    return Measured(error, 1e-13, text)


def consistent_mass(element: Element) -> Measured:
    """Check that the consistent mass matrix is positive definite (eigenvalues above 1e-6 of the largest)."""
    counts = []
    for X in (element.shape.nodes, distorted(element)):
        values = np.linalg.eigvalsh(element(X).mass(1.0))
        counts.append(int((~(values > 1e-6 * values[-1])).sum()))
    text = (
        f"{counts[0]} eigenvalues of the mass matrix are not positive on the reference cell, {counts[1]} on "
    )
    text += "a distorted one"
    if rule := element.mass_rule:
        text += f"; a mass_rule of more than {len(rule)} points, or none stated, helps"
    return Measured(max(counts), 0, text)


def lumped_mass(element: Element) -> Measured:
    """Check that each node has a positive mass."""
    masses = np.concatenate([element(X).lumped_mass(1.0) for X in (element.shape.nodes, distorted(element))])
    bad = int((~(masses > 1e-9 * np.abs(masses).max())).sum())
    text = f"nodes without a positive mass; the smallest is {masses.min():.3g} kg of 1 kg/m³"
    return Measured(bad, 0, text)


SINGLE = (
    volume, strain_operator, stiffness, symmetry, rank, stretched, rigid_motions, frame_invariance,
    numbering_invariance, length_scaling, offset, internal_force,
)  # fmt: skip
MASS = (body_force, mass_total, consistent_mass, lumped_mass)
