"""The five-file sets: real sets, every statement, every error, round trips, damaged files."""

import gzip
import json
import random

import numpy as np
import pytest
from meshes import with_block
from scenes import case, present

from kratos_lite.errors import MAX_PROBLEMS, InputError
from kratos_lite.io.formats.document import Constraint, Data, Document, Properties
from kratos_lite.io.formats.elem.reader import read_elem
from kratos_lite.io.formats.elem.writer import write_elem
from kratos_lite.io.formats.mdpa.reader import read_mdpa
from kratos_lite.mesh import Block, Mesh, Part
from kratos_lite.shapes.faces import Quadrilateral4, Triangle3
from kratos_lite.shapes.hexahedra import Hexahedron27
from kratos_lite.shapes.tetrahedra import Tetrahedron4

NODE = "NODES = NodesList([[1, 0, 0, 0], [2, 1, 0, 0], [3, 0, 1, 0], [4, 0, 0, 1], [5, 1, 1, 1]])\n"
ELEM = "ELEMENTS[1] = KinematicLinear3D4N([1,2,3,4],1);\n"
PROP = "PROPERTIES[1][DENSITY] = 1.5;\n"
SETS = {
    "elem_column_27N": "column",
    "elem_activation_8N": "activation_test",
    "elem_balken_27N": "balken",
    "elem_beam3d_KL4N": "beam_3d",
}
SETS = {folder: SETS[folder] for folder in present(*SETS)}


@pytest.fixture
def make(tmp_path):
    """Write a set: ``make(node=…, elem=…, …)``; returns its name without ending."""

    def write(name="a", **texts):
        for ending, text in {"node": NODE, "elem": ELEM, "prop": PROP, **texts}.items():
            if text is not None:
                data = text if isinstance(text, bytes) else text.encode()
                (tmp_path / f"{name}.{ending}").write_bytes(data)
        return tmp_path / name

    return write


@pytest.fixture
def problem(make):
    """Return the error text of a set without its folder."""

    def read(**texts):
        name = make(**texts)
        with pytest.raises(InputError) as caught:
            read_elem(name)
        return str(caught.value).replace(f"{name.parent}/", "")

    return read


def said(document):
    """Return all that a document says, apart from lines and notes, as it is compared."""
    mesh = document.mesh
    blocks = [[b.name, b.shape, b.nodes, b.ids, b.properties] for b in (*mesh.blocks, *mesh.conditions)]
    values = [[number, p.values] for number, p in document.properties.items()]
    data = [[d.variable, d.ids, d.fixed, d.values] for d in document.nodal_data]
    return repr([mesh.points.tolist(), mesh.node_ids.tolist(), plain([blocks, values, data])])


def plain(value):
    """Return nested values with arrays as lists."""
    if isinstance(value, dict):
        return [[key, plain(one)] for key, one in value.items()]
    return (
        [plain(one) for one in value]
        if isinstance(value, list)
        else getattr(value, "tolist", lambda: value)()
    )


# ---- real sets -----------------------------------------------------------------------------


@pytest.mark.parametrize(("folder", "name"), SETS.items())
def test_real_set_has_the_counts_of_the_reference(folder, name):
    path = case(folder)
    document = read_elem(path / f"{name}.elem")
    reference = json.loads((path / "reference.json").read_text())
    assert document.mesh.n_nodes == reference["n_nodes"]
    assert document.mesh.n_elements == reference["n_elements"]
    assert len(document.properties) == reference["n_properties"]


@pytest.mark.parametrize(("folder", "name"), SETS.items())
def test_real_set_equals_its_converted_mdpa(folder, name):
    path = case(folder)
    ours, other = read_elem(path / name), read_mdpa(path / f"{name}.mdpa")
    assert np.array_equal(ours.mesh.points, other.mesh.points)
    assert np.array_equal(ours.mesh.node_ids, other.mesh.node_ids)
    assert np.array_equal(ours.mesh.element_ids, other.mesh.element_ids)
    nodes, properties = (
        [np.concatenate([getattr(b, field) for b in document.mesh.blocks]) for document in (ours, other)]
        for field in ("nodes", "properties")
    )
    assert np.array_equal(*nodes)
    assert np.array_equal(*properties)
    for number, converted in other.properties.items():
        values = ours.properties[number].values
        for variable in ("DENSITY", "YOUNG_MODULUS", "POISSON_RATIO"):
            assert values[variable] == converted.values[variable]
        assert np.array_equal(values["GRAVITY"], converted.values["VOLUME_ACCELERATION"])


@pytest.mark.parametrize(("folder", "name"), SETS.items())
def test_real_set_survives_a_round_trip(tmp_path, folder, name):
    document = read_elem(case(folder) / name)
    assert write_elem(tmp_path / name, document) == []
    assert said(document) == said(read_elem(tmp_path / name))


def test_column_is_read_in_full():
    document = read_elem(case("elem_column_27N") / "column.node")
    (block,) = document.mesh.blocks
    assert (block.name, block.shape, len(block)) == ("TotalLagrangian3D27N", Hexahedron27, 2)
    assert document.mesh.node_ids[block.nodes[1]][:5].tolist() == [5, 6, 7, 8, 28]
    assert block.lines.tolist() == [4, 5]
    assert [(d.variable, len(d.ids), d.fixed.all()) for d in document.nodal_data] == [
        ("DISPLACEMENT_X", 30, True),
        ("DISPLACEMENT_Y", 30, True),
        ("DISPLACEMENT_Z", 9, True),
    ]
    assert document.properties[2].values["BODY_FORCE"].tolist() == [0, 0, -20000]
    assert document.properties[2].lines["YOUNG_MODULUS"] == 9
    assert (document.notes[0].line, "'])' closes no list" in document.notes[0].text) == (74, True)
    assert [(b.name, b.shape, b.nodes.shape) for b in document.mesh.conditions] == [
        ("MasterContactFace3D9", None, (1, 9)),
        ("SlaveContactFace3D9", None, (1, 9)),
    ]
    kept = [note.text for note in document.notes if "kept without use" in note.text]
    assert [text.split()[:3] for text in kept] == [
        ["1", "conditions", "MasterContactFace3D9"],
        ["1", "conditions", "SlaveContactFace3D9"],
    ]


@pytest.mark.parametrize("name", ["80_ragged", "81_unknown_keyword"])
def test_malformed_file_is_refused_at_its_statement(malformed, name):
    with pytest.raises(InputError) as caught:
        read_elem(malformed / f"{name}.elem")
    text = str(caught.value)
    assert f"{name}.elem:1:1: unknown statement" in text
    assert f"{name}.node: there is no such file" in text


# ---- grammar -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "node",
    [
        "NODES = NodesList([[7, 0.5, -1e-3, +.25], [9, 1., 2.D+0, 3d0]])",
        "NODES=NodesList([[7,0.5,-1e-3,+.25],[9,1.,2.D+0,3d0],])",
        "NODES[7] = Node(0.5, -1e-3, +.25); NODES[9] = Node(1., 2.D+0, 3d0)",
        "NODES [ 7 ]\n=\tNode ( 0.5\n, -1e-3 , +.25 ) ;;\nNODES=NodesList([[9,1.,2.D+0,3d0]])",
        "// first\nNODES/* = */=NodesList([ // [8, 0, 0, 0]\n[7,0.5,-1e-3,/*0*/+.25],[9,1.,2.D+0,3d0]])//",
        "NODES = NodesList([[7, 0.5, -1e-3, +.25]])\r\nNODES = NodesList([[9, 1., 2.D+0, 3d0]]);\r\n",
        b"\xef\xbb\xbfNODES[7] = Node(0.5, -1e-3, +.25) // \xe9t\xe9\nNODES[9] = Node(1., 2.D+0, 3d0)",
    ],
)
def test_nodes_in_every_form(make, node):
    mesh = read_elem(make(node=node, elem="ELEMENTS[1] = Bar3D2N([9, 7], 1)")).mesh
    assert mesh.node_ids.tolist() == [7, 9]
    assert mesh.points.tolist() == [[0.5, -1e-3, 0.25], [1, 2, 3]]
    assert mesh.blocks[0].nodes.tolist() == [[1, 0]]


@pytest.mark.parametrize(
    "elem",
    [
        "ELEMENTS[3] = KinematicLinear3D4N([1,2,3,4],1); ELEMENTS[8] = KinematicLinear3D4N([2,3,4,5],0)",
        "ELEMENTS [3]=KinematicLinear3D4N ( [ 1 , 2,3,4 , ] , 1 )\n;"
        "ELEMENTS[8]=KinematicLinear3D4N([2,3,4,5],0);;",
        "ElementsGroup = g;\nELEMENTS = ElementsList(KinematicLinear3D4N,[[3,[1,2,3,4],1],[8,[2,3,4,5],0],])",
        "ELEMENTS = ElementsList(KinematicLinear3D4N, [\n[3,[1,2,3,4],1]\n,\n[8,[2,3,4,5],0]\n])\n"
        "ElementsGroup=g",
        "ELEMENTS[3] = KinematicLinear3D4N([1,2,3,4],1)\n//ELEMENTS[3] = Other3D8N([\n"
        "ELEMENTS = ElementsList(Bar,[ ])\nELEMENTS = ElementsList(KinematicLinear3D4N,[[8,[2,3,4,5],0]])",
    ],
)
def test_elements_in_every_form(make, elem):
    (block,) = read_elem(make(elem=elem)).mesh.blocks
    assert (block.name, block.shape) == ("KinematicLinear3D4N", Tetrahedron4)
    assert block.ids.tolist() == [3, 8]
    assert block.properties.tolist() == [1, 0]
    assert block.nodes.tolist() == [[0, 1, 2, 3], [1, 2, 3, 4]]


def test_one_block_per_run_of_equal_names(make):
    elem = "".join(
        f"ELEMENTS[{i}] = {name}([1, {i}], 1);\n" for i, name in [(2, "A"), (3, "A"), (4, "B"), (5, "A")]
    )
    blocks = read_elem(make(elem=elem)).mesh.blocks
    assert [(b.name, b.ids.tolist(), b.lines.tolist(), b.shape) for b in blocks] == [
        ("A", [2, 3], [1, 2], None),
        ("B", [4], [3], None),
        ("A", [5], [4], None),
    ]


def test_conditions_in_every_form_keep_their_order_among_fix_statements(make):
    cond = (
        "CONDITIONS = ConditionsList(Face3D3N,[ ])\nNODES[1].Fix(DISPLACEMENT_X);\n"
        "CONDITIONS[4] = Face3D3N([1,2,3],0);\nNODES[2] . Fix ( DISPLACEMENT_X )\n"
        "CONDITIONS = ConditionsList(FacePressure3D4N,[[6,[1,2,3,5],1],\n])\nCONDITIONS[5]=Contact([1,2],1)"
    )
    document = read_elem(make(cond=cond))
    assert [(b.name, b.shape, b.ids.tolist()) for b in document.mesh.conditions] == [
        ("Face3D3N", Triangle3, [4]),
        ("FacePressure3D4N", Quadrilateral4, [6]),
        ("Contact", None, [5]),
    ]
    assert document.nodal_data[0].ids.tolist() == [1, 2]
    assert document.nodal_data[0].line == 2


def test_properties_of_every_type(make):
    prop = (
        "PROPERTIES[1][STEPS] = 2;PROPERTIES[1][E] = 2.1D+11 // Pa\nPROPERTIES[0][DENSITY]=.5\n"
        "PROPERTIES[1][GRAVITY] = [ 0, 0 , -9.81, ];\nPROPERTIES[1][M] = [[1,2],[3,4.5]];"
        "PROPERTIES[1][ROW] = [[ 1 , 2 ],];"
    )
    properties = read_elem(make(prop=prop)).properties
    values = properties[1].values
    assert list(values) == ["STEPS", "E", "GRAVITY", "M", "ROW"]
    assert (values["STEPS"], values["E"]) == (2.0, 2.1e11)
    assert values["GRAVITY"].tolist() == [0, 0, -9.81]
    assert values["M"].tolist() == [[1, 2], [3, 4.5]]
    assert values["ROW"].tolist() == [[1, 2]]
    assert properties[1].lines == {"STEPS": 1, "E": 1, "GRAVITY": 3, "M": 4, "ROW": 4}
    assert properties[0].values == {"DENSITY": 0.5}
    assert (properties[0].line, properties[1].line) == (2, 1)


def test_init_gives_the_values_of_fixed_and_of_free_degrees_of_freedom(make):
    cond = (
        "NODES[3].Fix(DISPLACEMENT_X);\nNODES[1].Fix(DISPLACEMENT_X);\nNODES[2].Fix(POSITIVE_FACE_PRESSURE)"
    )
    init = (
        "NODES[1](DISPLACEMENT_X, 0) =0.25;\nNODES[2](DISPLACEMENT_X,0)=-1\n"
        "NODES[2](POSITIVE_FACE_PRESSURE, 0) = 1e6;NODES[4](TEMPERATURE, 0) = 300;"
    )
    found = [
        (d.variable, d.ids.tolist(), d.fixed.tolist(), d.values.tolist(), d.line)
        for d in read_elem(make(cond=cond, init=init)).nodal_data
    ]
    assert found == [
        ("DISPLACEMENT_X", [3, 1], [True, True], [0.0, 0.25], 1),
        ("POSITIVE_FACE_PRESSURE", [2], [True], [1e6], 3),
        ("DISPLACEMENT_X", [2], [False], [-1.0], 2),
        ("TEMPERATURE", [4], [False], [300.0], 3),
    ]


def test_the_largest_id_is_exact(make):
    node = f"NODES[{2**63 - 1}] = Node(0, 0, 0); NODES[1] = Node(1, 0, 0)"
    mesh = read_elem(make(node=node, elem=f"ELEMENTS[{2**63 - 1}] = Bar([1, {2**63 - 1}], 1)")).mesh
    assert mesh.node_ids.tolist() == [2**63 - 1, 1]
    assert mesh.element_ids.tolist() == [2**63 - 1]
    assert mesh.blocks[0].nodes.tolist() == [[1, 0]]


def test_reals_are_those_of_python(make):
    rng = random.Random(7)
    texts = [repr(rng.uniform(-1, 1) * 10 ** rng.randint(-300, 49)) for _ in range(300)]
    node = "".join(f"NODES[{i + 1}] = Node({', '.join(texts[3 * i : 3 * i + 3])});" for i in range(100))
    points = read_elem(make(node=node)).mesh.points
    assert points.ravel().tolist() == [float(text) for text in texts]


# ---- which files ---------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["", ".node", ".elem", ".cond", ".prop", ".init", ".elem.gz"])
def test_any_file_of_the_set_names_it(make, ending):
    name = make("beam.v2")
    assert read_elem(f"{name}{ending}").mesh.n_nodes == 5


def test_gzipped_files_are_read(make, tmp_path):
    name = make(node=None, prop=None)
    (tmp_path / "a.node.gz").write_bytes(gzip.compress(NODE.encode()))
    (tmp_path / "a.prop.gz").write_bytes(gzip.compress(PROP.encode()))
    document = read_elem(name)
    assert document.mesh.n_nodes == 5
    assert document.properties[1].values == {"DENSITY": 1.5}


def test_a_second_gzipped_copy_is_noted(make, tmp_path):
    name = make(cond="", init="")
    (tmp_path / "a.node.gz").write_bytes(b"not even read")
    (note,) = read_elem(name).notes
    assert note.text.endswith("a.node is there too")


def test_optional_files_are_noted_when_absent(make):
    document = read_elem(make(prop=None))
    assert [note.text.rsplit("/", 1)[-1] for note in document.notes] == ["a.cond", "a.prop", "a.init"]
    assert list(document.properties) == [1]
    assert document.properties[1].values == {}


def test_both_missing_files_are_named(problem):
    text = problem(node=None, elem=None)
    assert [line.split(":")[0] for line in text.splitlines()] == ["a.node", "a.elem"]
    assert "there is no such file, nor a.node.gz; expected NAME.node and NAME.elem" in text


def test_a_folder_is_no_set(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_elem(tmp_path)


def test_broken_gzip_is_an_error(make, tmp_path):
    name = make(prop=None)
    (tmp_path / "a.prop.gz").write_bytes(gzip.compress(PROP.encode())[:-6])
    with pytest.raises(InputError, match=r"a\.prop\.gz"):
        read_elem(name)


def test_a_set_without_elements_is_noted(make):
    document = read_elem(make(elem="ElementsGroup = g;", cond="", init=""))
    assert document.mesh.blocks == ()
    assert [note.text.rsplit("/", 1)[-1] for note in document.notes] == ["a.elem: there are no elements"]


# ---- errors --------------------------------------------------------------------------------

ERRORS = {
    "nothing": ({"node": ""}, "a.node:1:1: there are no nodes"),
    "only comments": ({"node": "// none\n"}, "a.node:1:1: there are no nodes"),
    "empty list": ({"node": "NODES = NodesList([ ])"}, "a.node:1:1: there are no nodes"),
    "unknown statement": ({"node": NODE + " KNOTS[9]"}, "a.node:2:2: unknown statement 'KNOTS'"),
    "small letters": ({"elem": "elements[1] = X([1],1)"}, "a.elem:1:1: unknown statement 'elements'"),
    "wrong file": ({"elem": ELEM + NODE}, "a.elem:2:1: unknown statement 'NODES'"),
    "old writer": (
        {"elem": "ELEMENTS = ElementsList([[1,[1],1]])"},
        "a.elem:1:25: found '['; expected a name",
    ),
    "open list": (
        {"elem": "\nELEMENTS = ElementsList(A,[\n[1,[1,2],1],\n"},
        "(in the list opened at line 2)",
    ),
    "no comma": (
        {"node": "NODES = NodesList([[1,0,0,0] [2,1,1,1]])"},
        "a.node:1:30: found '['; expected ','",
    ),
    "unclosed comment": ({"prop": PROP + "/* ever"}, "a.prop:2"),
    "NUL byte": ({"cond": b"NODES[1]\0"}, "a.cond:1:9"),
    "nan": ({"node": "NODES[1] = Node(0,\n nan, 0)"}, "a.node:2:2: "),
    "inf": ({"node": "NODES = NodesList([[1, 0, -inf, 0]])"}, "a.node:1:27: "),
    "overflow": ({"node": "NODES[1] = Node(0, 1e999, 0)"}, "a.node:1:1: "),
    "underscore": ({"prop": "PROPERTIES[1][E] = 2_1e8;"}, "a.prop:1:20: "),
    "hexadecimal": ({"prop": "PROPERTIES[1][E] = 0x10;"}, "a.prop:1:20: "),
    "a word": ({"prop": "PROPERTIES[1][E] = steel;"}, "a.prop:1:20: "),
    "other digits": ({"elem": "ELEMENTS[١] = A([1,2],1)"}, "a.elem:1:10: found '\\xd9'; expected an id"),
    "Latin-1 text": ({"elem": b"\xe9l\xe9ment"}, "a.elem:1:1: unknown statement '\\xe9'"),
    "decimal comma, node": (
        {"node": "NODES[1] = Node(0,5, 1,5, 2)"},
        "found ','; expected ')'; a decimal comma?",
    ),
    "decimal comma, property": ({"prop": "PROPERTIES[1][E] = 2,5;"}, "unknown statement ','"),
    "id with point": ({"elem": "ELEMENTS[1.5] = A([1,2],1)"}, "a.elem:1:10: "),
    "id 0": ({"node": "NODES[0] = Node(0,0,0)"}, "a.node:1:1: "),
    "negative id": ({"elem": "ELEMENTS[1] = A([1,-2],1)"}, "a.elem:1:20: "),
    "huge id": ({"elem": "ELEMENTS[99999999999999999999] = A([1,2],1)"}, "a.elem:1:1: "),
    "huge node id": ({"elem": "\nELEMENTS[1] = A([1,99999999999999999999],1)"}, "a.elem:2:1: "),
    "node twice": (
        {"node": NODE + "NODES[3] = Node(9, 9, 9)"},
        "a.node:2:1: node 3 is already defined at line 1 at",
    ),
    "element twice": ({"elem": ELEM + ELEM}, "a.elem:2:1: element 1 is already defined at line 1"),
    "element twice in lists": (
        {"elem": "ELEMENTS = ElementsList(A,[[1,[1,2],1],\n[1,[2,3],1]])"},
        "a.elem:2:1: element 1 is already defined at line 1",
    ),
    "condition twice": (
        {"cond": "CONDITIONS[1]=A([1],0)\nCONDITIONS[1]=B([2],0)"},
        "a.cond:2:1: condition 1 is already defined at line 1",
    ),
    "missing node": (
        {"elem": ELEM + "ELEMENTS[2] = KinematicLinear3D4N([1,2,3,99],1)"},
        "a.elem:2:1: element 2 (KinematicLinear3D4N): there is no node 99",
    ),
    "missing node of a condition": (
        {"cond": "CONDITIONS[1]=A([9],0)"},
        "a.cond:1:1: condition 1 (A): there is no node 9",
    ),
    "missing node of Fix": ({"cond": "\nNODES[9].Fix(P)"}, "a.cond:2:1: there is no node 9"),
    "missing node of init": ({"init": "NODES[9](P, 0) = 1"}, "a.init:1:1: there is no node 9"),
    "same node twice": (
        {"elem": "ELEMENTS[1] = A([1,2,1],1)"},
        "a.elem:1:1: element 1 (A) names node 1 twice",
    ),
    "too few nodes": (
        {"elem": "ELEMENTS[1] = KinematicLinear3D4N([1,2,3],1)"},
        "a.elem:1:1: element 1 (KinematicLinear3D4N) has 3 nodes; expected 4",
    ),
    "too many nodes": (
        {"cond": "CONDITIONS[7] = Face3D3N([1,2,3,4],1)"},
        "a.cond:1:1: condition 7 (Face3D3N) has 4 nodes; expected 3",
    ),
    "unequal nodes": (
        {"elem": "ELEMENTS[1]=A([1,2],1)ELEMENTS[2]=A([1],1)"},
        "element 2 (A) has 1 nodes; expected 2",
    ),
    "no nodes": ({"elem": "ELEMENTS[1] = A([],1)"}, "a.elem:1:1: element 1 (A) has 0 nodes; expected 1"),
    "undeclared properties": (
        {"elem": "\nELEMENTS[1] = A([1,2],7)"},
        "a.elem:2: element 1 (A): properties 7 are not declared in a.prop; expected one of 1",
    ),
    "value twice": (
        {"prop": PROP + "PROPERTIES[1][DENSITY] = 2"},
        "a.prop:2:1: DENSITY of properties 1 is already defined at line 1",
    ),
    "ragged matrix": (
        {"prop": "PROPERTIES[1][M] = [[1,2],[3]]"},
        "a.prop:1:1: the rows of the matrix have [2, 1]",
    ),
    "empty vector": ({"prop": "PROPERTIES[1][G] = []"}, "a.prop:1:21: found ']'; expected a number"),
    "mdpa vector": ({"prop": "PROPERTIES[1] G[3] (0,0,0)"}, "a.prop:1:15: found 'G'; expected '['"),
    "old step": ({"init": "NODES[1](P, 1) = 0"}, "a.init:1:1: step 1 of the solution"),
    "init twice": (
        {"init": "NODES[1](P, 0) = 0;\nNODES[1](P, 0) = 1"},
        "a.init:2:1: P of node 1 is already defined at line 1 with another value",
    ),
    "whole vector": (
        {"cond": "NODES[1].Fix(DISPLACEMENT)"},
        "a.cond:1:1: DISPLACEMENT is a vector; expected",
    ),
    "truncated": (
        {"elem": "ELEMENTS[1] = A([1,"},
        "a.elem:1:20: the file ends inside a statement; expected an id",
    ),
}


@pytest.mark.parametrize(("texts", "expected"), ERRORS.values(), ids=ERRORS)
def test_error_names_its_place_and_what_was_expected(problem, texts, expected):
    assert problem(**texts).count("\n") == 0
    assert expected in problem(**texts)


def test_hint_of_a_misplaced_statement_and_of_a_misspelt_one(problem):
    assert "NODES statements of other kinds belong in .node, .cond or .init." in problem(elem=NODE)
    assert "Did you mean ELEMENTS?" in problem(elem="ELEMENT[1] = A([1],1)")


def test_all_problems_of_all_files_are_reported_together(problem):
    text = problem(
        node="NODES = NodesList([[1, 0, x, 0],\n[2, 0, 0, 0],\n[3, y, 0, 0]])\nNODES[4] = Node(0, 0)",
        elem="ELEMENTS[0] = A([1,2],1)\nFOO\nELEMENTS[2] = A([1 2],1)",
        prop="PROPERTIES[1][E] = nan",
        init="NODES[1](P, 0) = ;",
    )
    places = [line.split(": ")[0] for line in text.splitlines()]
    assert places == [
        "a.node:1:27",
        "a.node:3:5",
        "a.node:4:21",
        "a.elem:2:1",
        "a.elem:3:20",
        "a.prop:1:20",
        "a.init:1:18",
        "a.elem:1:1",
    ]


def test_many_problems_are_counted(problem):
    text = problem(elem="FOO;\n" + "ELEMENTS[0] = A([1,2],1);\n" * 50)
    assert len(text.splitlines()) == MAX_PROBLEMS + 1
    assert text.endswith("more")


def test_repetitions_that_agree_are_noted(make):
    document = read_elem(
        make(
            node=NODE + "NODES[3] = Node(0, 1, 0)",
            cond="NODES[1].Fix(P)\nNODES[1].Fix(P)",
            init="NODES[1](P, 0) = 1\nNODES[1](P, 0) = 1.0",
        )
    )
    assert [str(note) for note in document.notes] == [
        "a.node:2: node 3 is already defined at line 1, the same",
        "a.cond:2: 1 statements repeat earlier ones, from here on",
        "a.init:2: 1 statements repeat earlier ones, from here on",
    ]
    assert document.mesh.n_nodes == 5
    assert document.nodal_data[0].ids.tolist() == [1]


# ---- writing -------------------------------------------------------------------------------


def sample():
    """Return a document that uses all that the format can hold."""
    points = np.random.default_rng(3).normal(size=(5, 3)) * [1e-9, 1, 1e9]
    ids = np.array([40, 7, 9, 2, 3])
    four = np.array([[0, 1, 2, 3], [1, 2, 3, 4]], np.int32)
    tetra = Block("KinematicLinear3D4N", four, ids[:2], ids[:2] * 0 + 4, Tetrahedron4)
    bar = Block("Bar", np.array([[4, 0]], np.int32), ids[2:3], ids[:1] * 0, None)
    face = Block("Face3D3N", np.array([[0, 1, 2]], np.int32), ids[:1], ids[:1] * 0 + 4, Triangle3)
    mesh = Mesh(points, [tetra, bar], node_ids=ids, conditions=[face])
    values = {"E": 0.1 + 0.2, "G": np.array([0, -9.81, 1e-300]), "M": np.array([[1.0, 2], [3, 1e22]])}
    properties = {4: Properties(4, values), 0: Properties(0)}
    fixed = Data("DISPLACEMENT_X", ids[:2], np.array([True, True]), np.array([-0.0, 1 / 3]))
    free = Data("TEMPERATURE", ids[1:3], np.array([False, False]), np.array([293.15, 1e-5]))
    return Document(mesh, properties, [fixed, free])


def test_round_trip_keeps_every_digit(tmp_path):
    document = sample()
    assert write_elem(tmp_path / "b.elem", document) == []
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".cond", ".elem", ".init", ".node", ".prop"]
    assert said(document) == said(read_elem(tmp_path / "b"))  # -0.0 is not 0.0


def test_round_trip_of_properties_without_values(tmp_path):
    document = sample()
    document.properties = {4: Properties(4), 0: Properties(0)}
    assert write_elem(tmp_path / "b", document) == []
    again = read_elem(tmp_path / "b")
    assert {number: properties.values for number, properties in again.properties.items()} == {0: {}, 4: {}}


def test_what_the_format_cannot_hold_is_noted(tmp_path):
    document = sample()
    document.mesh = document.mesh.replace(parts={"top": Part(), "top.left": Part()})
    document.constraints = [Constraint(1, (7, "DISPLACEMENT_X"), ((9, "DISPLACEMENT_X"),), (1.0,), 0.0)]
    document.properties[4].values |= {"LAW": "LinearElastic3DLaw", "LUMPED": True, "EMPTY": np.zeros(0)}
    nowhere = np.zeros(1, dtype=bool)
    document.nodal_data.append(Data("VELOCITY", np.array([7]), nowhere, np.zeros((1, 3))))
    texts = write_elem(tmp_path / "b", document)
    assert [text.split(";")[0] for text in texts] == [
        "left out: 2 parts",
        "left out: 1 constraints",
        "left out: nodal VELOCITY",
        "left out: LAW of properties 4",
        "left out: LUMPED of properties 4",
        "left out: EMPTY of properties 4",
    ]
    assert said(sample()) == said(read_elem(tmp_path / "b"))


WRONG = Data("VELOCITY", np.array([7]), np.array([True]), np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (lambda d: d.nodal_data[0].values.fill(np.inf), "some values of DISPLACEMENT_X are not finite"),
        (lambda d: {"mesh": with_block(d.mesh, name="tetra 4")}, "'tetra 4' cannot be written"),
        (lambda d: {"mesh": with_block(d.mesh, properties=[5, 5])}, "properties 5 have no number to write"),
        (lambda d: d.nodal_data.append(WRONG), "VELOCITY is fixed as a whole"),
        (lambda d: {"mesh": Mesh(np.zeros((0, 3)))}, "there are no nodes to write"),
    ],
)
def test_what_would_be_another_model_is_refused_and_nothing_is_written(tmp_path, damage, expected):
    document = sample()
    vars(document).update(damage(document) or {})
    with pytest.raises(InputError, match=expected):
        write_elem(tmp_path / "b", document)
    assert list(tmp_path.iterdir()) == []


# ---- damaged files -------------------------------------------------------------------------

SMALL = {
    "node": "NODES = NodesList([\n[1, 0.0, 0, 1.0e0],[2,1,0,0], // c\n[3,0,1,0],\n])\n"
    "NODES[4]=Node(1,1,1);\n",
    "elem": "ElementsGroup = g;\nELEMENTS[1] = KinematicLinear3D4N([1,2,3,4],1);\n"
    "ELEMENTS = ElementsList(Bar,[[2,[2,3],1],\n])\n",
    "cond": "NODES[1].Fix(P_X);\nCONDITIONS = ConditionsList(Face3D3N,[\n[1,[1,2,3],1],])\n"
    "CONDITIONS[7] = C([1],0)\n",
    "prop": "PROPERTIES[1][E] = 1.5;\n/* c */PROPERTIES[1][G] = [0, 0, -9.81];\n"
    "PROPERTIES[1][M] = [[1,2],[3,4]]\n",
    "init": "NODES[1](P_X, 0) = 0.25;\nNODES[2](T,0)=3;",
}


def outcome(path, name, data):
    """Return what reading gives when one file is replaced: a Document, or an error text that names a file."""
    path.write_bytes(data)
    try:
        return read_elem(name)
    except InputError as error:
        return str(error)


def names_a_file(result, name):
    return isinstance(result, Document) or all(
        line.startswith((f"{name}.", "…")) for line in result.splitlines()
    )


def cut(data, _):
    return [data[:end] for end in range(len(data) + 1)]


def flipped(data, rng):
    """Return copies of data, each with one byte that is another."""
    at = [(rng.randrange(len(data)), bytes([rng.randrange(256)])) for _ in range(300)]
    return [data[:i] + byte + data[i + 1 :] for i, byte in at]


@pytest.mark.parametrize("ending", SMALL)
@pytest.mark.parametrize("damaged", [cut, flipped])
def test_every_damaged_file_ends_in_a_document_or_an_error(make, damaged, ending):
    name, files = make(**SMALL), damaged(SMALL[ending].encode(), random.Random(11))
    results = [outcome(name.with_suffix(f".{ending}"), name, data) for data in files]
    assert {type(result) for result in results} == {Document, str}
    assert all(names_a_file(result, name) for result in results)
