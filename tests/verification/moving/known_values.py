"""Known values of what moves, and where they come from."""

from collections.abc import Callable

from kratos_lite.verification.problem import Of, Problem


def only_one(kind: str) -> bool:
    """Return whether a problem whose answer no element changes is asked of this one."""
    return kind == "KinematicLinear3D20N"


def bounded(
    name: str, quantity: str, source: str, reference: float, tolerance: float, of: Callable[[str], float],
    takes: Of = only_one,
) -> Problem:  # fmt: skip
    """Return a problem with a tolerance, asked once if no element changes its answer."""
    return Problem(
        name=name, quantity=quantity, source=source, reference=float(reference), tolerance=tolerance, of=of,
        takes=takes,
    )  # fmt: skip


SOURCES = {
    "Rayleigh": (
        "J. W. Strutt, Baron Rayleigh, The Theory of Sound, 2nd ed., Macmillan 1894, chapters 7 (bars "
        "in longitudinal vibration) and 8 (beams)"
    ),
    "Newmark": (
        "N. M. Newmark, A method of computation for structural dynamics, Journal of the Engineering "
        "Mechanics Division ASCE 85 (1959) 67-94"
    ),
    "Hilber": (
        "H. M. Hilber, T. J. R. Hughes and R. L. Taylor, Improved numerical dissipation for time "
        "integration algorithms in structural dynamics, Earthquake Engineering and Structural Dynamics "
        "5 (1977) 283-292"
    ),
    "Bossak": (
        "W. L. Wood, M. Bossak and O. C. Zienkiewicz, An alpha modification of Newmark's method, IJNME "
        "15 (1980) 1562-1566"
    ),
    "Chung": (
        "J. Chung and G. M. Hulbert, A time integration algorithm for structural dynamics with improved "
        "numerical dissipation: the generalized-α method, Journal of Applied Mechanics 60 (1993) 371-375"
    ),
    "Landau": (
        "L. D. Landau and E. M. Lifshitz, Mechanics, 3rd ed., Pergamon 1976, section 37 (the "
        "asymmetrical top)"
    ),
    "Goldstein": "H. Goldstein, Classical Mechanics, 2nd ed., Addison-Wesley 1980, section 5-7 (heavy top)",
    "Newton": "I. Newton, Philosophiæ naturalis principia mathematica, 1687: laws of motion, closed forms",
    "Cohen": (
        "H. Cohen and R. G. Muncaster, The Theory of Pseudo-rigid Bodies, Springer 1988; closed forms "
        "for a cube of Saint Venant-Kirchhoff material"
    ),
    "Simo": (
        "J. C. Simo and N. Tarnow, The discrete energy-momentum method, Zeitschrift für angewandte "
        "Mathematik und Physik 43 (1992) 757-792"
    ),
    "Koziara": (
        "T. Koziara and N. Bićanić, Simple and efficient integration of rigid rotations suitable for "
        "constraint solvers, IJNME 81 (2010) 1073-1092"
    ),
    "Bessel": (
        "closed form by Bessel functions of the equations of linear elasticity in a frame fixed in space; "
        "functions in M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions, 1964, chapter 9"
    ),
    "Coriolis": (
        "linear elasticity in axes that turn with the body, with Coriolis and centrifugal forces: L. D. "
        "Landau and E. M. Lifshitz, Mechanics, 3rd ed., Pergamon 1976, section 39; computed with the row, "
        "wave by wave around the axis, by Galerkin's method with ten polynomials of the radius"
    ),
    "Dalembert": ("J. d'Alembert's solution of the wave equation, 1747: u = (f(x - c t) + f(x + c t)) / 2"),
    "Polynomials": "exact integrals of polynomials over the unit cube and the unit simplex",
}
"""Citations by the word that problems use for them."""
