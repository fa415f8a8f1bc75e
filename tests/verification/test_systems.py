"""Systems: what is made once and solved many times gives what a new model gives, whatever has changed."""

import numpy as np
import pytest
from meshes import changed_at

import kratos_lite as kl
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.solvers import constrained_system as system
from kratos_lite.solvers import plan
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.constraints import Constraints

STEEL = kl.Isotropic3D(E=2e9, nu=0.3, density=1000.0)
SOFT = kl.Isotropic3D(E=1e9, nu=0.2, density=500.0)
WIND = kl.Traction("x+", (3e4, 1e4, 0.0))
SNOW = kl.Pressure("z+", 2e4)


def block(cells=(3, 2, 2)):
    mesh = kl.box((3, 2, 2), cells)
    mesh = mesh.replace(points=changed_at(mesh.points, -1, mesh.points[-1] + 0.2))  # so that rules differ
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def close(a, b, digits=11):
    np.testing.assert_allclose(a, b, rtol=0, atol=10.0**-digits * max(np.abs(b).max(), 1e-300))


@pytest.fixture
def assembled(monkeypatch):
    """Count how often matrices are assembled."""
    count = []
    for name in ("assemble_dense", "assemble_stiffness"):
        right = getattr(system, name)

        def counted(*arguments, right=right, **options):
            count.append(1)
            return right(*arguments, **options)

        monkeypatch.setattr(system, name, counted)
    return count


@pytest.mark.parametrize("solver", ["dense", "direct", "amg"])
def test_load_cases_are_solved_with_one_matrix_and_add_up(solver, assembled):
    model = block()
    cases = {"wind": [WIND], "snow": [SNOW], "both": [WIND, SNOW], "own": model.loads}
    found = model.solve_cases(cases, solver, tolerance=1e-13)
    assert list(found) == list(cases)
    assert len(assembled) == 1
    close(found["both"].u, found["wind"].u + found["snow"].u)
    close(found["both"].reactions, found["wind"].reactions + found["snow"].reactions)
    np.testing.assert_array_equal(found["own"].u, model.solve(solver, tolerance=1e-13).u)
    for name, loads in cases.items():
        one = block()
        one.loads = list(loads)
        expected = one.solve(solver, tolerance=1e-13)
        close(found[name].u, expected.u)
        close(found[name].reactions, expected.reactions)
        close(found[name].loads, expected.loads)


def test_a_system_takes_the_loads_of_its_model_or_others_in_their_place(assembled):
    model = block()
    ready = model.static()
    own = ready.solve()
    np.testing.assert_array_equal(own.u, model.solve().u)
    wind = ready.solve([WIND])
    assert wind.report.total_load[2] == 0
    model.add(WIND)
    close(ready.solve().u, own.u + wind.u)
    assert len(assembled) == 2  # the system's, and that of model.solve()
    np.testing.assert_array_equal(ready.solve([]).u, 0.0)
    assert "check" in own.report.seconds
    assert "check" not in wind.report.seconds


def test_new_prescribed_values_are_taken_over_without_a_new_matrix(assembled):
    model = block()
    model.fix("z+", "x", 1e-3)
    model.constrain((4, "y"), {(7, "y"): 0.5, (35, "x"): 2.0}, 1e-4)  # the last one is on top
    ready = model.static()
    ready.solve()
    model.fix("z+", "x", -2e-3, override=True)
    again = ready.solve()
    assert len(assembled) == 1
    expected = model.solve()
    close(again.u, expected.u)
    close(again.reactions, expected.reactions)
    assert (again.displacement("z+")[:, 0] == -2e-3).all()
    assert again.u[4, 1] == pytest.approx(0.5 * again.u[7, 1] - 4e-3 + 1e-4, rel=1e-12)


CHANGES = {
    "material": lambda model: model.assign(SOFT, [0, 3]),
    "rule": lambda model: model.use_rule(4),
    "support": lambda model: model.fix("x+", "y"),
    "constraint": lambda model: model.constrain((34, "z"), {(35, "z"): 1.0}),
    "prestress": lambda model: model.add_prestress((1e6, 0, 0, 0, 0, 2e5), [1, 2]),
    "stress-free state": lambda model: model.set_stress_free_state(1e-3 * model.mesh.points[:, ::-1]),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_system_follows_whatever_changes_its_matrix(change, assembled):
    model = block()
    model.add_prestress((0, 1e5, 0, 0, 0, 0), [0])
    ready = model.static()
    before = ready.solve()
    change(model)
    after = ready.solve()
    assert len(assembled) == 2
    assert np.abs(after.u - before.u).max() > 1e-9 * np.abs(before.u).max()
    expected = model.solve()
    np.testing.assert_array_equal(after.u, expected.u)
    np.testing.assert_array_equal(after.reactions, expected.reactions)
    np.testing.assert_array_equal(after.stress(), expected.stress())


def test_a_change_that_breaks_the_model_is_found():
    model = block()
    ready = model.static()
    ready.solve()
    model.constrain((0, "x"), {}, 1e-3)
    for _ in range(2):  # it stays broken
        with pytest.raises(
            kl.ModelError, match=r"node 1 along x = 0\.001 m; node 1 along x = 0 m is prescribed"
        ):
            ready.solve()
    model.supports.constraints = Constraints.none()
    np.testing.assert_array_equal(ready.solve().u, model.solve().u)


def test_what_was_held_may_be_moved_later():
    """Elements with all nodes held at 0 are left out; they are needed once a value is prescribed there."""
    model = block((6, 2, 2))
    model.fix(lambda X: X[:, 0] < 1.1)
    ready = model.static()
    assert any("all their nodes are constrained" in text for text in ready.solve().report.skipped)
    model.fix(lambda X: X[:, 0] < 1e-9, "x", 1e-3, override=True)
    after, expected = ready.solve(), model.solve()
    close(after.u, expected.u)
    close(after.reactions, expected.reactions)


def test_a_matrix_too_large_is_refused_each_time(monkeypatch):
    """One part fits, both do not: what is refused must not be taken for solved."""
    monkeypatch.setattr(plan, "DENSE_MAX", 100)
    two = kl.box((4, 1, 1), (4, 2, 2))
    two = two.replace(blocks=[two.blocks[0].take(np.r_[0:4, 12:16])])
    model = kl.Model(two, STEEL)
    model.fix("z-")
    ready = model.static("dense")
    near, far = ([kl.Gravity((0, 0, -9.81), rows)] for rows in (np.arange(4), np.arange(4, 8)))
    first = ready.solve(near)
    assert first.u.any()
    for _ in range(2):
        with pytest.raises(kl.InputError, match="up to 100 degrees of freedom; got 108"):
            ready.solve(far)
    np.testing.assert_array_equal(ready.solve(near).u, first.u)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda model: model.solve_cases([WIND]), "load cases must map names to lists of loads; got list"),
        (lambda model: model.solve_cases({"wind": "x+"}), "a load, or a list of them, is needed; got str"),
        (
            lambda model: model.static().solve([1.0]),
            "a load such as Gravity or Traction is needed; got float",
        ),
        (lambda model: model.static(tolerance=2.0), "tolerance must be a number between 0 and 1"),
    ],
)
def test_wrong_cases_are_refused(wrong, words):
    with pytest.raises(kl.InputError, match=words):
        wrong(block())


def test_no_cases_have_no_results():
    assert block().solve_cases({}) == {}


@pytest.mark.parametrize("solver", ["dense", "direct"])
def test_equations_alone_reduce_expand_and_multiply(solver):
    model = block()
    model.constrain((35, "y"), {(34, "y"): 0.5}, 1e-4)
    mesh = kl.Mesh(np.vstack([model.mesh.points, [[9.0, 9.0, 9.0]]]), model.mesh.blocks)
    other = kl.Model(mesh, STEEL)
    for axis, fixed in zip("xyz", model.supports.fixed.T, strict=True):
        other.fix(np.flatnonzero(fixed), axis)
    supports = other.supports
    supports.constraints = model.supports.constraints
    one = ConstrainedSystem(mesh.points, model.element_groups(), supports.constraint_map, solver=solver)
    assert one.nodes.tolist() == list(range(36))
    rng = np.random.default_rng(4)
    q = rng.standard_normal(len(one.constraint_map.free))
    u = one.scatter(one.constraint_map.expand(q))
    assert u.shape == (37, 3)
    assert u[35, 1] == pytest.approx(0.5 * u[34, 1] + 1e-4)
    assert not u[supports.fixed].any()
    close(internal_load(mesh.points, model.element_groups(), u), one.residual(u, np.zeros_like(u)))
    f = rng.standard_normal(u.shape)
    f[-1] = 0.0
    one_by_one = f.copy()  # T^T f: the dependent hands its force to its independent
    one_by_one[34, 1] += 0.5 * f[35, 1]
    free = ~supports.fixed[:-1].ravel()
    free[3 * 35 + 1] = False
    reduce = one.constraint_map.reduce
    close(reduce(one.gather(f)), one_by_one[:-1].ravel()[free])
    solved, solution = one.solve(f)
    assert solution.method == solver
    np.testing.assert_allclose(reduce(one.gather(one.residual(solved, f))), 0, atol=1e-10)


def test_systems_of_one_model_share_the_pattern():
    model = block()
    first, second = model.static("direct"), model.static("direct")
    first.solve()
    second.solve()
    assert first.system.pattern is second.system.pattern
