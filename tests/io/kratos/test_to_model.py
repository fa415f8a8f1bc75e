"""What a file means for a model: no value is dropped without a word."""

from __future__ import annotations

import os

import numpy as np
import pytest
from run_files import CUBE_NODES

import kratos_lite as kl
from kratos_lite.io.formats.document import Constraint, Document
from kratos_lite.io.formats.elem.reader import read_elem
from kratos_lite.io.formats.elem.writer import write_elem
from kratos_lite.io.formats.mdpa.reader import read_mdpa
from kratos_lite.io.formats.mdpa.writer import write_mdpa
from kratos_lite.io.text import blank_comments, read_bytes
from kratos_lite.mesh import Block, Mesh

CUBE = """Begin Properties 1
 YOUNG_MODULUS 210e6
 POISSON_RATIO 0.3
 DENSITY 1000
 CONSTITUTIVE_LAW LinearElastic3DLaw
{properties}
End Properties
{nodes}
Begin Elements {element}
1 1 1 2 3 4 5 6 7 8
End Elements
Begin Conditions SurfaceLoadCondition3D4N
3 1 5 6 7 8
End Conditions
Begin Conditions PointLoadCondition3D1N
7 1 7
End Conditions
Begin Conditions StrangeCondition3D4N
9 1 1 2 3 4
End Conditions
{data}
"""


@pytest.fixture
def load(tmp_path):
    def load(properties="", data="", element="SmallDisplacementElement3D8N"):
        path = tmp_path / "cube.mdpa"
        path.write_text(CUBE.format(nodes=CUBE_NODES, properties=properties, data=data, element=element))
        return kl.read(path)

    return load


def total(model):
    return sum(load.forces(model.mesh, model.element_groups()) for load in model.loads).sum(axis=0)


@pytest.mark.parametrize(
    ("text", "force"),
    [
        ("VOLUME_ACCELERATION_Z -9.81", -9810.0),
        ("GRAVITY_Z -9.81", -9810.0),
        ("BODY_FORCE_Z -9.81", -9.81),
        ("GRAVITY [3] (0, 0, -9.81)\nGRAVITY_Z -9.81", -9810.0),
    ],
)
def test_a_component_in_properties_loads_like_the_vector(load, text, force):
    np.testing.assert_allclose(total(load(text)), [0, 0, force], atol=1e-9)


WOOD = (
    "YOUNG_MODULUS_X 1e9\nYOUNG_MODULUS_Y 2e9\nYOUNG_MODULUS_Z 3e9\nPOISSON_RATIO_XY 0.1\n"
    "POISSON_RATIO_YZ 0.1\nPOISSON_RATIO_XZ 0.1\nSHEAR_MODULUS_XY 1e9\n"
    "SHEAR_MODULUS_YZ 1e9\nSHEAR_MODULUS_XZ 1e9"
)


@pytest.mark.parametrize(
    ("properties", "variable", "value", "words"),
    [
        (WOOD, "LOCAL_AXIS_1", "[3] (0,1,0)", "cube.mdpa:38: ElementalData LOCAL_AXIS_1 of orthotropic"),
        ("", "REFERENCE_TEMPERATURE", "20", "cube.mdpa:30: ElementalData REFERENCE_TEMPERATURE is not supp"),
    ],
)
def test_data_of_elements_that_change_a_solution_in_kratos_are_refused(
    load, properties, variable, value, words
):
    data = f"Begin ElementalData {variable}\n1 {value}\nEnd ElementalData"
    with pytest.raises(kl.InputError, match=words):
        load(properties, data)
    if variable == "LOCAL_AXIS_1":
        assert any("LOCAL_AXIS_1 is not used" in note for note in load("", data).notes)


def test_a_component_that_contradicts_its_vector_is_refused(load):
    with pytest.raises(
        kl.InputError, match=r"cube\.mdpa:7: Properties 1: GRAVITY_Z is 1, but GRAVITY has -9\.81 there"
    ):
        load("GRAVITY [3] (0, 0, -9.81)\nGRAVITY_Z 1")


def test_properties_without_use_are_noted_but_not_those_that_are_zero(load):
    notes = load("THICKNESS 0.5\nVISCOSITY 1e-5\nTEMPERATURE 0").notes
    text = "THICKNESS, VISCOSITY not used by a static solution of solids"
    assert f"Properties 1: {text}" in notes
    assert not any("TEMPERATURE" in note for note in notes)


@pytest.mark.parametrize(
    ("block", "variable"),
    [
        ("NodalData ACCELERATION\n1 0 [3] (0,0,0)\nEnd NodalData", "ACCELERATION"),
        ("ConditionalData FANCY\n3 [3] (0,0,-77)\nEnd ConditionalData", "FANCY"),
        ("NodalData LOCAL_INERTIA_TENSOR\n1 0 [1,1] ((2))\nEnd NodalData", "LOCAL_INERTIA_TENSOR"),
    ],
)
def test_vectors_without_use_are_noted(load, block, variable):
    notes = load(data=f"Begin {block}").notes
    assert any(note.endswith(f": {variable} is not used by a static solution of solids") for note in notes)


@pytest.mark.parametrize("kind", ["NodalData DISPLACEMENT\n1 0", "ConditionalData SURFACE_LOAD\n3"])
def test_a_used_vector_of_wrong_size_is_refused_at_its_line(load, kind):
    name = kind.split()[1]
    with pytest.raises(kl.InputError, match=rf"cube\.mdpa:30: {name} has values \[2\]; expected \[3\]"):
        load(data=f"Begin {kind} [2] (1,2)\nEnd {kind.split()[0]}")


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (
            "ConditionalData SURFACE_LOAD\n3 [3] (0,0,1)\n7 [3] (0,0,1)\n9 [3] (0,0,1)",
            "SURFACE_LOAD on 2 conditions (first 7) has no effect: only faces carry it; StrangeCondition3D4N "
            "carries no load",
        ),
        (
            "ConditionalData POINT_LOAD\n3 [3] (0,0,1)",
            "POINT_LOAD on 1 conditions (first 3) has no effect: only point conditions carry it",
        ),
        (
            "NodalData POINT_LOAD_X\n7 0 1\n2 0 1",
            "POINT_LOAD on 1 nodes (first 2) has no effect: only point conditions carry it, and none has "
            "these nodes",
        ),
    ],
)
def test_loads_that_nothing_carries_are_noted(load, data, note):
    notes = load(data=f"Begin {data}\nEnd {data.split()[0]}").notes
    assert [n for n in notes if "no effect" in n] == [note]


def test_a_fixed_value_that_changes_in_a_later_block_is_noted(load):
    block = "Begin NodalData DISPLACEMENT_X\n1 1 {}\n2 1 0\nEnd NodalData\n"
    model = load(data=block.format(0) + block.format(0.5))
    text = "DISPLACEMENT_X of node 1 is fixed to another value before; the last one counts"
    assert f"line 34: {text}" in model.notes
    assert model.supports.values[0, 0] == 0.5
    assert not any("another value" in note for note in load(data=block.format(0) * 2).notes)


def test_hints_name_solids_only_for_names_in_three_dimensions(load):
    with pytest.raises(kl.InputError, match=r"unknown element 'Elemet3D8N'.*Did you mean Element3D8N"):
        load(element="Elemet3D8N")
    with pytest.raises(kl.InputError, match="unknown element 'Element2D8N'") as error:
        load(element="Element2D8N")
    assert "Did you mean" not in str(error.value)


def test_constraints_are_written_in_blocks_of_one_number_of_masters(tmp_path):
    u = "DISPLACEMENT_X"
    constraints = [
        Constraint(1, (1, u), ((2, u),), (1.0,), 0.0),
        Constraint(2, (3, u), ((2, u), (4, u)), (0.5, 0.5), 0.0),
    ]
    document = Document(Mesh(np.eye(4, 3)), constraints=constraints)
    write_mdpa(tmp_path / "a.mdpa", document)
    text = (tmp_path / "a.mdpa").read_text()
    assert text.count("Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X\n") == 2
    again = read_mdpa(tmp_path / "a.mdpa")
    assert [c.independents for c in again.constraints] == [c.independents for c in constraints]
    assert not again.notes
    (tmp_path / "a.mdpa").write_text(text.replace(
        "End Constraints\n\nBegin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X\n", ""
    ))  # fmt: skip
    (note,) = read_mdpa(tmp_path / "a.mdpa").notes
    assert "Kratos misreads a block of Constraints with different numbers of independent nodes" in note.text


def test_names_of_2008_become_those_of_kratos(tmp_path):
    blocks = [Block("TotalLagrangian3D8N", np.arange(8)[None], np.array([1]), np.array([1]), None)]
    faces = [
        Block(name, np.arange(4)[None], np.array([i]), np.array([1]), None)
        for i, name in enumerate(("Face3D4", "MasterContactFace3D4"), start=1)
    ]
    mesh = Mesh(np.arange(24.0).reshape(8, 3), blocks, conditions=faces)
    notes = write_mdpa(tmp_path / "a.mdpa", Document(mesh))
    assert list(map(str, notes)) == ["1 MasterContactFace3D4 are written, but Kratos 10 does not know them"]
    text = (tmp_path / "a.mdpa").read_text()
    assert "Begin Elements SmallDisplacementElement3D8N\n" in text
    assert "Begin Conditions SmallDisplacementSurfaceLoadCondition3D4N\n" in text


@pytest.fixture
def elem(tmp_path):
    def write(prop="", cond="", init=""):
        (tmp_path / "q.node").write_text("NODES=NodesList([[1,0,0,0],[2,1,0,0],[3,0,1,0],[4,0,0,1]])")
        (tmp_path / "q.elem").write_text("ELEMENTS[1] = TotalLagrangian3D4N([1,2,3,4],1);")
        base = "PROPERTIES[1][YOUNG_MODULUS]=1;\nPROPERTIES[1][POISSON_RATIO]=0;\n"
        (tmp_path / "q.prop").write_text(base + prop)
        (tmp_path / "q.cond").write_text(cond)
        (tmp_path / "q.init").write_text(init)
        return tmp_path / "q.elem"

    return write


@pytest.mark.parametrize(
    ("name", "expected"),
    [("INTEGRATION_ORDER", "1 … 5"), ("PRESTRESS_FACTOR", "one number"), ("GRAVITY_Z", "one number")],
)
def test_wrong_values_of_a_set_are_refused_in_the_prop_file(elem, name, expected):
    with pytest.raises(kl.InputError, match=rf"q\.prop:3: .*{name} must be {expected}"):
        kl.read(elem(f"PROPERTIES[1][{name}]=[1,2];"))


def test_a_set_writes_each_dof_once(elem, tmp_path):
    document = read_elem(elem(cond="NODES[1].Fix(DISPLACEMENT_X);"))
    document.nodal_data *= 2
    write_elem(tmp_path / "w.elem", document)
    assert (tmp_path / "w.cond").read_text() == "NODES[1].Fix(DISPLACEMENT_X);\n"
    assert (tmp_path / "w.init").read_text() == "NODES[1](DISPLACEMENT_X, 0) = 0.0;\n"


def test_a_set_is_written_whole_or_not_at_all(elem, tmp_path):
    document = read_elem(elem())
    (tmp_path / "w.init").mkdir()
    with pytest.raises(kl.InputError, match=r"w\.init: cannot be written"):
        write_elem(tmp_path / "w.elem", document)
    assert sorted(p.name for p in tmp_path.glob("[!q]*")) == ["w.init"]


def test_a_gzipped_set_is_not_written(elem, tmp_path):
    with pytest.raises(kl.InputError, match="not written gzipped"):
        write_elem(tmp_path / "w.elem.gz", read_elem(elem()))
    assert not list(tmp_path.glob("w*"))


def test_the_first_of_many_unclosed_comments_is_named():
    with pytest.raises(kl.InputError, match=r"a:2:3: comment '/\*' is never closed"):
        blank_comments(b"a // /*\n  " + b"/* \n" * 100_000, "a")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_and_a_loop_of_links_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.mdpa")
    with pytest.raises(kl.InputError, match="no ordinary file but a pipe or device"):
        read_bytes(tmp_path / "pipe.mdpa")
    (tmp_path / "loop.mdpa").symlink_to(tmp_path / "loop.mdpa")
    with pytest.raises(kl.InputError, match="cannot be read"):
        read_bytes(tmp_path / "loop.mdpa")


RING = """
Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X DISPLACEMENT_X
1 0.0 [1.0] 4 6
2 0.0 [1.0] 6 8
3 0.0 [1.0] 8 4
4 0.0005 [0.5] 2 2
End Constraints
"""


def test_a_ring_of_constraints_is_read_solved_and_written_without_it(tmp_path):
    """Nodes 4, 6 and 8 move alike in x; node 2 moves by 1 mm, as half of its motion and 0.5 mm."""
    model = kl.Model(kl.box(), kl.Isotropic3D(200e9, 0.3, density=7800.0))
    model.fix(model.mesh.nodes("z-")[[0, 2, 3]], "xyz")
    model.fix([1], "yz")
    model.add(kl.PointLoad([7], (1e5, 0, -1e5)))
    kl.write(tmp_path / "plain.mdpa", model)
    with open(tmp_path / "plain.mdpa", "a") as file:
        file.write(RING)
    ring = kl.read(tmp_path / "plain.mdpa")
    for dependent in (3, 5):
        model.constrain((dependent, "x"), {(7, "x"): 1.0})
    model.fix([1], "x", 1e-3)
    found, expected = ring.solve().u, model.solve().u
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    kl.write(tmp_path / "solved.mdpa", ring)
    again = kl.read(tmp_path / "solved.mdpa")
    assert len(np.unique(again.supports.constraints.dependents)) == len(again.supports.constraints) == 2
    assert np.abs(again.solve().u - expected).max() < 1e-12 * np.abs(expected).max()
