"""Elements that do not lock: bending, thin shells and ν → ½, on coarse meshes."""

import numpy as np
import pytest
from known_page import rows_of_page, value_ratio

import kratos_lite as kl
from kratos_lite.verification import scenes
from kratos_lite.verification.concentrations import SOFT
from kratos_lite.verification.meshes import nearest, short

ENHANCED = {
    "macneal_harder/straight_rectangular_in_plane": (0.98, 1.0),
    "macneal_harder/straight_rectangular_out_of_plane": (0.98, 1.0),
    "macneal_harder/straight_parallelogram_in_plane": (0.62, 1.0),
    "macneal_harder/curved_in_plane": (0.88, 1.0),
    "macneal_harder/curved_out_of_plane": (0.83, 1.0),
    "macneal_harder/twisted_in_plane": (0.99, 1.01),
    "macneal_harder/twisted_out_of_plane": (0.99, 1.01),
    "shells/plate_supported_square": (0.99, 1.01),
    "shells/plate_clamped_square": (0.99, 1.01),
    "shells/plate_clamped_1_to_5": (0.99, 1.01),
    "shells/scordelis_lo": (0.99, 1.03),
    "pressure/thick_cylinder_0.4999": (0.98, 1.0),
    "concentration/cook": (0.98, 1.0),
    "concentration/cook_incompressible": (0.96, 1.0),
}
PROJECTED = ("BBar3D15N", "BBar3D20N", "BBar3D27N", "Reduced3D20N")


@pytest.mark.parametrize(("problem", "bounds"), ENHANCED.items())
def test_enhanced_strain_does_not_lock(problem, bounds):
    low, high = bounds
    assert low <= value_ratio(problem, "EnhancedStrain3D8N") <= high
    assert value_ratio(problem, "KinematicLinear3D8N") < low


@pytest.mark.parametrize("element", PROJECTED)
def test_projected_dilatation_takes_nearly_incompressible_cylinders(element):
    assert abs(value_ratio("pressure/thick_cylinder_0.4999", element) - 1) < 4e-3


@pytest.mark.parametrize(
    ("element", "error"),
    [("BBar3D20N", 1e-3), ("BBar3D27N", 4e-4), ("Reduced3D20N", 4e-4), ("EnhancedStrain3D8N", 4e-3)],
)
def test_nearly_incompressible_plates_with_a_hole_have_small_errors(element, error):
    plain = f"KinematicLinear3D{len(kl.ELEMENTS[element].nodes)}N"
    rows = rows_of_page("concentration")
    actual, locked = (
        float(rows["kirsch_incompressible_field", short(kind)]["value"]) for kind in (element, plain)
    )
    assert actual < error < locked / 5


@pytest.mark.parametrize(("element", "error"), [("BBar3D27N", 4e-3), ("BBar3D20N", 2e-2)])
def test_cook_s_membrane_is_soft_enough_near_incompressibility(element, error):
    result = scenes.cook(element, 8, SOFT).model.solve("direct")
    assert abs(result.u[nearest(result.mesh, (48, 52, 0)), 1] / 7.695 - 1) < error


def pressed_block(element, n):
    """Return the work of a unit pressure on a quarter of the top of a cube, held along x and y there."""
    mesh = kl.box(cells=(n, n, n), element=element)
    model = kl.Model(mesh, kl.Isotropic3D(E=1.0, nu=0.4999))
    for side in ("x-", "y-", "z-"):
        model.fix(side, side[0])
    model.fix("z+", "xy")
    model.add(kl.Pressure(lambda X: (X[:, 2] == 1) & (X[:, :2] < 0.5 + 1e-9).all(axis=1), 1.0))
    result = model.solve("direct")
    return float((result.loads * result.u).sum())


def test_a_pressed_block_is_soft_enough_near_incompressibility():
    limit = 0.1320  # of refined meshes of 20N and 27N
    assert abs(pressed_block("BBar3D27N", 4) / limit - 1) < 4e-3
    assert abs(pressed_block("BBar3D20N", 4) / limit - 1) < 6e-3
    assert pressed_block("EnhancedStrain3D8N", 8) / limit > 0.98
    assert pressed_block("KinematicLinear3D8N", 8) / limit < 0.8


@pytest.mark.parametrize("height", [1.0, 0.1])
def test_one_element_through_the_thickness_is_enough(height):
    def tip(element, n):
        mesh = kl.box((10, 1, height), (10 * n, n, n), element)
        model = kl.Model(mesh, kl.Isotropic3D(E=1e7, nu=0.3))
        model.fix("x-")
        model.add(kl.Traction("x+", (0, 0, 1 / height)))
        return float(model.solve("direct").displacement("x+")[:, 2].mean())

    fine = tip("Reduced3D20N", 3)
    assert abs(tip("EnhancedStrain3D8N", 1) / fine - 1) < 0.01
    assert tip("KinematicLinear3D8N", 1) / fine < 0.7


def test_a_trapezoid_stays_stiff_in_bending_in_every_brick_of_eight_nodes():
    """MacNeal's theorem: patch test and bending exclude each other."""
    problem = "macneal_harder/straight_trapezoidal_in_plane"
    assert value_ratio(problem, "EnhancedStrain3D8N") < 0.06
    assert value_ratio(problem, "BBar3D27N") > 0.98


def test_stresses_of_the_bar_in_bending_are_those_of_the_enhanced_strain():
    mesh = kl.box((4, 1, 1), (4, 1, 1), "EnhancedStrain3D8N", origin=(0, -0.5, -0.5))
    result = scenes.bending("EnhancedStrain3D8N", 1).model.solve("direct")
    cells = kl.EnhancedStrain3D8N(mesh.points[mesh.blocks[0].nodes])
    y = cells.gauss_points()[..., 1]
    stress = result.stress()
    assert np.abs(stress[..., 0] - 0.01 * y).max() < 1e-12
    assert np.abs(stress[..., 1:]).max() < 1e-12
