"""Printed tables of CalculiX: closed forms of a bar under tension and of masses, and the layout of 2.20."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.writers.dat import VARIABLES, buckling, frequencies, prints, section_print

SIZES = 2.0, 1.0, 0.5  # m
STRESS = 4e6  # Pa


def bar(name="KinematicLinear3D8N"):
    """Return a bar under uniform tension, which every element has exactly."""
    model = kl.Model(kl.box(SIZES, (2, 1, 1), name), kl.Isotropic3D(E=2e11, nu=0.0, density=7800.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (STRESS, 0, 0)))
    return model


LINES = {
    "U": "displacements (vx,vy,vz) for set ALL and time  0.2500000E+00",
    "RF": "forces (fx,fy,fz) for set ALL and time  0.2500000E+00",
    "S": "stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set ALL and time  0.2500000E+00",
    "E": "strains (elem, integ.pnt.,exx,eyy,ezz,exy,exz,eyz) for set ALL and time  0.2500000E+00",
    "ENER": "internal energy density (elem, integ.pnt.,energy) for set ALL and time  0.2500000E+00",
    "COORD": "global coordinates (elem, integ.pnt.,x,y,z) for set ALL and time  0.2500000E+00",
    "EVOL": "volume (element, volume) for set ALL and time  0.2500000E+00",
    "ELSE": "internal energy (element, energy) for set ALL and time  0.2500000E+00",
}


@pytest.mark.parametrize("name", LINES)
def test_tables_begin_with_the_titles_of_calculix(name):
    lines = prints(bar().solve(), np.arange(2), name, "ALL", 0.25)
    assert lines[:3] == ["", f" {LINES[name]}", ""]
    assert len(lines) == 3 + (16 if name in ("S", "E", "ENER", "COORD") else 2)


def test_rows_have_ids_points_and_values_in_columns():
    result = bar().solve()
    assert prints(result, np.arange(2), "S", "ALL")[3].startswith("         1   1  4.000000E+06 ")
    assert prints(result, np.arange(1, 2), "EVOL", "ALL")[3:] == ["         2  5.000000E-01"]
    ends = np.sort(result.mesh.nodes("x-"))
    total = prints(result, ends, "RF", "ENDS", totals="ONLY")
    assert total[1] == " total force (fx,fy,fz) for set ENDS and time  0.1000000E+01"
    assert total[3].startswith("       -2.000000E+06")
    energy = STRESS**2 / 2 / 2e11 * np.prod(SIZES)
    assert prints(result, np.arange(2), "ELSE", "ALL", totals="YES")[-1] == f"{energy:20.6E}"
    assert prints(result, np.arange(2), "U", "ALL", totals="ONLY")[1].startswith(" displacements")


@pytest.mark.parametrize("name", ["NT", "PEEQ"])
def test_nothing_is_printed_of_what_a_result_has_not(name):
    assert prints(bar().solve(), np.arange(2), name, "ALL") == []


def test_unknown_variables_are_refused():
    with pytest.raises(kl.InputError, match="a printed variable"):
        prints(bar().solve(), np.arange(2), "SPIN", "ALL")
    assert set(LINES) < set(VARIABLES)


@pytest.mark.parametrize(
    "name", ["KinematicLinear3D4N", "KinematicLinear3D10N", "KinematicLinear3D20N", "Reduced3D20N"]
)
def test_sections_have_force_moment_area_and_center(name):
    if name == "Reduced3D20N":
        model = kl.Model(kl.box(SIZES, (2, 2, 2), name), kl.Isotropic3D(E=2e11, nu=0.0))
        model.fix("x-")
        model.add(kl.Traction("x+", (STRESS, 0, 0)))
    else:
        model = bar(name)
    lines = section_print(model.solve(), model.mesh.faces("x+"), "END", 2.0)
    assert lines[3] == " statistics for surface set END and time  0.2000000E+01"
    force, area = STRESS * 0.5, 0.5
    numbers = [list(map(float, lines[at].split())) for at in (7, 11, 15, 19)]
    assert lines[19][:16] == f"{area:16.6E}"
    close = [
        (numbers[0], [force, 0, 0, 0, 0.25 * force, -0.5 * force]),
        (numbers[1], [2, 0.5, 0.25, 1, 0, 0]),
        (numbers[2], [0, 0, 0]),
        (numbers[3], [area, force, 0, 0, 0]),
    ]
    for found, expected in close:  # matrices of the extrapolation have four or five digits
        assert np.abs(np.array(found) - expected).max() <= 1e-4 * max(np.abs(expected).max(), force)


def test_modes_have_factors_and_masses_of_rigid_motions():
    """All nodes free: the modes are complete, so that effective masses add up to all of the mass."""
    mesh = kl.box(SIZES, (1, 1, 1))
    model = kl.Model(mesh, kl.Isotropic3D(E=2e11, nu=0.0, density=7800.0))
    from scipy.linalg import eigh

    matrices = model.matrices()
    values, vectors = eigh(matrices.K.toarray(), matrices.M.toarray())
    omega, shapes = np.sqrt(np.maximum(values, 0)), 3.0 * vectors.T.reshape(-1, 8, 3)  # of any size
    lines = frequencies(omega, shapes, matrices.M, mesh.points, np.arange(24))
    assert lines[1] == "     E I G E N V A L U E   O U T P U T"
    assert lines[7].split()[0] == "1"
    (total,) = (line for line in lines if line.startswith("TOTAL  "))
    mass = 7800 * np.prod(SIZES)
    x, y, z = SIZES
    about = mass / 3 * np.array([y**2 + z**2, z**2 + x**2, x**2 + y**2])  # about the origin, a corner
    expected = [*[mass] * 3, *about]
    for line in (total, lines[-1]):
        found = [float(line[at : at + 16]) for at in range(7, 103, 16)]
        assert np.abs(np.array(found) / expected - 1).max() < 2e-7
    assert lines[-1].startswith("          0.7800000E+04")


def test_only_free_degrees_of_freedom_have_mass():
    """Of the consistent mass m / 6 [2 1; 1 2] of the first of two elements the free end has a third."""
    model = bar()
    matrices, (omega, shapes) = model.matrices(), model.modes(1)
    lines = frequencies(omega, shapes, matrices.M, model.mesh.points, matrices.free)
    assert abs(float(lines[-1][7:23]) / (3900 * 4 / 3) - 1) < 1e-7
    assert abs(float(lines[7][39:55]) / (omega[0] / 2 / np.pi) - 1) < 1e-7


def test_factors_of_buckling_are_a_table():
    assert buckling(np.array([21869359.43, -0.5])) == [
        "", "     B U C K L I N G   F A C T O R   O U T P U T", "", " MODE NO       BUCKLING",
        "                FACTOR", "", "      1   0.2186936E+08", "      2  -0.5000000E+00",
    ]  # fmt: skip
