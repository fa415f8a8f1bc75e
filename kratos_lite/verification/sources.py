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
}
"""Citations by the word that problems use for them."""
