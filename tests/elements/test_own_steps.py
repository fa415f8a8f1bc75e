"""An element class that overrides a step is the class that runs, in every analysis."""

import numpy as np
import pytest
from rounding import close

import kratos_lite as kl
from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.nodal_values import extrapolation
from kratos_lite.assembly.stiffness import assemble_dense
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.overridden_steps import stiffness_of

TRACE = np.array([1.0, 1, 1, 0, 0, 0])
PLAIN = kl.KinematicLinear3D8N
STEEL = kl.Isotropic3D(E=1e7, nu=0.4, density=1000.0)


@pytest.fixture(autouse=True)
def _registered():
    """Register the classes of this file while one of its tests runs."""
    with ELEMENTS.temporary():
        for kind in (BbarOfOne, BbarOfMany, BbarAtPoints, BbarStrain, Graded):
            ELEMENTS.add(kind.__name__, kind)
        yield


def dilated(B, center):
    """Return B with the dilatation of the center."""
    return B + TRACE[:, None] * (TRACE @ (center - B) / 3)[..., None, :]


with ELEMENTS.temporary():

    class BbarOfOne(PLAIN):
        """B-bar as a student writes it: one element, one point."""

        def B(self, xi):
            B = super().B(xi)
            return B + np.outer(TRACE, TRACE @ super().B(np.zeros(3)) - TRACE @ B) / 3

    class BbarOfMany(PLAIN):
        """B-bar of many elements at many points."""

        def B(self, xi):
            B, center = super().B(xi), super().B(np.zeros(3))
            return dilated(B, center.reshape(*self.X.shape[:-2], *(1,) * (np.ndim(xi) - 1), 6, 24))

    class BbarAtPoints(PLAIN):
        """B-bar at the Gauss points."""

        def B_at_gauss_points(self, C=None):
            return dilated(super().B_at_gauss_points(C), super().B(np.zeros((1, 3))))

    class BbarStrain(PLAIN):
        """B-bar by its strain, of one element."""

        def strain(self, u):
            e, center = super().strain(u), self.B(np.zeros(3)) @ np.ravel(u)
            return e + np.outer(TRACE @ center - e @ TRACE, TRACE) / 3

    class Graded(PLAIN):
        """C grows along x, point by point: C (1 + x)."""

        def stress(self, C, u):
            return super().stress(C, u) * (1 + self.gauss_points()[..., :1])


BBARS = [BbarOfOne, BbarOfMany, BbarAtPoints, BbarStrain]


def cantilever(name, cells=(4, 2, 2), nu=0.4, shift=0.1):
    """Return a clamped beam under its weight, with corners moved."""
    mesh = kl.box((4, 1, 1), cells, name)
    points = mesh.points + shift * np.sin(7 * mesh.points[:, [1, 2, 0]]) * (mesh.points[:, :1] > 0)
    model = kl.Model(kl.Mesh(points, mesh.blocks), kl.Isotropic3D(E=1e7, nu=nu, density=1000.0))
    model.fix(points[:, 0] == 0)
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def by_hand(model, C, factor=lambda x: 1.0):
    """Return K (3n, 3n) and places of Gauss points: Σ B^T C B det J of B-bar, or of the plain B, in loops."""
    n = model.mesh.n_nodes
    K, kind = np.zeros((3 * n, 3 * n)), model.mesh.blocks[0].name
    for nodes in model.mesh.blocks[0].nodes:
        cell = PLAIN(model.mesh.points[nodes])
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        for xi, weight in cell.rule:
            B = cell.B(xi)
            if kind.startswith("Bbar"):
                B = dilated(B, cell.B(np.zeros(3)))
            scale = factor(cell.position(xi)[0])
            K[np.ix_(dofs, dofs)] += scale * B.T @ C @ B * weight * cell.detJ(xi)
    return K


def solved(K, model, loads):
    """Return u (n, 3) of a clamped model by dense algebra."""
    free = ~model.supports.fixed.ravel()
    u = np.zeros(len(K))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], loads.ravel()[free])
    return u.reshape(-1, 3)


# ---- static ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", BBARS)
@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_a_model_of_an_own_B_is_solved_with_it(kind, solver):
    model = cantilever(kind.__name__)
    result = model.solve(solver=solver)
    K = by_hand(model, model.element_groups()[0].material.C)
    u = solved(K, model, result.loads)
    close(result.u, u, 1e-7)
    close(assemble_dense(model.mesh.points, model.element_groups()), K, 1e-12)
    assert result.energy() == pytest.approx(u.ravel() @ K @ u.ravel() / 2, rel=1e-6)
    assert result.report.force_error < 1e-8


@pytest.mark.parametrize("kind", BBARS)
def test_strains_stresses_and_loads_are_those_of_the_own_B(kind):
    model = cantilever(kind.__name__)
    result = model.solve(solver="dense")
    C = model.element_groups()[0].material.C
    forces = np.zeros_like(result.u)
    strains, stresses = result.strain("gauss"), result.stress("gauss")
    for nodes, strain, stress in zip(model.mesh.blocks[0].nodes, strains, stresses, strict=True):
        cell = PLAIN(model.mesh.points[nodes])
        for (xi, weight), e, s in zip(cell.rule, strain, stress, strict=True):
            B = dilated(cell.B(xi), cell.B(np.zeros(3)))
            close(e, B @ result.u[nodes].ravel(), 1e-11)
            close(s, C @ e, 1e-12)
            forces[nodes] += (B.T @ s * weight * cell.detJ(xi)).reshape(8, 3)
    close(forces, result.loads + result.reactions, 1e-10)
    means = np.einsum("mgi,mg->mi", stresses, PLAIN(model.mesh.points[model.mesh.blocks[0].nodes]).dV)
    volumes = PLAIN(model.mesh.points[model.mesh.blocks[0].nodes]).volume()
    close(result.stress("element"), means / volumes[:, None], 1e-12)


def test_a_B_bar_beam_bends_where_the_plain_element_locks():
    q, L, E, G = 9810.0, 4.0, 1e7, 1e7 / 2.9998
    exact = q * L**4 / (8 * E / 12) + q * L**2 / (2 * 5 / 6 * G)  # Timoshenko, clamped, own weight
    own, plain = (
        abs(cantilever(name, (8, 2, 2), 0.4999, 0.0).solve().u[:, 2]).max()
        for name in ("BbarOfMany", "KinematicLinear3D8N")
    )
    assert abs(own / exact - 1) < 0.15
    assert plain < 0.15 * exact


def test_no_warning_of_locking_is_given_for_an_own_B():
    texts = [cantilever(name, nu=0.4999).solve().report.warnings for name in ("BbarOfMany", PLAIN.__name__)]
    assert ["lock" in " ".join(text) for text in texts] == [False, True]


def test_C_that_grows_along_a_bar_stretches_it_by_the_logarithm():
    bar = kl.Model(kl.box((1, 0.2, 0.2), (40, 1, 1), "Graded"), kl.Isotropic3D(E=1e6, nu=0.0))
    bar.fix("x-")
    bar.add(kl.Traction("x+", (500.0, 0, 0)))
    result = bar.solve()
    u = 500.0 / 1e6 * np.log(2)
    assert result.u[bar.mesh.nodes("x+"), 0].mean() == pytest.approx(u, rel=1e-4)
    close(result.stress("element")[:, 0], np.full(40, 500.0), 1e-4)
    assert result.energy() == pytest.approx(500.0 * 0.04 * u / 2, rel=1e-4)
    assert result.totals()[1] == pytest.approx(500.0, rel=0.02)
    K = by_hand(bar, bar.element_groups()[0].material.C, lambda x: 1 + x)
    close(result.u, solved(K, bar, result.loads), 1e-9)
    assert result.report.force_error < 1e-10


def test_a_stress_of_its_own_is_that_of_points_nodes_and_prestress():
    model = cantilever("Graded")
    sigma = np.array([1e3, 2e3, -1e3, 500.0, 0, 300])
    model.add_prestress(sigma)
    result = model.solve(solver="dense")
    x = PLAIN(model.mesh.points[model.mesh.blocks[0].nodes]).gauss_points()[..., :1]
    C = model.element_groups()[0].material.C
    close(result.stress(), result.strain() @ C * (1 + x) + sigma, 1e-12)
    total, nodes = np.zeros((model.mesh.n_nodes, 6)), model.mesh.blocks[0].nodes
    np.add.at(total, nodes, extrapolation(PLAIN, PLAIN.rule) @ result.stress())
    close(result.stress("averaged"), total / np.bincount(nodes.ravel())[:, None], 1e-12)
    assert result.report.force_error < 1e-10


# ---- time ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [BbarOfOne, Graded])
def test_modes_and_matrices_are_those_of_the_own_steps(kind):
    from scipy.linalg import eigh

    model = cantilever(kind.__name__, (3, 1, 1))
    factor = (lambda x: 1 + x) if kind is Graded else (lambda x: 1.0)
    K = by_hand(model, model.element_groups()[0].material.C, factor)
    matrices = model.matrices()
    close(matrices.K.toarray(), K, 1e-12)
    free = matrices.free
    exact = eigh(K[np.ix_(free, free)], matrices.M.toarray()[np.ix_(free, free)], eigvals_only=True)
    close(model.modes(5)[0], np.sqrt(exact[:5]), 1e-8)


@pytest.mark.parametrize("kind", [BbarOfOne, BbarOfMany, Graded])
def test_a_local_system_is_that_of_the_own_steps(kind):
    model = cantilever(kind.__name__, (2, 1, 1))
    ids, nodes = model.mesh.element_ids, model.mesh.blocks[0].nodes
    K = model.local_system(int(ids[1])).K
    close(K, kind(model.mesh.points[nodes[1]]).stiffness(model.element_groups()[0].material.C), 1e-12)


def test_the_critical_step_counts_every_element_where_C_depends_on_the_place():
    mesh = kl.box((8, 1, 1), (8, 1, 1), "Graded")
    groups = kl.Model(mesh, STEEL).element_groups()
    cells = Graded(mesh.points[mesh.blocks[0].nodes])
    m = cells.mass(STEEL.density)
    largest = max(
        np.linalg.eigvals(np.linalg.solve(a, b)).real.max()
        for a, b in zip(m, cells.stiffness(STEEL.C), strict=True)
    )
    assert finite_strain.highest_frequency(mesh.points, groups) == pytest.approx(np.sqrt(largest), rel=1e-9)


# ---- bodies --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "step"), [(BbarOfOne, "B"), (BbarStrain, "strain"), (Graded, "stress")])
def test_large_displacements_refuse_a_small_strain_step_and_say_what_to_do(kind, step):
    mesh = kl.box((1, 1, 1), (1, 1, 1), kind.__name__)
    with pytest.raises(kl.KratosLiteError, match=f"{kind.__name__} overrides {step}: a small-strain step"):
        kl.FiniteElementBody(mesh, STEEL)
    groups = kl.Model(mesh, STEEL).element_groups()
    for function in (
        finite_strain.internal_load,
        finite_strain.strain_energy,
        finite_strain.highest_frequency,
    ):
        with pytest.raises(kl.KratosLiteError, match="corotational"):
            function(mesh.points, groups, np.zeros_like(mesh.points))


@pytest.mark.parametrize("formulation", ["corotational", "modal"])
def test_a_corotational_body_has_the_stiffness_of_the_own_steps(formulation):
    mesh = kl.box((2, 1, 1), (2, 1, 1), "BbarOfOne")
    body = kl.FiniteElementBody(mesh, STEEL, formulation=formulation)
    K = by_hand(kl.Model(mesh, STEEL), STEEL.C)
    q = 1e-9 * np.random.default_rng(2).uniform(-1, 1, mesh.points.size)
    close(body.formulation.K0 @ q, K @ q, 1e-12)


# ---- geometry --------------------------------------------------------------------------------------


def test_own_gradients_are_those_of_strain_stiffness_and_large_displacements():
    class Doubled8N(PLAIN):
        def dNdX(self, xi):
            return 2 * super().dNdX(xi)

    mesh = kl.box((1, 1, 1), (2, 1, 1))
    X, u = mesh.points[mesh.blocks[0].nodes], 1e-3 * mesh.points[mesh.blocks[0].nodes] ** 2
    own, plain = Doubled8N(X), PLAIN(X)
    close(own.strain(u), 2 * plain.strain(u), 1e-12)
    close(own.stiffness(STEEL.C), 4 * plain.stiffness(STEEL.C), 1e-12)
    close(own.B([[0.1, 0.2, 0.3]]), 2 * plain.B([[0.1, 0.2, 0.3]]), 1e-12)
    own, plain = (kl.Model(kl.box((1, 1, 1), (2, 1, 1), kind.__name__), STEEL) for kind in (Doubled8N, PLAIN))
    q = 1e-3 * mesh.points**2
    loads = [
        finite_strain.internal_load(mesh.points, m.element_groups(), f * q) for m, f in ((own, 1), (plain, 2))
    ]
    close(loads[0], 2 * loads[1], 1e-12)


def test_an_own_jacobian_is_that_of_volume_mass_and_stiffness():
    class Stretched8N(PLAIN):
        def J(self, xi):
            return 2 * super().J(xi)

    model = cantilever("KinematicLinear3D8N", (2, 1, 1))
    X = model.mesh.points[model.mesh.blocks[0].nodes]
    own, twice = Stretched8N(X), PLAIN(2 * X)
    close(own.volume(), twice.volume(), 1e-12)
    close(own.mass(3.0), twice.mass(3.0), 1e-12)
    close(own.lumped_mass(3.0), twice.lumped_mass(3.0), 1e-12)
    close(own.body_force((1, 2, 3)), twice.body_force((1, 2, 3)), 1e-12)
    close(own.stiffness(STEEL.C), twice.stiffness(STEEL.C), 1e-12)


# ---- refusals --------------------------------------------------------------------------------------


def test_a_strain_that_is_not_linear_is_refused():
    class Green8N(PLAIN):
        def strain(self, u):
            e = super().strain(u)
            return e + e**2

    with pytest.raises(kl.InputError, match=r"Green8N.strain is not linear in u"):
        cantilever("Green8N").solve()


def test_a_stress_that_is_not_linear_is_refused():
    class Hard8N(PLAIN):
        def stress(self, C, u):
            s = super().stress(C, u)
            return s * np.abs(s)

    with pytest.raises(kl.InputError, match=r"Hard8N.stress is not linear in u"):
        cantilever("Hard8N").solve()


def test_a_stress_without_energy_is_refused():
    class Odd8N(PLAIN):
        def stress(self, C, u):
            return super().stress(C + 0.1 * np.triu(C), u)

    with pytest.raises(kl.ModelError, match="stiffness of Odd8N is not symmetric"):
        cantilever("Odd8N").solve()


def test_a_stiffness_that_is_not_that_of_the_stresses_is_refused():
    class Soft8N(PLAIN):
        def stiffness(self, C):
            return 0.5 * super().stiffness(C)

    with pytest.raises(kl.SolveError, match="stiffness is not that of its stresses"):
        cantilever("Soft8N").solve()


def test_steps_for_one_element_see_their_own_element():
    class Hole8N(PLAIN):
        def B(self, xi):
            soft = 0.4 < self.X[:, 0].mean() < 0.6
            return super().B(xi) * (0.1 if soft else 1.0)

    model = kl.Model(kl.box(cells=(5, 1, 1), element="Hole8N"), kl.Isotropic3D(E=1e6, nu=0.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (1e3, 0, 0)))
    tip = model.solve().u[:, 0].max()
    assert abs(tip - 1e-3 * (0.8 + 0.2 * 100)) < 1e-12  # K of the middle one is a hundredth


def test_a_batched_step_that_is_not_one_is_refused():
    class First8N(PLAIN):
        batched = True

        def B(self, xi):
            return super().B(xi) * (1 + self.X.reshape(-1, 3)[0, 0] + self.X.reshape(-1, 3)[-1, 0])

    with pytest.raises(kl.InputError, match="gives other values for many elements than for one"):
        cantilever("First8N").solve()


def test_a_batched_step_that_fails_for_many_elements_is_named_with_the_cure():
    class Single8N(PLAIN):
        batched = True

        def B_at_gauss_points(self, C):
            B = super().B_at_gauss_points(C)
            return B * (np.tensordot(self.dV, B, axes=1) ** 0).mean()  # dV (8,) of one element alone

    with pytest.raises(
        kl.InputError, match=r"^Single8N\.B_at_gauss_points fails for many .*leave out batched"
    ):
        cantilever("Single8N").solve()


def test_a_stiffness_that_is_no_number_is_named_so():
    class Nothing8N(PLAIN):
        def B(self, xi):
            return super().B(xi) * np.nan

    with pytest.raises(kl.ModelError, match="the stiffness of Nothing8N holds nan or inf"):
        cantilever("Nothing8N").solve()


def test_an_own_b_that_is_not_that_of_the_gauss_points_gives_no_stress_at_points():
    class Two8N(PLAIN):
        def B(self, xi):
            return super().B(xi)

        def B_at_gauss_points(self, C=None):
            return 2 * super().B_at_gauss_points(C)

    result = cantilever("Two8N").solve()
    with pytest.raises(kl.InputError, match="is not that of its strain at the Gauss points"):
        _ = result.at([result.mesh.points.mean(axis=0)]).stress


def test_a_step_of_the_wrong_shape_is_refused():
    class Flat8N(PLAIN):
        def B(self, xi):
            return super().B(xi)[..., :5, :]

    with pytest.raises(kl.InputError, match=r"Flat8N.B must return shape \(6, 24\) here"):
        cantilever("Flat8N").solve()


def test_a_class_that_mixes_its_elements_is_computed_one_by_one():
    class Mixed8N(PLAIN):
        def stiffness(self, C):
            return super().stiffness(C)[::-1]

    class Own8N(PLAIN):
        def stiffness(self, C):
            K = super().stiffness(C)
            return K[::-1] if K.ndim > 2 else K

    X = cantilever("KinematicLinear3D8N").mesh
    X = X.points[X.blocks[0].nodes]
    by_axis = np.array([PLAIN(x).stiffness_by_axis(STEEL.C) for x in X])
    close(stiffness_of(Own8N(X), STEEL.C), by_axis, 1e-12)
