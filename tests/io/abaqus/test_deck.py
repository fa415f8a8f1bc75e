"""Cards, meshes and loads of decks, their meaning in steps, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.abaqus.cards import read_cards
from kratos_lite.io.abaqus.mesh import FACES, face_rows
from kratos_lite.shapes import SHAPES
from tests.io.abaqus.conftest import CUBE

Read = Callable[..., kl.Case]
PRINT = "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"


def displacements(dat: str) -> np.ndarray:
    """Return the displacements (steps, n, 3) that ccx prints of all nodes."""
    rows = re.findall(r"(?m)^ +\d+ +(\S+) +(\S+) +(\S+)$", dat)
    return np.array(rows, dtype=float).reshape(dat.count("displacements"), -1, 3)


def solved(case: kl.Case) -> np.ndarray:
    """Return the displacements (steps, n, 3) of all steps."""
    return np.array([kl.run(each).result.u for each in (case, *case.then)])


STEPS = {
    "loads of one step add, those of a later one replace": (
        "*STEP\n*STATIC\n*CLOAD\nTOP,3,1.\n7,3,1.\n*DLOAD\n1,P2,-4\n1,P2,-4\n" + PRINT,
        "*STEP\n*STATIC\n*CLOAD\nTOP,3,1.\n" + PRINT,
        "*STEP\n*STATIC\n*DLOAD\nEall,P2,-4\n" + PRINT,
        "*STEP\n*STATIC\n*CLOAD,OP=NEW\n5,3,1.\n" + PRINT,
        "*STEP\n*STATIC\n*DLOAD,OP=NEW\n" + PRINT,
        "*STEP\n*STATIC\n*BOUNDARY\nTOP,3,3,0.1\n" + PRINT,
        "*STEP\n*STATIC\n*BOUNDARY,OP=NEW\nBOTTOM,1,3\n" + PRINT,
    ),
    "OP=NEW counts on the first card of a kind": (
        "*STEP\n*STATIC\n*BOUNDARY,OP=NEW\nBOTTOM,1,3\n*BOUNDARY,OP=NEW\n8,1,1,.01\n"
        "*CLOAD,OP=NEW\nTOP,3,1.\n*CLOAD,OP=NEW\n7,1,2.\n" + PRINT,
        "*SURFACE,NAME=S\n1,S4\n*STEP\n*STATIC\n*CLOAD\n5,1,1.\n*CLOAD,OP=NEW\n6,1,1.\n"
        "*DLOAD,OP=NEW\nEALL,P2,-4.\n*DSLOAD,OP=NEW\nS,P,2.\n" + PRINT,
        "*STEP\n*STATIC\n*CLOAD,OP=NEW\n*DLOAD\nEALL,GRAV,9.81,0.,0.,-1.\n" + PRINT,
        "*STEP\n*STATIC\n*DSLOAD,OP=NEW\nS,P,3.\n" + PRINT,
    ),
    "a comma ends a card": ("*STEP\n*STATIC\n*CLOAD,\nTOP,3,1.\n" + PRINT,),
    "loads of one step on a body add, too; a missing value is 0": (
        "*STEP\n*STATIC\n*DLOAD\nEALL,GRAV,9.81,0.,0.6,-0.8\nEALL,GRAV,9.81,0.,0.6,-0.8\n" + PRINT,
        "*STEP\n*STATIC\n*DLOAD\nEALL,GRAV,5.,0.,0.6,-0.8\n*DLOAD\nEALL,GRAV,2.,1.,0.,0.\n" + PRINT,
        "*STEP\n*STATIC\n*CLOAD\n7,1\n8,2,1.\n" + PRINT,
    ),
    "weight, rotation and a surface": (
        "*STEP\n*STATIC\n*DLOAD\nEALL,GRAV,9.81,0.,0.6,-0.8\n" + PRINT,
        "*STEP\n*STATIC\n*DLOAD,OP=NEW\nEALL,CENTRIF,4.,1.,0.,0.,0.,0.,1.\n" + PRINT,
        "*STEP\n*STATIC\n*DLOAD,OP=NEW\n1,P4,3.\n1,P1,2.\n" + PRINT,
    ),
}


@pytest.mark.parametrize("steps", STEPS.values(), ids=STEPS)
def test_steps_are_those_of_ccx(steps: tuple[str, ...], read: Read, ccx: Callable[[str], str]) -> None:
    ours, theirs = solved(read("".join(steps))), displacements(ccx("".join(steps)))
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() < 1e-6 * np.abs(theirs).max()


def test_hydrostatic_pressure_by_faces_and_by_a_surface(read: Read) -> None:
    faces = "".join(f"1,P{i},7.\n" for i in range(1, 7))
    surface = "*SURFACE, NAME=SKIN\n" + "".join(f"EALL,S{i}\n" for i in range(1, 7))
    free = CUBE.replace("Bottom,1,3", "1,1,3\n2,2,3\n4,3")
    for model, step in (("", f"*DLOAD\n{faces}"), (surface, "*DSLOAD\nSKIN,P,7.\n")):
        case = read(f"{model}*STEP\n*STATIC\n{step}*END STEP\n", free)
        assert not case.model.is_nonlinear  # no load follows the body
        stress = kl.run(case).result.stress("element")
        assert np.abs(stress - [-7, -7, -7, 0, 0, 0]).max() < 1e-12


def test_single_loads_add_as_those_of_sets_do(read: Read) -> None:
    groups = "*NSET,NSET=A\n5,6,7\n*ELSET,ELSET=B\n1\n"
    singles = "5,1,2.\n6,1,2.\n7,1,2.\n7,3,1.\n7,3,1.\n*DLOAD\n1,P3,2.\n1 , p3 ,1.\n1,P5,4.\n"
    sets = "A,1,2.\n7,3,2.\n*DLOAD\nB,P3,3.\nB,P5,4.\n"
    step = "*STEP\n*STATIC\n*CLOAD\n{}*END STEP\n"
    ours, theirs = (solved(read(groups + step.format(text))) for text in (singles, sets))
    assert np.abs(ours - theirs).max() < 1e-12 * np.abs(theirs).max()


def test_numbers_behind_the_nodes_of_an_element_are_ignored_with_a_note(read: Read) -> None:
    case = read(STEP, CUBE.replace("\n5,6,7,8\n", "\n5,6,7,8,9,\n"))
    assert case.model.mesh.blocks[0].nodes.tolist() == [[0, 1, 2, 3, 4, 5, 6, 7]]
    assert any("what stands behind 9 numbers is ignored" in note for note in case.model.notes)


@pytest.mark.parametrize("name", ["Tetrahedron10", "Wedge15", "Hexahedron20"])
def test_faces_have_the_corners_that_the_manual_names(name: str) -> None:
    shape = SHAPES[name]
    for mine, theirs in zip(face_rows(shape), FACES[shape.cell], strict=True):
        assert {n for n in shape.faces[mine] if n < shape.corners} == set(theirs)


def test_local_axes_of_nodes_turn_supports_and_forces(read: Read) -> None:
    turned = "*TRANSFORM, NSET=ALL, TYPE=R\n0.,1.,0.,-1.,0.,0.\n"  # x' = y, y' = -x
    step = "*STEP\n*STATIC\n*CLOAD\nTOP,1,1.\n*END STEP\n"
    plain = solved(read(step.replace("TOP,1", "TOP,2")))
    assert np.abs(solved(read(turned + step)) - plain).max() < 1e-12 * np.abs(plain).max()


def test_equations_tie_nodes(read: Read) -> None:
    text = "*EQUATION\n2\n5,3,1.,6,3,-1.\n2\n7,3,1.,8,3,-2.\n*STEP\n*STATIC\n*CLOAD\n7,3,1.\n*END STEP\n"
    u = solved(read(text))[0]
    assert abs(u[4, 2] - u[5, 2]) < 1e-15
    assert abs(u[6, 2] - 2 * u[7, 2]) < 1e-15


def test_temperatures_count_from_initial_ones(read: Read) -> None:
    hot = CUBE.replace("*DENSITY", "*EXPANSION\n1e-3\n*DENSITY").replace("Bottom,1,3", "1,1,3\n2,2,3\n4,3")
    text = (
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL,20.\n*STEP\n*STATIC\n*TEMPERATURE\nALL,50.\n*END STEP\n"
    )
    u = solved(read(text, hot))[0]
    assert np.abs(u[6] - 0.03).max() < 1e-12


def test_sets_are_parts_and_included_files_are_read(tmp_path: Path) -> None:
    mesh, rest = CUBE.split("*MATERIAL")
    (tmp_path / "mesh.inp").write_text(mesh)
    deck = tmp_path / "job.inp"
    deck.write_text(f"*INCLUDE, INPUT=mesh.inp\n*MATERIAL{rest}*STEP\n*STATIC\n*END STEP\n")
    parts = kl.read_case(deck).model.mesh.parts
    assert [len(parts[name].nodes) for name in ("BOTTOM", "TOP", "EALL")] == [4, 4, 8]
    assert [card.keyword for card in read_cards(deck)][:2] == ["HEADING", "NODE"]


@pytest.mark.parametrize(
    ("head", "inside", "tail"),
    [("*NODE, NSET=ALL\n", "", ""), ("", "*NODE, NSET=ALL\n", ""), ("*NODE, NSET=ALL\n", "", "8,0,1,1\n")],
)
def test_data_go_on_in_included_files(head: str, inside: str, tail: str, tmp_path: Path) -> None:
    before, rest = CUBE.split("*NODE, NSET=ALL\n")
    nodes, after = rest.split("*ELEMENT")
    (tmp_path / "nodes.txt").write_text(inside + nodes.replace(tail or "?", ""))
    deck = tmp_path / "job.inp"
    deck.write_text(f"{before}{head}*INCLUDE, INPUT=nodes.txt\n{tail}*ELEMENT{after}")
    assert np.abs(kl.read_case(deck).model.mesh.points.sum(axis=0) - 4).max() == 0
    deck.write_text(f"{CUBE}*STEP\n*STATIC\n1.,1.\n*INCLUDE, INPUT=nodes.txt\n*END STEP\n")
    if not inside:
        with pytest.raises(kl.InputError, match=r"nodes.txt:1: the data of \*STATIC of .*:30 go on"):
            kl.read_case(deck)


STEP = "*STEP\n*STATIC\n*END STEP\n"
WRONG = {  # what is added to the cube, and the message, which begins with the line in that, from 0
    "*STEP\n*STATIC\n": "0: *STEP: the step is not ended by *END STEP",
    "*FOO\n" + STEP: "0: *FOO: this card is not known",
    "*RESTART, READ, STEP=1\n" + STEP: "*RESTART: a start from the state of another job is not supported",
    "*CONTACT PAIR, INTERACTION=A\n" + STEP: "*CONTACTPAIR: contact is not supported",
    "*STEP\n*STATIC\n*CLOAD\n99,1,1.\n*END STEP\n": "3: there is no node 99",
    "*STEP\n*STATIC\n*CLOAD\n7,1,1.\n99,1,1.\n*END STEP\n": "4: there is no node 99",
    "*STEP\n*STATIC\n*DLOAD\n1,P1,1.\n9,P1,1.\n*END STEP\n": "4: there is no solid element 9",
    "*STEP\n*STATIC\n*CLOAD\n7,1,1.\n7,P1,1.\n*END STEP\n": "4: 'P1' is not a number",
    "*STEP\n*STATIC\n*CLOAD\nTOPP,1,1.\n*END STEP\n": "3: there is no NSET 'TOPP'. Did you mean TOP",
    "*STEP\n*STATIC\n*CLOAD\nTOP,7,1.\n*END STEP\n": "3: a force on solids has direction 1, 2 or 3, on",
    "*STEP\n*STATIC\n*DLOAD\nEALL,P7,1.\n*END STEP\n": "3: a face is P1, P2, … P6; got 'P7'",
    "*STEP\n*STATIC\n*DLOAD\nEALL,BX,1.\n*END STEP\n": "3: a face is P1",
    "*CLOAD\nTOP,1,1.\n" + STEP: "0: *CLOAD: it belongs between *STEP and *END STEP",
    "*ELSET, ELSET=A\nB\n" + STEP: "1: there is no ELSET 'B'",
    "*NSET, NSET=A, GENERATE\n5,1\n" + STEP: "1: 5 to 1 by 1 is no range",
    "*ELEMENT, TYPE=S4, ELSET=S\n2,1,2,3,4\n" + STEP: "0: *ELEMENT: element S4 is not supported",
    "*ELEMENT, TYPE=C3D8\n2,1,2,3,4,5,6,7\n" + STEP: "0: *ELEMENT: 8 numbers are no rows of 9",
    "*ELEMENT, TYPE=C3D4\n2,1,2,3,44\n" + STEP: "0: element 2 names node 44, which is not there",
    "*ELEMENT, TYPE=C3D4\n2,1,2,3,5\n" + STEP: "element 2 is in no *SOLID SECTION",
    "*STEP\n*STATIC\n*DLOAD\nEALL,CENTRIF,1.,0,0,0,0,0,1.\nEALL,CENTRIF,1.,0,0,0,0,1.,0.\n*END STEP\n": (
        "4: an element turns about another axis already"
    ),
    "*EQUATION\n0\n" + STEP: "1: an equation has 1 term at least; got 0",
    "*EQUATION\n2\n5,3,0.,6,3,-1.\n" + STEP: "1: the first term has the factor 0",
    "*EQUATION\n2\n5,3,1.,6.5,3,-1.\n" + STEP: "1: there is no node 6.5",
    "*BOUNDARY\nTOP,XSYMM\n" + STEP: "1: 'XSYMM' is no number of a direction",
    "*BOUNDARY\nTOP,1,1,1;5\n" + STEP: "1: '1;5' is not a number",
    "*STEP, FOO=1\n*STATIC\n*END STEP\n": "0: *STEP: option FOO is not supported",
    "*STEP\n*STATIC\n*FREQUENCY\n3\n*END STEP\n": "2: *FREQUENCY: the step has *STATIC already",
    "*STEP\n*END STEP\n": "0: *STEP: the step has no procedure such as *STATIC",
    "*AMPLITUDE, NAME=A\n0.,1.,2.\n" + STEP: "0: *AMPLITUDE: times and factors come in pairs; got 3 numbers",
    "*SOLID SECTION, ELSET=EALL, MATERIAL=X\n" + STEP: "0: *SOLIDSECTION: there is no *MATERIAL X",
    "*DENSITY\n1.\n" + STEP: "0: *DENSITY: it belongs after *MATERIAL",
    "*INCLUDE, INPUT=../x.inp\n" + STEP: "leaves the folder",
    "*MATERIAL, NAME=STEEL\n" + STEP: "0: *MATERIAL: the name STEEL is taken",
    "*STEP\n*STATIC\n*CLOAD, AMPLITUDE=A\nTOP,1,1.\n*END STEP\n": "2: *CLOAD: there is no *AMPLITUDE A",
    "*BOUNDARY, AMPLITUDE=A\nTOP,1,1,1.\n" + STEP: "0: *BOUNDARY: there is no *AMPLITUDE A",
}


@pytest.mark.parametrize("text", WRONG)
def test_damaged_decks_get_one_clear_error(text: str, read: Read) -> None:
    with pytest.raises(kl.InputError) as caught:
        read(text)
    message = re.sub(r"^(\d+)", lambda m: f"job.inp:{CUBE.count(chr(10)) + 1 + int(m[1])}", WRONG[text])
    assert message in str(caught.value)


def test_a_deck_without_nodes_says_which_is_missing(read: Read) -> None:
    with pytest.raises(kl.InputError, match=r"job\.inp:5: element 1 names node 1, which is not there"):
        read(STEP, re.sub(r"(?m)^\d,[01],[01],[01]\n", "", CUBE))


def test_weight_needs_a_density(read: Read) -> None:
    weight = "*STEP\n*STATIC\n*DLOAD\nEALL,GRAV,9.81,0.,0.,-1.\n*END STEP\n"
    with pytest.raises(kl.InputError, match=r"\*MATERIAL: GRAV and CENTRIF need its \*DENSITY"):
        read(weight, CUBE.replace("*DENSITY\n2.\n", ""))


WEDGE = (
    "*NODE, NSET=ALL\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,1,.1,1\n6,0,1,1.2\n"
    "*ELEMENT, TYPE=C3D6, ELSET=EALL\n1,1,2,3,4,5,6\n*NSET, NSET=BOTTOM\n1,2,3\n"
)


def test_a_wedge_has_the_points_of_calculix(read: Read, ccx: Callable[..., str]) -> None:
    deck = WEDGE + CUBE[CUBE.index("*MATERIAL") :]
    step = "*STEP\n*STATIC\n*CLOAD\n4,1,1.\n6,3,2.\n" + PRINT
    ours, theirs = solved(read(step, deck)), displacements(ccx(step, deck))
    assert np.abs(ours - theirs).max() < 1e-6 * np.abs(theirs).max()
