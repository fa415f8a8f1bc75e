"""A class that overrides B or local_system is the class that runs; other overrides are refused."""

import numpy as np
import pytest
from rounding import close

import kratos_lite as kl
from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.stiffness import assemble_dense
from kratos_lite.elements import ELEMENTS
from kratos_lite.testing import assert_conforms

TRACE = np.array([1.0, 1, 1, 0, 0, 0])
PLAIN = kl.KinematicLinear3D8N
STEEL = kl.Isotropic3D(E=1e7, nu=0.4, density=1000.0)


@pytest.fixture(autouse=True)
def _registered():
    """Register the classes of this file while one of its tests runs."""
    with ELEMENTS.temporary():
        for kind in (BbarOfOne, BbarOfMany, BbarSystem, BbarSystems):
            ELEMENTS.add(kind.__name__, kind)
        yield


def dilated(B, center):
    """Return B with the dilatation of the center."""
    return B + TRACE[:, None] * (TRACE @ (center - B) / 3)[..., None, :]


def k_of(X, C):
    """Return K of B-bar in a loop over Gauss points."""
    cell, K = PLAIN(X), 0.0
    for xi, weight in cell.rule:
        B = dilated(cell.B(xi), cell.B(np.zeros(3)))
        K += B.T @ C @ B * weight * cell.detJ(xi)
    return K


with ELEMENTS.temporary():

    class BbarOfOne(PLAIN):
        """B-bar as a student writes it: one element, one point."""

        def B(self, xi):
            B = super().B(xi)
            return B + np.outer(TRACE, TRACE @ super().B(np.zeros(3)) - TRACE @ B) / 3

    class BbarOfMany(PLAIN):
        """B-bar of many elements, of a material that it does not need."""

        batched = True

        def B(self, xi, C):
            assert C.shape == (6, 6)
            return dilated(super().B(xi), super().B(np.zeros(3)))

    class BbarSystem(PLAIN):
        """K of B-bar by a loop of its own, and strains of B-bar."""

        def local_system(self, C, u):
            K = k_of(self.X, C)
            return K, (K @ u.ravel()).reshape(u.shape)

        def B(self, xi):
            return dilated(super().B(xi), super().B(np.zeros(3)))

    class BbarSystems(PLAIN):
        """The same of many elements."""

        batched = True

        def local_system(self, C, u):
            return BbarOfMany(self.X).local_system(C, u)

        def B(self, xi):
            return dilated(super().B(xi), super().B(np.zeros(3)))


BBARS = [BbarOfOne, BbarOfMany, BbarSystem, BbarSystems]


def cantilever(name, cells=(3, 2, 1), nu=0.4, shift=0.1):
    """Return a clamped beam under its weight, with corners moved."""
    mesh = kl.box((4, 1, 1), cells, name)
    points = mesh.points + shift * np.sin(7 * mesh.points[:, [1, 2, 0]]) * (mesh.points[:, :1] > 0)
    model = kl.Model(kl.Mesh(points, mesh.blocks), kl.Isotropic3D(E=1e7, nu=nu, density=1000.0))
    model.fix(points[:, 0] == 0)
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def by_hand(model):
    """Return K (3n, 3n) of B-bar in loops."""
    K = np.zeros((model.mesh.points.size,) * 2)
    for nodes in model.mesh.blocks[0].nodes:
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += k_of(model.mesh.points[nodes], model.element_groups()[0].material.C)
    return K


def solved(K, model, loads):
    """Return u (n, 3) of a clamped model by dense algebra."""
    free = ~model.supports.fixed.ravel()
    u = np.zeros(len(K))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], loads.ravel()[free])
    return u.reshape(-1, 3)


# ---- static ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("solver", "kind"), [*(("dense", kind) for kind in BBARS), ("direct", BbarOfMany), ("amg", BbarSystems)]
)
def test_a_model_of_a_custom_element_is_solved_with_it(kind, solver):
    model = cantilever(kind.__name__)
    result = model.solve(solver=solver)
    K = by_hand(model)
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


@pytest.mark.parametrize("name", ["BbarOfMany", "BbarSystems"])
def test_no_warning_of_locking_is_given_for_a_custom_element(name):
    texts = [cantilever(kind, nu=0.4999).solve().report.warnings for kind in (name, PLAIN.__name__)]
    assert ["lock" in " ".join(text) for text in texts] == [False, True]


@pytest.mark.parametrize("kind", BBARS)
def test_prestress_acts_by_the_own_B(kind):
    sigma = np.array([1e3, 2e3, -1e3, 500.0, 0, 300])
    model, twin = cantilever(kind.__name__), cantilever("BbarOfOne")
    for each in (model, twin):
        each.add_prestress(sigma)
    result = model.solve(solver="dense")
    close(result.u, twin.solve(solver="dense").u, 1e-9)
    close(result.stress(), result.strain() @ STEEL.C + sigma, 1e-12)
    assert result.report.force_error < 1e-10


# ---- time ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", BBARS)
def test_modes_and_matrices_are_those_of_the_custom_element(kind):
    from scipy.linalg import eigh

    model = cantilever(kind.__name__, (3, 1, 1))
    K, matrices = by_hand(model), model.matrices()
    close(matrices.K.toarray(), K, 1e-12)
    free = matrices.free
    exact = eigh(K[np.ix_(free, free)], matrices.M.toarray()[np.ix_(free, free)], eigvals_only=True)
    close(model.modes(5)[0], np.sqrt(exact[:5]), 1e-8)
    ids, nodes = model.mesh.element_ids, model.mesh.blocks[0].nodes
    close(model.local_system(int(ids[1])).K, k_of(model.mesh.points[nodes[1]], STEEL.C), 1e-12)


def test_the_critical_step_counts_every_element_where_B_depends_on_the_place():
    class Graded8N(PLAIN):
        def B(self, xi):
            return super().B(xi) * (1 + self.position(xi)[0])

    mesh = kl.box((8, 1, 1), (8, 1, 1), "Graded8N")
    groups = kl.Model(mesh, STEEL).element_groups()
    cells = Graded8N(mesh.points[mesh.blocks[0].nodes])
    m = cells.mass(STEEL.density)
    largest = max(
        np.linalg.eigvals(np.linalg.solve(a, b)).real.max()
        for a, b in zip(m, cells.stiffness(STEEL.C), strict=True)
    )
    assert finite_strain.highest_frequency(mesh.points, groups) == pytest.approx(np.sqrt(largest), rel=1e-9)


# ---- bodies --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", BBARS)
def test_large_displacements_refuse_a_custom_element_and_say_what_to_do(kind):
    mesh = kl.box((1, 1, 1), (1, 1, 1), kind.__name__)
    with pytest.raises(kl.KratosLiteError, match=f"{kind.__name__} has a B or local system of small strains"):
        kl.FiniteElementBody(mesh, STEEL)
    groups = kl.Model(mesh, STEEL).element_groups()
    for function in (
        finite_strain.internal_load,
        finite_strain.strain_energy,
        finite_strain.highest_frequency,
    ):
        with pytest.raises(kl.KratosLiteError, match="corotational"):
            function(mesh.points, groups, np.zeros_like(mesh.points))


@pytest.mark.parametrize("kind", BBARS)
@pytest.mark.parametrize("formulation", ["corotational", "modal"])
def test_a_corotational_body_has_the_stiffness_of_the_custom_element(formulation, kind):
    mesh = kl.box((2, 1, 1), (2, 1, 1), kind.__name__)
    body = kl.FiniteElementBody(mesh, STEEL, formulation=formulation)
    K = by_hand(kl.Model(mesh, STEEL))
    q = 1e-9 * np.random.default_rng(2).uniform(-1, 1, mesh.points.size)
    close(body.formulation.K0 @ q, K @ q, 1e-12)


# ---- B and local_system ------------------------------------------------------------------------------


def test_a_local_system_may_add_to_that_of_its_base():
    class Softened8N(PLAIN):
        def local_system(self, C, u):
            K, r = super().local_system(C, u)
            soft, forces = kl.BBar3D8N(self.X).local_system(C, u)
            return (K + soft) / 2, (r + forces) / 2

    assert_conforms(Softened8N)


def test_a_custom_B_may_add_to_one_that_depends_on_the_material():
    class Same10N(kl.BBar3D10N):
        def B(self, xi, C):
            return super().B(xi, C)

    X = Same10N.nodes + 0.02 * np.sin(np.arange(60.0)).reshape(2, 10, 3)[:1]
    close(Same10N(X).stiffness(STEEL.C), kl.BBar3D10N(X).stiffness(STEEL.C), 1e-14)
    close(Same10N(X).stiffness(STEEL.C[None]), kl.BBar3D10N(X).stiffness(STEEL.C[None]), 1e-14)


def test_a_B_for_one_element_sees_its_own_element():
    class Hole8N(PLAIN):
        def B(self, xi):
            soft = 0.4 < self.X[:, 0].mean() < 0.6
            return super().B(xi) * (0.1 if soft else 1.0)

    model = kl.Model(kl.box(cells=(5, 1, 1), element="Hole8N"), kl.Isotropic3D(E=1e6, nu=0.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (1e3, 0, 0)))
    tip = model.solve().u[:, 0].max()
    assert abs(tip - 1e-3 * (0.8 + 0.2 * 100)) < 1e-12  # K of the middle one is a hundredth


# ---- refusals --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "cure"),
    [
        ("N", "write it in the Shape"),
        ("dN", "write it in the Shape"),
        ("J", "override B"),
        ("dNdX", "override B"),
        ("_gauss", "give yours another name"),
        ("strain", "override B"),
        ("stress", "write a LinearMaterial with that C"),
        ("internal_force", "override local_system"),
        ("stiffness", "override local_system"),
        ("stiffness_by_axis", "override local_system"),
        ("K", "override local_system"),
        ("r_int", "override local_system"),
        ("r_ext", "state a mass_rule"),
        ("body_force", "state a mass_rule"),
        ("mass", "state a mass_rule"),
        ("lumped_mass", "state a mass_rule"),
        ("mass_rules", "give yours another name"),
        ("strain_tables", "give yours another name"),
        ("__init__", "override B"),
    ],
)
@pytest.mark.parametrize("base", [PLAIN, kl.KinematicLinear], ids=["element", "family"])
def test_what_is_overridden_and_would_not_be_used_is_refused(base, name, cure):
    with pytest.raises(kl.InputError, match=f"^Own overrides {name}, which analyses would not use; .*{cure}"):
        type("Own", (base,), {name: lambda self, *given: None})
    assert "Own" not in ELEMENTS


def test_a_mixin_and_a_built_in_helper_are_refused_too():
    class Mixin:
        def stress(self, C, u):
            return 0.0

    with pytest.raises(kl.InputError, match="Own overrides stress"):
        type("Own", (Mixin, PLAIN), {})
    with pytest.raises(kl.InputError, match="Own overrides kept"):
        type("Own", (kl.BBar3D10N,), {"kept": lambda self, C: 0.0})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            lambda K, u, r: (K, r + r**2),
            "Own.local_system is not linear: at a random u, r_int is not K u",
        ),
        (lambda K, u, r: (K * (1 + abs(u).max()), r * (1 + abs(u).max())), "is not linear"),
        (lambda K, u, r: (K, r + 1.0), "is not linear"),
        (lambda K, u, r: (np.triu(K), (np.triu(K) @ u.ravel()).reshape(8, 3)), "K that is not symmetric"),
        (lambda K, u, r: K, r"must return K and r_int; got array\(\[\["),
        (lambda K, u, r: (K[:23], r), r"must return numbers of shape \(24, 24\) here; got \(23, 24\)"),
        (lambda K, u, r: (K, r.ravel()), r"must return numbers of shape \(8, 3\) here; got \(24,\)"),
        (lambda K, u, r: (K * np.nan, r), r"numbers of shape \(24, 24\) here; got nan"),
        (lambda K, u, r: (K, "r"), r"numbers of shape \(8, 3\) here; got 'r'"),
    ],
)
def test_a_wrong_local_system_is_refused(change, text):
    class Own(PLAIN):
        def local_system(self, C, u):
            K, r = super().local_system(C, u)
            return change(K, u, r)

    with pytest.raises(kl.InputError, match=text):
        cantilever("Own").solve()


def test_a_local_system_that_calls_itself_is_refused():
    class Own(PLAIN):
        def local_system(self, C, u):
            return self.stiffness(C), u

    with pytest.raises(kl.InputError, match=r"calls itself through stiffness; take super\(\)"):
        cantilever("Own").solve()


@pytest.mark.parametrize(
    ("change", "batched", "text"),
    [
        (
            lambda e, B: B[..., :5, :],
            False,
            r"Own.B must return numbers of shape \(6, 24\) here; got \(5, 24\)",
        ),
        (lambda e, B: B * np.nan, False, r"Own.B must return numbers of shape \(6, 24\) here; got nan"),
        (lambda e, B: None, False, "Own.B must return numbers of shape"),
        (
            lambda e, B: [[1.0], [1.0, 2.0]],
            False,
            r"Own.B must return numbers of shape \(6, 24\) here; got \[",
        ),
        (lambda e, B: B * (1 + e.X.reshape(-1, 3)[[0, -1], 0].sum()), True, "gives other values for many"),
        (
            lambda e, B: B * (e.dV @ np.ones((8, 8)) @ e.dV),
            True,
            r"^Own\.B fails for many .*leave out batched",
        ),
    ],
)
def test_a_wrong_B_is_refused(change, batched, text):
    kind = {"B": lambda self, xi: change(self, PLAIN.B(self, xi)), "batched": batched}
    type("Own", (PLAIN,), kind)
    with pytest.raises(kl.InputError, match=text):
        cantilever("Own").solve()
