"""Known values of what moves: bodies, frames, material through the mesh, rotors; steps; frequencies."""

import pytest

from kratos_lite.verification import page
from kratos_lite.verification.page import SOURCES
from tests.verification.moving import (
    bodies_in_motion,
    known_values,
    moving_frames,
    moving_material,
    rotors,
    stepping,
    vibration,
)

FAMILIES = (bodies_in_motion, moving_frames, moving_material, rotors, stepping, vibration)
ELEMENTS = ("KinematicLinear3D10N", "KinematicLinear3D20N")
"""Those of the library that need no excuse."""


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__.rpartition(".")[2])
def test_known_values_are_found(family):
    rows = [problem.row(kind) for problem in family.PROBLEMS for kind in problem.elements(ELEMENTS)]
    assert [page.line(row) for row in rows if row.failed or row.grade in ("D", "F")] == []


def test_every_known_value_has_a_source():
    cited = {problem.cited for family in FAMILIES for problem in family.PROBLEMS}
    assert cited <= {*SOURCES, *known_values.SOURCES}
    assert {*known_values.SOURCES} <= cited
