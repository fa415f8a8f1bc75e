"""Meshes of which no rank has the whole: generated in parts, and what is wrong between parts."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.box import box
from kratos_lite.distributed.communicator import started
from kratos_lite.distributed.partition import Partition
from kratos_lite.errors import InputError, KratosLiteError, MeshError, ModelError

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)


def loaded(mesh):
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    model.fix("x+", "y", 1e-4)
    model.add(kl.Traction("z+", (1e6, 0.0, -2e6)))
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    model.add(kl.PointLoad("y+", (0.0, 10.0, 0.0), each=True))
    return model


def places(mesh):
    return [tuple(x) for x in np.rint(mesh.points * 1e6).astype(int).tolist()]


def compare(ranks, element, cells, solver):
    """Compare own values of a box in parts with those of the whole one."""
    mesh, partition = box((2, 1, 1), cells, element, ranks=ranks)
    whole = loaded(kl.box((2, 1, 1), cells, element))
    found, expected = kl.solve_part(loaded(mesh), partition, solver, 1e-12), whole.solve(tolerance=1e-12)
    row = {place: i for i, place in enumerate(places(whole.mesh))}
    rows = [row[place] for place in places(mesh)]
    for name in ("u", "reactions", "loads"):
        off = np.abs(getattr(found, name) - getattr(expected, name)[rows]).max(initial=0.0)
        assert off <= 1e-8 * np.abs(getattr(expected, name)).max(), name
    assert ranks.sum(int(partition.own.sum())) == whole.mesh.n_nodes
    assert ranks.sum(mesh.n_elements) == whole.mesh.n_elements
    assert abs(ranks.sum(found.energy()) - expected.energy()) <= 1e-8 * expected.energy()
    stress, mises = found.stress("element"), expected.largest_von_mises()[0]
    assert len(stress) == mesh.n_elements
    rows = dict(found.table())
    assert rows["largest von Mises"].startswith(f"{mises:.6e}")
    for name in ("nodes", "elements", "unknowns", "total load", "strain energy"):
        assert rows[name] == dict(expected.table())[name]
    return found.report.solver


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("element", ["8N", "20N", "10N", "15N", "13N", "KinematicLinear3D27N"])
def test_a_box_in_parts(element, solver):
    cells = (6, 4, 4) if element == "8N" else (4, 2, 2)
    assert "(PETSc)" in started().run(compare, element, cells, solver)


def written(ranks, path):
    mesh, partition = box(cells=(4, 3, 3), ranks=ranks)
    kl.write(path, kl.solve_part(loaded(mesh), partition))


def test_pieces(tmp_path):
    import meshio

    size = started().size
    started().run(written, tmp_path / "out.pvtu")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["out.pvtu", *(f"out_{rank}.vtu" for rank in range(size))]
    )
    pieces = [meshio.read(tmp_path / f"out_{rank}.vtu") for rank in range(size)]
    assert sum(len(piece.cells[0].data) for piece in pieces) == 36
    expected = loaded(kl.box(cells=(4, 3, 3))).solve()
    at = {place: u for place, u in zip(places(expected.mesh), expected.u, strict=True)}
    for piece in pieces:
        for place, u in zip(places(piece), piece.point_data["DISPLACEMENT"], strict=True):
            assert np.abs(u - at[place]).max() <= 1e-8 * np.abs(expected.u).max()


def with_error(ranks, what):
    mesh, partition = box(cells=(4, 3, 3), ranks=ranks)
    model = kl.Model(mesh, STEEL)
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    last = ranks.rank == ranks.size - 1
    if what == "free":
        model.fix("x-", "x")
    elif what == "no material" and last:
        model._material_of[:] = -1
    elif what == "twice":
        mesh = kl.Mesh(mesh.points, mesh.blocks, node_ids=mesh.node_ids, whole=False)
        extra = kl.Mesh(mesh.points, {mesh.blocks[0].name: mesh.blocks[0].nodes}, node_ids=mesh.node_ids)
        Partition(ranks, extra)
    elif what == "apart" and last:
        points = mesh.points.copy()
        points[:, 1] += 1e-3
        mesh = mesh.replace(points=points)
    elif what == "tied":
        model.constrain((0, "x"), {(1, "x"): 1.0})
    if what == "apart":
        Partition(ranks, mesh)
    kl.solve_part(model, partition)


@pytest.mark.parametrize(
    ("what", "error", "text"),
    [
        ("free", ModelError, "leave 3 rigid-body modes free"),
        ("no material", ModelError, "has no material"),
        ("tied", ModelError, "constraints, hanging nodes and motions need the whole mesh"),
        ("twice", MeshError, r"element \d+ is in two parts"),
        ("apart", MeshError, r"in part \d and at"),
    ],
)
def test_what_is_wrong_is_one_error(what, error, text):
    if started().size == 1 and what in ("twice", "apart"):
        return
    with pytest.raises(error, match=text):
        started().run(with_error, what)


def test_more_ranks_than_bricks():
    if started().size > 1:
        with pytest.raises(KratosLiteError):
            started().run(single)


def single(ranks):
    with ranks.agree_on_errors():
        if not box(cells=(1, 1, 1), ranks=ranks)[0].n_elements:
            raise InputError("nothing to do")
