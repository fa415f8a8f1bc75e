"""Result files against those of CalculiX 2.20 on the same meshes, line by line."""

import re
from itertools import zip_longest

import numpy as np
import pytest
from calculix_files import MISSING, TYPES, blocks, ccx, model_and_deck, warped

import kratos_lite as kl
from kratos_lite.io.writers import dat
from kratos_lite.io.writers.calculix import at_nodes
from kratos_lite.io.writers.frd import FrdStep, write_frd

pytestmark = pytest.mark.skipif(MISSING, reason="CalculiX is not installed")
STEP = ["*STEP", "*STATIC"]
OUTPUT = ["*NODE FILE", "U,RF", "*EL FILE", "S,E,ENER"]
PRINTS = [
    "*NODE PRINT,NSET=FIXED,TOTALS=YES", "U,RF",
    "*EL PRINT,ELSET=EALL,TOTALS=YES", "S,E,ENER,COORD,EVOL,ELSE",
]  # fmt: skip
END = ["*END STEP"]
NUMBER = re.compile(r"[ -]\d\.\d+E[+-]\d\d")
ROUND = {"KinematicLinear3D4N": (2, 1, 1), "Reduced3D20N": (2, 2, 2)}


def apart(text):
    """Return lines without numbers, dates and names of programs, and the numbers."""
    lines = [line for line in text.splitlines() if not line.startswith("    1U") or "1UMAT" in line]
    return [NUMBER.sub("#", line) for line in lines], [
        float(n) for line in lines for n in NUMBER.findall(line)
    ]


@pytest.mark.parametrize("name", TYPES)
def test_files_and_tables_of_statics_are_those_of_calculix(name, tmp_path):
    model, deck, load = model_and_deck(warped(name, ROUND.get(name, (2, 1, 1))))
    frd, printed = ccx(tmp_path, [*deck, *STEP, *load, *OUTPUT, *PRINTS, *END])
    result, mesh = model.solve(), model.mesh
    write_frd(tmp_path / "ours.frd", mesh, [FrdStep(at_nodes(result))], {1: "STEEL"})
    ours = (tmp_path / "ours.frd").read_text()
    theirs, (here, there) = blocks(frd), (apart(text)[0] for text in (ours, frd))
    assert [line for line, other in zip_longest(here, there) if line != other] == []
    cut = [text[text.index("    2C") : text.index("    1PSTEP")] for text in (ours, frd)]
    assert cut[0] == cut[1]
    for (_, field, *_, values), (*_, expected) in zip(blocks(ours), theirs, strict=True):
        # all six digits, but for their last one where it is decided by the rounding of a solution; constants
        # of errors have four to six
        least = 2e-5 if field == "ERROR" else 1.01e-6
        assert np.abs(values - expected).max() <= least * np.abs(expected).max(), field
    ids, elements = np.sort(mesh.nodes("x-")), np.arange(mesh.n_elements)
    lines = [line for v in ("U", "RF") for line in dat.prints(result, ids, v, "FIXED", totals="YES")]
    for variable in ("S", "E", "ENER", "COORD", "EVOL", "ELSE"):
        lines += dat.prints(result, elements, variable, "EALL", totals="YES")
    assert [line for line, other in zip_longest(lines, printed.splitlines()) if not same(line, other)] == []


def same(line, other, least=1e-12):
    """Return whether lines are the same, numbers to 4e-6 of the largest in the line, or of `least`."""
    if apart(line)[0] != apart(other)[0]:
        return False
    here, there = (np.array(apart(text)[1]) for text in (line, other))
    return not len(here) or np.abs(here - there).max() <= 4e-6 * max(np.abs(there).max(), least)


FACES = {
    "KinematicLinear3D4N": (0, 1, 3), "KinematicLinear3D6N": (3, 4, 5), "KinematicLinear3D8N": (4, 5, 6, 7),
    "KinematicLinear3D10N": (0, 1, 3, 4, 8, 7), "KinematicLinear3D15N": (3, 4, 5, 12, 13, 14),
    "KinematicLinear3D20N": (4, 5, 6, 7, 16, 17, 18, 19), "Reduced3D20N": (4, 5, 6, 7, 16, 17, 18, 19),
}  # fmt: skip
"""Nodes of the second face in decks."""
CELLS = {3: "Triangle3", 4: "Quadrilateral4", 6: "Triangle6", 8: "Quadrilateral8"}


@pytest.mark.parametrize("name", TYPES)
def test_section_forces_are_those_of_calculix(name, tmp_path):
    from kratos_lite.shapes import faces

    model, deck, load = model_and_deck(warped(name, ROUND.get(name, (2, 1, 1))))
    deck += ["*SURFACE,NAME=TOP", "1,S2"]
    section = ["*SECTION PRINT,SURFACE=TOP,NAME=CUT", "SOF"]
    _, printed = ccx(tmp_path, [*deck, *STEP, *load, *OUTPUT, *section, *END])
    nodes = model.mesh.blocks[0].nodes[:1, list(FACES[name])]
    face = kl.Block("face", nodes, shape=getattr(faces, CELLS[nodes.shape[1]]))
    lines = dat.section_print(model.solve(), [face], "TOP")
    expected = printed.splitlines()
    assert len(lines) == len(expected)
    assert [(a, b) for a, b in zip(lines, expected, strict=True) if not same(a, b, 1.0)] == []


def test_tables_of_modes_and_buckling_are_those_of_calculix(tmp_path):
    """A straight box: the masses of warped elements are integrated by other rules in CalculiX."""
    model, deck, load = model_and_deck(kl.box((3, 1.1, 0.9), (3, 2, 1), "KinematicLinear3D8N"))
    steps = [*STEP, *load, *END, "*STEP", "*FREQUENCY", "4", "*NODE FILE", "U", *END]
    frd, printed = ccx(tmp_path, [*deck, *steps, "*STEP", "*BUCKLE", "2,1.E-9", *load, *END])
    matrices, (omega, shapes) = model.matrices(), model.modes(4)
    lines = dat.frequencies(omega, shapes, matrices.M, model.mesh.points, matrices.free)
    factors, _ = model.buckling(2)
    at = printed.splitlines()
    begin = next(i for i, line in enumerate(at) if "E I G E N V A L U E   O" in line) - 1
    there = at[begin : begin + len(lines)]
    scale = [
        max((abs(float(n)) for n in re.findall(r"-?0\.\d+E[+-]\d\d", line)), default=0) for line in there
    ]
    for line, other, size in zip(lines, there, scale, strict=True):
        a, b = (re.sub(r"-?0\.\d+E[+-]\d\d", "", text).replace(" ", "") for text in (line, other))
        assert a == b
        x, y = (np.abs([float(n) for n in re.findall(r"-?0\.\d+E[+-]\d\d", text)]) for text in (line, other))
        assert len(x) == len(y)
        assert not len(x) or np.abs(x - y).max() <= 2e-6 * size
    begin = next(i for i, line in enumerate(at) if "B U C K" in line) - 1
    assert dat.buckling(factors) == at[begin : begin + 8]
    kl.write_modes(tmp_path / "m.frd", model.mesh, omega, shapes)
    ours = blocks((tmp_path / "m.frd").read_text())
    theirs = [block for block in blocks(frd) if "MODAL" in block[0] and block[1] == "DISP"]
    for (head, _, names, ids, values), (other, _, parts, numbers, expected) in zip(ours, theirs, strict=True):
        assert (names, ids, head[24:58], head[63:]) == (parts, numbers, other[24:58], other[63:])
        assert abs(float(head[12:24]) / float(other[12:24]) - 1) < 1e-8
        assert np.abs(np.abs(values) - np.abs(expected)).max() < 1e-5 * np.abs(values).max()
    heads = [
        [line for line in text.splitlines() if line.startswith("    1PG")]
        for text in ((tmp_path / "m.frd").read_text(), frd)
    ]
    assert [line[:30] for line in heads[0]] == [line[:30] for line in heads[1]]


def test_materials_are_averaged_together_and_heated_bodies_have_temperatures(tmp_path):
    mesh = warped("KinematicLinear3D10N")
    model, deck, _ = model_and_deck(mesh)
    half = mesh.n_elements // 2
    at = deck.index("*SOLID SECTION,ELSET=EALL,MATERIAL=STEEL")
    deck[at : at + 1] = [
        "*MATERIAL,NAME=ALU", "*ELASTIC", "7.E10,0.3", "*EXPANSION", "2.3E-5",
        "*ELSET,ELSET=A", *(f"{i}," for i in range(1, half + 1)),
        "*ELSET,ELSET=B", *(f"{i}," for i in range(half + 1, mesh.n_elements + 1)),
        "*SOLID SECTION,ELSET=A,MATERIAL=STEEL", "*SOLID SECTION,ELSET=B,MATERIAL=ALU",
    ]  # fmt: skip
    deck += ["*INITIAL CONDITIONS,TYPE=TEMPERATURE", "NALL,20."]
    output = ["*NODE FILE", "U,NT,RF", "*EL FILE", "S,E,ME"]
    frd, printed = ccx(
        tmp_path, [*deck, *STEP, "*TEMPERATURE", "NALL,70.", *output, "*NODE PRINT,NSET=FIXED", "NT", *END]
    )
    (block,) = mesh.blocks
    split = mesh.replace(
        blocks=[kl.Block(block.name, block.nodes, properties=1 + (np.arange(mesh.n_elements) >= half))]
    )
    both = {
        1: kl.Isotropic3D(E=2.1e11, nu=0.3, alpha=1.2e-5),
        2: kl.Isotropic3D(E=7e10, nu=0.3, alpha=2.3e-5),
    }
    model = kl.Model(split, both)
    model.fix("x-")
    model.add(kl.Temperature(70.0, reference=20.0))
    result = model.solve()
    names = ["DISP", "NDTEMP", "STRESS", "TOSTRAIN", "MESTRAIN", "FORC"]
    write_frd(tmp_path / "ours.frd", split, [FrdStep(at_nodes(result, names))], {1: "STEEL", 2: "ALU"})
    text = (tmp_path / "ours.frd").read_text()
    theirs = [found for found in blocks(frd) if found[1] != "ERROR"]
    for (_, field, *_, values), (_, name, *_, expected) in zip(blocks(text), theirs, strict=True):
        assert field == name
        assert np.abs(values - expected).max() <= 1.01e-6 * np.abs(expected).max(), field
    mats = [
        [line for line in t.splitlines() if "1UMAT" in line or re.match(r" -1 +\d+    6    0", line)]
        for t in (text, frd)
    ]
    assert sorted(mats[0]) == sorted(mats[1])
    table = dat.prints(result, np.sort(mesh.nodes("x-")), "NT", "FIXED")
    assert table == printed.splitlines()[: len(table)]


def test_forces_in_time_are_internal_ones_without_inertia(tmp_path):
    mesh = kl.box((2, 1, 1), (2, 1, 1), "KinematicLinear3D8N")  # straight, with the same masses
    model, deck, load = model_and_deck(mesh)
    steps = ["*STEP,INC=100", "*DYNAMIC,DIRECT,ALPHA=0.", "1.E-5,4.E-5", *load, "*NODE FILE", "U,V,RF", *END]
    frd, _ = ccx(tmp_path, [*deck, *steps])
    transient = model.transient(integrator=kl.Newmark())
    with kl.SeriesWriter(tmp_path / "ours.frd", transient) as series:
        for state in kl.integrate(transient, dt=1e-5, steps=4):
            if state.step:
                series.add(state)
    ours = [
        block for block in blocks((tmp_path / "ours.frd").read_text()) if block[1] in ("DISP", "VELO", "FORC")
    ]
    theirs = blocks(frd)
    assert [(head, name) for head, name, *_ in ours] == [(head, name) for head, name, *_ in theirs]
    for (_, name, *_, values), (*_, expected) in zip(ours, theirs, strict=True):
        assert np.abs(values - expected).max() <= 1e-3 * np.abs(expected).max(), (
            name
        )  # it iterates until 5e-3
