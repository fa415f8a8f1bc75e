"""Names in files: which slips of the pen are surely meant for a known word."""

import pytest

from kratos_lite.io.formats.mdpa.values import KINDS
from kratos_lite.io.kratos.properties import USED
from kratos_lite.io.kratos.variables import LOADING, VECTORS
from kratos_lite.io.names import SOLIDS, misspelt
from kratos_lite.shapes import SHAPES

WORDS = {*USED, *LOADING, *VECTORS}


@pytest.mark.parametrize(
    ("slip", "meant"),
    [
        ("DISPLACMENT_X", "DISPLACEMENT_X"),
        ("DISPLACEMNET_Y", "DISPLACEMENT_Y"),
        ("displacement_z", "DISPLACEMENT_Z"),
        ("SURFACE_LAOD", "SURFACE_LOAD"),
        ("DISPLACEMENTX", "DISPLACEMENT_X"),
        ("POSITIV_FACE_PRESURE", "POSITIVE_FACE_PRESSURE"),
        ("POISSONS_RATIO", "POISSON_RATIO"),
        ("DENSTIY", "DENSITY"),
    ],
)
def test_a_letter_or_two_missing_wrong_or_exchanged_are_a_slip(slip, meant):
    assert misspelt(slip, WORDS) == meant


@pytest.mark.parametrize(
    "name",
    [
        *(name for name in KINDS if name not in WORDS and not name[:-2].endswith("STRESS")),
        *("MESH_DISPLACEMENT_X", "FACE_PRESSURE", "STEP_DISPLACEMENT_X", "POROSITY", "SHEAR_MODULUS_GAMMA12"),
        *("POINT_LOADS_VECTOR", "EQUIVALENT_YOUNG_MODULUS", "DENSITY_WATER", "YOUNG_MODULUS_SENSITIVITY"),
        *("PRESTRESS_VECTOR", "COEFFICIENT_THERMAL_EXPANSION"),
        *("YOUNG_MODULUS_1", "CONSTITUTIVE_MATRIX", "AIR_PRESSURE", "INITIAL_STRAIN", "CAVITY"),
    ],
)
def test_variables_that_kratos_has_are_no_slips(name):
    assert misspelt(name, WORDS) is None


def test_it_has_every_solid_shape_of_the_library():
    solids = {shape for shape in SHAPES.values() if shape.nodes.shape[1] == 3}
    own = {shape for shape in solids if shape.__module__.startswith("kratos_lite.shapes.")}
    assert {nodes: SHAPES[name] for nodes, name in SOLIDS.items()} == {len(s.nodes): s for s in own}
    assert len(SOLIDS) == len(own)
