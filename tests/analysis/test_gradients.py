"""Derivatives of quantities: against central differences, closed forms, and what is refused."""

import pickle

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh.refinement import refine
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.surface import ConditionLoads
from kratos_lite.shapes import SHAPES

MESHES = {
    "8N": "KinematicLinear3D8N",
    "10N": "KinematicLinear3D10N",
    "20N": "KinematicLinear3D20N",
    "enhanced": "EnhancedStrain3D8N",
    "b_bar": "BBar3D8N",
    "hanging": "KinematicLinear3D8N",
}
QUANTITIES = ("displacement", "mean", "reaction", "stress", "compliance")


class Case:
    """A random model, as a function of moduli, densities, factors of loads and coordinates."""

    def __init__(self, kind, moves):
        rng = np.random.default_rng(len(kind))
        mesh = kl.box((2.0, 1.0, 0.8), (1 if kind == "10N" else 2, 1, 1), MESHES[kind])
        self.mesh = mesh if kind != "hanging" else refine(mesh, np.array([True, False])).mesh
        n, m, X = self.mesh.n_nodes, self.mesh.n_elements, self.mesh.points
        self.moves = moves  # whether supports move, nodes are tied and the body is stressed without loads
        size = 0.02 * (kind != "10N")  # whose boundary must contain the point of the stress
        self.p = {
            "E": np.where(np.arange(m) < m / 2, 1e3, 1.7e3),
            "density": np.where(np.arange(m) < m / 2, 1.0, 2.2),
            "loads": np.ones(5),
            "coordinates": X + size * rng.uniform(-1, 1, X.shape),
        }
        self.traction, self.u0 = rng.uniform(-9, 9, X.shape), 1e-3 * rng.uniform(-1, 1, X.shape)
        self.force, self.prestress = rng.uniform(-9, 9, X.shape), rng.uniform(-9, 9, (m, 6))
        self.temperature, self.end = rng.uniform(0, 9, n), rng.uniform(-9e-3, 9e-3, 3)
        moved = self.mesh.replace(points=self.p["coordinates"])
        self.located = moved.locate((0.7, 0.43, 0.31), required=True)
        self.result = self.solve()

    def solve(self, **changed):
        """Return the result with some parameters changed."""
        p = self.p | changed
        mesh = self.mesh.replace(points=p["coordinates"])
        model = kl.Model(mesh)
        pairs, owner = np.unique(np.stack([p["E"], p["density"]]), axis=1, return_inverse=True)
        for i, (E, density) in enumerate(pairs.T):
            material = kl.Isotropic3D(E=E, nu=0.3, density=density, alpha=1e-3)
            model.assign(material, np.flatnonzero(owner.ravel() == i))
        model.fix("x-")
        f = p["loads"]
        model.add(kl.Traction("z+", self.traction), amplitude=f[0])
        model.add(kl.Pressure("y+", 3.0), amplitude=f[1])
        model.add(kl.Gravity((1.0, -2.0, 3.0)), amplitude=f[2])
        model.add(kl.BodyForce(self.force), amplitude=f[3])
        if self.moves:
            model.add(kl.Temperature(self.temperature), amplitude=f[4])
            model.fix("x+", "yz", self.end[:2])
            end = np.flatnonzero(self.mesh.points[:, 0] == 2.0)
            model.constrain(3 * end[1:], 3 * end[:1], 1e-3, weights=0.9)
            model.add_prestress(self.prestress)
            model.set_stress_free_state(self.u0)
        return model.solve(solver="direct")

    def quantity(self, name, coordinates=None):
        """Return a quantity, whose point moves with its element."""
        X = self.p["coordinates"] if coordinates is None else coordinates
        point = self.located.interpolate(X)
        return {
            "displacement": lambda: kl.DisplacementAt(point, "y"),
            "mean": lambda: kl.MeanDisplacement("z+", "z"),
            "reaction": lambda: kl.ReactionOf("x-", "z"),
            "stress": lambda: kl.StressAt(point, "xx"),
            "compliance": kl.Compliance,
        }[name]()


@pytest.fixture(scope="module", params=[(kind, moves) for kind in MESHES for moves in (False, True)], ids=str)
def case(request):
    return Case(*request.param)


@pytest.mark.parametrize("wrt", ["E", "density", "loads", "coordinates"])
def test_gradients_are_central_differences(case, wrt):
    start, rng = case.p[wrt], np.random.default_rng(4)
    direction = rng.uniform(-1, 1, start.shape)
    h = 1e-5 * np.abs(start).max()
    there, back = (case.solve(**{wrt: start + s * h * direction}) for s in (1, -1))
    result = case.result
    for name in QUANTITIES:
        X = [start + s * h * direction if wrt == "coordinates" else None for s in (1, -1)]
        values = [case.quantity(name, x).value(r) for x, r in zip(X, (there, back), strict=True)]
        gradient = result.gradient(case.quantity(name), wrt)
        if wrt == "loads":
            gradient = np.append(gradient, np.zeros(5 - len(gradient)))
        found, difference = (gradient * direction).sum(), (values[0] - values[1]) / (2 * h)
        allowed = 1e-6 * np.abs(gradient * direction).max() + 1e-12 * abs(values[0]) / h
        assert abs(found - difference) < allowed, name


def test_a_mean_over_a_volume_by_coordinates():
    mesh = kl.box((1, 1, 1), (3, 3, 3))
    rng, h = np.random.default_rng(2), 1e-6
    shift, direction = rng.uniform(-0.03, 0.03, (2, *mesh.points.shape))
    inside = (np.abs(mesh.points - 0.5) < 0.2).all(axis=1)
    mean = kl.MeanDisplacement(inside, "y")

    def solved(points):
        model = kl.Model(mesh.replace(points=points), kl.Isotropic3D(E=1e3, nu=0.3))
        model.fix("x-")
        model.add(kl.PointLoad("x+", (1.0, 2.0, 3.0), each=True))
        return model.solve(solver="direct")

    there, back = (mean.value(solved(mesh.points + shift + s * h * direction)) for s in (1, -1))
    by_nodes = solved(mesh.points + shift).gradient(mean, "coordinates") * direction
    assert abs(by_nodes.sum() - (there - back) / (2 * h)) < 1e-6 * np.abs(by_nodes).max()
    explicit = mean.explicit(solved(mesh.points + shift), "coordinates", None) * direction
    assert np.abs(explicit).max() > 1e-2 * np.abs(by_nodes).max()


def bar(**options):
    """Return a clamped bar 2 x 1 x 1 of two elements with density and thermal expansion."""
    model = kl.Model(
        kl.box((2, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e3, nu=0.3, density=2.0, alpha=1e-3), **options
    )
    model.fix("x-")
    return model


def test_a_bar_of_two_moduli_in_closed_form():
    """u = F/A (L1/E1 + L2/E2), and 2 x 1 x 1 with x-coordinates of the end moved: ∂u/∂L2 = F/(A E2)."""
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)))
    for e, E in enumerate((1e3, 4e3)):
        model.assign(kl.Isotropic3D(E=E, nu=0.0), [e])
    model.fix("x-")
    model.add(kl.Traction("x+", (8.0, 0, 0)))
    result, end = model.solve(), kl.MeanDisplacement("x+", "x")
    assert np.abs(result.gradient(end, "E") - [-8e-6, -8 / 16e6]).max() < 1e-15
    moved = result.gradient(end, "coordinates")[model.mesh.nodes("x+"), 0].sum()
    assert abs(moved - 8 / 4e3) < 1e-9
    assert np.abs(result.gradient(kl.Compliance()) + np.array([64e-3, 16e-3])).max() < 1e-12


def test_compliance_takes_no_solution_but_where_supports_move(monkeypatch):
    """Under prescribed displacements -u·K'u is not the derivative of f·u: with f at a fixed point it is 0."""
    model = bar()
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    result = model.solve()
    energy = result.gradient(kl.Compliance())
    assert abs(energy.sum() + kl.Compliance().value(result)) < 1e-9
    model.fix("x+", "z", 0.1)
    moved = model.solve()
    solutions = []
    adjoint = type(moved._analysis).adjoint
    monkeypatch.setattr(
        type(moved._analysis), "adjoint", lambda self, *args: solutions.append(1) or adjoint(self, *args)
    )
    derivative = moved.gradient(kl.Compliance())
    assert len(solutions) == 1
    assert np.abs(derivative).max() < 1e-9 < moved.energy()
    bar_at_rest = bar()
    bar_at_rest.add(kl.Traction("x+", (0, 0, 1.0)))
    bar_at_rest.solve().gradient(kl.Compliance())
    assert len(solutions) == 1


def test_weight_is_linear_in_the_density():
    model = bar()
    model.add(kl.Gravity(lambda X: np.stack([X[:, 0], 1 - X[:, 1], 0 * X[:, 2]], axis=1)))
    result, tip = model.solve(), kl.DisplacementAt((2, 1, 1), "y")
    assert abs(2.0 * result.gradient(tip, "density").sum() / tip.value(result) - 1) < 1e-9


def test_loads_of_conditions_and_lines_by_coordinates():
    """Loads as files state them, on faces, lines and points; quadrilaterals may be warped."""
    rng, mesh = np.random.default_rng(5), kl.box((2, 1, 1), (2, 1, 1))
    mesh = mesh.replace(points=mesh.points + 0.05 * rng.uniform(-1, 1, mesh.points.shape))
    top, n = mesh.faces("z+")[0], mesh.n_nodes
    blocks = [
        kl.Block(f"{name}Condition", top.nodes[:, :k], np.arange(2 * k, 2 * k + 2), shape=SHAPES[shape])
        for name, k, shape in (("Surface", 4, "Quadrilateral4"), ("Line", 2, "Line2"), ("Point", 1, "Point1"))
    ]
    nodal = {cell: rng.uniform(-1, 1, (n, 3)) for cell in ("quadrilateral", "line", "point")}
    force, pressure = rng.uniform(-1, 1, (6, 3)), np.array([1.0, 2, 0, 0, 0, 0])
    loads = [
        ConditionLoads(force, nodal, pressure, rng.uniform(0, 1, n)),
        kl.Pressure("z+", rng.uniform(0, 1, n)),
        kl.Pressure(top.nodes.ravel(), 2.0, normal="nodes"),
    ]
    v, d, h = (*rng.uniform(-1, 1, (2, n, 3)), 1e-6)
    mesh = mesh.replace(conditions=blocks)
    for some in loads:
        works = [(some.forces(mesh.replace(points=mesh.points + s * h * d), []) * v).sum() for s in (1, -1)]
        assert abs((some.by_coordinates(mesh, [], v) * d).sum() - (works[0] - works[1]) / (2 * h)) < 1e-8


def test_the_error_of_the_compliance_is_that_of_the_energy():
    """f·u - f·u_h = a(e, e)."""
    model = kl.Model(kl.box((2, 1, 1), (4, 2, 2), MESHES["20N"]), kl.Isotropic3D(E=1e3, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    result = model.solve()
    error, energy = result.error(of=kl.Compliance()), result.error()
    assert abs(error.signed / (energy.absolute / energy.safety) ** 2 - 1) < 1e-4


def plastic():
    model = kl.Model(kl.box((2, 1, 1)), kl.J2Plasticity3D(E=1e3, nu=0.3, yield_stress=1e9))
    model.fix("x-")
    return model


def orthotropic():
    model = kl.Model(kl.box(), kl.Orthotropic3D(1e3, 1e3, 1e3, 0.0, 0.0, 0.0, 1e3, 1e3, 1e3))
    model.fix("x-")
    return model


class OwnLoad(Load):
    def forces(self, mesh, groups):
        return np.ones_like(mesh.points)


def free():
    model = kl.Model(kl.box((2, 1, 1)), kl.Isotropic3D(E=1e3, nu=0.3))
    model.add(kl.Traction("x-", (-1.0, 0, 0)))
    return model


def with_support(**support):
    model = bar()
    model.fix("z-", **support)
    return model


def with_point():
    model = bar()
    model.rigid("x+", (3.0, 0.5, 0.5))
    return model


def with_springs():
    model = bar()
    model.add(kl.ElasticSupport("x+", 1e2))
    return model


PLACES = lambda X: X[:, :1] * [[0.0, 0.0, 1.0]]  # noqa: E731


@pytest.mark.parametrize(
    ("make", "load", "wrt", "error", "message"),
    [
        (bar, None, "E_modulus", InputError, "wrt"),
        (plastic, None, "E", InputError, "gradient is one of linear elasticity, and J2Plasticity3D"),
        (orthotropic, None, "E", InputError, "Orthotropic3D has no Young's modulus"),
        (free, None, "density", ModelError, "supports that hold the body"),
        (with_point, None, "coordinates", ModelError, "remote point rigid x\\+"),
        (with_springs, None, "coordinates", ModelError, "attached ElasticSupport"),
        (bar, OwnLoad(), "coordinates", ModelError, "OwnLoad.* defines no by_coordinates"),
        (bar, kl.Traction("z+", PLACES), "coordinates", ModelError, "Traction.*function of places"),
        (bar, kl.Gravity(PLACES), "coordinates", ModelError, "Gravity.*function of places"),
        (bar, kl.Temperature(lambda X: X[:, 0]), "coordinates", ModelError, "Temperature.*function of"),
        (bar, kl.Resultant("x+", (0, 0, 1.0)), "coordinates", ModelError, "Resultant.*no derivative"),
        (
            lambda: with_support(axes="r", local=kl.Cylindrical((0, 9, 9), (1, 0, 0))),
            None, "coordinates", ModelError, "support.*depends on places",
        ),
        (
            lambda: with_support(axes="z", field=lambda X: X[:, :1] - X[:, :1]),
            None, "coordinates", ModelError, "support.*depends on places",
        ),
    ],
)  # fmt: skip
def test_what_has_no_gradient_is_refused_by_name(make, load, wrt, error, message):
    model = make()
    model.add(kl.Traction("x+", (1.0, 0, 0)))
    if load is not None:
        model.add(load)
    with pytest.raises(error, match=message):
        model.solve().gradient(kl.MeanDisplacement("x+", "x"), wrt)


def test_a_gradient_needs_the_static_analysis_of_the_model_as_it_is():
    model = bar()
    model.add(kl.Traction("x+", (1.0, 0, 0)))
    result = model.solve()
    model.assign(kl.Isotropic3D(E=2e3, nu=0.3))
    with pytest.raises(ModelError, match="the model has changed since"):
        result.gradient(kl.Compliance())
    with pytest.raises(InputError, match="Quantity"):
        result.gradient("compliance")


def test_a_result_of_a_kept_analysis_goes_through_pickle_and_solves_again():
    model = bar()
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    result, tip = model.static("amg").solve(), kl.MeanDisplacement("x+", "z")
    other = pickle.loads(pickle.dumps(result))
    assert (other.u == result.u).all()
    assert abs(other.gradient(tip, "loads") / result.gradient(tip, "loads") - 1) < 1e-9
