"""Writing `.mdpa` files: everything survives, Kratos reads them, a failure leaves nothing behind."""

import gzip
import importlib.util
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from children import output_of
from meshes import with_block
from scenes import case, present

import kratos_lite as kl
from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Constraint, Data, Document, Properties
from kratos_lite.io.formats.mdpa.reader import read_mdpa
from kratos_lite.io.formats.mdpa.values import Table
from kratos_lite.io.formats.mdpa.writer import write_mdpa
from kratos_lite.mesh import Block, Mesh, Part
from kratos_lite.shapes.faces import Quadrilateral4
from kratos_lite.shapes.hexahedra import Hexahedron8

CASES = present(
    "bar_8N", "elem_column_27N", "parse_all_blocks", "eigen_cube_8N", "elem_balken_27N",
    "parse_freezing1D_KinematicLinear20N", "parse_test_model_part_io_read", "parse_test_serializer",
    "patch_3D_shear_hexa", "rve_4N_pressure", "tensile_hexahedra",
)  # fmt: skip
KRATOS = """
import json, sys
import KratosMultiphysics as K
import KratosMultiphysics.StructuralMechanicsApplication as S
K.Logger.GetDefaultOutput().SetSeverity(K.Logger.Severity.WARNING)
part = K.Model().CreateModelPart("main")
for v in (K.DISPLACEMENT, K.REACTION, K.VELOCITY, S.POINT_LOAD):
    part.AddNodalSolutionStepVariable(v)
K.ModelPartIO(sys.argv[1]).ReadModelPart(part)
constraint = part.GetMasterSlaveConstraint(5)
A, b = K.Matrix(), K.Vector()
constraint.CalculateLocalSystem(A, b, part.ProcessInfo)
print("RESULT" + json.dumps({
    "conditions": {c.Id: [n.Id for n in c.GetNodes()] for c in part.Conditions},
    "velocity": list(part.GetNode(11).GetSolutionStepValue(K.VELOCITY)),
    "parts": {p.FullName(): [sorted(n.Id for n in p.Nodes), sorted(e.Id for e in p.Elements)]
              for top in part.SubModelParts for p in [top, *top.SubModelParts]},
    "weights": [A[0, 0], A[0, 1]], "constant": b[0],
    "dependent": [d.Id() for d in constraint.GetSlaveDofsVector()],
    "independents": [d.Id() for d in constraint.GetMasterDofsVector()],
}))
"""


def cube():
    """Return a document that uses everything: odd ids, awkward numbers, nested parts."""
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    points = np.array(corners) * [1 / 3, 0.1, 1e-7 / 3] + 1 / 7
    ids = np.array([11, 3, 14, 2, 50, 17, 9, 8])
    three = np.array([3])
    brick = Block(
        "SmallDisplacementElement3D8N", np.arange(8, dtype=np.int32)[None], np.array([7]), three, Hexahedron8
    )
    face = Block("SurfaceLoadCondition3D4N", brick.nodes[:, 4:], np.array([70]), three, Quadrilateral4)
    parts = {
        "all": Part(np.arange(8), np.array([0]), np.array([0]), properties=(3,), data={"IS_RESTARTED": True}),
        "all.top": Part(np.array([7, 4]), conditions=np.array([0])),
    }
    values = {
        "YOUNG_MODULUS": 2.1e11 / 3,
        "CONSTITUTIVE_LAW": "LinearElastic3DLaw",
        "VOLUME_ACCELERATION": np.array([0, 0.1, -9.81]),
        "INTEGRATION_ORDER": 2,
        "COMPUTE_LUMPED_MASS_MATRIX": True,
        "LOCAL_INERTIA_TENSOR": np.array([[1.0, 2.0], [3.0, 0.1]]),
        "Table TEMPERATURE VISCOSITY": Table("TEMPERATURE", "VISCOSITY", np.array([[1.0, 0.1]])),
    }
    mask = np.array([True, False])
    x = "DISPLACEMENT_X"
    return Document(
        Mesh(points, [brick], node_ids=ids, conditions=[face], parts=parts),
        {3: Properties(3, values)},
        nodal_data=[
            Data(x, ids[:2], mask, np.array([0.1, 1 / 3])),
            Data("VELOCITY", ids[:1], mask[1:], np.array([[1.0, 0.1, 1 / 3]])),
            Data("SLIP", ids[2:4], np.zeros(2, dtype=bool), np.zeros(0)),
        ],
        element_data=[Data("TEMPERATURE", np.array([7]), mask[1:], np.array([2.5]))],
        condition_data=[Data("SURFACE_LOAD", np.array([70]), mask[1:], np.array([[0, 0, 0.1]]))],
        constraints=[Constraint(5, (8, x), ((9, x), (17, x)), (0.1, 1 / 3), 0.7)],
        tables={4: Table("TEMPERATURE", "VISCOSITY", np.array([[0.0, 1.0], [1.0, 1 / 3]]))},
        model_data={"AMBIENT_TEMPERATURE": 1 / 3},
    )


def same_values(first, second):
    """Return whether two dictionaries of values are equal, number by number, in the same order."""
    return list(first) == list(second) and all(
        np.array_equal(a.rows, b.rows) and (a.x, a.y) == (b.x, b.y)
        if isinstance(a, Table)
        else np.array_equal(a, b)
        for a, b in zip(first.values(), second.values(), strict=True)
    )


def assert_same(first, second, rename=str):
    """Assert that two documents say the same."""
    assert first.mesh.points.tobytes() == second.mesh.points.tobytes()
    assert np.array_equal(first.mesh.node_ids, second.mesh.node_ids)
    for blocks in (lambda d: d.mesh.blocks, lambda d: d.mesh.conditions, lambda d: d.geometries):
        assert [(rename(b.name), b.shape) for b in blocks(first)] == [
            (b.name, b.shape) for b in blocks(second)
        ]
        same_columns(blocks(first), blocks(second), "nodes", "ids", "properties")
    assert list(first.mesh.parts) == list(second.mesh.parts)
    parts, second_parts = first.mesh.parts.values(), second.mesh.parts.values()
    lists = ("nodes", "elements", "conditions", "geometries", "constraints", "properties", "tables")
    same_columns(parts, second_parts, *lists)
    assert all(same_values(one.data, other.data) for one, other in zip(parts, second_parts, strict=True))
    assert list(first.properties) == list(second.properties)
    for number, properties in first.properties.items():
        assert same_values(properties.values, second.properties[number].values)
    assert same_values(first.model_data, second.model_data)
    assert same_values(first.tables, second.tables)
    for field in ("nodal_data", "element_data", "condition_data"):
        same_columns(getattr(first, field), getattr(second, field), "variable", "ids", "fixed", "values")
    assert [replace(c, line=0) for c in first.constraints] == [replace(c, line=0) for c in second.constraints]


def same_columns(ours, others, *columns):
    for one, other in zip(ours, others, strict=True):
        for column in columns:
            assert np.array_equal(getattr(one, column), getattr(other, column)), column


def test_everything_survives_bit_by_bit(tmp_path):
    write_mdpa(tmp_path / "cube.mdpa", cube())
    assert_same(cube(), read_mdpa(tmp_path / "cube.mdpa"))


@pytest.mark.parametrize("folder", CASES)
def test_real_file_survives(tmp_path, folder):
    (path,) = case(folder).glob("*.mdpa")
    document = read_mdpa(path)
    write_mdpa(tmp_path / "copy.mdpa", document)
    assert_same(
        document,
        read_mdpa(tmp_path / "copy.mdpa"),
        lambda name: name.replace("KinematicLinear3D", "SmallDisplacementElement3D"),
    )


def test_second_writing_gives_the_same_bytes(tmp_path):
    write_mdpa(tmp_path / "one.mdpa", cube())
    write_mdpa(tmp_path / "two.mdpa", read_mdpa(tmp_path / "one.mdpa"))
    assert (tmp_path / "one.mdpa").read_bytes() == (tmp_path / "two.mdpa").read_bytes()


def test_gzipped_by_the_ending_of_the_name(tmp_path):
    write_mdpa(tmp_path / "cube.mdpa.gz", cube())
    assert gzip.decompress((tmp_path / "cube.mdpa.gz").read_bytes()).startswith(b"Begin ModelPartData\n")
    assert_same(cube(), read_mdpa(tmp_path / "cube.mdpa.gz"))


def test_mesh_alone_gets_the_properties_that_its_elements_use(tmp_path):
    write_mdpa(tmp_path / "a.mdpa", Document(cube().mesh))
    assert read_mdpa(tmp_path / "a.mdpa").properties[3].values == {}


def test_constraints_of_different_variables_survive(tmp_path):
    mesh = cube().mesh
    constraints = [
        Constraint(1, (8, "DISPLACEMENT_X"), ((9, "DISPLACEMENT_Y"),), (1.0,), 0.0),
        Constraint(2, (8, "DISPLACEMENT_Y"), ((9, "DISPLACEMENT_Y"), (3, "DISPLACEMENT_X")), (0.5, 0.1), 1.0),
    ]
    document = Document(mesh, {3: Properties(3)}, constraints=constraints)
    write_mdpa(tmp_path / "a.mdpa", document)
    assert_same(document, read_mdpa(tmp_path / "a.mdpa"))


def broken(change):
    document = cube()
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.properties[3].values.update(DENSITY=np.inf), "DENSITY: a number is not finite"),
        (lambda d: d.properties[3].values.update(LAW="two words"), "LAW: 'two words' is not a single word"),
        (lambda d: d.properties[3].values.update(LAW=None), "LAW: None is not a number"),
        (lambda d: d.properties[3].values.update({"a b": 1}), "'a b' is no name"),
        (lambda d: setattr(d, "mesh", d.mesh.replace(parts={"x/y": Part()})), "part 'x/y' has no name"),
        (lambda d: d.tables.update({4: 3}), "Table 4: expected a Table, got int"),
    ],
)
def test_what_the_format_cannot_hold_is_refused_and_the_old_file_stays(tmp_path, change, message):
    path = tmp_path / "a.mdpa"
    path.write_text("old")
    with pytest.raises(InputError, match=message):
        write_mdpa(path, broken(change))
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a.mdpa", "old")]


@pytest.mark.skipif(
    importlib.util.find_spec("KratosMultiphysics") is None
    or importlib.util.find_spec("KratosMultiphysics.StructuralMechanicsApplication") is None,
    reason="Kratos is not installed",
)
def test_kratos_itself_reads_the_same(tmp_path):
    """Parts inside parts, data, conditions and constraints; the rest is in tests/interop."""
    document = cube()
    document.mesh = with_block(document.mesh, name="KinematicLinear3D8N")
    given = document.nodal_data[0]  # a displacement of free nodes is a state that Kratos does not have
    document.nodal_data[0] = Data(given.variable, given.ids[:1], given.fixed[:1], given.values[:1])
    write_mdpa(tmp_path / "cube.mdpa", document)
    lines = output_of(sys.executable, "-c", KRATOS, tmp_path / "cube").splitlines()
    (line,) = [line for line in lines if line.startswith("RESULT")]
    found = json.loads(line.removeprefix("RESULT"))
    ids = document.mesh.node_ids
    assert found["conditions"] == {"70": ids[4:].tolist()}
    assert found["velocity"] == [1, 0.1, 1 / 3]
    assert found["parts"] == {"main.all": [sorted(ids.tolist()), [7]], "main.all.top": [[8, 50], []]}
    assert (found["weights"], found["constant"]) == ([0.1, 1 / 3], 0.7)
    assert (found["dependent"], found["independents"]) == ([8], [9, 17])


def test_elements_without_a_formulation_are_written_as_plain_ones_with_a_note(tmp_path):
    notes = kl.write(tmp_path / "box.mdpa", kl.box((1, 1, 1), (2, 1, 1)))
    assert [str(note) for note in notes if "Element3D8N, which names no formulation" in str(note)]
    assert "SmallDisplacementElement3D8N" in (tmp_path / "box.mdpa").read_text()
    named = kl.box((1, 1, 1), (2, 1, 1), element="KinematicLinear3D8N")
    assert not any("names no formulation" in str(note) for note in kl.write(tmp_path / "box.mdpa", named))
