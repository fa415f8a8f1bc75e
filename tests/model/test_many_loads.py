"""Many loads: they act as one load of the same faces, and cost no array of the size of the mesh each."""

import tracemalloc

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.nodal_loads import external_loads
from kratos_lite.model.loads.base import Load, equal_loads
from kratos_lite.model.loads.merging import joined

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
MESH = kl.box((2.0, 1.0, 1.0), (4, 3, 3))
TOP = MESH.faces("z+")[0].nodes

ONE_BY_ONE = {
    "pressures": (lambda nodes: kl.Pressure(nodes, 2e5), kl.Pressure("z+", 2e5)),
    "tractions": (lambda nodes: kl.Traction(nodes, (1e3, 0, -2e5)), kl.Traction("z+", (1e3, 0, -2e5))),
    "functions": (
        lambda nodes: kl.Pressure(nodes, lambda X: 1e5 * X[:, 0]),
        kl.Pressure("z+", lambda X: 1e5 * X[:, 0]),
    ),
    "local axes": (
        lambda nodes: kl.Traction(nodes, (0, 0, -2e5), local=kl.Cartesian((1, 0, 0))),
        kl.Traction("z+", (0, 0, -2e5), local=kl.Cartesian((1, 0, 0))),
    ),
}


def fixed(*loads, mesh=MESH, material=STEEL, **options):
    model = kl.Model(mesh, material, **options)
    model.fix("z-")
    for load in loads:
        model.add(load)
    return model


def total(model):
    return external_loads(model, model.element_groups(), model.loads)


def assert_close(one, other):
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-13 * np.abs(other).max())


@pytest.mark.parametrize("kind", ONE_BY_ONE)
def test_loads_face_by_face_are_one_load(kind):
    load, whole = ONE_BY_ONE[kind]
    assert_close(total(fixed(*map(load, TOP))), total(fixed(whole)))


def test_each_load_keeps_its_own_size_and_face():
    """Forces of a face are its own pressure times its area, and sum up where loads overlap."""
    sizes = 1e5 * np.arange(1, len(TOP) + 1)
    loads = [kl.Pressure(nodes, p) for nodes, p in zip(TOP, sizes, strict=True)]
    area, expected = 2.0 / len(TOP), np.zeros((MESH.n_nodes, 3))
    np.add.at(expected[:, 2], TOP, -np.repeat(sizes[:, None], 4, axis=1) * area / 4)
    assert_close(total(fixed(*loads)), expected)
    assert_close(total(fixed(*loads, kl.Pressure("z+", 1e5), *loads))[:, 2].sum(), 2 * expected.sum() - 2e5)


def test_each_load_keeps_its_own_amplitude():
    model, plain = fixed(), [kl.Pressure(nodes, 1e5 * i) for i, nodes in enumerate(TOP)]
    for i, nodes in enumerate(TOP):
        model.add(kl.Pressure(nodes, 1e5), amplitude=float(i))
    assert_close(total(model), total(fixed(*plain)))


def test_point_loads_on_nodes_and_points_add_up():
    nodes = np.unique(TOP)
    loads = [kl.PointLoad(nodes[[i]], (0, 1.0, i)) for i in range(len(nodes))]
    loads += [kl.PointLoad(tuple(map(float, MESH.points[node])), (0, 0, 1.0)) for node in nodes]
    loads += [kl.PointLoad((0.9, 0.3, 0.4), (0, 0, 5.0))] * 2  # inside an element
    found, n = total(fixed(*loads)).sum(axis=0), len(nodes)
    assert_close(found, [0.0, n, n * (n - 1) / 2 + n + 10.0])


def test_many_loads_are_one_load_of_their_kind():
    loads = [kl.Pressure(nodes, 1e5 + nodes[0]) for nodes in TOP] + [
        kl.Traction(nodes, (0, 0, 1)) for nodes in TOP
    ]
    loads += [
        kl.Pressure("z+", 1.0, normal="nodes"),
        kl.Pressure("x+", np.ones(MESH.n_nodes)),
        kl.Gravity((0, 0, 1)),
    ]
    assert len(list(joined(MESH, [(1.0, load) for load in loads]))) == 5


def test_a_class_that_gives_its_forces_alone_is_asked_for_them():
    class Half(kl.Pressure):
        def forces(self, mesh, groups):
            return super().forces(mesh, groups) / 2

    assert Half.on_nodes is Load.on_nodes
    assert_close(total(fixed(*(Half(nodes, 2e5) for nodes in TOP))), total(fixed(kl.Pressure("z+", 1e5))))


@pytest.mark.parametrize("follower", [False, True])
def test_steps_and_times_under_many_loads_are_those_under_one(follower):
    rubber = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
    ramp = kl.TimeSeries([0.0, 1.0], [0.0, 1.0])
    found = []
    for where, count in ((["z+"], 1), (TOP, len(TOP))):
        model = fixed(material=rubber, formulation="total_lagrangian")
        for nodes in where:
            model.add(kl.Pressure(nodes, 4e4, follower=follower), amplitude=ramp)
        assert len(model.loads) == count
        *_, last = kl.integrate(model.quasi_static(), dt=0.5, steps=2)
        found.append(last.u)
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-9 * np.abs(found[0]).max())


def test_equal_warnings_are_one_with_their_number():
    twice = [kl.Pressure(nodes, 1e5) for nodes in TOP for _ in range(2)]
    (text,) = equal_loads(twice, {})
    assert text.startswith("2 equal loads Pressure(")
    assert text.endswith(f" (and {len(TOP) - 1} more loads)")
    jumps = [kl.Pressure("z+", lambda X, x=x: 1e5 * (X[:, 0] > x)) for x in (0.3, 0.7, 1.2)]
    jumping = [text for text in fixed(*jumps).solve().report.warnings if "jumps or peaks" in text]
    assert len(jumping) == 1
    assert jumping[0].endswith(" (and 2 more loads)")


def test_a_load_makes_no_array_of_the_size_of_the_mesh():
    """Faces and nodes are looked up in tables of the mesh."""
    mesh = kl.box(cells=(1, 1, 20000))
    model, (face,) = kl.Model(mesh, STEEL), mesh.faces("z+")[0].nodes
    loads = [
        kl.Pressure(face, 1e5),
        kl.PointLoad(face[[0]], (0, 0, 1.0)),
        kl.PointLoad((0.0, 0.0, 1.0), (0, 0, 1.0)),
    ]
    for load in loads:
        model.add(load)
        load.on_nodes(mesh, [])
    tracemalloc.start()
    for load in loads:
        model.add(load)
        load.on_nodes(mesh, [])
    assert tracemalloc.get_traced_memory()[1] < 4 * mesh.n_nodes  # a mask of the nodes has one byte each
    tracemalloc.stop()
