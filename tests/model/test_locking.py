"""The locking forecast: warnings with the better choice, and none where elements are good enough."""

import numpy as np
import pytest
from meshes import joined

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e9, nu=0.3)
PLAIN = "KinematicLinear3D8N"


def warnings(size, cells, element, material=STEEL, supports=(("x-", "xyz"),)):
    model = kl.Model(kl.box(size, cells, element), material)
    for part, axes in supports:
        model.fix(part, axes)
    return model.check()


@pytest.mark.parametrize("cells", [(10, 10, 1), (10, 10, 4), (40, 4, 1)])
def test_plain_bricks_that_are_long_beside_a_wall_are_forecast_to_lock(cells):
    (text,) = warnings((10, 1, 0.1), cells, PLAIN)
    assert "too stiff in bending" in text
    assert text.endswith("take EnhancedStrain3D8N")


@pytest.mark.parametrize(("cells", "measured"), [((10, 1, 1), 0.025), ((20, 2, 1), 0.092)])
def test_the_forecast_has_the_size_of_the_error(cells, measured):
    """Against the share of Timoshenko's deflection that plain bricks reach."""
    model = kl.Model(kl.box((10, 1, 0.1), cells, PLAIN), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    deflection = np.abs(model.solve().u[:, 2]).max()
    exact = 4 * 0.1 * 10**3 / (210e9 * 1 * 0.1**3)
    share = float(deflection / exact)
    assert abs(share / measured - 1) < 0.2
    factor = float(model.check()[0].split("come out up to ")[1].split(" times")[0])
    assert 0.7 < factor * share < 1.1


@pytest.mark.parametrize(
    ("size", "cells"),
    [
        ((1, 1, 1), (1, 1, 1)),
        ((1, 1, 1), (4, 4, 4)),
        ((10, 1, 1), (80, 8, 8)),
        ((10, 1, 1), (20, 2, 2)),
    ],
)
def test_well_refined_plain_bricks_and_single_cells_are_not_warned_of(size, cells):
    assert warnings(size, cells, PLAIN) == []


def test_elements_that_do_not_lock_are_not_warned_of():
    for element in ("EnhancedStrain3D8N", "Element3D8N", "KinematicLinear3D20N", "KinematicLinear3D10N"):
        assert warnings((10, 1, 0.1), (10, 2, 1), element) == []


def test_names_of_kratos_are_warned_of_too():
    (text,) = warnings((10, 1, 0.1), (10, 1, 1), "SmallDisplacementElement3D8N")
    assert "take EnhancedStrain3D8N" in text


def test_wedges_and_tetrahedra_are_pointed_to_quadratic_ones():
    (wedge,) = warnings((10, 1, 0.1), (10, 1, 1), "KinematicLinear3D6N")
    (tetrahedron,) = warnings((1, 1, 1), (3, 3, 3), "KinematicLinear3D4N")
    assert wedge.endswith("take KinematicLinear3D15N")
    assert tetrahedron.startswith("KinematicLinear3D4N locks")
    assert tetrahedron.endswith("take KinematicLinear3D10N")


def test_pyramids_are_warned_of_unless_they_are_few():
    (text,) = [t for t in warnings((1, 1, 0.01), (4, 4, 1), "KinematicLinear3D5N") if "3D5N" in t]
    assert "locks in bending" in text
    assert "take KinematicLinear3D13N" in text


@pytest.mark.parametrize(
    ("element", "better"),
    [
        ("KinematicLinear3D8N", "EnhancedStrain3D8N"),
        ("KinematicLinear3D6N", "BBar3D15N"),
        ("KinematicLinear3D5N", "BBar3D13N"),
        ("KinematicLinear3D20N", "BBar3D20N"),
        ("KinematicLinear3D27N", "BBar3D27N"),
    ],
)
def test_plain_elements_near_incompressibility_are_pointed_to_better_ones(element, better):
    text = warnings((1, 1, 1), (2, 2, 2), element, kl.Isotropic3D(E=1e6, nu=0.4999))[0]
    assert f"{element} may lock" in text
    assert text.endswith(f"take {better}")


@pytest.mark.parametrize(
    "element", ["EnhancedStrain3D8N", "BBar3D20N", "KinematicLinear3D10N", "Element3D27N"]
)
def test_sound_elements_near_incompressibility_are_not_warned_of(element):
    assert warnings((1, 1, 1), (2, 2, 2), element, kl.Isotropic3D(E=1e6, nu=0.4999)) == []


def test_bodies_far_apart_are_looked_at_one_by_one():
    model = kl.Model(joined(kl.box(element=PLAIN), kl.box(element=PLAIN, origin=(20, 0, 0))), STEEL)
    model.fix("z-")
    assert model.check() == []


def test_the_forecast_stands_in_the_report_and_in_the_table():
    model = kl.Model(kl.box((10, 1, 0.1), (10, 1, 1), PLAIN), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    result = model.solve()
    assert any("too stiff in bending" in text for text in result.report.warnings)
    assert any(label == "warning" and "EnhancedStrain3D8N" in text for label, text in result.table())
