"""Nodes chosen by a point, and triples that may be a point or rows."""

import numpy as np
import pytest

import kratos_lite as kl

MESH = kl.box((2, 1, 1), cells=(2, 1, 1))
POINT = (1.0, 1.0, 0.0)


@pytest.mark.parametrize("where", [POINT, list(POINT), np.array(POINT), (1, 1, 0.0), tuple(np.array(POINT))])
def test_three_coordinates_choose_the_node_there(where):
    (row,) = MESH.nodes(where)
    assert MESH.points[row].tolist() == list(POINT)
    assert MESH.nodes(np.array(where) + 1e-7).tolist() == [row]


def test_all_nodes_at_a_place_are_chosen():
    twice = kl.Mesh(np.vstack([MESH.points, MESH.points]), {})
    assert twice.nodes(POINT).tolist() == [row + at for at in (0, 12) for row in MESH.nodes(POINT)]


@pytest.mark.parametrize("where", [(0, 1, 2), [0, 1, 2], (1, 1, 1)])
def test_three_whole_numbers_are_refused_with_both_readings(where):
    model = kl.Model(MESH, kl.Isotropic3D(E=1e9, nu=0.3))
    calls = [
        MESH.nodes,
        model.fix,
        lambda w: MESH.replace().add_part("a", w),
        lambda w: kl.PointLoad(w, POINT),
    ]
    for call in calls:
        with pytest.raises(
            kl.MeshError, match=r"point or three node indices: write \(.\.0, 1\.0, .*np\.array\(\["
        ):
            call(where)


@pytest.mark.parametrize("rows", [np.array([0, 1, 2]), range(3), [*np.arange(3)], [np.int32(0), 1, 2]])
def test_three_rows_as_an_array_or_a_range_are_rows(rows):
    assert MESH.nodes(rows).tolist() == [0, 1, 2]


def test_lists_of_other_lengths_and_masks_are_what_they_were():
    assert MESH.nodes([4, 1]).tolist() == [4, 1]
    assert kl.Mesh(MESH.points[:3], {}).nodes([True, False, True]).tolist() == [0, 2]


def test_a_place_without_a_node_is_an_error_that_names_the_nearest():
    match = (
        r"no node at \[0\.9, 1\.0, 0\.0\] m; the nearest node is that at \[1\.0, 1\.0, 0\.0\] m .*0\.1 m away"
    )
    with pytest.raises(kl.MeshError, match=match):
        MESH.nodes((0.9, 1.0, 0.0))
    with pytest.raises(kl.MeshError, match="must be finite"):
        MESH.nodes((0.9, np.nan, 0.0))
    with pytest.raises(kl.MeshError, match="there are no nodes"):
        kl.Mesh(np.zeros((0, 3)), {}).nodes(POINT)


def test_a_support_and_a_displacement_at_a_point():
    model = kl.Model(MESH, kl.Isotropic3D(E=1e9, nu=0.3))
    model.fix("x-")
    model.fix((2.0, 0.0, 0.0), "z", 1e-3)
    assert model.solve().displacement((2.0, 0.0, 0.0))[0, 2] == 1e-3


def test_a_point_on_a_thin_plate_does_not_choose_its_other_side():
    plate = kl.box((1e3, 1e3, 1e-3), cells=(2, 2, 2))
    for row, point in enumerate(plate.points):
        assert plate.nodes(tuple(map(float, point))).tolist() == [row]
    assert len(plate.nodes((500.0, 500.0, 2.5e-4))) == 1
