"""Parts of equal work, with METIS and without."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.distributed import cut

STEEL = kl.Isotropic3D(E=210e9, nu=0.3)


def groups_of(mesh):
    return kl.Model(mesh, STEEL).element_groups()


@pytest.mark.parametrize("installed", [True, False])
def test_parts_are_balanced_and_compact(installed, monkeypatch):
    if installed:
        pytest.importorskip("pymetis")
    else:
        monkeypatch.setattr(cut, "find_spec", lambda name: None)
    mesh, size = kl.box(cells=(12, 12, 12)), 8
    parts = cut.parts_of(mesh.points, groups_of(mesh), size)
    sizes = np.bincount(parts, minlength=size)
    assert sizes.max() <= 1.03 * sizes.mean()
    low, high = np.full(mesh.n_nodes, size), np.full(mesh.n_nodes, -1)
    np.minimum.at(low, mesh.blocks[0].nodes, parts[:, None])
    np.maximum.at(high, mesh.blocks[0].nodes, parts[:, None])
    assert (low < high).sum() <= 1.2 * (3 * 13**2 - 3 * 13 + 1)  # that of eight cubes


@pytest.mark.parametrize("size", [2, 3, 4, 7, 16])
def test_halves_have_equal_work(size, monkeypatch):
    monkeypatch.setattr(cut, "find_spec", lambda name: None)
    mesh = kl.box((3, 1, 1), cells=(9, 7, 5))
    parts = cut.parts_of(mesh.points, groups_of(mesh), size)
    done = np.bincount(parts, minlength=size)
    assert abs(done - mesh.n_elements / size).max() <= np.ceil(np.log2(size))


def test_more_parts_than_elements():
    mesh = kl.box(cells=(3, 1, 1))
    assert len(set(cut.parts_of(mesh.points, groups_of(mesh), 8).tolist())) == 3


@pytest.mark.parametrize("element", ["8N", "20N"])
def test_each_part_has_all_elements_at_its_own_nodes(element):
    model = kl.Model(kl.box(cells=(4, 3, 3), element=element), STEEL)
    model.fix("x-")
    model.constrain((40, "y"), {(7, "x"): 0.5, (45, "z"): 2.0})
    model.constrain((50, "x"), {(3, "y"): 2.0})  # of a prescribed one alone: no equation
    groups, nodes = model.element_groups(), np.arange(model.mesh.n_nodes)
    whole = cut.Cut(model.mesh.points, groups, model.supports.constraint_map(nodes), 3)
    assert whole.held[50].tolist() == [True, False, False]
    assert not whole.held[40].any()
    assert np.array_equal(np.sort(np.concatenate(whole.own)), np.flatnonzero(~whole.held.all(axis=1)))
    K = model.matrices().K.toarray().reshape(len(nodes), 3, -1, 3)
    dependents = []
    for rank in range(3):
        part = whole.part(rank)
        pattern = Pattern(len(part.points), [group.nodes for group in part.groups])
        here = assemble_stiffness(part.points, part.groups, pattern).scipy().toarray()
        here = here.reshape(len(part.points), 3, -1, 3)[part.own]
        columns = np.array([int(np.argmin(((model.mesh.points - x) ** 2).sum(axis=1))) for x in part.points])
        expected = K[whole.own[rank]][:, :, columns]
        assert np.abs(here - expected).max() <= 1e-12 * np.abs(K).max()
        assert np.array_equal(part.number, whole.number[columns])
        dependents += zip(*(entries.tolist() for entries in part.dependents), strict=True)
    at = 3 * whole.number
    assert dependents == [(at[40] + 1, at[45] + 2, 2.0)]  # the other independent is fixed
