"""Values of results for spreadsheets, pandas and PyVista."""

import builtins
import csv

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite import voigt


@pytest.fixture
def result():
    mesh = kl.box((2, 1, 1), (4, 2, 2), element="KinematicLinear3D20N")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 5.0)))
    return model.solve()


def rows(path):
    with open(path, newline="", encoding="utf-8") as file:
        head, *lines = csv.reader(file)
    return dict(zip(head, np.array(lines, dtype=float).T, strict=True))


def test_csv_of_a_result_holds_its_nodes_unrounded(result, tmp_path):
    kl.write(tmp_path / "nodes.csv", result)
    found = rows(tmp_path / "nodes.csv")
    assert list(found)[:4] == ["node", "x [m]", "y [m]", "z [m]"]
    assert (found["node"] == result.mesh.node_ids).all()
    for name, field, unit in (("displacement", result.u, "m"), ("reaction", result.reactions, "N")):
        for i, axis in enumerate("xyz"):
            assert (found[f"{name} {axis} [{unit}]"] == field[:, i]).all()
    stress = result.stress("node")
    assert (found["stress zx [Pa]"] == stress[:, 5]).all()
    assert (found["von Mises stress [Pa]"] == result.von_mises("node")).all()
    assert (found["principal stress 3 [Pa]"] == result.principal_stresses("node")[:, 2]).all()
    assert all(name.isascii() for name in found)


def test_csv_of_points_and_lines(result, tmp_path):
    line = result.along((0, 0.5, 0.5), (2, 0.5, 0.5), n=5)
    kl.write(tmp_path / "line.csv", line)
    found = rows(tmp_path / "line.csv")
    assert (found["distance [m]"] == [0, 0.5, 1, 1.5, 2]).all()
    assert (found["Tresca stress [Pa]"] == line.tresca).all()
    kl.write(tmp_path / "point.csv", result.at((0.3, 0.4, 0.5)))
    assert rows(tmp_path / "point.csv")["y [m]"].tolist() == [0.4]


def test_values_of_points_are_written_as_csv_alone_and_whole_or_not_at_all(result, tmp_path):
    values = result.at((0.3, 0.4, 0.5))
    with pytest.raises(kl.InputError, match=r"the ending must be \.csv"):
        kl.write(tmp_path / "point.vtu", values)
    with pytest.raises(kl.InputError, match=r"only \.vtu files"):
        kl.write(tmp_path / "nodes.csv", result, mode="ascii")
    values.displacement[...] = np.nan
    with pytest.raises(kl.SolveError):
        kl.write(tmp_path / "point.csv", values)
    assert not list(tmp_path.iterdir())


def test_data_frames_hold_the_columns_of_the_file(result, tmp_path):
    pandas = pytest.importorskip("pandas")
    kl.write(tmp_path / "nodes.csv", result)
    frame = result.to_dataframe()
    assert len(frame) == result.mesh.n_nodes
    pandas.testing.assert_frame_equal(frame, pandas.read_csv(tmp_path / "nodes.csv"), check_exact=True)
    line = result.along((0, 0.5, 0.5), (2, 0.5, 0.5), n=5)
    assert line.to_dataframe()["distance [m]"].tolist() == line.distance.tolist()


@pytest.mark.parametrize(
    ("package", "call", "cure"),
    [("pandas", "to_dataframe", "pip install pandas"), ("pyvista", "to_pyvista", "pip install pyvista")],
)
def test_missing_packages_are_named_with_the_cure(result, monkeypatch, package, call, cure):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.split(".")[0] == package:
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(kl.KratosLiteError, match=cure):
        getattr(result, call)()


# ---- PyVista ---------------------------------------------------------------------------------------


KINDS = [f"KinematicLinear3D{n}N" for n in (4, 5, 6, 8, 10, 13, 15, 20, 27)]


@pytest.mark.parametrize("kind", KINDS)
def test_grids_of_every_element_have_the_volume_of_the_mesh(kind):
    pytest.importorskip("pyvista")
    mesh = kl.box((2, 1, 1), (2, 1, 1), element=kind)
    grid = mesh.to_pyvista()
    assert (grid.n_points, grid.n_cells) == (mesh.n_nodes, mesh.n_elements)
    assert abs(grid.compute_cell_sizes()["Volume"].sum() - 2) < 1e-6
    assert (grid.cell_data["ELEMENT_ID"] == mesh.element_ids).all()
    shape = mesh.blocks[0].shape
    assert (grid.celltypes == shape.vtk).all()
    nodes = grid.get_cell(1).point_ids
    assert nodes == mesh.blocks[0].nodes[1][list(shape.to_vtk)].tolist()


def test_grids_of_mixed_meshes_carry_all_fields(result):
    pytest.importorskip("pyvista")
    grid = result.to_pyvista()
    assert (grid.point_data["DISPLACEMENT"] == result.u).all()
    assert (grid.point_data["CAUCHY_STRESS_VECTOR"] == result.stress("node")).all()
    assert (grid.cell_data["VON_MISES_STRESS"] == voigt.von_mises(result.stress("element"))).all()
    points = np.vstack([kl.box().points, [[5, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1], [0, 0, 9]]])
    hexahedron = kl.box().blocks[0].nodes
    mixed = kl.Mesh(
        points,
        {"KinematicLinear3D8N": hexahedron, "KinematicLinear3D4N": [[0, 4, 2, 12]]},
    )
    grid = mixed.to_pyvista()
    assert grid.celltypes.tolist() == [12, 10]
    assert grid.get_cell(1).point_ids == [0, 4, 2, 12]
