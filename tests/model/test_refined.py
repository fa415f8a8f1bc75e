"""Structures on finer meshes: materials, supports, loads and what is refused."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.nodal_loads import external_loads
from kratos_lite.mesh.refinement import raised, refine
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.surface import ConditionLoads
from kratos_lite.model.refined import refined

STEEL = kl.Isotropic3D(E=200e9, nu=0.3, density=7800.0)


def model(kind="8N", cells=(2, 2, 1)):
    return kl.Model(kl.box((1.0, 1.3, 0.7), cells, "KinematicLinear3D" + kind), STEEL)


def totals(structure):
    """Return force (3,) and moment (3,) of all loads."""
    forces = external_loads(structure, structure.element_groups(), structure.loads)
    return np.concatenate([forces.sum(axis=0), np.cross(structure.mesh.points, forces).sum(axis=0)])


def finer_of(one):
    return [refine(one.mesh), refine(one.mesh, [0]), raised(one.mesh)]


LOADS = {
    "gravity": kl.Gravity((1.0, -2.0, -9.81)),
    "body force": kl.BodyForce((1.0, 2.0, 3.0), [0, 1]),
    "linear body force": kl.BodyForce(lambda X: X),
    "traction": kl.Traction("x+", (1.0, 2.0, 3.0)),
    "linear traction": kl.Traction("z+", lambda X: X),
    "traction by rows": kl.Traction([0, 1, 2, 3, 4, 5], (1.0, 2.0, 3.0)),
    "pressure": kl.Pressure(lambda X: X[:, 2] == 0.7, 5.0),
    "point load": kl.PointLoad("z+", (0.0, 0.0, 2.0), each=True),
    "nodal forces": kl.NodalForces(np.arange(54.0).reshape(18, 3)),
    "nodal body force": kl.BodyForce(np.linspace(0, 1, 54).reshape(18, 3)),
}


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
def test_totals_of_loads_stay(load):
    one = model()
    one.add(load)
    one.add(load, amplitude=0.5)
    want = totals(one)
    for finer in finer_of(one):
        assert np.abs(totals(refined(one, finer)) - want).max() < 1e-9 * max(np.abs(want).max(), 1.0)


def test_loads_of_time_stay_functions_of_time():
    one = model()
    one.add(kl.TimeDependentLoad(lambda t: kl.Gravity((0, 0, 1 + t))))
    (load,) = refined(one, refine(one.mesh)).loads
    assert load.at(3.0).force[2] == 4.0


def test_conditions_of_a_file_keep_their_loads():
    plain = kl.box((1.0, 1.3, 0.7), (2, 2, 1))
    (side,) = plain.faces("x+")
    mesh = plain.replace(conditions=[kl.Block("SurfaceCondition3D4N", side.nodes, shape=side.shape)])
    one = kl.Model(mesh, STEEL)
    nodal = {"quadrilateral": mesh.points.copy()}
    one.add(
        ConditionLoads(np.array([[1.0, 2, 3], [2, 3, 4]]), nodal, np.array([5.0, 6.0]), mesh.points[:, 1])
    )
    for finer in finer_of(one):
        assert np.abs(totals(refined(one, finer)) - totals(one)).max() < 1e-12


def test_materials_prestress_and_stress_free_displacement_follow():
    one = model()
    one.assign(kl.Isotropic3D(E=1e9, nu=0.2), [1])
    one.add_prestress(np.arange(6.0), [2])
    one.set_stress_free_state(one.mesh.points * 0.1)
    for finer in finer_of(one):
        new = refined(one, finer)
        stiff = {group.material.C[0, 0]: group.rows for group in new.element_groups()}
        assert (finer.elements[stiff[min(stiff)]] == 1).all()
        assert np.abs(new.initial_displacement - finer.mesh.points * 0.1).max() < 1e-15
        assert (new.prestress[finer.elements == 2] == np.arange(6.0)).all()


@pytest.mark.parametrize("kind", ["8N", "20N", "4N", "15N"])
def test_supports_follow(kind):
    one = model(kind)
    low = one.mesh.nodes("z-")
    one.fix("x-", "xy")
    one.fix(lambda X: X[:, 0] == 1.0, "x", field=lambda X: X[:, 1:2] ** 2)
    one.fix(low, "z", one.mesh.points[low][:, :1])
    for finer in (refine(one.mesh), refine(one.mesh, [0])):
        new, X = refined(one, finer), finer.mesh.points
        free = np.ones(len(X), dtype=bool)
        if finer.mesh.hanging is not None:
            free[finer.mesh.hanging.nodes] = False
        fixed, values = new.supports.fixed, new.supports.values
        assert (fixed[:, 1] == ((X[:, 0] == 0) & free)).all()
        assert (fixed[:, 2] == ((X[:, 2] == 0) & free)).all()
        end = (X[:, 0] == 1.0) & free
        assert np.abs(values[end, 0] - X[end, 1] ** 2).max() < 1e-14
        assert np.abs(values[fixed[:, 2], 2] - X[fixed[:, 2], 0]).max() < 1e-14


def test_quadratic_elements_take_the_formulation_that_does_not_lock_only_where_asked():
    one = kl.Model(kl.box(cells=(1, 1, 1)), STEEL, formulation="b_bar")
    assert refined(one, raised(one.mesh)).element_groups()[0].element is kl.BBar3D20N


def test_a_constraint_between_nodes_far_apart_stays():
    one = model()
    one.fix("x-")
    one.constrain((17, "x"), {(15, "y"): 2.0}, 0.1)
    new = refined(one, refine(one.mesh, [0]))
    new.add(kl.Gravity((1.0, 1.0, 1.0)))
    u = new.solve().u
    assert abs(u[17, 0] - 2 * u[15, 1] - 0.1) < 1e-12


def test_ties_along_cut_edges_are_refused():
    one = model()
    for node in one.mesh.nodes("x-").tolist():
        one.constrain((node, "x"), {(node + 12, "x"): 1.0})
    with pytest.raises(kl.ModelError, match="tie nodes of edges that are cut"):
        refined(one, refine(one.mesh))


def test_loads_that_do_not_say_how_are_refused_by_name():
    class Wind(Load):
        def forces(self, mesh, groups):
            return np.zeros_like(mesh.points)

    one = model()
    one.add(Wind())
    with pytest.raises(kl.ModelError, match="Wind cannot be carried over"):
        refined(one, refine(one.mesh))


def test_motions_are_refused():
    one = kl.Model(kl.annulus(1.0, 2.0, 1.0), STEEL)
    one.add(kl.ale.Rotation("z", 1.0))
    with pytest.raises(kl.ModelError, match="moves through the mesh"):
        refined(one, refine(one.mesh))


def test_rules_follow_if_the_shape_stays():
    one = model()
    one.use_rule(2, [0])
    new = refined(one, refine(one.mesh, [0]))
    assert sum(len(group.rule) == 8 for group in new.element_groups()) > 0
    one.use_rule(kl.KinematicLinear3D8N.rule, [1])
    with pytest.raises(kl.ModelError, match="does not fit those of another shape"):
        refined(one, raised(one.mesh))


def test_a_model_of_a_class_with_a_constructor_of_its_own_is_refined():
    class Bar(kl.Model):
        def __init__(self, length):
            super().__init__(kl.box((length, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.3))
            self.length = length

    finer = refined(Bar(3.0), refine(Bar(3.0).mesh))
    assert type(finer) is Bar
    assert finer.length == 3.0
    assert finer.mesh.n_elements == 16


def test_a_support_of_hanging_nodes_alone_is_refused():
    model = kl.Model(refine(kl.box(cells=(2, 1, 1)), [0]).mesh, kl.Isotropic3D(E=1e6, nu=0.3))
    with pytest.raises(kl.ModelError, match="hang on an edge or face of a larger element"):
        model.fix(model.mesh.hanging.nodes[:1], "y")


def test_a_body_of_a_mesh_with_hanging_nodes_is_refused():
    mesh = refine(kl.box(cells=(2, 1, 1)), [0]).mesh
    with pytest.raises(kl.ModelError, match="5 hanging nodes, whose constraints a body does not take"):
        kl.FiniteElementBody(mesh, kl.Isotropic3D(E=1e6, nu=0.3, density=1.0))


@pytest.mark.parametrize("kind", ["8N", "10N", "20N"])
def test_hanging_nodes_are_written_as_constraints_or_said_to_be_left_out(kind, tmp_path):
    mesh = refine(kl.box((2, 1, 1), (2, 1, 1), f"KinematicLinear3D{kind}"), [0]).mesh
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0.0, 0.0, 1.0)))
    kl.write(tmp_path / "model.mdpa", model)
    u = model.solve().u
    assert np.abs(kl.read(tmp_path / "model.mdpa").solve().u - u).max() < 1e-9 * np.abs(u).max()
    kl.write(tmp_path / "mesh.mdpa", mesh)
    assert len(kl.read(tmp_path / "mesh.mdpa").supports.constraints) == 3 * len(mesh.hanging)
    (note,) = kl.write(tmp_path / "mesh.vtu", mesh)
    assert "constraints" in note
