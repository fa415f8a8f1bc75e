"""Where the reference values come from."""

SOURCES = {
    "Hooke": (
        "Hooke's law for an isotropic body in a uniform state of stress: S. P. Timoshenko and "
        "J. N. Goodier, Theory of Elasticity, 3rd ed., McGraw-Hill 1970, chapter 1"
    ),
    "Timoshenko": "S. P. Timoshenko and J. N. Goodier, Theory of Elasticity, 3rd ed., McGraw-Hill 1970",
    "Irons": (
        "B. M. Irons and A. Razzaque, Experience with the patch test for convergence of finite "
        "elements, in: A. K. Aziz (ed.), The Mathematical Foundations of the Finite Element "
        "Method, Academic Press 1972"
    ),
    "MacNeal": (
        "R. H. MacNeal and R. L. Harder, A proposed standard set of problems to test finite "
        "element accuracy, Finite Elements in Analysis and Design 1 (1985) 3-20"
    ),
    "Hughes": "T. J. R. Hughes, The Finite Element Method, Dover 2000",
    "Roache": (
        "P. J. Roache, Code verification by the method of manufactured solutions, Journal of "
        "Fluids Engineering 124 (2002) 4-10; orders p + 1 and p: P. G. Ciarlet, The Finite "
        "Element Method for Elliptic Problems, North-Holland 1978"
    ),
    "Lame": (
        "G. Lamé, Leçons sur la théorie mathématique de l'élasticité, Paris 1852; also in S. P. Timoshenko "
        "and J. N. Goodier, Theory of Elasticity (cylinder and sphere under uniform pressure)"
    ),
    "Kirsch": (
        "E. G. Kirsch, Die Theorie der Elastizität und die Bedürfnisse der Festigkeitslehre, "
        "Zeitschrift des VDI 42 (1898) 797-807"
    ),
    "Goodier": (
        "J. N. Goodier, Concentration of stress around spherical and cylindrical inclusions and "
        "flaws, Journal of Applied Mechanics 1 (1933) 39-44"
    ),
    "Williams": (
        "M. L. Williams, Stress singularities resulting from various boundary conditions in "
        "angular corners of plates in extension, Journal of Applied Mechanics 19 (1952) 526-528; "
        "field of C. Carstensen, G. Dolzmann, S. Funken and D. Helm, CMAME 190 (2001) 1885-1900"
    ),
    "Cook": (
        "R. D. Cook, Improved two-dimensional finite element, Journal of the Structural Division "
        "ASCE 100 (1974) 1851-1863; value of the limit: J. C. Simo and M. S. Rifai, IJNME 29 "
        "(1990) 1595-1638"
    ),
    "NAFEMS": "NAFEMS, The Standard NAFEMS Benchmarks, Rev. 3, 1990",
    "NAFEMS-FV": "NAFEMS, Selected Benchmarks for Natural Frequency Analysis, 1987",
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
