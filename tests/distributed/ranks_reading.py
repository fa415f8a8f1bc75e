"""Inputs read by several ranks, each of which gets its share."""

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kratos_part_files import write_part_files

import kratos_lite as kl
from kratos_lite.errors import InputError, MeshError
from kratos_lite.mesh import ids_of

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"


def inputs():
    """Return model files and run files of real scenes; none where they are absent."""
    found = sorted(CASES.glob("*/*.mdpa")) + sorted(CASES.glob("*/ProjectParameters.json"))
    found += sorted(CASES.glob("*/*.elem"))
    return [path for path in found if not path.parent.name.startswith("parse_")]


def read(path, **options):
    """Return the case of an input, or the text of its error."""
    try:
        return kl.read_case(path, **options), ""
    except kl.KratosLiteError as error:
        return None, str(error)


def test_the_shares_make_the_whole(ranks, path):
    whole, expected = read(path)
    case, error = read(path, comm=ranks)
    assert error == expected
    if whole is None or case is None:
        return
    check_shares(ranks, whole, case)


def check_shares(ranks, whole, case):
    mesh, all_of = case.model.mesh, whole.model.mesh
    assert ranks.sum(int(mesh.own_nodes.sum())) == all_of.n_nodes
    assert ranks.sum(int(mesh.own_elements.sum())) == all_of.n_elements
    rows = all_of.node_rows(mesh.node_ids)
    assert np.array_equal(mesh.points, all_of.points[rows])
    assert np.array_equal(case.model.supports.fixed, whole.model.supports.fixed[rows])
    assert np.array_equal(case.model.supports.values, whole.model.supports.values[rows])
    assert list(mesh.parts) == list(all_of.parts)
    assert case.model.notes == whole.model.notes
    assert list(map(type, case.model.loads)) == list(map(type, whole.model.loads))
    for name, part in all_of.parts.items():
        for what, ids, every in (
            ("nodes", mesh.node_ids, all_of.node_ids),
            ("elements", mesh.element_ids, all_of.element_ids),
            ("conditions", ids_of(mesh.conditions), ids_of(all_of.conditions)),
        ):
            inside = np.isin(ids, every[getattr(part, what)])
            assert np.array_equal(np.sort(getattr(mesh.parts[name], what)), np.flatnonzero(inside)), what
    u0, whole_u0 = case.model.initial_displacement, whole.model.initial_displacement
    if whole_u0 is not None and whole_u0[rows].any():
        assert np.array_equal(u0, whole_u0[rows])


test_the_shares_make_the_whole.cases = inputs()


def malformed():
    return sorted(
        path for path in (CASES.parent / "bad").glob("*") if path.suffix in (".mdpa", ".json", ".elem")
    )


def test_malformed_files_give_the_error_of_one_process(ranks, path):
    expected, found = read(path)[1], read(path, comm=ranks)[1]
    assert found == expected
    assert len(set(ranks.gather(found))) == 1


test_malformed_files_give_the_error_of_one_process.cases = malformed()


def test_values_loads_and_constraints_come_along(ranks, element):
    folder = folder_of(ranks)
    try:
        path, _ = parts_of_beam(ranks, folder, element=element)
        if ranks.rank == 0:
            text = path.read_text(encoding="utf-8")
            tie = "Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_Y DISPLACEMENT_Y\n"
            path.write_bytes(
                (text + tie + "1 0.0 [1.0] 40 44\nEnd Constraints\n").replace("\n", "\r\n").encode()
            )
        ranks.sum(1)
        whole = kl.read_case(path)
        case = kl.read_case(path, comm=ranks)
        check_shares(ranks, whole, case)
        found = {one.slave for of_rank in ranks.gather(_by_ids(case.model)) for one in of_rank}
        assert found == {one.slave for one in _by_ids(whole.model)}
    finally:
        ranks.sum(1)
        if ranks.rank == 0:
            shutil.rmtree(folder)


test_values_loads_and_constraints_come_along.cases = [f"KinematicLinear3D{n}N" for n in (8, 27, 4)]


def _by_ids(model):
    """Return the constraints of a model with ids of nodes in place of rows."""
    ids = model.mesh.node_ids
    return [
        replace(one, slave=3 * int(ids[one.slave // 3]) + one.slave % 3) for one in model.supports.constraints
    ]


def folder_of(ranks):
    """Return a new folder that all ranks know, and that rank 0 removes in the end."""
    return Path(ranks.first(tempfile.mkdtemp() if ranks.rank == 0 else None))


def parts_of_beam(ranks, folder, size=None, element="EnhancedStrain3D8N", seed=5):
    """Write a beam with a support and a traction, and its part files; return both paths."""
    size = ranks.size if size is None else size
    path = folder / "whole" / "beam.mdpa"
    if ranks.rank == 0:
        path.parent.mkdir(exist_ok=True)
        model = kl.Model(kl.box((3, 1, 1), cells=(6, 2, 2), element=element), kl.Isotropic3D(E=210e9, nu=0.3))
        model.fix("x-", "xyz", 1e-4)
        model.stress_free_at(np.where(model.supports.fixed, 0.0, 1e-5 * model.mesh.points))
        model.add(kl.Traction("x+", (1e6, 2e6, -3e6)))
        kl.write(path, model)
        count = model.mesh.n_elements
        chosen = np.random.default_rng(seed).integers(size, size=count)
        write_part_files(path, folder, size, chosen)
    ranks.sum(1)
    return path, folder / "beam.mdpa"


def test_part_files(ranks, element):
    folder = folder_of(ranks)
    try:
        path, parts = parts_of_beam(ranks, folder, element=element)
        whole = kl.read_case(path)
        for name in (parts, folder / "beam_partitioned"):
            case = kl.read_case(name, comm=ranks)
            check_shares(ranks, whole, case)
            mesh, rows = case.model.mesh, whole.model.mesh.node_rows(case.model.mesh.node_ids)
            assert np.array_equal(case.model.initial_displacement, whole.model.initial_displacement[rows])
            assert mesh.subdomain is not None
        if ranks.size == 1:
            with pytest.raises(InputError, match="there are 1 part files; solve them by"):
                kl.read_case(parts)
    finally:
        ranks.sum(1)
        if ranks.rank == 0:
            shutil.rmtree(folder)


test_part_files.cases = ["KinematicLinear3D8N", "KinematicLinear3D4N", "KinematicLinear3D20N"]


def cut(file):
    text = file.read_text(encoding="utf-8")
    file.write_text(text[: len(text) // 3], encoding="utf-8")


def move(file):
    """Move each node of a part file a little."""
    lines = file.read_text(encoding="utf-8").split("\n")
    first, last = lines.index("Begin Nodes"), lines.index("End Nodes")
    for i in range(first + 1, last):
        words = lines[i].split()
        lines[i] = " ".join([words[0], str(float(words[1]) + 1e-3), *words[2:]])
    file.write_text("\n".join(lines), encoding="utf-8")


def stranger(file):
    text = file.read_text(encoding="utf-8")
    at = text.index("Begin NodalData PARTITION_INDEX")
    head, *rest = text[at:].split("\n")
    words = rest[0].split()
    file.write_text("\n".join([text[:at] + head, f"{words[0]} 0 7", *rest[1:]]), encoding="utf-8")


def test_broken_part_files(ranks, damage, text):
    """One error on all ranks, which names the file or the node."""
    folder = folder_of(ranks)
    try:
        _, parts = parts_of_beam(ranks, folder)
        if ranks.rank == 0:
            damage(folder / "beam_partitioned" / f"beam_{ranks.size - 1}.mdpa")
        ranks.sum(1)
        if damage is move and ranks.size == 1:
            return  # nobody to disagree with
        if damage is Path.unlink and ranks.size == 1:
            text = "no such file"
        with pytest.raises((InputError, MeshError), match=text) as found:
            kl.read_case(parts, comm=ranks)
        assert len(set(ranks.gather(str(found.value)))) == 1
    finally:
        ranks.sum(1)
        if ranks.rank == 0:
            shutil.rmtree(folder)


test_broken_part_files.cases = [
    (cut, r"beam_\d.mdpa:\d+"),
    (Path.unlink, r"part files"),
    (move, r"node \d+"),
    (stranger, r"PARTITION_INDEX of node \d+ is 7"),
]


def test_other_numbers_of_part_files_than_ranks(ranks):
    folder = folder_of(ranks)
    try:
        _, parts = parts_of_beam(ranks, folder, size=ranks.size + 1)
        with pytest.raises(InputError, match=f"there are {ranks.size + 1} part files"):
            kl.read_case(parts, comm=ranks)
    finally:
        ranks.sum(1)
        if ranks.rank == 0:
            shutil.rmtree(folder)


def test_materials_and_loads_that_a_rank_has_nothing_of(ranks):
    """Each half of a bar has its own material; the load is at one end."""
    folder = folder_of(ranks)
    mesh = kl.box((8, 1, 1), (8, 1, 1))
    (block,) = mesh.blocks
    mesh = mesh.replace(blocks=[replace(block, properties=np.where(np.arange(8) < 4, 3, 5))])
    mesh.add_part("end", lambda X: X[:, 0] > 7.9)
    model = kl.Model(mesh, {3: kl.Isotropic3D(E=1e9, nu=0.3), 5: kl.Isotropic3D(E=3e9, nu=0.2)})
    model.fix("x-")
    model.add(kl.Traction("end", (1e6, 0, 0)))
    if ranks.rank == 0:
        kl.write(folder / "bar.mdpa", model)
    ranks.agree()
    whole = kl.read(folder / "bar.mdpa")
    found = kl.read_case(folder / "bar.mdpa", comm=ranks).model
    assert [law.E for law in found._materials] == [law.E for law in whole._materials]
    assert list(map(type, found.loads)) == list(map(type, whole.loads))
    assert found.notes == whole.notes
    of_element = dict(zip(whole.mesh.element_ids.tolist(), whole._material_of.tolist(), strict=True))
    expected = [of_element[one] for one in found.mesh.element_ids.tolist()]
    assert found._material_of.tolist() == expected
