"""A force on a point: on the node there, or by N on the element around it."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.mesh.refinement import refine

STEEL = kl.Isotropic3D(E=210e9, nu=0.3)
FORCE = np.array([10.0, -20.0, 30.0])


def nodal(mesh, where):
    return kl.PointLoad(where, FORCE).forces(mesh, [])


def test_a_force_on_the_place_of_a_node_acts_on_it_once():
    mesh = kl.box((1, 1, 1), (2, 2, 2))
    f = nodal(mesh, (1.0, 1.0, 1.0))
    assert f[mesh.nodes((1.0, 1.0, 1.0))].tolist() == [FORCE.tolist()]
    assert np.count_nonzero(f) == 3


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D20N", "KinematicLinear3D10N"])
def test_a_force_between_nodes_has_its_resultant_and_moment_and_the_work_of_the_field(element):
    mesh, x = kl.box((1, 2, 1), (2, 2, 2), element), np.array([0.3, 1.1, 0.85])
    f = nodal(mesh, tuple(x))
    np.testing.assert_allclose(f.sum(axis=0), FORCE, rtol=1e-13)
    np.testing.assert_allclose(np.cross(mesh.points, f).sum(axis=0), np.cross(x, FORCE), atol=1e-12)
    assert len(np.flatnonzero(f.any(axis=1))) <= mesh.blocks[0].nodes.shape[1]
    if element.endswith("10N"):  # a quadratic field is held exactly
        u = np.stack(
            [mesh.points[:, 0] ** 2, mesh.points[:, 1] * mesh.points[:, 2], mesh.points[:, 2]], axis=1
        )
        assert (f * u).sum() == pytest.approx(FORCE @ [x[0] ** 2, x[1] * x[2], x[2]], rel=1e-12)


def test_a_node_that_no_element_uses_does_not_take_the_force():
    box = kl.box()
    mesh = kl.Mesh(np.vstack([[[1.0, 1.0, 1.0]], box.points]), {"Element3D8N": box.blocks[0].nodes + 1})
    assert not nodal(mesh, (1.0, 1.0, 1.0))[0].any()
    lone = kl.Mesh(np.vstack([[[0.5, 0.5, 0.5]], box.points]), {"Element3D8N": box.blocks[0].nodes + 1})
    np.testing.assert_allclose(nodal(lone, (0.5, 0.5, 0.5))[1:], np.tile(FORCE / 8, (8, 1)), rtol=1e-13)


def test_a_point_outside_the_mesh_is_an_error_that_names_the_nearest_node():
    model = kl.Model(kl.box(), STEEL)
    load = kl.PointLoad((1.0, 1.0, 1.2), FORCE)
    match = r"\[1\.0, 1\.0, 1\.2\] m acts outside .*\[1\.0, 1\.0, 1\.0\] m .*0\.2 m"
    with pytest.raises(kl.MeshError, match=match):
        model.add(load)


def test_a_force_on_a_point_stays_on_a_finer_mesh():
    finer = refine(kl.box((1, 1, 1), (2, 1, 1)))
    load = kl.PointLoad((0.25, 0.5, 0.5), FORCE)
    f = load.refined(finer).forces(finer.mesh, [])
    assert f[finer.mesh.nodes((0.25, 0.5, 0.5))].tolist() == [FORCE.tolist()]


def test_a_force_within_a_thin_plate_acts_where_it_is():
    plate = kl.box((1e3, 1e3, 1e-3), (2, 2, 1))
    point = np.array([400.0, 500.0, 2e-4])
    f = nodal(plate, tuple(point))
    at_corner = nodal(plate, (500.0, 500.0, 2e-4))
    assert abs(f.sum(axis=0) - FORCE).max() < 1e-12 * abs(FORCE).max()
    assert abs(plate.points[:, 2] @ f - point[2] * FORCE).max() < 1e-9 * 1e-3 * abs(FORCE).max()
    assert abs(plate.points[:, 2] @ at_corner - point[2] * FORCE).max() < 1e-9 * 1e-3 * abs(FORCE).max()
