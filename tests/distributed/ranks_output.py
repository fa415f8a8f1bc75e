"""Files that ranks write together."""

import json
import xml.etree.ElementTree as ElementTree
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

import meshio
import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.fields import fields
from kratos_lite.analysis.result import Result
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.errors import InputError, SolveError
from kratos_lite.io.kratos.expected_values import NodeComparison

LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)


def random(mesh, size):
    return np.random.default_rng(7).integers(size, size=mesh.n_elements)


def first_rank_only(mesh, size):
    return np.zeros(mesh.n_elements, dtype=int)


def whole_result(element="KinematicLinear3D8N"):
    mesh = kl.box((2, 1, 1), (4, 3, 2), element=element)
    model = kl.Model(mesh, LAW)
    model.fix("x-")
    model.add(kl.Traction("x+", (1e6, 0.0, 2e6)))
    return model.solve()


def shared(ranks, result, parts):
    """The displacements and reactions of a result on what each rank holds of its mesh; ghosts are wrong."""
    mesh = scattered(result.mesh, ranks, parts)
    rows = result.mesh.node_rows(mesh.node_ids)
    model = kl.Model(mesh, LAW)
    groups = model.element_groups()
    reactions = np.where(mesh.own_nodes[:, None], result.reactions[rows], 1e30)
    kinds = model.kinds(groups)
    return Result(mesh, groups, result.u[rows], reactions, result.loads[rows], result.report, kinds=kinds)


@contextmanager
def folder_of(ranks):
    """Give an empty folder, which vanishes at the end."""
    folder = Path(ranks.first(mkdtemp() if ranks.rank == 0 else None))
    try:
        with ranks.together():
            yield folder
    finally:
        if ranks.rank == 0:
            rmtree(folder)


def pieces_of(path):
    """Return the meshes that a .pvtu file names, and the names, types and components of its arrays."""
    (grid,) = ElementTree.parse(path).getroot()
    described = {
        kind.tag: {one.get("Name"): (one.get("type"), one.get("NumberOfComponents", "1")) for one in kind}
        for kind in grid
        if kind.tag != "Piece"
    }
    sources = [piece.get("Source") for piece in grid.iter("Piece")]
    return [meshio.read(path.parent / source) for source in sources], described, sources


def by_node(pieces, name):
    """Return the value of each node by its id, and how far values of the same node differ."""
    found, off = {}, 0.0
    for piece in pieces:
        for node, value in zip(piece.point_data["NODE_ID"], piece.point_data[name], strict=True):
            off = max(off, float(np.abs(np.asarray(value) - found.setdefault(int(node), value)).max()))
    return found, off


def by_element(pieces, name):
    """Return the value of each element by its id."""
    return {
        element: value
        for piece in pieces
        for ids, values in zip(piece.cell_data["ELEMENT_ID"], piece.cell_data[name], strict=True)
        for element, value in zip(ids.tolist(), values, strict=True)
    }


def assert_same(found, expected):
    assert np.abs(np.array(found) - expected).max() <= 1e-10 * np.abs(expected).max()


def test_pieces_are_the_whole(ranks, cut, mode, element):
    """All fields of all nodes and elements."""
    serial = whole_result(element)
    result = shared(ranks, serial, cut(serial.mesh, ranks.size))
    with folder_of(ranks) as folder:
        path = folder / "beam.pvtu"
        kl.write(path, result, mode)
        pieces, described, sources = pieces_of(path)
        assert sorted(one.name for one in folder.iterdir()) == sorted(["beam.pvtu", *sources])
    points, cells = fields(serial)
    assert sum(len(block.data) for piece in pieces for block in piece.cells) == serial.mesh.n_elements
    for name, values in points.items():
        found, off = by_node(pieces, name)
        assert off == 0.0
        assert_same([found[node] for node in serial.mesh.node_ids.tolist()], values)
    owners, off = by_node(pieces, "PARTITION_INDEX") if ranks.size > 1 else ({}, 0.0)
    assert off == 0.0
    assert set(owners.values()) <= set(range(ranks.size))
    for name, values in cells.items():
        found = by_element(pieces, name)
        assert_same([found[one] for one in serial.mesh.element_ids.tolist()], values)
    for piece in pieces:
        for corner, node in zip(piece.points, piece.point_data["NODE_ID"], strict=True):
            assert np.array_equal(corner, serial.mesh.points[node - 1])
    assert described["PPointData"]["DISPLACEMENT"] == ("Float64", "3")
    assert described["PPointData"]["NODE_ID"] == ("Int64", "1")
    assert described["PCellData"]["CAUCHY_STRESS_VECTOR"] == ("Float64", "6")
    assert described["PPoints"] == {"Points": ("Float64", "3")}


test_pieces_are_the_whole.cases = [
    (random, "binary", "KinematicLinear3D8N"),
    (random, "compressed", "KinematicLinear3D8N"),
    (random, "ascii", "KinematicLinear3D8N"),
    (first_rank_only, "binary", "KinematicLinear3D8N"),
    (random, "binary", "KinematicLinear3D20N"),
]


def test_over_ranks_a_vtu_file_is_a_pvtu_file(ranks):
    serial = whole_result()
    with folder_of(ranks) as folder:
        kl.write(folder / "beam.vtu", shared(ranks, serial, random(serial.mesh, ranks.size)))
        names = {one.name for one in folder.iterdir()}
    many = {"beam.pvtu", *(f"beam_{rank}.vtu" for rank in range(ranks.size))}
    assert names == ({"beam.vtu"} if ranks.size == 1 else many)


def test_formats_of_one_process_are_refused(ranks):
    serial = whole_result()
    result = shared(ranks, serial, random(serial.mesh, ranks.size))
    for name in ("a.html", "a.csv", "a.vtk"):
        if ranks.size > 1:
            with pytest.raises(InputError, match=r"none holds the whole result; write \.pvtu"):
                kl.write(name, result)


def test_a_summary_has_what_ranks_know_together(ranks):
    """Reactions are wrong at ghosts here."""
    serial = whole_result()
    for name, axis, place in (("clamped", 0, 0.0), ("edge", 1, 1.0)):
        serial.mesh.add_part(name, lambda X, axis=axis, place=place: X[:, axis] == place)
    result = shared(ranks, serial, random(serial.mesh, ranks.size))
    with folder_of(ranks) as folder:
        kl.write(folder / "beam.json", result)
        ranks.agree()
        found = json.loads((folder / "beam.json").read_text())
    if ranks.size == 1:
        assert len(found["displacement"]) == serial.mesh.n_nodes
        return
    assert "displacement" not in found
    assert "pieces of a .pvtu" in found["left_out"]
    assert found["smallest_displacements"] == serial.u.min(axis=0).tolist()
    assert found["largest_displacements"] == serial.u.max(axis=0).tolist()
    for name in ("clamped", "edge"):
        expected = serial.reaction(name).sum(axis=0)
        assert np.abs(np.array(found["reaction_of_parts"][name]) - expected).max() < 1e-3


def test_an_error_on_one_rank_leaves_what_was_there(ranks):
    """A number that is not finite, on the last rank only."""
    serial = whole_result()
    good = shared(ranks, serial, np.arange(serial.mesh.n_elements) % ranks.size)
    u = good.u.copy()
    u[good.mesh.own_nodes & (ranks.rank == ranks.size - 1)] = np.nan
    bad = Result(good.mesh, good.groups, u, good.reactions, good.loads, good.report, kinds=good.kinds)
    with folder_of(ranks) as folder:
        path = folder / "beam.pvtu"
        kl.write(path, good)
        ranks.agree()
        before = {one: one.read_bytes() for one in folder.iterdir()}
        with np.errstate(invalid="ignore"), pytest.raises(SolveError, match="not finite"):
            kl.write(path, bad)
        ranks.agree()
        assert {one: one.read_bytes() for one in folder.iterdir()} == before


def test_where_one_rank_cannot_write_none_does(ranks):
    """A folder stands where the piece of the last rank has to go."""
    serial = whole_result()
    result = shared(ranks, serial, np.arange(serial.mesh.n_elements) % ranks.size)
    last = f"beam_{ranks.size - 1}.vtu"
    with folder_of(ranks) as folder:
        if ranks.rank == 0:
            (folder / last).mkdir()
        ranks.agree()
        with pytest.raises(InputError, match=f"{last}: cannot be written: it is a folder"):
            kl.write(folder / "beam.pvtu", result)
        ranks.agree()
        assert [one.name for one in folder.iterdir()] == [last]
        with pytest.raises(InputError, match="there is no folder"):
            kl.write(folder / "missing" / "beam.pvtu", result)


# ---- expected values ------------------------------------------------------------------------------


def compared(result, where, component, expected, allowed):
    """Return the line that compares a component on nodes with a function of their places."""

    def wanted(result, rows):
        return expected(result.mesh.points[rows]), np.full(len(rows), allowed)

    return NodeComparison("what", component, result.mesh.nodes(where), wanted)(result)


def test_expected_values_are_those_of_one_process(ranks, cut):
    serial = whole_result()
    result = shared(ranks, serial, cut(serial.mesh, ranks.size))

    def right(X):
        return serial.u[[nearest(serial.mesh, x) for x in X], 0]

    def off(X):
        return right(X) + 1e-6 * (1 + X[:, 1] + 10 * X[:, 2])

    for wanted, allowed in ((right, 1e-12), (off, 1e-9), (off, 1.0)):
        lines = [compared(one, "x+", "DISPLACEMENT_X", wanted, allowed) for one in (serial, result)]
        assert lines[0] == lines[1]
        assert lines[0].startswith(f"check what {'failed' if allowed == 1e-9 else 'passed'} (node ")
        assert ranks.gather(lines[1]) == [lines[1]] * ranks.size


test_expected_values_are_those_of_one_process.cases = [random, first_rank_only]


def nearest(mesh, point):
    return int(np.linalg.norm(mesh.points - point, axis=1).argmin())


def test_reactions_are_compared_by_who_owns_the_node(ranks):
    """At ghosts they are wrong here."""
    serial = whole_result()
    result = shared(ranks, serial, random(serial.mesh, ranks.size))

    def wanted(X):
        return 1e5 * (X[:, 1] + 3 * X[:, 2])

    lines = [compared(one, "x-", "REACTION_Z", wanted, 1e7) for one in (serial, result)]
    assert lines[0] == lines[1]
    assert "passed" in lines[0]


def test_what_one_rank_cannot_evaluate_is_not_evaluated(ranks):
    serial = whole_result()
    result = shared(ranks, serial, random(serial.mesh, ranks.size))

    def wanted(found, rows):
        if (found.mesh.node_ids[rows] == 1).any():
            raise ValueError("there is no node 1")
        return np.zeros(len(rows)), np.ones(len(rows))

    line = NodeComparison("what", "DISPLACEMENT_X", result.mesh.nodes("x-"), wanted)(result)
    assert line == "check what not evaluated: there is no node 1"
    none = np.zeros(0, dtype=np.int64)
    line = NodeComparison("what", "DISPLACEMENT_X", none, wanted)(result)
    assert line == "check what not evaluated: its part has no nodes"
