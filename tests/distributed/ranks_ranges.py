"""`.mdpa` files of which each rank reads a range: whatever stands in them, all is as read by one process."""

import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from ranks_run_files import forces

import kratos_lite as kl
from kratos_lite.io.formats import ranks as reading
from kratos_lite.io.formats.mdpa.reader import read_mdpa

EXTRA = [
    "Begin Table 1 TIME PRESSURE\n 0 1\n 1 2\nEnd Table\n",
    "Begin ModelPartData\n AMBIENT_TEMPERATURE 25 // C\nEnd ModelPartData\n",
    "Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X\n 1 0.0 [1.0] 8 7\nEnd Constraints\n",
    "Begin SubModelPart Deep\n Begin SubModelPartData\n A_B 1.0\n End SubModelPartData\n"
    " Begin SubModelPartNodes\n 1\n 2\n End SubModelPartNodes\n Begin SubModelPart Deeper\n"
    "  Begin SubModelPartElements\n  1\n  End SubModelPartElements\n"
    "  Begin SubModelPartProperties\n  1\n  End SubModelPartProperties\n"
    " End SubModelPart\nEnd SubModelPart\n",
    "Begin NodalData VOLUME_ACCELERATION\n 1 0 [3] (0.0, 1.0, 2.0)\n 2 0 (0.0, 1.0, 2.0)\nEnd NodalData\n",
    "Begin NodalData TEMPERATURE\n 1 0 2.0\n 2 0 3.5\nEnd NodalData\n",
    "Begin NodalData DISPLACEMENT_X\n 1 1 0.5\n 5 1 0.5\nEnd NodalData\n",
    "Begin NodalData BOUNDARY\n 1\n 3\nEnd NodalData\n",
    "Begin NodalData VELOCITY\n 1 0 [2] (0.0, 1.0)\nEnd NodalData\n",
    "Begin ElementalData PRESSURE\n 1 2.0\nEnd ElementalData\n",
    "Begin Geometries Hexahedra3D8\n 7 1 2 3 4 5 6 7 8\nEnd Geometries\n",
    "Begin Properties 9\n DENSITY 1.0\n Begin Table TIME PRESSURE\n 0 1\n End Table\nEnd Properties\n",
    "// Begin Nodes\n",
    "Begin Mesh 1\n Begin MeshNodes\n 1\n End MeshNodes\nEnd Mesh\n",
    "Begin Elements KinematicLinear3D8N\nEnd Elements\n",
    "Begin Wibble\n 1 2\nEnd Wibble\n",
]
"""Blocks that may stand between others."""
WORDS = ["0", "99999", "-3", "nan", "1e999", "x", "2.5", "1.0D+01", "(1,2)", "+5", "007"]
LINES = ["/* open", "*/", "Begin Nodes", "End Nodes", "End", "Begin SubModelPart Q", "   ", "7", "// note"]


@contextmanager
def file_of(ranks, text):
    """A file that all ranks know, of which each reads a range, however small it is."""
    folder = Path(ranks.first(tempfile.mkdtemp() if ranks.rank == 0 else None))
    before, reading.LARGE = reading.LARGE, 0
    try:
        if ranks.rank == 0:
            (folder / "a.mdpa").write_text(text, encoding="utf-8", newline="")
        ranks.sum(1)
        yield folder / "a.mdpa"
    finally:
        reading.LARGE = before
        ranks.sum(1)
        if ranks.rank == 0:
            shutil.rmtree(folder)


def box_text(cells, element="KinematicLinear3D8N"):
    """Return a clamped box with a traction and its weight, as .mdpa text."""
    model = kl.Model(kl.box(cells=cells, element=element), kl.Isotropic3D(E=2e11, nu=0.3, density=7800.0))
    model.fix("z-", "xyz", 1e-3)
    model.add(kl.Traction("z+", (1e6, 2e6, -3e6)))
    model.add(kl.Gravity((0, 0, -9.81)))
    model.stress_free_at(np.where(model.supports.fixed, 0.0, 1e-5 * model.mesh.points))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mdpa"
        kl.write(path, model)
        return path.read_text(encoding="utf-8")


def read(path, **options):
    try:
        return kl.read_case(path, **options).model, ""
    except kl.KratosLiteError as error:
        return None, f"{type(error).__name__}: {error}"


def check(ranks, text, strict=True):
    """Compare a file read by ranges with the same read by one process; return its error."""
    with file_of(ranks, text) as path:
        (whole, expected), (model, error) = read(path, strict=strict), read(path, strict=strict, comm=ranks)
    assert ranks.gather(error) == [expected] * ranks.size, (error, expected)
    if whole is not None:
        same(ranks, whole, model)
    return error


def same(ranks, whole, model):
    """Compare nodes, cells, parts, supports, notes, and forces on own nodes."""
    mesh, all_of = model.mesh, whole.mesh
    rows, own = all_of.node_rows(mesh.node_ids), mesh.own_nodes
    own_cells = [own.sum(), mesh.own_elements.sum(), mesh.own_conditions.sum()]
    assert ranks.sum(np.array(own_cells)).tolist() == [all_of.n_nodes, all_of.n_elements, all_of.n_conditions]
    assert np.array_equal(mesh.points, all_of.points[rows])
    assert cells(mesh).items() <= cells(all_of).items()
    assert np.array_equal(model.supports.fixed, whole.supports.fixed[rows])
    assert np.array_equal(model.supports.values, whole.supports.values[rows])
    u, expected = model.initial_displacement, whole.initial_displacement
    assert (u is None) == (expected is None)
    assert u is None or np.array_equal(u, expected[rows])
    assert model.notes == whole.notes, (model.notes, whole.notes)
    assert list(mesh.parts) == list(all_of.parts)
    for name, part in mesh.parts.items():
        other = all_of.parts[name]
        there = set(all_of.node_ids[other.nodes].tolist()) & set(mesh.node_ids.tolist())
        assert set(mesh.node_ids[part.nodes].tolist()) == there
        assert (part.properties, part.tables, part.data) == (other.properties, other.tables, other.data)
    try:
        loads = forces(whole)
    except kl.KratosLiteError:
        return  # elements without a material, which reading does not mind
    difference = forces(model)[own] - loads[rows[own]]
    assert np.abs(difference).max(initial=0.0) <= 1e-12 * np.abs(loads).max(initial=0.0)


def cells(mesh):
    """Return kind, properties and nodes of each element, by its id."""
    return {
        i: (block.name, p, tuple(nodes))
        for block in mesh.blocks
        for i, p, nodes in zip(
            block.ids.tolist(), block.properties.tolist(), mesh.node_ids[block.nodes].tolist(), strict=True
        )
    }


def inserted(text, more, random):
    """Return a text with more between two blocks."""
    at = int(random.choice([i + 1 for i in range(len(text)) if text.startswith("\n\n", i)]))
    return text[:at] + more + text[at:]


def changed(text, random):
    """Return a text in which a line or two are other ones."""
    lines = text.split("\n")
    for _ in range(random.integers(3)):
        at, words = int(random.integers(len(lines))), lines[int(random.integers(len(lines)))].split()
        kind = random.integers(7)
        if kind == 0:
            lines.insert(at, lines[at])
        elif kind == 1:
            lines.insert(at, str(random.choice(LINES)))
        elif kind == 2:
            lines[at] += " " + str(random.choice(LINES))
        elif kind == 3:
            del lines[at]
        elif kind == 4:
            del lines[at + 1 :]
        elif kind == 5:
            lines[at] = lines[at].replace(" ", "\t").lower()
        elif words:
            words[int(random.integers(len(words)))] = str(random.choice(WORDS))
            lines[at] = " ".join(words)
    return str(random.choice(["\n", "\n", "\n", "\r\n", "\r"])).join(lines)


def test_files_of_any_form(ranks, seed):
    """Odd, wrong and ordinary files: what one process reads or refuses, ranks do."""
    random, refused = np.random.default_rng(seed), 0
    elements = ["KinematicLinear3D8N", "KinematicLinear3D4N", "SmallDisplacementElement3D8N"]
    for _ in range(25):
        text = box_text(tuple(random.integers(1, 4, 3)), str(random.choice(elements)))
        for number in random.permutation(len(EXTRA))[: random.integers(5)]:
            text = inserted(text, EXTRA[number], random)
        refused += bool(check(ranks, changed(text, random), strict=bool(random.random() < 0.8)))
    assert 0 < refused < 25


test_files_of_any_form.cases = [1, 2, 3]


def test_each_block(ranks, number):
    """Blocks of few rows, which stand in the range of one rank alone, the first or the last."""
    text = box_text((2, 2, 3))
    assert check(ranks, EXTRA[number] + text) == ""
    assert check(ranks, text + EXTRA[number]) == ""


test_each_block.cases = list(range(len(EXTRA)))


def test_a_rank_without_nodes(ranks):
    """One element for all ranks, and a support of its node that is given twice."""
    text = box_text((1, 1, 1))
    assert check(ranks, text) == ""
    assert check(ranks, text + EXTRA[6]) == ""


def test_what_is_odd_is_read_by_one_rank(ranks):
    """A comment over lines: no ranges, but no other rank than 0 has all of the file."""
    text, seen = "/* a comment\nof two lines */\n" + box_text((2, 2, 3)), []

    def read_one(path, strict):
        seen.append(path)
        return read_mdpa(path, strict=strict)

    with file_of(ranks, text) as path:
        document = reading.read_shared(path, ranks, True, read_one)
    assert ranks.gather(len(seen)) == [1] + [0] * (ranks.size - 1)
    assert document.mesh.subdomain.n_all == 36


def test_repeated_values_count_as_in_the_file(ranks):
    """The last value of a node counts, wherever it stands."""
    rows = "1 1 0.5\n 5 1 0.5\n 1 1 0.25\n 5 0 0.125\n"
    assert check(ranks, box_text((1, 1, 2)) + f"Begin NodalData DISPLACEMENT_X\n {rows}End NodalData\n") == ""


def test_values_of_different_sizes(ranks):
    """The first rows of two ranks differ, but only the file as a whole says what is wrong."""
    ids = range(1, 28)
    rows = "".join(f" {i} 0 [{2 + (i < 20)}] ({', '.join(['1.0'] * (2 + (i < 20)))})\n" for i in ids)
    text = box_text((2, 2, 2)) + f"Begin NodalData VOLUME_ACCELERATION\n{rows}End NodalData\n"
    assert "VOLUME_ACCELERATION" in check(ranks, text)
