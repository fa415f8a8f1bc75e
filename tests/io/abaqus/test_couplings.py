"""What connects the nodes of a deck: rigid bodies, couplings, cuts, equations, ties, springs and masses."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.abaqus.job import Job
from kratos_lite.model.reference_nodes import displacements
from kratos_lite.solvers.constraints import rigid_modes
from tests.io.abaqus.conftest import CUBE

Read = Callable[..., kl.Case]
REFS = CUBE.replace("8,0,1,1\n", "8,0,1,1\n20,.5,.4,2.\n21,0,0,0\n")
TWO = REFS.replace("20,.5", "9,0,0,2\n10,1,0,2\n11,1,1,2\n12,0,1,2\n20,.5").replace(
    "GENERATE\n5,8", "GENERATE\n9,12"
)
TWO = TWO.replace("5,6,7,8\n*NSET", "5,6,7,8\n2,5,6,7,8,9,10,11,12\n*NSET")
APART = REFS.replace(
    "20,.5",
    "9,0,0,1\n10,1,0,1\n11,1,1,1\n12,0,1,1\n13,0,0,2\n14,1,0,2\n15,1,1,2\n16,0,1,2\n20,.5",
).replace("5,6,7,8\n*NSET", "5,6,7,8\n2,9,10,11,12,13,14,15,16\n*NSET")
TIE = (
    "*NSET,NSET=MIDDLE\n9,10,11,12\n*SURFACE,NAME=NODES,TYPE=NODE\nMIDDLE\n*SURFACE,NAME=LOW\n2,S1\n"
    "*SURFACE,NAME=UP\n1,S2\n*TIE, NAME=T, POSITION TOLERANCE=0.1\nLOW,UP\n"
)
RIGID = "*RIGID BODY, NSET=TOP, REF NODE=20, ROT NODE=21\n"
COUPLED = "*SURFACE, NAME=STOP\nEALL,S2\n*COUPLING, REF NODE=20, SURFACE=STOP, CONSTRAINT NAME=C\n"
CUT = "*SURFACE, NAME=MID\n1,S2\n*PRE-TENSION SECTION, SURFACE=MID, NODE=20\n"
STATIC, END = "*STEP\n*STATIC\n", "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"
LARGE = "*STEP, NLGEOM\n*STATIC\n0.5,1.\n"


def spring(kind: str, nodes: str, lines: str) -> str:
    """Return the cards of a spring."""
    return f"*ELEMENT, TYPE={kind}, ELSET=ES\n77,{nodes}\n*SPRING, ELSET=ES\n{lines}\n"


MASS = "*ELEMENT, TYPE=MASS, ELSET=EM\n77,7\n*MASS, ELSET=EM\n3.\n"
CASES = {
    "force and moment on a rigid body": (
        REFS,
        RIGID + STATIC + "*CLOAD\n20,1,1.\n20,3,2.\n21,1,1.\n21,3,2.\n",
    ),
    "displacement of a rigid body": (REFS, RIGID + "*BOUNDARY\n21,1,3\n20,1,1,.01\n" + STATIC),
    "a rigid body along axes": (
        REFS,
        RIGID + "*NSET,NSET=REF\n20,\n*TRANSFORM,NSET=REF\n1.,1.,0.,-1.,1.,.5\n"
        "*BOUNDARY\n20,1,1,.01\n" + STATIC + "*CLOAD\n20,2,1.\n20,3,3.\n",
    ),
    "a body tied to a rigid one": (APART, RIGID + TIE + STATIC + "*CLOAD\n20,1,1.\n14,2,2.\n"),
    "rotation of a rigid body": (REFS, RIGID + "*BOUNDARY\n21,1,1,.01\n20,1,3\n" + STATIC),
    "kinematic": (REFS, COUPLED + "*KINEMATIC\n1,3\n" + STATIC + "*CLOAD\n20,1,1.\n20,5,.3\n"),
    "kinematic along x": (
        REFS,
        COUPLED + "*KINEMATIC\n1,1\n*BOUNDARY\n20,4,6\n" + STATIC + "*CLOAD\n20,1,1.\n5,2,1.\n",
    ),
    "kinematic along x and z": (
        REFS,
        COUPLED + "*KINEMATIC\n1\n3\n*BOUNDARY\n20,5,5,.01\n" + STATIC + "*CLOAD\n20,1,1.\n5,2,1.\n",
    ),
    "kinematic, large": (
        REFS,
        COUPLED + "*KINEMATIC\n1,3\n*BOUNDARY\n20,4,6\n" + LARGE + "*CLOAD\n20,1,20.\n",
    ),
    "two kinematic ones turn by themselves": (
        REFS,
        "*SURFACE, NAME=S, TYPE=NODE\n5\n6\n*SURFACE, NAME=T, TYPE=NODE\n7\n8\n"
        "*COUPLING, REF NODE=20, SURFACE=S, CONSTRAINT NAME=A\n*KINEMATIC\n1,3\n"
        "*COUPLING, REF NODE=20, SURFACE=T, CONSTRAINT NAME=B\n*KINEMATIC\n1,3\n"
        + STATIC
        + "*CLOAD\n20,1,1.\n20,4,.5\n20,5,.3\n20,6,.2\n",
    ),
    "distributed": (
        REFS,
        COUPLED + "*DISTRIBUTING\n1,6\n" + STATIC + "*CLOAD\n20,1,1.\n20,3,1.\n20,4,1.\n20,6,1.\n",
    ),
    "weights": (
        REFS,
        "*ELEMENT, TYPE=DCOUP3D, ELSET=EC\n77,20\n*DISTRIBUTING COUPLING, ELSET=EC\nTOP,1.\n5,3.\n"
        "*SOLID SECTION, ELSET=EC, MATERIAL=STEEL\n" + STATIC + "*CLOAD\n20,1,1.\n20,3,1.\n",
    ),
    "a node moves others by equations": (
        REFS,
        "*EQUATION\n2\n5,3,1.,20,1,-1.\n2\n6,3,1.,20,1,-2.\n*BOUNDARY\n20,1,1,.01\n" + STATIC,
    ),
    "a node loads others by equations": (
        REFS,
        "*EQUATION\n2\n5,3,1.,20,1,-1.\n2\n6,3,1.,20,1,-2.\n" + STATIC + "*CLOAD\n20,1,1.\n",
    ),
    "a spring along its line": (
        REFS,
        spring("SPRINGA", "20,7", "\n300.") + "*BOUNDARY\n20,1,3\n" + STATIC + "*CLOAD\nTOP,3,1.\n",
    ),
    "a spring to the ground": (REFS, spring("SPRING1", "7", "2\n300.") + STATIC + "*CLOAD\nTOP,2,1.\n"),
    "a spring between directions": (
        REFS,
        spring("SPRING2", "7,5", "2,1\n300.") + STATIC + "*CLOAD\nTOP,2,1.\n",
    ),
    "a spring on a rigid body": (
        REFS,
        RIGID + spring("SPRING1", "20", "2\n300.") + STATIC + "*CLOAD\n20,2,1.\n",
    ),
    "weight of a mass": (
        REFS,
        MASS + STATIC + "*DLOAD\nEALL,GRAV,9.81,0.,0.,-1.\nEM,GRAV,9.81,0.,0.6,-0.8\n",
    ),
    "a mass without weight": (REFS, MASS + STATIC + "*DLOAD\nEALL,GRAV,9.81,0.,0.,-1.\n"),
    "a bolt is pulled": (TWO, CUT + "*BOUNDARY\nTOP,1,3\n" + STATIC + "*CLOAD\n20,1,5.\n5,1,1.\n"),
    "a bolt is pulled aslant": (TWO, CUT + "0.1,0.,1.\n*BOUNDARY\nTOP,1,3\n" + STATIC + "*CLOAD\n20,1,5.\n"),
    "a bolt is shortened, from above": (
        TWO,
        CUT.replace("1,S2", "2,S1") + "*BOUNDARY\nTOP,1,3\n20,1,1,.01\n" + STATIC,
    ),
    "a bolt is shortened, large": (
        TWO,
        CUT + "*BOUNDARY\nTOP,1,3\n" + LARGE + "*BOUNDARY\n20,1,1,.01\n" + END + LARGE + "*CLOAD\n7,1,2.\n",
    ),
}


@pytest.mark.parametrize(("cube", "text"), CASES.values(), ids=CASES)
def test_connections_are_those_of_ccx(cube: str, text: str, read: Read, ccx: Callable[..., str]) -> None:
    case, dat = read(text + END, cube), ccx(text + END, cube)
    last = dat[dat.rindex("displacements") :]
    theirs = np.array(re.findall(r"(?m)^ +(\d+) +(\S+) +(\S+) +(\S+)$", last), dtype=float)
    mesh, u = case.model.mesh, kl.run(case).result.u
    rows = mesh.node_rows(theirs[:, 0].astype(int))
    used = mesh.used_nodes()[rows]
    off = np.abs(u[rows] - theirs[:, 1:])[used]
    assert off.max() < 1e-6 * np.abs(theirs[used, 1:]).max()
    if "DISTRIBUTING" not in text:  # whose mean displacements ccx does not compute
        moved = displacements(case.model.supports, u, case.time.sizes[0] * 2 if case.time else 0.0)
        assert np.abs(moved[rows] - theirs[:, 1:]).max() < 1e-6 * np.abs(theirs[:, 1:]).max()


@pytest.mark.parametrize("name", ["displacement of a rigid body", "force and moment on a rigid body"])
def test_tables_have_reference_nodes_as_ccx_prints_them(
    name: str, tmp_path: Path, ccx: Callable[..., str]
) -> None:
    cube, text = CASES[name]
    (tmp_path / "job.inp").write_text(cube + text + END)
    Job(tmp_path / "job.inp", print).run()
    tables = [
        np.array(re.findall(r"(?m)^ +(\d+) +(\S+) +(\S+) +(\S+)$", dat), dtype=float)
        for dat in ((tmp_path / "job.dat").read_text(), ccx(text + END, cube))
    ]
    assert np.abs(tables[0] - tables[1]).max() < 1e-6 * np.abs(tables[1][:, 1:]).max()


def test_masses_have_the_frequencies_of_ccx(read: Read, ccx: Callable[..., str]) -> None:
    text = RIGID + MASS.replace("77,7", "77,20") + "*STEP\n*FREQUENCY\n2\n*END STEP\n"
    values, _ = read(text, TWO).model.modes(2)
    theirs = [float(cycles) for cycles in re.findall(r"(?m)^ +\d+ +\S+ +\S+ +(\S+) +\S+$", ccx(text, TWO))]
    assert np.abs(values / (2 * np.pi) - theirs[:2]).max() < 1e-6 * theirs[0]


FREE = "1,1,3\n2,2,3\n4,1\n4,3\n3,3"


def test_a_rigid_body_is_a_remote_point(read: Read) -> None:
    text = (
        RIGID.replace("*RIGID BODY, NSET=TOP", "*RIGID BODY, NSET=TOP")
        + STATIC
        + "*CLOAD\n20,1,2.\n21,3,1.\n"
        + END
    )
    case, other = read(text, REFS), read(STATIC + END, REFS).model
    point = other.rigid("TOP", (0.5, 0.4, 2.0))
    other.add(point.load((2.0, 0, 0), moment=(0, 0, 1.0)))
    result, theirs = kl.run(case).result, other.solve()
    assert np.abs(result.u - theirs.u).max() < 1e-12 * np.abs(theirs.u).max()
    moved = displacements(case.model.supports, result.u)
    rows = case.model.mesh.node_rows(np.array([20, 21]))
    assert np.abs(moved[rows] - [point.displacement(theirs), point.rotation(theirs)]).max() < 1e-12


def test_supported_nodes_of_a_rigid_body_hold_it(read: Read) -> None:
    held = RIGID + "*BOUNDARY\n5,1,3\n6,2,3\n8,3,3\n" + STATIC + "*CLOAD\n20,1,2.\n21,3,1.\n3,1,1.\n" + END
    case = read(held, REFS.replace("Bottom,1,3", "1,3,3"))
    u = kl.run(case).result.u
    assert np.abs(u[4:8]).max() < 1e-15
    assert np.abs(u).max() > 1e-4


def test_a_bar_beside_springs(read: Read) -> None:
    springs = spring("SPRING1", "5\n78,6\n79,7\n80,8", "3\n75.")
    u = kl.run(
        read(springs + STATIC + "*CLOAD\nTOP,3,10.\n" + END, CUBE.replace("Bottom,1,3", FREE))
    ).result.u
    assert np.abs(u[4:, 2] - 40 / (1000 + 300)).max() < 1e-15  # F / (E A / L + 4 k)


@pytest.mark.parametrize(("step", "force"), [("*CLOAD\n20,1,5.\n", 5.0), ("*BOUNDARY\n20,1,1,.01\n", 5.0)])
def test_a_bolt_between_walls(step: str, force: float, read: Read) -> None:
    wall = TWO.replace("Bottom,1,3", FREE) + "TOP,3\n"
    case = read(CUT + STATIC + step + END, wall)
    result = kl.run(case).result
    assert np.abs(result.stress("element")[:, 2] - force).max() < 1e-12  # E δ / L
    assert abs(displacements(case.model.supports, result.u)[12, 0] - 0.01) < 1e-12


@pytest.mark.parametrize("slave", ["LOW", "NODES"])
def test_a_tie_passes_stress_on(slave: str, read: Read) -> None:
    text = TIE.replace("LOW,", f"{slave},") + STATIC + "*DLOAD\n2,P2,-5.\n" + END
    u = kl.run(read(text, APART.replace("Bottom,1,3", FREE))).result.u
    assert np.abs(u[12:16, 2] - 0.01).max() < 1e-14


@pytest.mark.parametrize("n", [3, 4])
def test_what_is_tied_to_finer_faces_of_a_rigid_body_moves_with_it(n: int, read: Read) -> None:
    upper = kl.box((1, 1, 1), (n, n, 1))
    X, cells = np.add(upper.points, (0, 0, 1)), upper.blocks[0].nodes + 100
    lines = [f"*NODE\n20,.5,.4,2.\n21,0,0,0\n{rows(100, X)}*ELEMENT,TYPE=C3D8,ELSET=B\n{rows(100, cells)}"]
    lines += [f"*SOLID SECTION, ELSET=B, MATERIAL=STEEL\n{RIGID.replace('NSET=TOP', 'ELSET=B')}"]
    lines += ["*SURFACE, NAME=UP\n1,S2\n*SURFACE, NAME=LOW\nB,S1\n*TIE, NAME=T\nUP,LOW\n", STATIC]
    case = read("".join([*lines, "*CLOAD\n20,1,1.\n20,3,-2.\n", END]))
    result = kl.run(case).result
    R = rigid_modes(case.model.mesh.points, np.zeros(3)).reshape(-1, 3, 6)
    rigid, tied = (np.isin(case.model.mesh.node_ids, ids) for ids in (range(100, 100 + len(X)), range(5, 9)))
    motion = np.linalg.lstsq(R[rigid].reshape(-1, 6), result.u[rigid].ravel())[0]
    assert np.abs(result.u - R @ motion)[rigid | tied].max() < 1e-13


def rows(first: int, values: np.ndarray) -> str:
    """Return data lines with numbers from the first one."""
    return "".join(f"{i}, {', '.join(map(str, row))}\n" for i, row in enumerate(values.tolist(), first))


def test_reference_nodes_are_no_forgotten_nodes(read: Read) -> None:
    model = read(RIGID + STATIC + "*CLOAD\n20,1,1.\n" + END, REFS).model
    assert not [text for text in model.check() if "belong to no element" in text]
    model = read(STATIC + "*CLOAD\nTOP,1,1.\n" + END, REFS).model
    assert [text for text in model.check() if "belong to no element" in text]


LOOSE = "free, which no element uses; fix it and, if it is a reference node, its rotations"
WRONG = {  # text, and the message
    RIGID + STATIC + "*CLOAD\n20,5,1.\n": "rotations of the rigid body of node 20 are directions 1, 2, 3 of",
    RIGID + LARGE + "*BOUNDARY\n20,1,1,.1\n": "with NLGEOM its rotation must be held at 0",
    RIGID.replace("=20", "=TOP"): "REF NODE and ROT NODE are numbers of nodes; got TOP, 21",
    "*KINEMATIC\n1,3\n": "it belongs after *COUPLING",
    COUPLED + "*DISTRIBUTING\n1,6\n" + COUPLED.split("\n", 2)[2] + "*KINEMATIC\n1,3\n": (
        "with *DISTRIBUTING give each one of its own"
    ),
    COUPLED + "*KINEMATIC\n": "its lines have the first and the last degree of freedom, of 1 … 6",
    COUPLED.replace("STOP,", "TOP,") + "*DISTRIBUTING\n1,3\n": "there is no *SURFACE TOP of faces",
    COUPLED + "*KINEMATIC\n1,1\n" + STATIC: LOOSE,
    "*TIE, CYCLIC SYMMETRY, NAME=T\nA,B\n": "option CYCLICSYMMETRY is not supported",
    spring("SPRING1", "7", "2\n3.").replace("*SPRING,", "*SPRING,NONLINEAR,"): "option NONLINEAR is not",
    spring("SPRING1", "7", "2\n3.\n4."): "a line with one stiffness",
    spring("SPRING1", "7", "5\n3."): "a spring has directions 1, 2, 3 of solids",
    spring("SPRINGA", "20,7", "\n3.") + STATIC: "a spring ends at a node of no element that nothing holds",
    spring("SPRINGA", "1,7", "\n3.") + LARGE: "with NLGEOM ends of a spring must move along its line alone",
    MASS.replace("ELSET=EM\n3", "ELSET=EALL\n3"): "EALL has other elements than MASS",
    MASS + STATIC + "*DLOAD\nEM,CENTRIF,1.,0,0,0,0,0,1.\n": "CENTRIF on masses is not supported",
    CUT.replace("SURFACE=MID", "ELEMENT=3"): "option ELEMENT is not supported",
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), WRONG.items())
def test_what_is_wrong_or_not_supported(text: str, message: str, read: Read) -> None:
    with pytest.raises(kl.KratosLiteError, match=re.escape(message)):
        read(text + END if "*STEP" in text else text + STATIC + END, REFS)
