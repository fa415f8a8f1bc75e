"""Loads are checked where they are added."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
UP = (0.0, 0.0, 1.0)


def a_model():
    mesh = kl.box(cells=(2, 1, 1))
    mesh.add_part("bottom", "z-")
    return kl.Model(mesh, STEEL)


@pytest.mark.parametrize(
    "load",
    [
        kl.Traction("botom", UP),
        kl.Pressure("botom", 1.0),
        kl.LineLoad("botom", UP),
        kl.PointLoad("botom", UP),
        kl.Gravity(UP, "botom"),
        kl.BodyForce(UP, "botom"),
    ],
)
@pytest.mark.parametrize("amplitude", [None, 2.0])
def test_a_load_on_a_misspelt_part_is_refused_where_it_is_added_with_a_suggestion(load, amplitude):
    model = a_model()
    with pytest.raises(kl.MeshError, match=r"no part 'botom'; .*Did you mean bottom\?"):
        model.add(load, amplitude=amplitude)
    assert not len(model.loads)


def test_rows_that_do_not_exist_are_refused_where_they_are_added():
    model = a_model()
    for load in (kl.PointLoad([3, 99], UP), kl.Traction(np.array([1, 99]), UP), kl.Gravity(UP, [7])):
        with pytest.raises(kl.MeshError, match="must lie in 0"):
            model.add(load)
