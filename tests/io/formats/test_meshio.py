import sys
from dataclasses import replace

import numpy as np
import pytest

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError
from kratos_lite.io.formats import read_document
from kratos_lite.io.formats.meshio import CELLS, read_meshio, write_meshio
from kratos_lite.io.formats.vtu import write_vtu
from kratos_lite.mesh import Block, Mesh
from kratos_lite.shapes import SHAPES

meshio = pytest.importorskip("meshio")
SOLIDS = [name for name in CELLS.values() if SHAPES[name].nodes.shape[1] == 3]


def one(name):
    """Return a mesh of one curved cell in which no two nodes can be exchanged unseen."""
    shape = SHAPES[name]
    x, y, z = shape.nodes.T
    X = shape.nodes + 0.05 * np.stack([y * z + z**2, x**2 + z, x * y + x], axis=-1)
    nodes = np.arange(len(X), dtype=np.int32)[None]
    return Mesh(X, [Block(f"Element3D{len(X)}N", nodes, np.array([1]), np.array([4]), shape)])


@pytest.mark.parametrize("ending", ["vtk", "vtu", "own.vtu"])
@pytest.mark.parametrize("name", SOLIDS)
def test_every_solid_returns_in_kratos_order(tmp_path, name, ending):
    mesh, path = one(name), tmp_path / f"one.{ending}"
    (write_vtu if ending == "own.vtu" else write_meshio)(path, mesh, {}, {"PROPERTIES_ID": np.array([4])})
    document = read_meshio(path)
    (block,) = document.mesh.blocks
    assert (block.name, block.shape, block.ids.tolist()) == (mesh.blocks[0].name, SHAPES[name], [1])
    assert block.properties.tolist() == list(document.properties) == [4]
    np.testing.assert_array_equal(document.mesh.points[block.nodes[0]], mesh.points)


@pytest.mark.parametrize(
    ("ending", "names"),
    [
        ("msh", SOLIDS),
        ("inp", ["Tetrahedron10", "Hexahedron20", "Wedge6"]),
        ("bdf", ["Tetrahedron4", "Hexahedron20", "Wedge15"]),
        ("mesh", ["Tetrahedron4", "Hexahedron8"]),
        ("su2", ["Pyramid5", "Wedge6"]),
    ],
)
def test_other_formats_keep_the_node_order(tmp_path, ending, names):
    for name in names:
        mesh, path = one(name), tmp_path / f"{name}.{ending}"
        mesh = mesh.replace(
            points=mesh.points.round(3)
        )  # meshio writes no long negative numbers to Nastran files
        write_meshio(path, mesh, {}, {})
        found = read_meshio(path).mesh
        np.testing.assert_allclose(found.points[found.blocks[0].nodes[0]], mesh.points, rtol=1e-6, atol=1e-12)


@pytest.fixture(scope="module")
def gmsh():
    return pytest.importorskip("gmsh")


def box(gmsh, path, *, recombine=0, incomplete=0, version=4.1):
    """Mesh the box 1 x 2 x 3 m with Gmsh in second order; recombine=1 gives hexahedra, 2 wedges."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.9)
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 2)
        layers = {"numElements": [2], "recombine": True} if recombine else {}
        gmsh.model.occ.extrude([(2, 1)], 0, 0, 3, **layers)
        gmsh.model.occ.synchronize()
        if recombine == 1:
            gmsh.model.mesh.setRecombine(2, 1)
        top = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(-1, -1, 2.9, 2, 3, 4, 2)]
        gmsh.model.addPhysicalGroup(3, [1], 7, "body")
        gmsh.model.addPhysicalGroup(2, top, 5, "top")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], 7, "skin")
        gmsh.model.addPhysicalGroup(0, [1], 9, "corner")
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize(
    ("recombine", "incomplete", "solid", "faces"),
    [
        (0, 0, "Element3D10N", {"SurfaceCondition3D6N"}),
        (1, 0, "Element3D27N", {"SurfaceCondition3D9N"}),
        (1, 1, "Element3D20N", {"SurfaceCondition3D8N"}),
        (2, 1, "Element3D15N", {"SurfaceCondition3D6N", "SurfaceCondition3D8N"}),
    ],
)
def test_gmsh_files_of_second_order_give_the_volume_and_the_named_parts(
    gmsh, tmp_path, version, recombine, incomplete, solid, faces
):
    box(gmsh, tmp_path / "box.msh", recombine=recombine, incomplete=incomplete, version=version)
    document = read_meshio(tmp_path / "box.msh")
    mesh = document.mesh
    assert [block.name for block in mesh.blocks] == [solid]
    element = ELEMENTS[f"KinematicLinear3D{len(mesh.blocks[0].shape.nodes)}N"]
    dV = element(mesh.points[mesh.blocks[0].nodes]).dV
    assert dV.min() > 0
    assert dV.sum() == pytest.approx(6, rel=1e-12)
    assert {block.name for block in mesh.conditions} == {"PointCondition3D1N", *faces}
    assert set(mesh.parts) == {"body", "top", "skin", "corner"}
    assert list(document.properties) == [7]
    assert len(mesh.parts["body"].elements) == mesh.n_elements
    assert len(mesh.parts["body"].conditions) == 0
    np.testing.assert_array_equal(mesh.nodes("top"), np.flatnonzero(mesh.points[:, 2] == 3))
    np.testing.assert_array_equal(mesh.points[mesh.nodes("corner")], [[0, 0, 0]])
    for name, area in (("top", 2), ("skin", 22)):
        total = 0.0
        for block in mesh.faces(name):
            X = mesh.points[block.nodes[:, : block.shape.corners]]
            total += np.linalg.norm(np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]), axis=1).sum() / 2
            if block.shape.cell == "quadrilateral":
                total += np.linalg.norm(np.cross(X[:, 2] - X[:, 0], X[:, 3] - X[:, 0]), axis=1).sum() / 2
        if version == 4.1:  # Gmsh 2 files hold each face once for every group that it is in
            assert total == pytest.approx(area, rel=1e-12)


def test_abaqus_sets_become_parts(tmp_path):
    (tmp_path / "two.inp").write_text(
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,1,1,1\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n2,2,3,4,5\n"
        "*NSET, NSET=FIX\n1,3\n*ELSET, ELSET=FAR\n2\n"
    )
    mesh = read_meshio(tmp_path / "two.inp").mesh
    assert mesh.parts["FIX"].nodes.tolist() == [0, 2]
    assert mesh.parts["FAR"].elements.tolist() == [1]
    assert mesh.parts["FAR"].nodes.tolist() == [1, 2, 3, 4]


def test_what_is_not_used_is_noted(tmp_path):
    cells = [("tetra", [[0, 1, 2, 3]]), ("line", [[0, 1], [1, 2]]), ("quad", [[0, 1, 2, 3]])]
    cells.append(("polygon", [list(range(5))]))
    meshio.Mesh(np.random.default_rng(1).normal(size=(18, 3)), cells, {"T": np.zeros(18)}).write(
        tmp_path / "a.vtk", file_format="vtk"
    )
    document = read_meshio(tmp_path / "a.vtk")
    assert [str(note) for note in document.notes] == [
        "nodes are numbered 1 … 18 in the order of the file",
        "2 cells 'line' are in no named group and are not used",
        "1 cells 'polygon' are of no known type and are not used",
        "data not used: T",
    ]
    assert [block.name for block in document.mesh.conditions] == ["SurfaceCondition3D4N"]
    assert [block.properties.tolist() for block in document.mesh.conditions] == [[1]]


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
FACE = [("triangle", [[0, 1, 2]])]
COMMAND = "'gmsh -3 -order 2 {0}.geo -o {0}.msh'"


def refused(path):
    """Return what is wrong with a file, less the name of its folder."""
    with pytest.raises(InputError) as error:
        read_document(path)
    return str(error.value).replace(f"{path.parent}/", "")


@pytest.mark.parametrize("form", ["gmsh22", "gmsh"])
@pytest.mark.parametrize("named", [{}, {"top": np.array([3, 2])}, {"body": np.array([1, 3])}])
def test_gmsh_files_without_volumes_are_answered_with_the_line_or_the_command(tmp_path, form, named):
    """Gmsh saves physical groups alone where there are some; a mesh of surfaces needs -3."""
    tags = {"gmsh:physical": [np.array([3])], "gmsh:geometrical": [np.array([3])]} if named else {}
    meshio.Mesh(SQUARE, FACE, cell_data=tags, field_data=named).write(tmp_path / "a.msh", file_format=form)
    said = refused(tmp_path / "a.msh")
    assert "there are no solid cells" in said
    assert said.endswith(COMMAND.format("a"))
    assert ('add the line Physical Volume("body") = {1};' in said) == ("top" in named)
    assert ("mesh volumes, not surfaces alone" in said) == ("top" not in named)


@pytest.mark.parametrize(
    ("kind", "nodes", "cure"),
    [
        ("tetra20", 20, "set Mesh.ElementOrder = 2; in the .geo file, or mesh with " + COMMAND.format("a")),
        ("hexahedron64", 64, "set Mesh.ElementOrder = 2; in the .geo file"),
        ("wedge18", 18, "add the line Mesh.SecondOrderIncomplete = 1; to the .geo file, or mesh with"),
        ("pyramid14", 14, "-setnumber Mesh.SecondOrderIncomplete 1 a.geo -o a.msh'"),
    ],
)
def test_solids_of_gmsh_that_no_element_has_are_answered_with_line_and_option(tmp_path, kind, nodes, cure):
    points = np.random.default_rng(2).normal(size=(nodes, 3))
    cells = [("tetra", [[0, 1, 2, 3]]), (kind, [list(range(nodes))])]
    meshio.Mesh(points, cells).write(tmp_path / "a.msh", file_format="gmsh22")
    said = refused(tmp_path / "a.msh")
    assert f"a.msh: there are no elements for 1 cells {kind!r}; " in said
    assert cure in said


@pytest.mark.parametrize(
    ("cells", "text"),
    [
        (
            FACE,
            "a.vtk: there are no solid cells (tetrahedra, pyramids, wedges, hexahedra), but 1 triangle; mesh",
        ),
        ([("wedge18", [list(range(18))])], "1 cells 'wedge18'; save linear or quadratic ones"),
    ],
)
def test_cells_of_other_formats_that_no_element_has_are_refused_too(tmp_path, cells, text):
    meshio.Mesh(np.random.default_rng(2).normal(size=(18, 3)), cells).write(tmp_path / "a.vtk")
    assert text in refused(tmp_path / "a.vtk")


@pytest.mark.parametrize("ending", ["geo", "GEO", "step", "brep"])
def test_a_geometry_is_answered_with_the_command_that_meshes_it(tmp_path, ending):
    (tmp_path / f"part.{ending}").write_text("Box(1) = {0, 0, 0, 1, 1, 2};")
    said = refused(tmp_path / f"part.{ending}")
    assert said == (
        f"part.{ending}: is a geometry, not a mesh; mesh it with "
        f"'gmsh -3 -order 2 part.{ending} -o part.msh' and give the .msh"
    )


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.xyz", "", r"unknown ending '\.xyz'; known are \.mdpa \.elem .*\.vtu"),
        (
            "a.msh",
            "$MeshFormat\n4.1 0 8\n$EndMesh",
            r"a\.msh: cannot be read by meshio: .*is the file complete",
        ),
        ("a.bdf", "BEGIN BULK\n", r"a\.bdf: there is no ENDDATA behind a BEGIN BULK; is the file complete"),
        ("a.vtu", "<VTKFile", r"a\.vtu: cannot be read by meshio"),
        ("a.vtk", "", r"a\.vtk: cannot be read by meshio"),
        ("none.vtk", None, r"none\.vtk.*not found"),
        ("a.inp", "*NODE\n1,0,0\n", r"a\.inp: the points form \(1, 2\); expected \(n, 3\)"),
        ("a.inp", "*NODE\n1,0,0,nan\n", r"a\.inp: point 1 has coordinates \[ 0\.  0\. nan\]"),
        (
            "a.su2",
            "NDIME= 3\nNELEM= 1\n10 0 1 2 9\nNPOIN= 4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
            r"a tetra names point 10; the points are 1 … 4",
        ),
    ],
)
def test_bad_files_are_input_errors_and_nothing_is_printed(tmp_path, capfd, name, text, message):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_meshio(tmp_path / name)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("old.xyz", "unknown ending"),
        ("old.mdpa", "unknown ending"),
        ("old.stl", "keeps no cells of 1 hexahedron20; .vtu"),
        ("old.mesh", "keeps no cells of 1 hexahedron20; .vtu"),
        ("old.avs", "cannot be written by meshio"),
        ("old.msh", "cannot hold STRESS on elements"),
    ],
)
def test_a_format_that_cannot_hold_the_mesh_leaves_the_old_file(tmp_path, capfd, name, message):
    (tmp_path / name).write_text("old")
    with pytest.raises(InputError) as error:
        write_meshio(tmp_path / name, one("Hexahedron20"), {}, {"STRESS": np.zeros((1, 6))})
    assert message in str(error.value)
    assert (tmp_path / name).read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1
    assert capfd.readouterr() == ("", "")


def test_mixed_cells_keep_their_properties_in_gmsh_files(tmp_path):
    a, b = one("Hexahedron8"), one("Tetrahedron4")
    blocks = [a.blocks[0], replace(b.blocks[0], nodes=b.blocks[0].nodes + 8)]
    mesh = Mesh(np.vstack([a.points, b.points + 5]), blocks)
    write_meshio(tmp_path / "a.msh", mesh, {}, {"PROPERTIES_ID": np.array([3, 8])})
    found = read_meshio(tmp_path / "a.msh")
    assert [block.properties.tolist() for block in found.mesh.blocks] == [[3], [8]]
    assert list(found.properties) == [3, 8]


def test_a_format_that_needs_another_package_says_which(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match="this format needs it: pip install h5py"):
        write_meshio(tmp_path / "a.med", one("Tetrahedron4"), {}, {})


def test_a_full_disk_is_reported_as_such(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(meshio, "write", full)
    with pytest.raises(InputError, match=r"a\.vtk: cannot be written: No space left"):
        write_meshio(tmp_path / "a.vtk", one("Tetrahedron4"), {}, {})
    assert list(tmp_path.iterdir()) == []


def test_warnings_of_meshio_become_notes(tmp_path, monkeypatch):
    def read(_):
        print("Warning: odd", file=sys.stderr)  # noqa: T201
        return meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])])

    monkeypatch.setattr(meshio, "read", read)
    assert [str(note) for note in read_meshio(tmp_path / "a.vtk").notes] == [
        "Warning: odd",
        "nodes are numbered 1 … 4 in the order of the file",
    ]


def test_elements_listed_twice_in_a_gmsh_file_are_refused(tmp_path):
    twice = [("tetra", [[0, 1, 2, 3], [0, 1, 2, 3]])]
    meshio.Mesh(np.eye(4, 3), twice).write(tmp_path / "a.msh", file_format="gmsh22")
    with pytest.raises(InputError, match=r"Element3D4N listed twice; save it from Gmsh as version 4\.1"):
        read_meshio(tmp_path / "a.msh")


@pytest.mark.parametrize("ending", ["gz", "GZ"])
def test_no_gzipped_vtu_is_written(tmp_path, ending):
    with pytest.raises(InputError, match=r"write it as \.vtu"):
        write_vtu(tmp_path / f"a.vtu.{ending}", one("Tetrahedron4"), {}, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["vtu", "vtk", "own.vtu"])
def test_our_own_files_keep_the_ids_of_nodes_and_elements(tmp_path, ending):
    a, b = one("Hexahedron8"), one("Tetrahedron4")
    points, ids = np.vstack([a.points, b.points + 5]), np.arange(12)[::-1] * 10 + 101
    blocks = [replace(a.blocks[0], ids=[90]), replace(b.blocks[0], nodes=b.blocks[0].nodes + 8, ids=[70])]
    mesh = Mesh(points, blocks, node_ids=ids)
    data = {"ELEMENT_ID": np.array([90, 70]), "PROPERTIES_ID": np.array([4, 4])}
    path = tmp_path / f"a.{ending}"
    (write_vtu if ending == "own.vtu" else write_meshio)(path, mesh, {"NODE_ID": ids}, data)
    document = read_meshio(path)
    assert document.mesh.node_ids.tolist() == ids.tolist()
    assert [block.ids.tolist() for block in document.mesh.blocks] == [[90], [70]]
    assert document.notes == []


@pytest.mark.parametrize("ids", [[1, 2, 3, 3], [0, 1, 2, 3], [1, 2, 3, 4.5], [1, 2, 3, np.nan]])
def test_ids_that_are_none_are_not_taken(tmp_path, ids):
    tetra = [("tetra", [[0, 1, 2, 3]])]
    meshio.Mesh(np.eye(4, 3), tetra, point_data={"NODE_ID": np.array(ids)}).write(tmp_path / "a.vtu")
    document = read_meshio(tmp_path / "a.vtu")
    assert document.mesh.node_ids.tolist() == [1, 2, 3, 4]
    assert [str(note) for note in document.notes] == [
        "nodes are numbered 1 … 4 in the order of the file",
        "data not used: NODE_ID",
    ]


def test_property_ids_too_large_for_gmsh_are_refused(tmp_path):
    mesh = one("Tetrahedron4")
    write_meshio(tmp_path / "a.msh", mesh, {}, {"PROPERTIES_ID": np.array([2**31 - 1])})
    assert list(read_meshio(tmp_path / "a.msh").properties) == [2**31 - 1]
    with pytest.raises(InputError, match=r"property ids up to 2147483647; got 2147483648"):
        write_meshio(tmp_path / "b.msh", mesh, {}, {"PROPERTIES_ID": np.array([2**31])})
