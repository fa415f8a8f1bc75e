"""Periodic cells: mean strains by constants alone, effective stiffness of laminates and of inclusions."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.static import StaticAnalysis

SOFT, HARD = kl.Isotropic3D(E=3e9, nu=0.35), kl.Isotropic3D(E=70e9, nu=0.2)
SIDES = (("x-", "x+"), ("y-", "y+"), ("z-", "z+"))


def cell(mesh, material=SOFT, **options):
    model = kl.Model(mesh, material, **options)
    for a, b in SIDES:
        model.periodic(a, b)
    return model


def laminate(element="KinematicLinear3D8N"):
    """Return layers along z: 1/4 of them hard."""
    mesh = kl.box((0.3, 0.2, 1.0), (2, 2, 4), element)
    model = cell(mesh, formulation="standard")
    heights = np.concatenate([mesh.points[b.nodes][:, :, 2].mean(axis=1) for b in mesh.blocks])
    model.assign(HARD, np.flatnonzero(heights > 0.75))
    return model


def laminated(C1, C2, fraction):
    """Return C of layers normal to z: stress across and strain along are the same in all of them."""
    across, along = [2, 4, 5], [0, 1, 3]
    nn = [np.linalg.inv(C[np.ix_(across, across)]) for C in (C1, C2)]
    nt = [C[np.ix_(across, along)] for C in (C1, C2)]
    w, mean = (1 - fraction, fraction), np.zeros((6, 6))
    N = np.linalg.inv(sum(f * a for f, a in zip(w, nn, strict=True)))
    B = sum(f * a @ b for f, a, b in zip(w, nn, nt, strict=True))
    tt = [C[np.ix_(along, along)] - b.T @ a @ b for C, a, b in zip((C1, C2), nn, nt, strict=True)]
    mean[np.ix_(across, across)], mean[np.ix_(across, along)] = N, N @ B
    mean[np.ix_(along, across)] = (N @ B).T
    mean[np.ix_(along, along)] = sum(f * t for f, t in zip(w, tt, strict=True)) + B.T @ N @ B
    return mean


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D20N", "KinematicLinear3D4N"])
def test_a_laminate_is_exact(element):
    exact = laminated(SOFT.C, HARD.C, 0.25)
    assert np.abs(kl.homogenized(laminate(element)) - exact).max() < 1e-11 * exact.max()


def sphere(n=6, fraction=0.2):
    """Return a cube with a hard ball of about this volume in its middle, whose cells are whole."""
    mesh = kl.box(cells=(n, n, n), element="KinematicLinear3D8N")
    centers = mesh.points[mesh.blocks[0].nodes].mean(axis=1) - 0.5
    ball = np.linalg.norm(centers, axis=1) < (3 * fraction / (4 * np.pi)) ** (1 / 3)
    model = cell(mesh)
    model.assign(HARD, np.flatnonzero(ball))
    return model, ball.mean()


def moduli(C):
    """Return bulk modulus and the two shear moduli of cubic symmetry."""
    return (C[0, 0] + 2 * C[0, 1]) / 3, C[3, 3], (C[0, 0] - C[0, 1]) / 2


def hashin_shtrikman(f):
    """Return the bounds of bulk and shear modulus with a fraction of `HARD`."""
    # Source: Hashin & Shtrikman, J. Mech. Phys. Solids 11 (1963) 127-140.
    (k1, g1, _), (k2, g2, _) = moduli(SOFT.C), moduli(HARD.C)

    def bound(ka, ga, kb, gb, fb):
        fa = 1 - fb
        k = ka + fb / (1 / (kb - ka) + 3 * fa / (3 * ka + 4 * ga))
        shear = ga + fb / (1 / (gb - ga) + 6 * fa * (ka + 2 * ga) / (5 * ga * (3 * ka + 4 * ga)))
        return k, shear

    return bound(k1, g1, k2, g2, f), bound(k2, g2, k1, g1, 1 - f)


def test_a_cell_with_a_ball_is_cubic_and_within_bounds():
    model, f = sphere()
    C = kl.homogenized(model)
    assert np.abs(C - C.T).max() < 1e-8 * C.max()
    for turn in ([1, 2, 0, 4, 5, 3], [1, 0, 2, 3, 5, 4]):
        assert np.abs(C[np.ix_(turn, turn)] - C).max() < 1e-8 * C.max()
    k, g, g2 = moduli(C)
    (k_low, g_low), (k_high, g_high) = hashin_shtrikman(f)
    assert k_low < k < k_high
    assert g_low < min(g, g2) < max(g, g2) < g_high
    voigt = (1 - f) * SOFT.C + f * HARD.C
    reuss = np.linalg.inv((1 - f) * np.linalg.inv(SOFT.C) + f * np.linalg.inv(HARD.C))
    assert np.linalg.eigvalsh(voigt - C).min() > 0
    assert np.linalg.eigvalsh(C - reuss).min() > 0


def within(low, high):
    return lambda X: ((X > low) & (X < high)).all(axis=1)


def test_a_rigid_inclusion_is_one_of_a_stiff_material():
    mesh = kl.box(cells=(4, 4, 4))
    rigid, stiff = cell(mesh), cell(mesh)
    rigid.rigid(within(0.2, 0.8), (0.5, 0.5, 0.5))
    centers = mesh.points[mesh.blocks[0].nodes].mean(axis=1)
    stiff.assign(kl.Isotropic3D(E=1e15, nu=0.3), np.flatnonzero(within(0.2, 0.8)(centers)))
    C = kl.homogenized(rigid)
    assert np.abs(C - kl.homogenized(stiff)).max() < 1e-4 * C.max()


def test_springs_inside_store_energy_and_what_displaces_the_cell_does_not_count():
    model = cell(kl.box(cells=(4, 4, 4)))
    model.add(kl.ElasticSupport((0.25, 0.5, 0.5), (1e9, 0, 0), to=(0.75, 0.5, 0.5)))
    C = kl.homogenized(model)
    model.periodic("x-", "x+", strain=(1, 0, 0, 0, 0, 0))
    result = model.solve()
    assert abs(C[0, 0] / (2 * result.energy()) - 1) < 1e-9
    assert C[0, 0] > SOFT.C[0, 0] + 1e7
    tied = []
    for constant in (0.0, 0.5):
        other = cell(kl.box(cells=(4, 4, 4)))
        other.constrain((62, "x"), {(63, "x"): 1.0}, constant)
        tied.append(kl.homogenized(other))
    assert np.abs(tied[1] - tied[0]).max() < 1e-9 * SOFT.C.max()
    assert np.abs(tied[0] - SOFT.C).max() > 1e6


def test_six_strains_use_one_matrix(monkeypatch):
    made = []
    plain = StaticAnalysis._equations_of

    def counted(self, moving):
        before, equations = self._equations, plain(self, moving)
        made.append(equations.system is not getattr(before, "system", None))
        return equations

    monkeypatch.setattr(StaticAnalysis, "_equations_of", counted)
    kl.homogenized(laminate())
    assert made == [True] + 5 * [False]


def test_the_mean_strain_of_the_displacement_is_the_one_given():
    """Any of the supports, and none, hold the cell: nothing but the translation differs."""
    G = np.array([[1.0, 0.5, -0.3], [0.2, -0.7, 0.4], [0.1, 0.6, 0.3]]) * 1e-3
    stresses = []
    for node in (None, 0, 17, 44):  # nodes of the corner, an edge and the corner opposite
        model = laminate()
        if node is not None:
            model.fix([node], "xyz", (1e-3, -2e-3, 5e-4))
        for a, b in SIDES:
            model.periodic(a, b, strain=G)
        result = model.solve()
        X, u = model.mesh.points, result.u
        for a, b in (("x-", "x+"), ("y-", "y+"), ("z-", "z+")):
            way = X[model.mesh.nodes(b)] - X[model.mesh.nodes(a)]
            assert np.abs(result.displacement(b) - result.displacement(a) - way @ G.T).max() < 1e-14
        if node is not None:
            assert np.abs(u[node] - (1e-3, -2e-3, 5e-4)).max() < 1e-16
        stresses.append(result.stress())
    for stress in stresses[1:]:
        assert np.abs(stress - stresses[0]).max() < 1e-10 * np.abs(stresses[0]).max()


def test_supports_of_a_pair_agree_with_the_strain_or_are_refused():
    model = laminate()
    model.periodic("x-", "x+", strain=(1e-3, 0, 0, 0, 0, 0))
    model.fix((0.0, 0.0, 0.0), "xyz")
    model.fix((0.3, 0.0, 0.0), "x", 0.3e-3)
    assert np.isfinite(model.solve().u).all()
    model.fix((0.3, 0.0, 0.0), "x", 0.2e-3, override=True)
    with pytest.raises(kl.ModelError, match=r"node 31 along x = node 1 along x \+ 0\.0003 m; node 1"):
        model.solve()


def test_the_strain_of_a_cell_is_kept_and_said():
    model = laminate()
    model.periodic("x-", "x+", strain=(1e-3, 0, 0, 2e-4, 0, 0))
    before, version = str(model), model.version
    assert "x- and x+, y- and y+, z- and z+ periodic, mean gradient (0.001, 0.0001, 0, 0.0001, 0" in before
    kl.homogenized(model)
    assert (str(model), model.version) == (before, version)


def only_two():
    model = kl.Model(kl.box(cells=(2, 2, 2)), SOFT)
    for a, b in SIDES[:2]:
        model.periodic(a, b)
    return model


def held():
    model = cell(kl.box(cells=(2, 2, 2)))
    model.fix("x-")
    return model


def stressed():
    model = cell(kl.box(cells=(2, 2, 2)))
    model.add_prestress((1e6, 0, 0, 0, 0, 0))
    return model


def grounded():
    model = cell(kl.box(cells=(2, 2, 2)))
    model.add(kl.ElasticSupport((0.5, 0.5, 0.5), (1e6, 1e6, 1e6)))
    return model


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (grounded, "springs hold the cell to the ground"),
        (lambda: kl.Model(kl.box(), SOFT), "three pairs of periodic parts along three directions; got 0"),
        (only_two, "got 2"),
        (held, "hold more of the cell than one node"),
        (stressed, "initial stress"),
        (lambda: cell(kl.box(), kl.J2Plasticity3D(E=1e9, nu=0.3, yield_stress=1e6)), "linear laws"),
    ],
)
def test_what_is_no_cell_is_refused(make, message):
    with pytest.raises(kl.ModelError, match=message):
        kl.homogenized(make())


@pytest.mark.parametrize(
    ("a", "b", "options", "message"),
    [
        ("x-", "x-", {}, "one part twice"),
        ("x-", (1.0, 1.0, 1.0), {}, "there are 9 and 1, not in the same places"),
        ("x-", "y+", {}, "there are 9 and 9, not in the same places: mesh both faces alike"),
        ("x-", "x+", {"strain": (1, 2, 3)}, "a mean strain is xx yy zz xy yz zx, or"),
        ("x-", "x+", {"strain": np.full(6, np.nan)}, "a mean strain"),
        ("x-", "left", {}, "there is no part 'left'"),
    ],
)
def test_what_is_no_periodic_pair_is_refused(a, b, options, message):
    model = kl.Model(kl.box(cells=(2, 2, 2)), SOFT)
    with pytest.raises(kl.KratosLiteError, match=message):
        model.periodic(a, b, **options)


def test_doubled_nodes_of_a_periodic_pair_are_named():
    halves = kl.split(kl.box(cells=(2, 2, 2)), lambda X: X[:, 2] == 0.5)
    with pytest.raises(kl.ModelError, match=r"one node at each place; nodes \d+, \d+ are at one: mesh all"):
        kl.Model(halves, SOFT).periodic("x-", "x+")
