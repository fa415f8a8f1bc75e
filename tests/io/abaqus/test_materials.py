"""Materials of decks: what a live ccx makes of them, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

import kratos_lite as kl

Read = Callable[..., kl.Case]
TETRAHEDRON = """*NODE, NSET=ALL
1,0.1,0.,0.05
2,1.2,0.1,-0.1
3,0.2,0.9,0.15
4,0.4,0.3,1.1
*ELEMENT, TYPE=C3D4, ELSET=EALL
1,1,2,3,4
*BOUNDARY
1,1,3
2,1,3
3,1,3
*INITIAL CONDITIONS, TYPE=TEMPERATURE
ALL,20.
*ORIENTATION, NAME=AXES
1.,2.,.5,0.,1.,1.
*MATERIAL, NAME=M
"""
TURNED = "*SOLID SECTION, ELSET=EALL, MATERIAL=M, ORIENTATION=AXES\n"
PLAIN = "*SOLID SECTION, ELSET=EALL, MATERIAL=M\n"
PRINT = "*NODE PRINT, NSET=ALL\nU\n*EL PRINT, ELSET=EALL, GLOBAL=YES\nS\n*END STEP\n"
PULLED = "*STEP\n*STATIC\n*CLOAD\n4,1,2.\n4,2,-1.\n4,3,3.\n" + PRINT
HEATED = PULLED.replace("*CLOAD", "*TEMPERATURE\nALL,120.\n*CLOAD")
LARGE = "*STEP, NLGEOM\n*STATIC\n.25,1.\n*BOUNDARY\n4,1,1,.3\n4,2,2,-.2\n4,3,3,.4\n" + PRINT
SIZES = [37, 9, 41, 8, -7, 39, 1, 2, -3, 21, -2, 1, 4, 3, 17, 2, -1, 3, 1, 2, 19]
ANISOTROPIC = "".join(
    f"{1000 * value}.,{chr(10) if i in (7, 15, 20) else ''}" for i, value in enumerate(SIZES)
)
ORTHO = "*ELASTIC, TYPE=ORTHO\n3e4,1e4,2.5e4,1.1e4,.9e4,2e4,.7e4,.6e4\n.5e4\n"
ENGINEERING = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n3e4,2e4,1e4,.2,.3,.25,.7e4,.6e4,\n.5e4,293.\n"
LAWS = {
    "isotropic": "*ELASTIC\n2e4,.3\n" + PLAIN + PULLED,
    "given twice": "*ELASTIC\n1e4,.2\n*ELASTIC\n2e4,.3\n" + PLAIN + PULLED,
    "isotropic along axes": "*ELASTIC, TYPE=ISOTROPIC\n2e4,.3\n" + TURNED + PULLED,
    "orthotropic": ORTHO + PLAIN + PULLED,
    "orthotropic along axes": ORTHO + TURNED + PULLED,
    "engineering constants": ENGINEERING + TURNED + PULLED,
    "anisotropic": f"*ELASTIC, TYPE=ANISO\n{ANISOTROPIC}" + PLAIN + PULLED,
    "anisotropic along axes": f"*ELASTIC, TYPE=ANISO\n{ANISOTROPIC}" + TURNED + PULLED,
    "alike at two temperatures": f"*ELASTIC, TYPE=ANISO\n{2 * ANISOTROPIC}*DENSITY\n1.,0.\n1.,9.\n"
    + TURNED + PULLED,
    "heated": "*ELASTIC\n2e4,.3\n*EXPANSION, ZERO=50.\n1e-4,0.\n1e-4,500.\n" + PLAIN + HEATED,
    "between temperatures": "*ELASTIC\n2e4,.3,0.\n1e4,.35,200.\n*EXPANSION, ZERO=50.\n1e-4,0.\n3e-4,500.\n"
    + PLAIN + HEATED,
    "orthotropic between temperatures": ORTHO.replace("\n.5e4", "\n.5e4,30.")
    + "2e4,1e4,2.5e4,1.2e4,.9e4,2e4,.6e4,.5e4\n.4e4,180.\n*EXPANSION, TYPE=ORTHO\n1e-4,3e-4,2e-4,0.\n"
    "2e-4,3e-4,1e-4,150.\n" + TURNED + HEATED,
    "heated along axes": ORTHO + "*EXPANSION, TYPE=ORTHO\n1e-4,3e-4,2e-4\n" + TURNED + HEATED,
    "isotropic but heated": "*ELASTIC\n2e4,.3\n*EXPANSION, TYPE=ORTHO\n1e-4,3e-4,2e-4\n" + TURNED + HEATED,
    "sheared by heat": f"*ELASTIC, TYPE=ANISO\n{ANISOTROPIC}"
    "*EXPANSION, TYPE=ANISO\n1e-4,3e-4,2e-4,4e-5,-6e-5,5e-5\n" + TURNED + HEATED,
    "large": "*ELASTIC\n2e4,.3\n" + PLAIN + LARGE,
    "anisotropic and large": f"*ELASTIC, TYPE=ANISO\n{ANISOTROPIC}" + TURNED + LARGE,
    "neo-Hooke": "*HYPERELASTIC, NEO HOOKE\n1.5,.02\n" + PLAIN + LARGE,
    "neo-Hooke without NLGEOM": "*HYPERELASTIC, NEO HOOKE\n1.5,.02\n" + PLAIN + LARGE.replace(", NLGEOM", ""),
    "neo-Hooke, D = 0": "*HYPERELASTIC, NEO HOOKE\n1.5,0.\n" + PLAIN + LARGE,
    "Mooney-Rivlin": "*HYPERELASTIC, MOONEY-RIVLIN\n1.5,.4,.02\n" + PLAIN + LARGE,
    "Mooney-Rivlin, D = 0": "*HYPERELASTIC, MOONEY-RIVLIN\n1.5,.4,0.\n" + PLAIN + LARGE,
    "Ogden": "*HYPERELASTIC, OGDEN\n3.,2.5,.02\n" + PLAIN + LARGE,
    "Ogden, D = 0": "*HYPERELASTIC, OGDEN\n3.,2.5,0.\n" + PLAIN + LARGE,
    "Ogden of two": "*HYPERELASTIC, OGDEN, N=2\n3.,2.5,.4,-2.,.02,.5\n" + PLAIN + LARGE,
    "Ogden of three": "*HYPERELASTIC, OGDEN, N=3\n3.,2.5,.4,-2.,.2,4.,.02,0.\n.1\n" + PLAIN + LARGE,
}  # fmt: skip


def results(case: kl.Case) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements (steps, n, 3) and the stress (steps, 6) xx yy zz xy xz yz of the only element."""
    found = [kl.run(each).result for each in (case, *case.then)]
    stress = np.array([result.stress("element")[0] for result in found])
    return np.array([result.u for result in found]), stress[:, [0, 1, 2, 3, 5, 4]]


def printed(dat: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the last displacements (n, 3) and the last stress (6,) that ccx prints."""
    number = r" +(-?\d\.\d+E[+-]\d+)"
    u = re.findall(r"(?m)^ +\d+" + 3 * number + "$", dat[dat.rindex("displacements") :])
    stress = re.findall(6 * number, dat[dat.rindex("stresses") :])
    return np.array(u, dtype=float), np.array(stress[-1], dtype=float)


@pytest.mark.parametrize("text", LAWS.values(), ids=LAWS)
def test_displacements_and_stresses_are_those_of_ccx(text: str, read: Read, ccx: Callable[..., str]) -> None:
    (u, stress), (their_u, their_stress) = results(read(text, TETRAHEDRON)), printed(ccx(text, TETRAHEDRON))
    assert np.abs(u[-1] - their_u).max() < 1e-6 * np.abs(their_u).max()
    assert np.abs(stress[-1] - their_stress).max() < 1e-6 * np.abs(their_stress).max()


def test_a_card_that_replaces_another_is_named(read: Read) -> None:
    notes = read(LAWS["given twice"], TETRAHEDRON).model.notes
    assert [note for note in notes if ":19: *ELASTIC replaces that of" in note]


CURVES = {
    "isotropic": "*PLASTIC\n25.,0.\n30.,.003\n32.,.01\n",
    "steep": "*PLASTIC\n25.,0.\n26.,.001\n45.,.003\n46.,.012\n90.,.02\n",
    "perfect": "*PLASTIC\n25.,0.\n",
    "alike at two temperatures": "*PLASTIC\n25.,0.,0.\n30.,.003,0.\n25.,0.,9.\n30.,.003,9.\n",
}
STRAINS = [(0.002, 0.001, -0.003), (-0.004, 0.01, 0.02), (0.03, -0.02, -0.01)]


def along_path(nlgeom: str = "", scale: float = 1.0) -> str:
    """Return steps of four increments in which the apex moves."""
    moves = ["".join(f"4,{i},{i},{scale * x:g}\n" for i, x in enumerate(point, 1)) for point in STRAINS]
    return "".join(f"*STEP{nlgeom}\n*STATIC, DIRECT\n.25,1.\n*BOUNDARY\n{move}{PRINT}" for move in moves)


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
def test_stresses_beyond_yield_are_those_of_ccx(curve: str, read: Read, ccx: Callable[..., str]) -> None:
    text = f"*ELASTIC\n2e4,.3\n{curve}{PLAIN}{along_path()}"
    stress, theirs = results(read(text, TETRAHEDRON))[1][-1], printed(ccx(text, TETRAHEDRON))[1]
    assert np.abs(stress - theirs).max() < 2e-6 * np.abs(theirs).max()


def test_kinematic_hardening_is_that_of_ccx(read: Read, ccx: Callable[..., str]) -> None:
    """CalculiX 2.20 softens by it without NLGEOM; strains so small that NLGEOM does not matter are right."""
    text = "*ELASTIC\n2e4,.3\n*PLASTIC, HARDENING=KINEMATIC\n25e-4,0.\n75e-4,1e-5\n" + PLAIN
    stress = results(read(text + along_path("", 1e-4), TETRAHEDRON))[1][-1]
    theirs = printed(ccx(text + along_path(", NLGEOM", 1e-4), TETRAHEDRON))[1]
    assert np.abs(stress - theirs).max() < 2e-5 * np.abs(theirs).max()


STEP = "*STEP\n*STATIC\n*END STEP\n"
WRONG = {  # what follows *MATERIAL, and the message, which begins with the line in that, from 1
    "*DENSITY\n1.\n": "0: *MATERIAL: material M has no *ELASTIC; got DENSITY",
    "*ELASTIC\n": "1: *ELASTIC: 2 constants are needed, 8 on a line; got 0 lines",
    "*ELASTIC\n2e4\n": "2: value 2 of the line is missing",
    "*ELASTIC\n2e4,.3,100.\n1e4,.3,100.\n": "1: *ELASTIC: temperatures must ascend; got 100, 100",
    "*ELASTIC, TYPE=FOO\n1.\n": "1: *ELASTIC: TYPE=FOO is not supported; there are ISO, ORTHO, ENGIN",
    "*ELASTIC, TYPE=ORTHO\n3.,1.,2.,1.,1.,2.,1.,1.\n": "ELASTIC: 9 constants are needed, 8 on a line",
    "*ELASTIC, TYPE=ORTHO\n3.,1.,2.,1.,1.,2.,1.,1.,1.\n": "ELASTIC: 9 constants are needed, 8 on a line",
    "*ELASTIC\n2e4,.6\n": "0: *MATERIAL: nu (POISSON_RATIO) 0.6 must be < 0.5",
    "*ELASTIC\n2e4,.3\n*EXPANSION, TYPE=FOO\n1.\n": "TYPE=FOO is not supported; there are ISO, ORTHO, ANISO",
    "*ELASTIC\n2e4,.3\n*PLASTIC\n25.,.1\n": "3: *PLASTIC: the first line gives the yield stress at",
    "*ELASTIC\n2e4,.3\n*PLASTIC\n25.,0.\n20.,.1\n": "*MATERIAL: the plastic strains of a curve grow from 0",
    "*ELASTIC\n2e4,.3\n*PLASTIC\n25.,0.,0.\n20.,0.,9.\n": "yield stresses that depend on the temperature",
    "*ELASTIC\n2e4,.3\n*PLASTIC, HARDENING=COMBINED\n25.,0.\n30.,1.\n": "HARDENING is ISOTROPIC, or",
    "*ELASTIC\n2e4,.3\n*PLASTIC, HARDENING=KINEMATIC\n25.,0.\n30.,1.\n31.,2.\n": "with two lines, which give",
    ORTHO + "*PLASTIC\n25.,0.\n": "*PLASTIC: it is supported with *ELASTIC and *EXPANSION of TYPE=ISO alone",
    "*HYPERELASTIC, YEOH\n1.,1.,1.,1.,1.,1.\n": "1: *HYPERELASTIC: option YEOH is not supported",
    "*HYPERELASTIC\n1.,1.,1.\n": "1: *HYPERELASTIC: it is supported with NEO HOOKE, MOONEY-RIVLIN or OGDEN",
    "*HYPERELASTIC, OGDEN, N=4\n1.,1.,1.\n": "MOONEY-RIVLIN or OGDEN, N=1 … 3",
    "*HYPERELASTIC, OGDEN\n1.,0.,1.\n": "the exponents alpha of OGDEN are not 0",
    "*HYPERELASTIC, NEO HOOKE\n1.,.1\n*EXPANSION\n1.\n": "rubber that temperatures strain is not supported",
    f"{ORTHO}*ORIENTATION, NAME=R, SYSTEM=CYLINDRICAL\n0.,0.,0.,0.,0.,1.\n": "must be SYSTEM=RECTANGULAR",
    f"{ORTHO}*ORIENTATION, NAME=R, DEFINITION=NODES\n1,2,3\n": "DEFINITION=COORDINATES alone",
    f"{ORTHO}*ORIENTATION, NAME=R\n0.,1.,0.,0.,0.,1.\n3,30.\n": "further rotations are not supported",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_no_law_here_says_is_refused(text: str, read: Read) -> None:
    first = TETRAHEDRON.count("\n")
    section = PLAIN.replace("\n", ", ORIENTATION=R\n") if "ORIENTATION" in text else PLAIN
    with pytest.raises(kl.InputError) as caught:
        read(text + section + STEP, TETRAHEDRON)
    assert re.sub(r"^(\d+)", lambda m: f"job.inp:{first + int(m[1])}", WRONG[text]) in str(caught.value)


@pytest.mark.parametrize(
    "step", [HEATED.replace("ALL,120", "4,120"), "*STEP, NLGEOM\n*STATIC\n*TEMPERATURE\nALL,120.\n" + PRINT]
)
def test_a_law_at_several_temperatures_is_refused(step: str, read: Read) -> None:
    with pytest.raises(
        kl.InputError, match=r"\*ELASTIC: it depends on the temperature, which must be the same"
    ):
        read("*ELASTIC\n2e4,.3,0.\n1e4,.3,100.\n" + PLAIN + step, TETRAHEDRON)
