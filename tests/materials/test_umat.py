"""A law of Abaqus: a subroutine UMAT of our own, compiled here, beside the same law of the library."""

import shutil
import subprocess

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import MaterialError, SolveError
from kratos_lite.testing import assert_conforms

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")

HEAD = """
#include <math.h>
void umat_(double *stress, double *statev, double *ddsdde, double *sse, double *spd, double *scd, double *rpl,
           double *ddsddt, double *drplde, double *drpldt, const double *stran, const double *dstran,
           const double *time, const double *dtime, const double *temp, const double *dtemp,
           const double *predef, const double *dpred, const char *cmname, const int *ndi, const int *nshr,
           const int *ntens, const int *nstatv, const double *props, const int *nprops, const double *coords,
           const double *drot, double *pnewdt, const double *celent, const double *dfgrd0,
           const double *dfgrd1, const int *noel, const int *npt, const int *layer, const int *kspt,
           const int *kstep, const int *kinc) {
"""
J2 = (
    HEAD
    + """
    /* Simo & Hughes, box 3.1, with linear isotropic hardening; E, nu, yield stress, hardening */
    double E = props[0], nu = props[1], G = E / 2 / (1 + nu), K = E / 3 / (1 - 2 * nu), s[6], norm = 0;
    double unit[6] = {1, 1, 1, 0, 0, 0}, mean, q, f, dp = 0, a, b = 0;
    double trace = dstran[0] + dstran[1] + dstran[2];
    if (*ndi != 3 || *nshr != 3 || *ntens != 6 || *nprops != 4 || *nstatv != 1) { *pnewdt = -1; return; }
    if (*kstep != 1 || kstep[2] != 0 || dfgrd1[4] != 1 || drot[1] != 0 || cmname[79] != ' ') {
        *pnewdt = -2;
        return;
    }
    for (int i = 0; i < 6; i++) {
        stress[i] += i < 3 ? 2 * G * (dstran[i] - trace / 3) + K * trace : G * dstran[i];
    }
    mean = (stress[0] + stress[1] + stress[2]) / 3;
    for (int i = 0; i < 6; i++) {
        s[i] = stress[i] - mean * unit[i];
        norm += (i < 3 ? 1 : 2) * s[i] * s[i];
    }
    q = sqrt(1.5 * norm);
    f = q - props[2] - props[3] * statev[0];
    if (f > 0) {
        dp = f / (3 * G + props[3]);
        b = 6 * G * G * (dp / q - 1 / (3 * G + props[3])) * 1.5 / (q * q);
    }
    a = 1 - (dp > 0 ? 3 * G * dp / q : 0);
    for (int j = 0; j < 6; j++)
        for (int i = 0; i < 6; i++)
            ddsdde[i + 6 * j] = K * unit[i] * unit[j] + b * s[i] * s[j] +
                                2 * G * a * ((i == j) * (i < 3 ? 1 : 0.5) - unit[i] * unit[j] / 3);
    for (int i = 0; i < 6; i++) stress[i] = mean * unit[i] + a * s[i];
    statev[0] += dp;
}
"""
)
CONSTANTS = (200e9, 0.3, 250e6, 2e9)
OWN = kl.J2Plasticity3D(*CONSTANTS)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Return what compiles C to a library and gives its path."""
    folder = tmp_path_factory.mktemp("umat")

    def make(source):
        number = len(list(folder.iterdir()))
        path, library = folder / f"umat{number}.c", folder / f"umat{number}.so"
        path.write_text(source)
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", path, "-o", library, "-lm"], check=True)
        return str(library)

    return make


@pytest.fixture(scope="module")
def steel(compiled):
    return kl.UMAT(compiled(J2), CONSTANTS, state_variables=1, density=7850.0)


def body(source):
    return HEAD + source + "}"


def test_a_j2_umat_is_the_law_of_the_library_through_cycles(steel):
    rng, states = np.random.default_rng(2), [law.initial_state(4, 5) for law in (steel, OWN)]
    for size in (1e-3, 4e-3, -4e-3, 8e-3, 1e-4):
        strain = size * rng.normal(size=(4, 5, 6))
        found, exact = (law.evaluate(strain, s, 0.1) for law, s in zip((steel, OWN), states, strict=True))
        states = [found[2], exact[2]]
        assert np.abs(found[0] - exact[0]).max() < 1e-13 * 200e9 * 0.03
        assert np.abs(found[1] - exact[1]).max() < 1e-13 * 200e9
        p = exact[2]["accumulated_plastic_strain"]
        assert np.abs(found[2]["state_variables"] - p).max() < 1e-13 * max(p.max(), 1e-3)
    assert (p > 0).any()


def test_it_passes_the_kit(steel):
    assert_conforms(steel)


def test_a_model_of_it_yields_as_one_of_the_law_of_the_library(steel):
    results = []
    for law in (steel, OWN):
        model = kl.Model(kl.box((2, 1, 1), (2, 1, 1), "BBar3D8N"), law)
        model.fix("x-")
        model.fix("x+", "xz", lambda t: 0.02 * np.sin(2 * np.pi * t))
        analysis = model.quasi_static(tolerance=1e-12)
        for _ in kl.integrate(analysis, dt=0.25, steps=4):
            pass
        assert max(step.iterations for step in analysis.reports) < 8
        results.append(analysis.result())
    found, exact = results
    assert np.abs(found.u - exact.u).max() < 1e-10 * np.abs(exact.u).max()
    p = exact.field("accumulated_plastic_strain").max()
    assert abs(found.field("state_variables").max() / p - 1) < 1e-10


def test_what_the_subroutine_is_given(compiled):
    """Order and factors of components, time step, length and the first increment."""
    source = "for (int i = 0; i < 6; i++) { stress[i] += props[i] * dstran[i]; statev[i] = stran[i]; }"
    primes = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0]
    more = "stress[0] += *dtime; statev[6] = *celent; statev[7] = *kinc;"
    law = kl.UMAT(compiled(body(source + more)), primes, 8)
    strain = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    state = law.initial_state()
    stress, tangent, new = law.evaluate(strain, state, 17.0)
    C = np.diag([2.0, 3, 5, 7, 13, 11])  # yz is the last of Abaqus
    assert np.abs(stress - strain @ C - [17, 0, 0, 0, 0, 0]).max() < 1e-14
    assert np.abs(tangent - C).max() < 1e-6  # by differences, as DDSDDE is 0
    assert new["state_variables"].tolist() == [0, 0, 0, 0, 0, 0, 1, 1]
    new["element_length"] = np.array([0.5])
    last = law.evaluate(2 * strain, new, 17.0)[2]["state_variables"]
    assert last.tolist() == [0.1, 0.2, 0.3, 0.4, 0.6, 0.5, 0.5, 2]


def test_an_unsymmetric_ddsdde_is_taken_by_columns(compiled):
    law = kl.UMAT(compiled(body("for (int k = 0; k < 36; k++) ddsdde[k] = k;")), [], symmetric_tangent=False)
    tangent = law.evaluate(np.zeros(6), law.initial_state(), 1.0)[1]
    assert tangent[1, 0] == 1
    assert tangent[0, 1] == 6
    assert tangent[4, 5] == 5 + 6 * 4
    assert not law.symmetric_tangent


def test_a_smaller_step_is_what_pnewdt_asks_for(compiled):
    for part in (0.5, -1.0):
        source = f"for (int i = 0; i < 6; i++) stress[i] += dstran[i]; if (dstran[0] > 0.1) *pnewdt = {part};"
        law = kl.UMAT(compiled(body(source)), [])
        with pytest.raises(SolveError, match=f"smaller step, PNEWDT = {part:g}"):
            law.evaluate(np.full((3, 6), 0.2), law.initial_state(3), 1.0)
    bar = kl.Model(kl.box(element="KinematicLinear3D8N"), law)
    bar.fix("x-")
    bar.fix("x+", "x", lambda t: 0.3 * t)
    analysis = bar.quasi_static()
    for _ in kl.integrate(analysis, dt=1.0, steps=1):
        pass
    assert len(analysis.reports) >= 4  # three would stretch it by 0.1 each


@pytest.mark.parametrize(
    ("source", "constants", "count", "message"),
    [
        ("statev[2] = 1;", [], 2, "more state variables than 2; say how many"),
        ("stress[0] = props[1];", [1.0], 0, "not finite.*may need more constants"),
        ("", [1.0, np.nan], 0, "constants of a UMAT must be finite"),
        ("", ["E"], 0, "constants of a UMAT must be made of real numbers"),
        ("", 3.0, 0, "constants of a UMAT must have shape"),
        ("", [], -1, "state_variables must be a whole number"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(compiled, source, constants, count, message):
    with pytest.raises(MaterialError, match=message):
        kl.UMAT(compiled(body(source)), constants, count)


def test_a_library_that_does_not_fit_is_refused(compiled, tmp_path):
    (tmp_path / "text.so").write_text("SUBROUTINE UMAT")
    for path, message in (
        (tmp_path / "missing.so", "cannot be loaded.*missing.so.*compile it with gfortran"),
        (tmp_path / "text.so", "cannot be loaded.*text.so"),
        (compiled("int umat = 1;"), "no symbol umat_, that of SUBROUTINE UMAT"),
    ):
        with pytest.raises(MaterialError, match=message):
            kl.UMAT(path, [])
    with pytest.raises(MaterialError, match="density"):
        kl.UMAT(compiled(J2), CONSTANTS, 1, -1.0)
