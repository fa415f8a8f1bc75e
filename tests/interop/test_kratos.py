"""The same models in Kratos, live: what we write it reads, what it computes we compute, what it writes we read."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.elements import KinematicLinear
from kratos_lite.io.document import Data, Document, Properties
from kratos_lite.io.files import read_document
from kratos_lite.mesh import select
from kratos_lite.quadrature import Rule
from kratos_lite.shapes import SHAPES, Pyramid13, Shape, Wedge15

for application in ("", ".StructuralMechanicsApplication", ".LinearSolversApplication"):
    module = f"KratosMultiphysics{application}"
    pytest.importorskip("KratosMultiphysics")
    found = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, check=False)
    if found.returncode:
        pytest.skip(f"{module} is not installed", allow_module_level=True)

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7620.0)
KINDS = (4, 5, 6, 8, 10, 13, 15, 20, 27)
"""Nodes of the elements."""
OTHER_FUNCTIONS = (13, 15)
"""Kinds whose shape functions are other ones in Kratos, see KratosPyramid13 and KratosWedge15."""
SAME_RULE = (4, 6, 8, 20, 27)
"""Kinds that Kratos integrates by default with our points."""
FACES = ((4, 3), (10, 6), (8, 4), (20, 8), (27, 9))
"""Elements by the number of nodes of all their faces."""


def name_of(kind):
    return f"KinematicLinear3D{kind}N"


def ask(folder, jobs):
    """Return what Kratos answers to jobs, see kratos_driver.py."""
    (folder / "jobs.json").write_text(json.dumps(jobs))
    driver = Path(__file__).with_name("kratos_driver.py")
    run = subprocess.run(
        [sys.executable, driver, folder / "jobs.json", folder / "answers.json"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-2000:]
    return json.loads((folder / "answers.json").read_text())


def by_node(mesh, values):
    return np.array([values[str(i)] for i in mesh.node_ids])


def assert_close(ours, theirs, tolerance):
    assert np.abs(ours - theirs).max() <= tolerance * np.abs(theirs).max()


def distorted_cube(kind, n, amount=0.05):
    mesh = kl.box(cells=(n, n, n), element=name_of(kind))
    mesh.points += amount / n * np.random.default_rng(kind).uniform(-1, 1, mesh.points.shape)
    return mesh


def sheared_cube(kind, n):
    """Return a cube of parallel-sided cells, whose volumes any right node order gives exactly."""
    mesh = kl.box(cells=(n, n, n), element=name_of(kind))
    mesh.points = mesh.points @ np.array([[1.1, 0.2, 0.1], [-0.1, 0.9, 0.3], [0.2, -0.3, 1.2]])
    return mesh


def cube(kind, n, mesh=None):
    model = kl.Model(distorted_cube(kind, n) if mesh is None else mesh, STEEL)
    model.fix("z-", "xyz")
    model.fix("z+", "x", 1e-6)
    model.add(kl.Gravity((3.0, -2.0, -9.81)))
    return model


def one_cell(kind):
    """Return a model of the reference cell, on which Gauss points are where the rule has them."""
    element = kl.ELEMENTS[name_of(kind)]
    nodes = np.arange(kind, dtype=np.int32)[None]
    one = np.ones(1, dtype=np.int64)
    return kl.Model(kl.Mesh(element.nodes, [kl.Block(element.__name__, nodes, one, one, element.shape)]), STEEL)


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    """By kind: our models and what Kratos says of the files that we wrote from them."""
    folder = tmp_path_factory.mktemp("cubes")
    models = {
        (kind, what): model
        for kind in KINDS
        for what, model in (
            ("cell", one_cell(kind)),
            ("sheared", cube(kind, 2, sheared_cube(kind, 2))),
            (1, cube(kind, 1)),
            (2, cube(kind, 2)),
        )
    }
    jobs = []
    for (kind, what), model in models.items():
        path = folder / f"{kind}_{what}.mdpa"
        kl.write(path, model)
        jobs.append({"mdpa": str(path), "solve": what != "cell"})
    return {key: (models[key], found) for key, found in zip(models, ask(folder, jobs), strict=True)}


def kratos_rule(cubes, kind):
    cell = cubes[kind, "cell"][1]["elements"]["1"]
    return Rule(np.array(cell["points"]), np.array(cell["weights"]), degree=1, name="Kratos")


# ---- what we write, Kratos reads ---------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_kratos_reads_nodes_elements_and_parts_that_we_write(cubes, kind):
    model, found = cubes[kind, 2]
    mesh = model.mesh
    assert np.array_equal(by_node(mesh, found["nodes"]), mesh.points)
    assert len(found["nodes"]) == mesh.n_nodes
    block = mesh.blocks[0]
    connectivity = {str(i): mesh.node_ids[nodes].tolist() for i, nodes in zip(block.ids, block.nodes, strict=True)}
    assert {i: element["nodes"] for i, element in found["elements"].items()} == connectivity
    sides = {"-": "_minus", "+": "_plus"}
    parts = {name[0] + sides[name[1]]: mesh.node_ids[part.nodes].tolist() for name, part in mesh.parts.items()}
    assert {name: part["nodes"] for name, part in found["parts"].items()} == parts


@pytest.mark.parametrize("kind", KINDS)
def test_kratos_reads_material_and_supports_that_we_write(cubes, kind):
    model, found = cubes[kind, 2]
    assert found["properties"] == {
        "1": {
            "DENSITY": 7620.0,
            "YOUNG_MODULUS": 210e9,
            "POISSON_RATIO": 0.3,
            "VOLUME_ACCELERATION": [3.0, -2.0, -9.81],
        }
    }
    bottom, top = (model.mesh.node_ids[model.mesh.nodes(side)].tolist() for side in ("z-", "z+"))
    expected = [[i, axis, 0.0] for i in bottom for axis in "xyz"] + [[i, "x", 1e-6] for i in top]
    assert sorted(found["fixed"]) == sorted(expected)


@pytest.mark.parametrize("kind", KINDS)
def test_volume_of_each_element_is_that_of_kratos(cubes, kind):
    """A wrong node order of the file would twist the cells."""
    model, found = cubes[kind, "sheared"]
    volumes = model.batches()[0].at(model.mesh.points).volume()
    theirs = [sum(element["weights"]) for element in found["elements"].values()]
    assert_close(volumes, np.array(theirs), 1e-14)


# ---- stiffness and displacements -----------------------------------------------------------------


class ComplexStep(Shape):
    """Mixin: derivatives of N by the complex step, exact to rounding."""

    @classmethod
    def dN(cls, xi):
        steps = np.asarray(xi)[..., None, :] + 1e-30j * np.eye(3)
        return np.swapaxes(cls.N(steps).imag, -1, -2) / 1e-30


def kratos_shapes():
    """Return the shapes that Kratos has in place of our Pyramid13 and Wedge15."""

    class KratosPyramid13(ComplexStep):
        """Kratos: a collapsed cube with a bubble in the base that breaks completeness."""

        cell, corners, degree = "pyramid", 5, 1
        nodes = Pyramid13.nodes * [1, 1, 2] - [0, 0, 1]

        @staticmethod
        def N(xi):
            x, y, z = np.moveaxis(np.asarray(xi), -1, 0)

            def corner(x, y):
                rest = 4 - 3 * x - 3 * y + 2 * x * y + 2 * z - x * z - y * z + 2 * x * y * z
                return -(1 + x) * (1 + y) * (1 - z) * rest / 16

            def base(x, y):
                return (1 - x * x) * (1 + y) * (1 - z) * (2 - y - y * z) / 8

            corners = [corner(-x, -y), corner(x, -y), corner(x, y), corner(-x, y), z * (1 + z) / 2]
            middles = [base(x, -y), base(y, x), base(x, y), base(y, -x)]
            upright = [(1 + a * x) * (1 + b * y) * (1 - z * z) / 4 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            return np.stack([*corners, *middles, *upright], axis=-1)

    class KratosWedge15(ComplexStep):
        """Kratos: quadratic triangles at the ends, but a linear one half-way between them."""

        cell, corners, degree = "wedge", 6, 1
        nodes = Wedge15.nodes

        @staticmethod
        def N(xi):
            r, s, z = np.moveaxis(np.asarray(xi), -1, 0)
            L = (1 - r - s, r, s)
            quadratic = [a * (2 * a - 1) for a in L] + [4 * L[i] * L[j] for i, j in ((0, 1), (1, 2), (2, 0))]
            low, high, half = z * (z - 1) / 2, z * (z + 1) / 2, 1 - z * z
            ends = [[end * q for q in quadratic] for end in (low, high)]
            upright = [half * a for a in L]
            order = [*ends[0][:3], *ends[1][:3], *ends[0][3:], *upright, *ends[1][3:]]
            return np.stack(order, axis=-1)

    return {13: KratosPyramid13, 15: KratosWedge15}


def as_kratos_has_it(kind, rule):
    """Return element class and rule that do what Kratos does."""
    if kind not in OTHER_FUNCTIONS:
        return kl.ELEMENTS[name_of(kind)], rule
    with SHAPES.temporary(), kl.ELEMENTS.temporary():
        shape = kratos_shapes()[kind]
        element = type(f"Kratos{kind}", (KinematicLinear,), {"shape": shape, "rule": rule})
    if kind == 15:
        return element, rule
    # Kratos numbers points of the pyramid in a cube, of which the upper face is the apex.
    r, s, t = rule.points.T
    cube_points = np.column_stack([r / (1 - t), s / (1 - t), 2 * t - 1])
    return element, Rule(cube_points, 2 * rule.weights / (1 - t) ** 2, degree=1, name="Kratos, in the cube")


@pytest.mark.parametrize("kind", KINDS)
def test_stiffness_is_that_of_kratos_at_its_points(cubes, kind):
    element, rule = as_kratos_has_it(kind, kratos_rule(cubes, kind))
    for n in (1, 2):
        model, found = cubes[kind, n]
        block = model.mesh.blocks[0]
        K = element(model.mesh.points[block.nodes], rule).stiffness(STEEL.C)
        for ours, number in zip(K, block.ids, strict=True):
            assert_close(ours, np.array(found["elements"][str(number)]["K"]), 1e-12)


@pytest.mark.parametrize("kind", sorted({*KINDS} - {*OTHER_FUNCTIONS}))
@pytest.mark.parametrize("n", [1, 2])
def test_displacements_and_reactions_are_those_of_kratos_at_its_points(cubes, kind, n):
    model, found = cubes[kind, n]
    copy = cube(kind, n, model.mesh)
    copy.use_rule(kratos_rule(cubes, kind))
    result = copy.solve()
    assert_close(result.displacement(), by_node(model.mesh, found["displacement"]), 1e-12)
    assert_close(result.reaction(), by_node(model.mesh, found["reaction"]), 1e-11)


@pytest.mark.parametrize("kind", [*SAME_RULE, 10])
@pytest.mark.parametrize("n", [1, 2])
def test_displacements_with_our_own_points_are_those_of_kratos(cubes, kind, n):
    """The points of Kratos for 10 nodes are given to 8 digits only."""
    model, found = cubes[kind, n]
    expected = by_node(model.mesh, found["displacement"])
    assert_close(model.solve().displacement(), expected, 2e-8 if kind == 10 else 1e-12)


@pytest.mark.parametrize(("kind", "largest"), [(13, 0.1), (15, 0.15)])
def test_functions_of_kratos_for_13_and_15_nodes_miss_quadratic_fields(kind, largest):
    """Ours hold x², theirs do not: this is why the numbers of these two kinds differ."""
    with SHAPES.temporary():
        theirs = kratos_shapes()[kind]
    ours = kl.ELEMENTS[name_of(kind)].shape
    apart = []
    for shape in (ours, theirs):
        xi = 0.3 * np.random.default_rng(0).uniform(-1, 1, (50, 3)) + [0.3, 0.3, 0.3]
        N = shape.N(xi)
        x = N @ ours.nodes[:, 0]
        assert np.abs(N.sum(axis=1) - 1).max() <= 1e-14
        apart.append(np.abs(N @ ours.nodes[:, 0] ** 2 - x**2).max())
    assert apart[0] <= 1e-14
    assert apart[1] > largest


def test_an_element_of_ours_reads_as_it_was_written(cubes, tmp_path):
    model, _ = cubes[27, 2]
    kl.write(tmp_path / "a.mdpa", model)
    again = kl.read(tmp_path / "a.mdpa")
    assert_close(again.solve().u, model.solve().u, 1e-14)


# ---- loads on surfaces and points ----------------------------------------------------------------


def with_conditions(kind, name, variable, value):
    """Return a document of a distorted cube with conditions on top, all loaded alike."""
    mesh = distorted_cube(kind, 2)
    faces = select(mesh.faces("z+"), np.arange(10**4))
    assert len(faces) == 1
    face = faces[0]
    ids = np.arange(1, len(face) + 1)
    conditions = [kl.Block(f"{name}3D{face.nodes.shape[1]}N", face.nodes, ids, 0 * ids + 1, face.shape)]
    bottom = mesh.node_ids[mesh.nodes("z-")]
    loaded = kl.Mesh(mesh.points, mesh.blocks, conditions=conditions)
    held = np.ones(len(bottom), dtype=bool)
    free = np.zeros(len(ids), dtype=bool)
    properties = {"DENSITY": 7620.0, "YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3}
    return Document(
        loaded,
        {1: Properties(1, properties)},
        nodal_data=[Data(f"DISPLACEMENT_{a}", bottom, held, np.zeros(len(bottom))) for a in "XYZ"],
        condition_data=[Data(variable, ids, free, np.tile(np.asarray(value, dtype=float), (len(ids), 1)).squeeze())],
    )


def solve_both(tmp_path, documents):
    paths = []
    for i, document in enumerate(documents):
        paths.append(tmp_path / f"{i}.mdpa")
        kl.write(paths[-1], document)
    answers = ask(tmp_path, [{"mdpa": str(path), "solve": True} for path in paths])
    return [(kl.read(path), answer) for path, answer in zip(paths, answers, strict=True)]


def test_tractions_are_those_of_kratos_on_all_faces(tmp_path):
    force = np.array([2e5, -1e5, -3e5])
    documents = [with_conditions(kind, "SurfaceLoadCondition", "SURFACE_LOAD", force) for kind, _ in FACES]
    for (kind, n), (model, found) in zip(FACES, solve_both(tmp_path, documents), strict=True):
        assert model.mesh.conditions[0].nodes.shape[1] == n
        assert found["conditions"] == model.mesh.n_conditions
        expected = by_node(model.mesh, found["displacement"])
        u = model.solve().displacement()
        assert_close(u, expected, 1e-10 if kind in SAME_RULE else 2e-8)
        by_hand = kl.Model(distorted_cube(kind, 2), STEEL)
        by_hand.fix("z-")
        by_hand.add(kl.Traction("z+", force))
        assert_close(by_hand.solve().displacement(), u, 1e-12)


def test_pressures_are_those_of_kratos_on_all_faces(tmp_path):
    name = "SmallDisplacementSurfaceLoadCondition"
    documents = [with_conditions(kind, name, "POSITIVE_FACE_PRESSURE", 1e6) for kind, _ in FACES]
    for (kind, n), (model, found) in zip(FACES, solve_both(tmp_path, documents), strict=True):
        assert model.mesh.conditions[0].nodes.shape[1] == n
        expected = by_node(model.mesh, found["displacement"])
        u = model.solve().displacement()
        assert_close(u, expected, 1e-10 if kind in SAME_RULE else 2e-8)
        by_hand = kl.Model(distorted_cube(kind, 2), STEEL)
        by_hand.fix("z-")
        by_hand.add(kl.Pressure("z+", 1e6))
        assert_close(by_hand.solve().displacement(), u, 1e-12)


def test_point_loads_and_prescribed_displacements_are_those_of_kratos(tmp_path):
    model = kl.Model(distorted_cube(20, 2), STEEL)
    model.fix("z-", "xyz", [1e-5, -2e-5, 3e-5])
    model.fix("z+", "y", 4e-5)
    model.add(kl.PointLoad("x+", (100.0, 200.0, -300.0)))
    kl.write(tmp_path / "a.mdpa", model)
    (found,) = ask(tmp_path, [{"mdpa": str(tmp_path / "a.mdpa"), "solve": True}])
    assert found["conditions"] == len(model.mesh.nodes("x+"))
    for ours in (model, kl.read(tmp_path / "a.mdpa")):
        result = ours.solve()
        assert_close(result.displacement(), by_node(model.mesh, found["displacement"]), 1e-12)
        assert_close(result.reaction(), by_node(model.mesh, found["reaction"]), 1e-11)


# ---- materials and constraints ---------------------------------------------------------------------


def test_orthotropic_body_is_that_of_kratos_with_the_same_elasticity_matrix(tmp_path):
    """Kratos takes the inverse of the compliance written out here, in its order xx yy zz xy yz xz."""
    (ex, ey, ez), (nxy, nyz, nxz), (gxy, gyz, gxz) = (11e9, 2e9, 1e9), (0.4, 0.3, 0.35), (0.7e9, 0.2e9, 0.6e9)
    compliance = np.zeros((6, 6))
    compliance[:3, :3] = [
        [1 / ex, -nxy / ex, -nxz / ex],
        [-nxy / ex, 1 / ey, -nyz / ey],
        [-nxz / ex, -nyz / ey, 1 / ez],
    ]
    compliance[3:, 3:] = np.diag([1 / gxy, 1 / gyz, 1 / gxz])
    wood = kl.Orthotropic3D(
        Ex=ex, Ey=ey, Ez=ez, nuxy=nxy, nuyz=nyz, nuxz=nxz, Gxy=gxy, Gyz=gyz, Gxz=gxz, density=500.0
    )
    models = [cube(8, 2), cube(8, 2)]
    models[1].assign(wood)
    for name, model in zip("ab", models, strict=True):
        kl.write(tmp_path / f"{name}.mdpa", model)
    text = (tmp_path / "a.mdpa").read_text()
    (tmp_path / "a.mdpa").write_text(text.replace("CONSTITUTIVE_LAW LinearElastic3DLaw", "").replace("7620", "500"))
    job = {"mdpa": str(tmp_path / "a.mdpa"), "solve": True, "elasticity": np.linalg.inv(compliance).tolist()}
    (found,) = ask(tmp_path, [job])
    expected = by_node(models[1].mesh, found["displacement"])
    assert_close(models[1].solve().displacement(), expected, 1e-12)
    assert_close(kl.read(tmp_path / "b.mdpa").solve().displacement(), expected, 1e-12)


def test_multi_point_constraints_are_those_of_kratos(tmp_path):
    """One slave of the same direction, one of two other directions, one with a constant."""
    model = kl.Model(distorted_cube(8, 2), STEEL)
    model.fix("z-")
    model.add(kl.Gravity((3.0, -2.0, -9.81)))
    top = model.mesh.nodes("z+").tolist()
    model.link((top[0], "z"), {(top[1], "z"): 0.5, (top[2], "z"): 0.25})
    model.link((top[3], "x"), {(top[4], "y"): 1.0, (top[5], "z"): -0.5})
    model.link((top[6], "z"), {(top[8], "z"): 1.0}, constant=1e-6)
    kl.write(tmp_path / "a.mdpa", model)
    (found,) = ask(tmp_path, [{"mdpa": str(tmp_path / "a.mdpa"), "solve": True}])
    assert found["constraints"] == 3
    expected = by_node(model.mesh, found["displacement"])
    assert_close(model.solve().displacement(), expected, 1e-10)
    assert_close(kl.read(tmp_path / "a.mdpa").solve().displacement(), expected, 1e-10)


# ---- what Kratos writes, we read -------------------------------------------------------------------


def test_we_read_what_kratos_writes(cubes, tmp_path):
    """Kratos writes all but the supports of the nodes exactly, in its own order of blocks."""
    model, _ = cubes[27, 2]
    ours, theirs = tmp_path / "ours.mdpa", tmp_path / "theirs.mdpa"
    kl.write(ours, model)
    ask(tmp_path, [{"mdpa": str(ours), "write": str(theirs)}])
    first, second = read_document(ours), read_document(theirs)
    assert_close(second.mesh.points, first.mesh.points, 1e-12)
    assert np.array_equal(first.mesh.node_ids, second.mesh.node_ids)
    assert [b.name for b in first.mesh.blocks] == [b.name for b in second.mesh.blocks]
    for one, other in zip(first.mesh.blocks, second.mesh.blocks, strict=True):
        assert np.array_equal(one.nodes, other.nodes)
        assert np.array_equal(one.ids, other.ids)
        assert np.array_equal(one.properties, other.properties)
    assert {n: p.nodes.tolist() for n, p in first.mesh.parts.items()} == {
        n: p.nodes.tolist() for n, p in second.mesh.parts.items()
    }
    for key in ("DENSITY", "YOUNG_MODULUS", "POISSON_RATIO"):
        assert second.properties[1].values[key] == first.properties[1].values[key]
    assert_close(kl.read(theirs).solve().displacement(), model.solve().displacement(), 1e-9)
