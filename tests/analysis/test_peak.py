"""The largest stress where stresses have no limit, and that away from there."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.peak import clamped_nodes, peak
from kratos_lite.mesh.facets import reentrant_nodes
from kratos_lite.verification import scenes

STEEL = kl.Isotropic3D(E=210e9, nu=0.3)
CLAMPED = "at a clamped or concentrated support"


def bent(n):
    model = kl.Model(kl.box((4, 1, 1), (8 * n, 2 * n, 2 * n), element="Element3D20N"), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e6)))
    return model.solve()


def test_away_from_a_clamp_stresses_stay_where_the_largest_one_grows():
    coarse, fine = bent(2), bent(4)
    growth = fine.largest_von_mises()[0] / coarse.largest_von_mises()[0]
    assert growth > 1.2
    for result in (coarse, fine):
        top = peak(result)
        assert top.place == CLAMPED
        bending = 6 * 4e6 * (1 - 2 / result.mesh.n_elements ** (1 / 3) / 4)
        assert 0.75 * bending < top.elsewhere < 1.02 * bending
        row = dict(result.table())["largest von Mises"]
        assert f" {CLAMPED}, where it may grow with each refinement; at most {top.elsewhere:.6e} Pa" in row
    assert "largest at a clamped" in fine.plot().axes[0].get_title() + str(fine.plot().texts)


@pytest.mark.parametrize(
    ("scene", "place"), [("l_domain", "at a re-entrant edge"), ("sphere", None), ("cavity", None)]
)
def test_corners_and_smooth_surfaces(scene, place):
    top = peak(getattr(scenes, scene)("20N", 4).model.solve())
    assert (top and top.place) == place


def test_symmetry_planes_and_rollers_clamp_nothing_but_a_held_node_does():
    model = kl.Model(kl.box((1, 1, 1), (2, 2, 2)), STEEL)
    for axis in "xyz":
        model.fix(f"{axis}-", axis)
    model.add(kl.Traction("z+", (0, 0, 1e6)))
    result = model.solve()
    assert not clamped_nodes(result.mesh, np.where(model.supports.fixed, 1.0, 0.0)).any()
    assert peak(result) is None
    held = np.zeros((27, 3))
    held[4, 0] = 1.0
    assert np.flatnonzero(clamped_nodes(result.mesh, held)).tolist() == [4]


def test_edges_beyond_180_degrees_are_re_entrant():
    mesh = scenes.l_domain("8N", 2).model.mesh
    assert np.abs(mesh.points[reentrant_nodes(mesh), :2]).max() < 1e-12
    assert reentrant_nodes(mesh).sum() == 2
    assert not reentrant_nodes(kl.box((1, 2, 3), (2, 2, 2))).any()
    tube = kl.annulus(1, 2, 1, (2, 12, 1))
    assert not reentrant_nodes(tube).any()


def test_a_solution_to_a_requested_error_warns():
    model = kl.Model(kl.box((2, 1, 1), (4, 2, 2)), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e6)))
    warnings = model.solve(error=0.1).report.warnings
    assert any("the largest von Mises stress lies at a clamped" in text for text in warnings)
