"""Reading `.mdpa` files: what each block means, real files, exact numbers."""

import json
import re

import numpy as np
import pytest
from scenes import case, present

from kratos_lite.errors import InputError
from kratos_lite.io.formats.mdpa.reader import read_mdpa
from kratos_lite.io.names import condition_shape, element_shape

COUNTED = present(
    "bar_8N", "elem_column_27N", "parse_all_blocks", "eigen_cube_8N", "elem_activation_8N", "elem_balken_27N",
    "elem_beam3d_KL4N", "parse_test_model_part_io_read", "patch_3D_shear_hexa", "patch_3D_tension_tetra",
    "response_cantilever_beam_8N", "rve_4N_pressure", "symmetrical_cube_4N", "tensile_hexahedra",
)  # fmt: skip
KINDS = ("nodes", "elements", "conditions", "geometries", "properties", "tables")
NODES = """Begin Nodes
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
End Nodes
"""
TETRA = NODES + "Begin Properties 1\nEnd Properties\nBegin Elements Element3D4N\n7 1 1 2 3 4\nEnd Elements\n"


@pytest.fixture
def read(tmp_path):
    """Return a function: document of a text."""

    def make(text, **options):
        path = tmp_path / "model.mdpa"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_mdpa(path, **options)

    return make


def part(name, *content):
    return "\n".join([f"Begin SubModelPart {name}", *content, "End SubModelPart\n"])


def members(kind, *ids):
    return "\n".join([f"Begin SubModelPart{kind}", *map(str, ids), f"End SubModelPart{kind}"])


def texts(document):
    return [note.text for note in document.notes]


# ---- real files ----------------------------------------------------------------------------


def tree(mesh):
    """Return the parts as nested dictionaries of counts, as the references have them."""
    root = {}
    for name, part in mesh.parts.items():
        *parents, last = name.split(".")
        place = root
        for parent in parents:
            place = place[parent]["sub"]
        place[last] = {kind: len(getattr(part, kind)) for kind in KINDS} | {"sub": {}}
    return root


@pytest.mark.parametrize("folder", COUNTED)
def test_real_file_has_the_counts_and_parts_that_kratos_finds(folder):
    (path,) = case(folder).glob("*.mdpa")
    document = read_mdpa(path)
    reference = json.loads((case(folder) / "reference.json").read_text())
    assert {
        "n_nodes": document.mesh.n_nodes,
        "n_elements": document.mesh.n_elements,
        "n_conditions": document.mesh.n_conditions,
        "n_geometries": sum(map(len, document.geometries)),
        "n_properties": len(document.properties),
        "n_tables": len(document.tables),
        "n_constraints": len(document.constraints),
    } == {key: value for key, value in reference.items() if key.startswith("n_")}
    assert tree(document.mesh) == reference["sub_model_parts"]


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("parse_test_serializer/test_serializer.mdpa", (355, 627, 81)),
        ("parse_freezing1D_KinematicLinear20N/freezing1D.mdpa", (404, 100, 1)),
    ],
)
def test_real_file_that_kratos_refuses_has_the_counts_of_its_text(shared, name, counts):
    mesh = read_mdpa(shared / "cases" / name).mesh
    assert (mesh.n_nodes, mesh.n_elements, mesh.n_conditions) == counts


def test_two_elements_on_one_line_are_noted():
    document = read_mdpa(case("parse_all_blocks") / "all_blocks.mdpa")
    (block,) = document.mesh.blocks
    assert block.lines.tolist() == [42, 42]
    assert (42, "several rows on one line: elements") in [(n.line, n.text) for n in document.notes]


def test_values_of_every_kind_of_block():
    document = read_mdpa(case("parse_all_blocks") / "all_blocks.mdpa")
    values = document.properties[4].values
    assert values["IS_RESTARTED"] is True
    assert values["COMPUTE_LUMPED_MASS_MATRIX"] is False
    assert values["DENSITY"] == 2500.0
    assert values["VOLUME_ACCELERATION"].tolist() == [0, 0, -9.8]
    assert values["LOCAL_INERTIA_TENSOR"].tolist() == [[2, 0.5, 0], [0.5, 3, 0], [0, 0, 4.25]]
    assert values["Table TEMPERATURE VISCOSITY"].rows.tolist() == [[270, 4e-3], [300, 2e-3]]
    assert document.properties[4].lines["DENSITY"] == 16
    assert document.tables[3].rows.tolist() == [[0, 1e5], [2, 3e5]]
    assert document.model_data["DISPLACEMENT"].tolist() == [0.5, -1.5, 2.5]
    assert document.mesh.parts["Solid"].data["COMPUTE_DYNAMIC_TANGENT"] is False
    data = {d.variable: d for d in document.nodal_data}
    assert data["BOUNDARY"].ids.tolist() == [10, 21]
    assert data["BOUNDARY"].values.size == 0
    assert data["VELOCITY"].values.tolist() == [[1.5, 2.5, 3.5]]
    assert data["DISPLACEMENT_X"].fixed.tolist() == [True, True]


# ---- layout --------------------------------------------------------------------------------


def test_blocks_stand_in_any_order(read):
    _, nodes, properties, elements = re.split(r"(?m)^(?=Begin )", TETRA)
    fixed = "Begin NodalData DISPLACEMENT_X\n4 1 0.5\nEnd NodalData\n"
    document = read(fixed + part("A", members("Nodes", 4, 2)) + elements + properties + nodes)
    assert document.mesh.blocks[0].nodes.tolist() == [[0, 1, 2, 3]]
    assert document.mesh.parts["A"].nodes.tolist() == [3, 1]
    assert document.nodal_data[0].values.tolist() == [0.5]


def test_header_body_and_end_share_one_line_with_single_rows(read):
    text = "Begin Nodes 5 0 0 1e3 End Nodes Begin Properties 0 DENSITY 2 YOUNG_MODULUS 3 End Properties"
    document = read(text)
    assert document.mesh.points.tolist() == [[0, 0, 1000]]
    assert document.properties[0].values == {"DENSITY": 2.0, "YOUNG_MODULUS": 3.0}


def test_whole_file_on_one_line_reads_without_strict_as_in_kratos(read):
    document = read(TETRA.replace("\n", " "), strict=False)
    assert document.mesh.node_ids.tolist() == [1, 2, 3, 4]
    assert document.mesh.blocks[0].ids.tolist() == [7]


def test_rows_run_over_line_ends_only_without_strict(read):
    text = TETRA.replace("7 1 1 2 3 4", "7 1 1\n2 3 4")
    assert read(text, strict=False).mesh.blocks[0].nodes.tolist() == [[0, 1, 2, 3]]
    with pytest.raises(InputError, match=r":10:1: element 7 has 1 nodes; Element3D4N needs 4"):
        read(text)


@pytest.mark.parametrize("end", [b"\r\n", b"\r", b"\n\n", b"\t\n"])
def test_line_ends_and_blanks_of_all_kinds(read, end):
    assert read(TETRA.encode().replace(b"\n", end)).mesh.n_elements == 1


def test_bom_comments_and_bytes_of_other_encodings_in_comments(read):
    text = b"\xef\xbb\xbf// \xff caf\xe9\n" + TETRA.encode().replace(
        b"Element3D4N", b"Element3D4N// GUI\xfc/* */"
    )
    document = read(text.replace(b"1 0 0 0", b"/* two\nlines */ 1 0 0 0"))
    assert document.mesh.blocks[0].name == "Element3D4N"
    assert document.mesh.blocks[0].lines.tolist() == [12]


def test_ids_with_gaps_out_of_order_and_large(read):
    text = "Begin Nodes\n9223372036854775807 0 0 0\n3 1 0 0\nEnd Nodes\nBegin Nodes\n0001 2 0 0\nEnd Nodes\n"
    document = read(text)
    assert document.mesh.node_ids.tolist() == [2**63 - 1, 3, 1]
    assert document.mesh.node_rows([1, 2**63 - 1, 2]).tolist() == [2, 0, -1]


def test_empty_blocks_are_left_out_and_repeated_blocks_kept(read):
    empty = "Begin Elements Element3D4N\nEnd Elements\nBegin Conditions Odd\nEnd Conditions\n"
    document = read(empty + TETRA + "Begin Elements Element3D4N\n8 1 1 2 3 4\nEnd Elements\n")
    assert [block.ids.tolist() for block in document.mesh.blocks] == [[7], [8]]
    assert document.mesh.conditions == ()


def test_arrays_have_the_promised_types(read):
    block = read(TETRA).mesh.blocks[0]
    types = [block.nodes.dtype, block.ids.dtype, block.properties.dtype, block.lines.dtype]
    assert types == [np.int32, np.int64, np.int64, np.int32]


def test_unknown_blocks_are_skipped_whole_with_a_note(read):
    odd = "Begin Wibble x\n 1 2\nBegin Nodes\n oops\nEnd Nodes\nEnd Wibble\n"
    legacy = "Begin Mesh 1\nBegin MeshNodes\n1\nEnd MeshNodes\nEnd Mesh\n"
    document = read(odd + TETRA + legacy)
    assert document.mesh.n_nodes == 4
    assert [(n.line, n.text) for n in document.notes] == [
        (1, "block Wibble is skipped."),
        (18, "block Mesh is skipped."),
    ]


# ---- numbers -------------------------------------------------------------------------------


def test_numbers_are_exactly_those_of_python(read):
    rng = np.random.default_rng(1)
    numbers = rng.standard_normal((400, 3)) * 10.0 ** rng.integers(-300, 49, (400, 3))
    tokens = [[repr(x) for x in row] for row in numbers.tolist()]
    tokens[0] = ["1.", ".5", "+.5e0"]
    tokens[1] = ["-0.0", "4.9e-324", "9.999999999999999E+49"]
    tokens[2] = ["0.1000000000000000055511151231257827021181583404541015625", "1e-400", "9007199254740993"]
    rows = "\n".join(f"{i + 1} {' '.join(row)}" for i, row in enumerate(tokens))
    expected = np.array([[float(t) for t in row] for row in tokens])
    assert read(f"Begin Nodes\n{rows}\nEnd Nodes").mesh.points.tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    "token",
    ["1.0.0", "1-2", "1e", "1e+", "+", ".", "e5", "--1", "nan", "inf", "1e999", "1_0", "0x1", "1,0", "١"],
)
@pytest.mark.parametrize("place", [1, 2, 3])
def test_malformed_numbers_are_refused_at_their_place(read, token, place):
    row = ["8", "0", "0", "0"]
    row[place] = token
    column = len(" ".join(row[:place])) + 2
    with pytest.raises(InputError, match=rf":2:{column}: node 8: .* (is not a number|is too large)"):
        read(f"Begin Nodes\n{' '.join(row)}\nEnd Nodes\n")


@pytest.mark.parametrize("token", ["-1", "0", "2.0", "1e2", "+1", "9223372036854775808", "00000", "1D0", "٣"])
def test_malformed_ids_are_refused(read, token):
    with pytest.raises(InputError, match=r":2:1: .* is not an id; ids are 1 … 2\^63-1"):
        read(f"Begin Nodes\n{token} 0 0 0\nEnd Nodes\n")
    with pytest.raises(InputError, match=r":10:1: .* is not an id; ids are 1 … 2\^63-1"):
        read(TETRA.replace("\n7 1", f"\n{token} 1"))


# ---- values --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("DENSITY 7.85D3", 7850.0),
        ("DENSITY\n 2", 2.0),
        ("BODY_FORCE [ 3 ] ( 0 , 0 , -9.81 )", [0, 0, -9.81]),
        ("BODY_FORCE (0,0,\n9)", [0, 0, 9]),
        ("INTEGRATION_ORDER 2", 2),
        ("IS_RESTARTED true", True),
        ("CONSTITUTIVE_LAW LinearElastic3DLaw", "LinearElastic3DLaw"),
        ("MY_NUMBER 1.5", 1.5),
        ("MY_COUNT -3", -3),
        ("MY_TRUTH False", False),
        ("MY_WORD steel", "steel"),
        ("MY_MATRIX [2,1] ((1),(2))", [[1], [2]]),
    ],
)
def test_value_by_the_type_of_its_variable(read, text, value):
    values = read(f"{NODES}Begin Properties 3\n {text}\nEnd Properties\n").properties[3].values
    (found,) = values.values()
    assert (found.tolist() if isinstance(found, np.ndarray) else found) == value
    assert type(found) in (np.ndarray, type(value))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("YOUNG_MODULUS steel", r"8:16: YOUNG_MODULUS: 'steel' is not a number"),
        ("YOUNG_MODULUS [3] (1,2,3)", r"8:16: YOUNG_MODULUS: expected a number, found"),
        ("YOUNG_MODULUS", r"8:2: YOUNG_MODULUS: has no value"),
        ("YOUNG_MODULUS 1,5", r"'1,5' is not a number; decimal comma\? write 1.5"),
        ("YOUNG_MODULUS 200,000", r"decimal comma\? write 200.000; thousands\? write 200000"),
        ("DENSITY 1 kg", r"8:12: 'kg' is not a variable"),
        ("BODY_FORCE 1.0, 2.0, 3.0", r"BODY_FORCE: '1.0,' is not a vector; write \[3\] \(x, y, z\)"),
        ("MINE 1.0, 2.0, 3.0", r"MINE: '1.0,' is not a number"),
        ("MINE 2_1e8", r"'2_1e8' is not a number"),
        ("BODY_FORCE [3] (1, 2)", r"has size \[2\], not \[3\]"),
        ("BODY_FORCE [3] (1, 2, 3", r"is a '\)' missing\?"),
        ("BODY_FORCE [3] (1, x, 3)", r"'x' is not a number"),
        ("LOCAL_INERTIA_TENSOR [2,2] ((1,2),(3))", r"different lengths"),
        ("IS_RESTARTED yes", r"'yes' is neither true nor false"),
        ("INTEGRATION_ORDER 2.0", r"'2.0' is not a whole number"),
        ("DENSITY 1\n DENSITY 2", r"9:2: DENSITY is already defined at line 8 with another value"),
    ],
)
def test_wrong_value_is_named_with_its_place(read, text, message):
    with pytest.raises(InputError, match=message):
        read(f"{NODES}Begin Properties 3\n {text}\nEnd Properties\n")


def test_unknown_variable_is_kept_with_a_hint(read):
    document = read(f"{NODES}Begin Properties 3\nYOUNGS_MODULUS 2e8\nEnd Properties\n")
    assert document.properties[3].values == {"YOUNGS_MODULUS": 2e8}
    assert (
        "unknown variable YOUNGS_MODULUS is kept, but not used. Did you mean YOUNG_MODULUS"
        in texts(document)[0]
    )


TABLE = "Begin Table 0 TIME VELOCITY\n0.0 0.0\n1.0 2.0\nEnd Table\n"
TWICE = "Begin {0} {1}\n1 0 1 2 2 3\n3 0 1 2 3 4\n4 0 4 4 4 4\nEnd {0}\n"
NO_PROPERTIES = "Begin Properties 0\nEnd Properties\n"
NOT_SOLVED = [
    ("Elements", "element", "SurfaceElement3D4N"),
    ("Elements", "element", "UPwSmallStrainInterfaceElement2D4N"),
    ("Conditions", "condition", "MyCondition3D4N"),
    ("Geometries", "geometry", "Quadrilateral3D4"),
]


@pytest.mark.parametrize(("kind", "word", "name"), NOT_SOLVED)
def test_what_is_not_solved_may_name_a_node_twice_as_in_kratos(read, kind, word, name):
    block = TWICE.format(kind, name).replace(" 0 ", " " if kind == "Geometries" else " 0 ")
    (note,) = read(NODES + NO_PROPERTIES + block).notes
    assert (note.line, note.text.partition(";")[0]) == (
        10,
        f"{word} 1 (and 1 more {word}s) of {name} names a node twice",
    )


def test_a_table_may_have_the_id_0_as_in_kratos(read):
    document = read(NODES + TABLE + part("A", members("Tables", 0)))
    assert document.tables[0].rows.tolist() == [[0, 0], [1, 2]]
    assert document.mesh.parts["A"].tables == (0,)


@pytest.mark.parametrize("command", ["check", "solve"])
def test_a_file_without_nodes_is_described_and_not_solved(run, tmp_path, command):
    path = tmp_path / "tables.mdpa"
    path.write_text(TABLE + NO_PROPERTIES)
    assert "nodes       0" in run("info", path).out
    assert run(command, path).refuses("tables.mdpa", ": there are no nodes")


# ---- data ----------------------------------------------------------------------------------


def test_elemental_and_conditional_data(read):
    conditions = "Begin Conditions SurfaceLoadCondition3D3N\n5 1 1 2 3\nEnd Conditions\n"
    data = (
        "Begin ElementalData DENSITY\n7 2.5\nEnd ElementalData\n"
        "Begin ConditionalData SURFACE_LOAD\n5 [3] (0, 0, -1)\nEnd ConditionalData\n"
        "Begin ElementalData MY_STRESS\n7 [2,2] ((1,2),(3,4))\nEnd ElementalData\n"
        "Begin NodalData SLIP\n1 2\n3\nEnd NodalData\n"
    )
    document = read(TETRA + conditions + data)
    assert document.element_data[0].values.tolist() == [2.5]
    assert document.element_data[1].values.tolist() == [[[1, 2], [3, 4]]]
    assert document.condition_data[0].values.tolist() == [[0, 0, -1]]
    assert document.nodal_data[0].ids.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("NodalData DISPLACEMENT_X\n1 2 0.5", r"13:3: node 1: '2' is neither true nor false"),
        ("NodalData DISPLACEMENT_X\n1 0.5", r"node 1 has 1 values; expected node id, is_fixed, value"),
        ("NodalData DISPLACEMENT\n1 1 [3] (0,0,0)", r"a vector cannot be fixed; fix its components"),
        ("NodalData DISPLACEMENT\n1 0 0.5", r"'0.5' is not a vector"),
        (
            "NodalData DISPLACEMENT_X\n99 1 0.5",
            r"DISPLACEMENT_X is fixed on node 99, which the file does not have",
        ),
        ("NodalData VELOCITY\n1 0 [3] (0,0,0)\n2 0 [2] (0,0)", r"has size \[2\], but the first row \[3\]"),
        ("ElementalData DENSITY\n7 x", r"element 7: 'x' is not a number"),
    ],
)
def test_wrong_data_is_refused(read, block, message):
    with pytest.raises(InputError, match=message):
        read(f"{TETRA}Begin {block}\nEnd {block.split()[0]}\n")


def test_free_data_on_missing_nodes_and_elements_is_noted(read):
    nodal = "Begin NodalData DISPLACEMENT_X\n99 0 1\n1 true 0\nEnd NodalData\n"
    document = read(TETRA + nodal + "Begin ElementalData DENSITY\n8 1\n9 1\nEnd ElementalData\n")
    assert document.nodal_data[0].fixed.tolist() == [False, True]
    assert texts(document) == [
        "DISPLACEMENT_X on node 99 is ignored: the file does not have it",
        "DENSITY on element 8 (and 1 more) is ignored: the file does not have it",
    ]


@pytest.mark.parametrize(
    ("header", "independents"),
    [("", "XX"), (" DISPLACEMENT_Y", "YY"), (" DISPLACEMENT_Y DISPLACEMENT_Z", "YZ")],
)
def test_constraint_variables_follow_the_header(read, header, independents):
    header = f"LinearMasterSlaveConstraint DISPLACEMENT_X{header}"
    text = f"Begin Constraints {header}\n4 0.5 [0.5, 0.25] 1 2 3\nEnd Constraints\n"
    (constraint,) = read(NODES + text).constraints
    assert (constraint.id, constraint.constant, constraint.weights) == (4, 0.5, (0.5, 0.25))
    assert constraint.dependent == (1, "DISPLACEMENT_X")
    assert constraint.independents == tuple(
        (i + 2, f"DISPLACEMENT_{axis}") for i, axis in enumerate(independents)
    )


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1 0.0 [2,1.0,-0.5]", r"has 3 weights, but 0 nodes"),
        ("1 0.0 [1] 1 9", r"there is no node 9"),
        ("1 0.0 1 2", r"expected 'id constant \[w1, w2, …\] dependent"),
        ("1 0.0 [1] 1 2\n1 0.0 [1] 3 4", r"9: constraint 1 is already defined at line 8"),
    ],
)
def test_wrong_constraint_is_refused(read, row, message):
    with pytest.raises(InputError, match=message):
        read(f"{NODES}Begin Constraints C DISPLACEMENT_X\n{row}\nEnd Constraints\n")


# ---- parts ---------------------------------------------------------------------------------


def test_members_of_a_part_belong_to_its_ancestors_in_order_and_once(read):
    inner = part("c", members("Nodes", 3, 1, 3))
    text = part("A.b", members("Nodes", 4, 3), inner)
    parts = read(NODES + text).mesh.parts
    assert {name: part.nodes.tolist() for name, part in parts.items()} == {
        "A": [3, 2, 0],
        "A.b": [3, 2, 0],
        "A.b.c": [2, 0],
    }


def test_parts_hold_rows_through_all_blocks(read):
    more = "Begin Elements Element3D4N\n3 1 4 3 2 1\nEnd Elements\n"
    mesh = read(TETRA + more + part("A", members("Elements", 3, 7))).mesh
    assert mesh.parts["A"].elements.tolist() == [1, 0]


def test_part_lists_of_properties_are_kept_and_missing_ones_noted(read):
    document = read(TETRA + part("A", members("Properties", 1, 5)))
    assert document.mesh.parts["A"].properties == (1,)
    assert texts(document) == ["SubModelPart A lists Properties 5, which the file does not have"]


# ---- names ---------------------------------------------------------------------------------


SHAPES = {
    "KinematicLinear3D4N": "Tetrahedron4", "SmallDisplacementElement3D10N": "Tetrahedron10",
    "Element3D8N": "Hexahedron8", "X3D20N": "Hexahedron20", "X3D27N": "Hexahedron27", "X3D6N": "Wedge6",
    "X3D15N": "Wedge15", "X3D5N": "Pyramid5", "X3D13N": "Pyramid13", "Element2D3N": None, "X3D9N": None,
    "ShellThinElement3D4N": None,
}  # fmt: skip
CONDITION_SHAPES = {
    "PointLoadCondition3D1N": "Point1", "LineLoadCondition3D2N": "Line2", "LineLoadCondition3D3N": "Line3",
    "SurfaceLoadCondition3D4N": "Quadrilateral4", "SmallDisplacementSurfaceLoadCondition3D3N": "Triangle3",
    "SurfaceCondition3D4N": "Quadrilateral4", "Face3D3N": "Triangle3", "FacePressure3D4N": "Quadrilateral4",
    "Face3D6N": "Triangle6", "Face3D8N": "Quadrilateral8", "Face3D9N": "Quadrilateral9",
    "LineCondition2D2N": None, "WallCondition2D": None,
}  # fmt: skip


@pytest.mark.parametrize(
    ("table", "shape_of"), [(SHAPES, element_shape), (CONDITION_SHAPES, condition_shape)]
)
def test_shape_of_a_name(table, shape_of):
    shapes = {name: shape_of(name) for name in table}
    assert {name: shape and shape.__name__ for name, shape in shapes.items()} == table
