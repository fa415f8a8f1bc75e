from xml.etree import ElementTree

import numpy as np
import pytest

from kratos_lite.errors import InputError
from kratos_lite.io.formats.vtu import BLOCK, MODES, write_pvd, write_vtu
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.generators import box
from kratos_lite.shapes import SHAPES, Shape

SOLIDS = [name for name, shape in zip(SHAPES, SHAPES.values(), strict=True) if shape.nodes.shape[1] == 3]


def gauss(cell, n=6):
    """Return reference points and weights, and the same points and weights in the coordinates of VTK."""
    x, w = np.polynomial.legendre.leggauss(n)
    u = np.stack(np.meshgrid(*3 * [(x + 1) / 2], indexing="ij"), axis=-1).reshape(-1, 3)
    W = np.einsum("i,j,k->ijk", w, w, w).ravel() / 8
    a, b, c = u.T
    if cell == "hexahedron":
        return 2 * u - 1, 8 * W, u, W
    if cell == "pyramid":
        return np.stack([(2 * a - 1) * (1 - c), (2 * b - 1) * (1 - c), c], -1), 4 * W * (1 - c) ** 2, u, W
    b, W = b * (1 - a), W * (1 - a)
    if cell == "wedge":
        return np.stack([a, b, 2 * c - 1], -1), 2 * W, np.stack([a, b, c], -1), W
    c, W = c * (1 - a - b), W * (1 - a - b)
    return np.stack([a, b, c], -1), W, np.stack([a, b, c], -1), W


def curved(shape):
    """Return the nodes of a cell with curved edges, and skewed enough that each node is told apart."""
    x, y, z = shape.nodes.T
    return shape.nodes + np.stack(
        [0.1 * y * z + 0.05 * z**2, 0.07 * x**2 + 0.1 * z, 0.1 * x * y + 0.05 * x], -1
    )


def volume(shape, X):
    xi, w, _, _ = gauss(shape.cell)
    return w @ np.linalg.det(np.einsum("ai,pad->pid", X, shape.dN(xi)))


def row_of_cells(names):
    """Return one curved cell of every kind, in a row, and in between a block of an unknown kind."""
    points, blocks, first = [], [], 0
    for e, name in enumerate(names):
        shape = SHAPES[name]
        blocks.append(Block(name, [range(first, first + len(shape.nodes))], [e + 1], shape=shape))
        points.append(curved(shape) + np.array([3 * e, 0, 0]))
        first += len(shape.nodes)
    strange = Block("Spring", [[0, 1]], [99])
    return Mesh(np.vstack(points), [*blocks[:2], strange, *blocks[2:]])


@pytest.fixture
def mesh():
    return row_of_cells(SOLIDS)


def read(path):
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput()


def arrays(data):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


@pytest.mark.parametrize("mode", MODES)
def test_vtk_finds_every_cell_and_point(mesh, tmp_path, mode):
    write_vtu(tmp_path / "all.vtu", mesh, mode=mode)
    grid = read(tmp_path / "all.vtu")
    assert len(SOLIDS) == 9
    assert [grid.GetCellType(e) for e in range(grid.GetNumberOfCells())] == [SHAPES[s].vtk for s in SOLIDS]
    points = np.array([grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())])
    np.testing.assert_array_equal(points, mesh.points)


def vtk_cell(grid, e, pcoords, weights):
    """Return the points that VTK interpolates in cell e, and the volume by its own derivatives."""
    cell = grid.GetCell(e)
    nodes = np.array([cell.GetPoints().GetPoint(i) for i in range(cell.GetNumberOfPoints())])
    values, slopes, points, total = np.zeros(len(nodes)), np.zeros(3 * len(nodes)), [], 0.0
    for p, w in zip(pcoords, weights, strict=True):
        cell.InterpolateFunctions(p, values)
        cell.InterpolateDerivs(p, slopes)
        points.append(values @ nodes)
        total += w * np.linalg.det(slopes.reshape(3, -1) @ nodes)
    return np.array(points), total


@pytest.mark.parametrize("name", [name for name in SOLIDS if name != "Pyramid13"])
def test_vtk_interpolates_and_measures_the_same_curved_cell(mesh, tmp_path, name):
    write_vtu(tmp_path / "all.vtu", mesh)
    e, shape = SOLIDS.index(name), SHAPES[name]
    xi, _, pcoords, weights = gauss(shape.cell)
    points, total = vtk_cell(read(tmp_path / "all.vtu"), e, pcoords, weights)
    X = curved(shape) + np.array([3 * e, 0, 0])
    np.testing.assert_allclose(points, shape.N(xi) @ X, atol=1e-13)
    assert total == pytest.approx(volume(shape, X), rel=1e-12)


def test_vtk_knows_the_quadratic_pyramid_with_straight_edges_and_nearly_the_curved_one(tmp_path):
    # VTK interpolates this cell by other functions, which agree with the rational ones on affine cells.
    shape = SHAPES["Pyramid13"]
    straight = shape.nodes @ np.array([[1, 0.2, 0.1], [0, 1.1, 0.3], [0.2, 0, 0.9]])
    xi, _, pcoords, weights = gauss(shape.cell)
    for X, far, off in ((straight, 1e-13, 1e-12), (curved(shape), 0.02, 1e-4)):
        write_vtu(tmp_path / "p.vtu", Mesh(X, [Block("P", [range(13)], shape=shape)]))
        points, total = vtk_cell(read(tmp_path / "p.vtu"), 0, pcoords, weights)
        np.testing.assert_allclose(points, shape.N(xi) @ X, atol=far)
        assert total == pytest.approx(volume(shape, X), rel=off)


@pytest.mark.parametrize("mode", MODES)
def test_vtk_reads_every_array_with_its_type_and_component_names(mesh, tmp_path, mode):
    n, m = mesh.n_nodes, mesh.n_elements
    numbers = np.random.default_rng(1)
    nodal = {
        "DISPLACEMENT": numbers.normal(size=(n, 3)),
        "NODE_ID": np.arange(n) + 2**40,
        "T<1>&\"'": np.full(n, 0.1),
        "FLAG": np.arange(n) % 2 == 0,
        "TENSOR": numbers.normal(size=(n, 3, 3)),
    }
    cells = {"STRESS": numbers.normal(size=(m, 6)).astype(np.float32), "PART": np.arange(m, dtype=np.int32)}
    write_vtu(tmp_path / "all.vtu", mesh, nodal, cells, mode)
    grid = read(tmp_path / "all.vtu")
    found = arrays(grid.GetPointData())
    assert list(found) == list(nodal)
    for name, values in nodal.items():
        np.testing.assert_array_equal(found[name], values.reshape(found[name].shape))
    assert [a.dtype.str for a in found.values()] == ["<f8", "<i8", "<f8", "<i4", "<f8"]
    known = np.arange(m) != 2  # the third block has no shape
    for name, values in arrays(grid.GetCellData()).items():
        np.testing.assert_array_equal(values, cells[name][known])
    stress, shift = grid.GetCellData().GetArray("STRESS"), grid.GetPointData().GetArray("DISPLACEMENT")
    assert [stress.GetComponentName(i) for i in range(6)] == ["XX", "YY", "ZZ", "XY", "YZ", "ZX"]
    assert [shift.GetComponentName(i) for i in range(3)] == ["X", "Y", "Z"]


@pytest.mark.parametrize("mode", MODES)
def test_meshio_reads_the_same_file(tmp_path, mode):
    meshio = pytest.importorskip("meshio")
    names = [name for name in SOLIDS if name not in {"Wedge15", "Pyramid13"}]  # meshio 5.3.5 fails on these
    mesh = row_of_cells(names)
    write_vtu(tmp_path / "all.vtu", mesh, {"U": mesh.points**2}, {"E": np.arange(8.0)}, mode)
    found = meshio.read(tmp_path / "all.vtu")
    np.testing.assert_array_equal(found.points, mesh.points)
    np.testing.assert_array_equal(found.point_data["U"], mesh.points**2)
    np.testing.assert_array_equal(np.concatenate(found.cell_data["E"]), [0, 1, 3, 4, 5, 6, 7])
    for cells, name in zip(found.cells, names, strict=True):
        block = next(b for b in mesh.blocks if b.name == name)
        # meshio follows the text of VTK on its linear wedge, not VTK's formulas: it exchanges two corners
        order = [0, 2, 1, 3, 5, 4] if name == "Wedge6" else list(SHAPES[name].to_vtk)
        np.testing.assert_array_equal(cells.data, block.nodes[:, order])


@pytest.mark.parametrize("mode", MODES)
def test_meshio_takes_no_array_for_another(tmp_path, mode):
    meshio = pytest.importorskip("meshio")
    # With 8 nodes, meshio moves the fourth number field to the offset at which the fifth is stored.
    data = {f"field {i}": np.random.default_rng(i).random(8) for i in range(6)}
    write_vtu(tmp_path / "a.vtu", box(), data, mode=mode)
    found = meshio.read(tmp_path / "a.vtu").point_data
    for name, values in data.items():
        np.testing.assert_array_equal(found[name], values)
    for name, values in arrays(read(tmp_path / "a.vtu").GetPointData()).items():
        np.testing.assert_array_equal(values, data[name])


@pytest.mark.parametrize("mode", MODES)
def test_a_mesh_without_elements_is_written(tmp_path, mode):
    write_vtu(tmp_path / "points.vtu", Mesh(np.eye(3)), {"T": np.arange(3.0)}, mode=mode)
    grid = read(tmp_path / "points.vtu")
    assert (grid.GetNumberOfPoints(), grid.GetNumberOfCells()) == (3, 0)
    np.testing.assert_array_equal(arrays(grid.GetPointData())["T"], [0, 1, 2])


@pytest.mark.parametrize("n", [BLOCK // 8, BLOCK // 8 + 1, BLOCK // 2])
def test_compressed_numbers_come_back_whether_or_not_they_fill_their_blocks(tmp_path, n):
    points, values = np.zeros((n, 3)), np.arange(n) / 3
    write_vtu(tmp_path / "plain.vtu", Mesh(points), {"T": values})
    write_vtu(tmp_path / "points.vtu", Mesh(points), {"T": values}, mode="compressed")
    np.testing.assert_array_equal(arrays(read(tmp_path / "points.vtu").GetPointData())["T"], values)
    assert (tmp_path / "points.vtu").stat().st_size < (tmp_path / "plain.vtu").stat().st_size / 2


@pytest.mark.parametrize(
    ("values", "mode", "text"),
    [
        (np.zeros(4), "binary", "U: expected one row per node, that is 3; got shape (4,)"),
        (np.float64(1), "binary", "U: expected one row per node, that is 3; got shape ()"),
        (np.zeros(3, dtype=complex), "binary", "U: expected real or whole numbers; got complex128"),
        (np.array(["a", "b", "c"]), "binary", "U: expected real or whole numbers; got <U1"),
        (np.zeros(3), "text", "a .vtu file is written as binary, compressed, ascii; got 'text'"),
    ],
)
def test_wrong_arrays_and_modes_are_refused_and_nothing_is_written(tmp_path, values, mode, text):
    with pytest.raises(InputError) as error:
        write_vtu(tmp_path / "a.vtu", Mesh(np.eye(3)), {"U": values}, mode=mode)
    assert str(error.value) == text
    assert list(tmp_path.iterdir()) == []


def test_a_shape_without_vtk_number_is_refused(tmp_path):
    class Plain(Shape):
        cell, corners, degree = "tetrahedron", 1, 0
        nodes = np.zeros((1, 3))

    SHAPES._items.pop("Plain")
    mesh = Mesh(np.eye(3), [Block("X", [[0]], shape=Plain)])
    with pytest.raises(InputError, match="X: Plain has no VTK number"):
        write_vtu(tmp_path / "a.vtu", mesh)


def test_a_series_names_its_files_and_times(tmp_path):
    write_pvd(tmp_path / "s.pvd", [(0.0, "s_0.vtu"), (0.1, "a&b.vtu")])
    root = ElementTree.parse(tmp_path / "s.pvd").getroot()
    assert root.attrib["type"] == "Collection"
    found = [(float(d.attrib["timestep"]), d.attrib["file"]) for d in root.iter("DataSet")]
    assert found == [(0.0, "s_0.vtu"), (0.1, "a&b.vtu")]
