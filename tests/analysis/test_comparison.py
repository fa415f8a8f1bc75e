"""Two results compared: closed forms of the differences, on one mesh and on two."""

import numpy as np
import pytest

import kratos_lite as kl

E = 1e6


def stretched(mesh, field, nu=0.0):
    """Return the result of a mesh with prescribed displacements."""
    model = kl.Model(mesh, kl.Isotropic3D(E=E, nu=nu))
    model.fix(np.arange(mesh.n_nodes), "xyz", field(mesh.points))
    return model.solve()


def pull(strain):
    return lambda X: X * [strain, 0.0, 0.0]


def bend(X):
    return 1e-3 * np.array([X[:, 0] * X[:, 1], -(X[:, 0] ** 2) / 2, 0 * X[:, 0]]).T


def test_same_mesh_gives_the_differences_of_the_nodes():
    mesh = kl.box((2, 1, 1), (4, 2, 2))
    first, second = stretched(mesh, pull(1e-3)), stretched(mesh, pull(1.5e-3))
    found = kl.compare(first, second)
    assert found.same_mesh
    assert found.outside == 0
    assert abs(found.displacement.maximum - 1e-3) < 1e-15  # at x = 2 m
    assert found.displacement.point[0] == 2
    assert abs(found.displacement.relative_maximum - 0.5) < 1e-12
    assert abs(found.stress.maximum - 500) < 1e-8
    assert abs(found.stress.l2 - 500) < 1e-8  # constant, so whatever the weights
    assert abs(found.stress.relative_l2 - 0.5) < 1e-12
    assert np.allclose(found.energies, (E * 1e-6 / 2 * 2, E * 2.25e-6 / 2 * 2))
    assert (found.displacement.values == second.u - first.u).all()


def test_size_of_a_shear_stress_counts_it_twice():
    mesh = kl.box()
    first, second = stretched(mesh, pull(0.0)), stretched(mesh, lambda X: X[:, [1, 0, 2]] * [1e-3, 0, 0])
    found = kl.compare(first, second)
    assert abs(found.stress.maximum / (np.sqrt(2) * E / 2 * 1e-3) - 1) < 1e-12
    assert np.isnan(found.stress.relative_maximum)
    assert "nan" not in str(found)


def test_mean_squares_of_a_linear_field_converge_to_the_integral_on_unequal_cells():
    """√(1/V ∫ x² dV) of a field on [0, 2] is √(4/3)."""
    mesh = kl.box((2, 1, 1), (60, 1, 1), element="KinematicLinear3D20N")
    mesh = mesh.replace(
        points=mesh.points * np.column_stack([mesh.points[:, 0] / 2, *np.ones((2, mesh.n_nodes))])
    )
    found = kl.compare(stretched(mesh, pull(0.0)), stretched(mesh, pull(1.0)))
    assert abs(found.displacement.l2 / np.sqrt(4 / 3) - 1) < 1e-3


@pytest.mark.parametrize(("kinds", "cells"), [(("27N", "10N"), (3, 2, 2)), (("20N", "20N"), (4, 3, 1))])
def test_different_meshes_with_the_same_field_do_not_differ(kinds, cells):
    a, b = (
        stretched(kl.box((2, 1, 1), n, element=f"KinematicLinear3D{kind}"), bend)
        for kind, n in zip(kinds, ((2, 2, 2), cells), strict=True)
    )
    found = kl.compare(a, b)
    assert not found.same_mesh
    assert found.outside == 0
    assert found.displacement.relative_maximum < 1e-9
    assert found.stress.relative_maximum < 1e-8
    assert abs(found.energies[0] / found.energies[1] - 1) < 1e-9


def test_nodes_outside_the_second_mesh_are_left_out_and_counted():
    first, second = (stretched(kl.box((length, 1, 1), (length, 1, 1)), pull(1e-3)) for length in (3, 2))
    found = kl.compare(first, second)
    assert (found.outside, len(found.nodes)) == (4, 12)
    assert found.displacement.maximum < 1e-12
    assert "16 nodes, 4 of them outside the second mesh and left out" in str(found)
    far = stretched(first.mesh.replace(points=first.mesh.points + 10), pull(1e-3))
    with pytest.raises(kl.MeshError, match="no node of the first result lies in the mesh of the second"):
        kl.compare(first, far)


def test_table_of_a_comparison_names_place_and_units():
    mesh = kl.box((2, 1, 1), (2, 1, 1))
    found = kl.compare(stretched(mesh, pull(1e-3)), stretched(mesh, pull(2e-3)))
    rows = dict(found.table())
    assert rows["displacement"].startswith("largest 2.000000e-03 m (1 of the first), L2 ")
    assert "m at node" not in rows["displacement"]
    assert f"largest at node {found.displacement.node}, (2, " in rows["displacement"]
    assert rows["strain energy"].endswith("+3.000e+00 of the first")
    assert "<td" in found._repr_html_()


def test_results_alone_are_compared():
    result = stretched(kl.box(), pull(1e-3))
    with pytest.raises(kl.InputError, match="second must be a Result"):
        kl.compare(result, result.mesh)
