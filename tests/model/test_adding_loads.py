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


ON_FACES = (kl.Traction, kl.Pressure, kl.LineLoad)


@pytest.mark.parametrize("make", [kl.BodyForce, kl.Gravity, kl.Temperature, *ON_FACES])
def test_a_function_of_three_coordinates_is_refused_where_it_is_given(make):
    where = ("z+",) if make in ON_FACES else ()
    with pytest.raises(kl.InputError, match=r"takes places X \(m, 3\) alone: lambda X: …"):
        make(*where, lambda x, y, z: 0.0)
    with pytest.raises(kl.InputError, match=r"time goes by model.add\(load, amplitude=lambda t: …\)"):
        make(*where, lambda X, t: 0.0)
    make(*where, lambda X: X)


def test_a_load_of_bodies_is_told_whose_it_is():
    with pytest.raises(kl.InputError, match="got Torque, which acts on bodies"):
        a_model().add(kl.Torque(UP))


def test_percents_and_swapped_constants_are_understood_or_said():
    model = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", UP))
    assert model.solve(error="30%").report.error_asked == 0.3
    with pytest.raises(kl.InputError, match="error must be"):
        model.solve(error="few%")
    for E, nu, hint in ((210e9, 30.0, "in percent"), (0.3, 210e9, "two of E, nu and density swapped")):
        with pytest.raises(kl.MaterialError, match=hint):
            kl.Isotropic3D(E, nu, 0.3)
    model.add(kl.Pressure("z+", (0, 0, -1e4)))
    with pytest.raises(kl.InputError, match="a vector is a Traction"):
        model.solve()
