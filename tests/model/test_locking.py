"""The locking forecast: warnings with the better choice, and none where elements are good enough."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e9, nu=0.3)
PLAIN = "KinematicLinear3D8N"


def warnings(size, cells, element, material=STEEL):
    model = kl.Model(kl.box(size, cells, element), material)
    model.fix("x-")
    return model.check()


SLENDER = (10, 1, 0.1)


@pytest.mark.parametrize(
    ("size", "cells", "element", "words", "better"),
    [
        (SLENDER, (10, 10, 1), PLAIN, "too stiff in bending", "EnhancedStrain3D8N"),
        (SLENDER, (10, 10, 4), PLAIN, "too stiff in bending", "EnhancedStrain3D8N"),
        (SLENDER, (40, 4, 1), PLAIN, "too stiff in bending", "EnhancedStrain3D8N"),
        (SLENDER, (10, 1, 1), "SmallDisplacementElement3D8N", "too stiff", "EnhancedStrain3D8N"),
        ((1, 0.1, 0.1), (5, 1, 1), PLAIN, "up to 2.5 times too stiff in bending", "EnhancedStrain3D8N"),
        ((16, 1, 1), (8, 1, 1), PLAIN, "up to 2.5 times too stiff in bending", "EnhancedStrain3D8N"),
        (SLENDER, (10, 1, 1), "KinematicLinear3D6N", "too stiff in bending", "KinematicLinear3D15N"),
        ((1, 1, 1), (3, 3, 3), "KinematicLinear3D4N", "3D4N locks in bending", "KinematicLinear3D10N"),
        ((1, 1, 0.01), (4, 4, 1), "KinematicLinear3D5N", "3D5N locks in bending", "KinematicLinear3D13N"),
    ],
)
def test_elements_that_lock_in_bending_are_pointed_to_better_ones(size, cells, element, words, better):
    (text,) = warnings(size, cells, element)
    assert words in text
    assert text.endswith(f"take {better}")


@pytest.mark.parametrize(("cells", "measured"), [((10, 1, 1), 0.025), ((20, 2, 1), 0.092)])
def test_the_forecast_has_the_size_of_the_error(cells, measured):
    """Against the fraction of Timoshenko's deflection that plain bricks reach."""
    model = kl.Model(kl.box((10, 1, 0.1), cells, PLAIN), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    deflection = np.abs(model.solve().u[:, 2]).max()
    exact = 4 * 0.1 * 10**3 / (210e9 * 1 * 0.1**3)
    fraction = float(deflection / exact)
    assert abs(fraction / measured - 1) < 0.2
    factor = float(model.check()[0].split("come out up to ")[1].split(" times")[0])
    assert 0.7 < factor * fraction < 1.1


@pytest.mark.parametrize("cells", [8, 40])
def test_one_layer_of_b_bar_bricks_is_within_what_the_forecast_says(cells):
    """Long cells are too stiff in bending, short ones too soft: between both bounds, and beyond 1."""
    model = kl.Model(kl.box((16, 1, 1), (cells, 1, 1), "BBar3D8N"), STEEL)
    model.fix("x-")
    model.add(kl.Resultant("x+", (0, 0, 1e3)))
    fraction = model.solve().displacement("x+")[:, 2].mean() / (1e3 * 16**3 / (3 * 210e9 / 12))
    (text,) = model.check()
    stiff, soft = (float(text.split(f" times too {word}")[0].split()[-1]) for word in ("stiff", "soft"))
    assert (1.5 < fraction < soft) if cells == 40 else (1 / stiff < fraction < 1.15 / stiff)
    assert text.endswith("take EnhancedStrain3D8N")


@pytest.mark.parametrize(
    ("law", "better"),
    [
        (kl.J2Plasticity3D(2e11, 0.3, 2e8), "EnhancedStrain3D8N"),
        (kl.DruckerPrager3D(2e10, 0.3, 5e7, 20.0, 20.0), "EnhancedStrain3D8N"),
        (kl.DruckerPrager3D(2e10, 0.3, 5e7, 20.0, 10.0), "KinematicLinear3D20N"),  # flows off the normal
        (kl.RankineDamage3D(3e10, 0.2, 3e6, 1000.0), "KinematicLinear3D20N"),  # softens
    ],
)
def test_enhanced_bricks_are_advised_where_they_find_equilibrium(law, better):
    model = kl.Model(kl.box((10, 1, 1), (4, 1, 1)), law)
    model.fix("x-")
    model.add(kl.Resultant("x+", (0, 0, 1e3)))
    (text,) = model.check()
    assert text.startswith("BBar3D8N")
    assert text.endswith(f"take {better}")


def test_near_half_ten_nodes_lock_as_forecast_and_b_bar_does_not():
    """A flat block between rigid plates, over the force on finer meshes of any element."""
    forces = []
    for cells, element in (
        ((2, 2, 1), "KinematicLinear3D10N"),
        ((2, 2, 1), "BBar3D10N"),
        ((4, 4, 2), "BBar3D20N"),
    ):
        model = kl.Model(kl.box((1, 1, 0.5), cells, element), RUBBER)
        model.fix("z-")
        model.fix("z+", "xyz", (0, 0, -0.01))
        forces.append(model.solve().reaction("z-")[:, 2].sum())
    assert forces[0] > 10 * forces[2]
    assert forces[1] < 1.5 * forces[2]


RUBBER = kl.Isotropic3D(E=1e6, nu=0.4999)


@pytest.mark.parametrize(
    ("size", "cells", "elements", "material"),
    [
        ((1, 1, 1), (1, 1, 1), [PLAIN], STEEL),
        ((1, 1, 1), (4, 4, 4), [PLAIN], STEEL),
        ((10, 1, 1), (80, 8, 8), [PLAIN], STEEL),
        ((10, 1, 1), (20, 2, 2), [PLAIN], STEEL),
        (SLENDER, (10, 2, 1), ["EnhancedStrain3D8N", "Element3D8N"], STEEL),
        (SLENDER, (10, 2, 1), ["KinematicLinear3D20N", "KinematicLinear3D10N"], STEEL),
        ((1, 1, 1), (2, 2, 2), ["EnhancedStrain3D8N", "BBar3D20N"], RUBBER),
        ((1, 1, 1), (2, 2, 2), ["BBar3D10N", "Element3D10N", "Element3D27N"], RUBBER),
    ],
)
def test_elements_that_are_good_enough_are_not_warned_of(size, cells, elements, material):
    for element in elements:
        assert warnings(size, cells, element, material) == []


@pytest.mark.parametrize(
    ("element", "better"),
    [
        ("KinematicLinear3D8N", "EnhancedStrain3D8N"),
        ("KinematicLinear3D4N", "BBar3D10N"),
        ("KinematicLinear3D10N", "BBar3D10N"),
        ("KinematicLinear3D6N", "BBar3D15N"),
        ("KinematicLinear3D5N", "BBar3D13N"),
        ("KinematicLinear3D20N", "BBar3D20N"),
        ("KinematicLinear3D27N", "BBar3D27N"),
        ("TotalLagrangianElement3D8N", "FBar3D8N"),
        ("TotalLagrangianElement3D4N", "TotalLagrangianElement3D10N"),
    ],
)
def test_plain_elements_near_incompressibility_are_pointed_to_better_ones(element, better):
    text = warnings((1, 1, 1), (2, 2, 2), element, RUBBER)[0]
    assert f"{element} may lock" in text
    assert text.endswith(f"take {better}")


def test_plastic_flow_locks_plain_linear_elements():
    metal = kl.J2Plasticity3D(200e9, 0.3, 2e8)
    for element, better in ((PLAIN, "BBar3D8N"), ("TotalLagrangianElement3D8N", "FBar3D8N")):
        (text,) = warnings((1, 1, 1), (2, 2, 2), element, metal)
        assert text.startswith(f"J2Plasticity3D flows without change of volume: {element} may lock")
        assert text.endswith(f"take {better}")
    for element in ("Element3D8N", "EnhancedStrain3D8N", "Element3D20N", "FBar3D8N"):
        assert warnings((1, 1, 1), (2, 2, 2), element, metal) == []
