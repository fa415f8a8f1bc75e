"""The same models in Kratos, live: each reads what the other writes, and both compute the same."""

import json
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pytest
from children import output_of
from rounding import close

import kratos_lite as kl
from kratos_lite.elements import KinematicLinear
from kratos_lite.io.formats import read_document
from kratos_lite.io.formats.document import Data, Document, Properties
from kratos_lite.quadrature import Rule
from kratos_lite.shapes import SHAPES, Shape
from kratos_lite.shapes.pyramids import Pyramid13
from kratos_lite.shapes.wedges import Wedge15

for wheel in ("Multiphysics", "StructuralMechanicsApplication", "LinearSolversApplication"):
    try:
        version(f"Kratos{wheel}")
    except PackageNotFoundError:
        pytest.skip(f"Kratos{wheel} is not installed", allow_module_level=True)

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7620.0)
GRAVITY = kl.Gravity((3.0, -2.0, -9.81))
KINDS = (4, 5, 6, 8, 10, 13, 15, 20, 27)
"""Nodes of the elements."""
OTHER_FUNCTIONS = (13, 15)
"""Kinds whose shape functions are other ones in Kratos, see KratosPyramid13 and KratosWedge15."""
SAME_RULE = (4, 6, 8, 20, 27)
"""Kinds that Kratos integrates by default with our points."""
WITH_FACES = (4, 8, 10, 20, 27)
"""Kinds that have faces of one form only, of 3, 4, 6, 8 and 9 nodes."""


def name_of(kind):
    return f"KinematicLinear3D{kind}N"


def ask(folder, jobs):
    """Return what Kratos answers to jobs, see kratos_driver.py."""
    (folder / "jobs.json").write_text(json.dumps(jobs))
    driver = Path(__file__).with_name("kratos_driver.py")
    output_of(sys.executable, driver, folder / "jobs.json", folder / "answers.json")
    return json.loads((folder / "answers.json").read_text())


def solved_by_kratos(path, model, **job):
    """Return what Kratos answers to a model that is written."""
    kl.write(path, model)
    (found,) = ask(path.parent, [{"mdpa": str(path), "solve": True, **job}])
    return found


def by_node(mesh, values):
    return np.array([values[str(i)] for i in mesh.node_ids])


def distorted_cube(kind, n, amount=0.05):
    mesh = kl.box(cells=(n, n, n), element=name_of(kind))
    shift = np.random.default_rng(kind).uniform(-1, 1, mesh.points.shape)
    return mesh.replace(points=mesh.points + amount / n * shift)


def sheared_cube(kind, n):
    """Return a cube of parallel-sided cells, whose volumes any right node order gives exactly."""
    mesh = kl.box(cells=(n, n, n), element=name_of(kind))
    shear = np.array([[1.1, 0.2, 0.1], [-0.1, 0.9, 0.3], [0.2, -0.3, 1.2]])
    return mesh.replace(points=mesh.points @ shear)


def cube(mesh, *loads):
    model = kl.Model(mesh, STEEL)
    model.fix("z-", "xyz")
    model.fix("z+", "x", 1e-6)
    for load in loads:
        model.add(load)
    return model


def one_cell(kind):
    """Return a model of the reference cell, on which Gauss points are where the rule has them."""
    element = kl.ELEMENTS[name_of(kind)]
    return kl.Model(kl.Mesh(element.nodes, [kl.Block(element.__name__, np.arange(kind)[None])]), STEEL)


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    """By kind: our models and what Kratos says of the files that we wrote from them."""
    folder = tmp_path_factory.mktemp("cubes")
    models = {
        (kind, what): model
        for kind in KINDS
        for what, model in (
            ("cell", one_cell(kind)),
            ("sheared", cube(sheared_cube(kind, 2), GRAVITY)),
            (1, cube(distorted_cube(kind, 1))),  # no gravity: ours is exact in distorted cells
            (2, cube(distorted_cube(kind, 2))),
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
    nodes = mesh.node_ids[block.nodes].tolist()
    connectivity = {str(i): corners for i, corners in zip(block.ids, nodes, strict=True)}
    assert {i: element["nodes"] for i, element in found["elements"].items()} == connectivity
    sides = {"-": "_minus", "+": "_plus"}
    parts = {
        name[0] + sides[name[1]]: mesh.node_ids[part.nodes].tolist() for name, part in mesh.parts.items()
    }
    assert found["parts"] == parts


@pytest.mark.parametrize("kind", KINDS)
def test_kratos_reads_material_and_supports_that_we_write(cubes, kind):
    model, found = cubes[kind, "sheared"]
    constants = {"DENSITY": 7620.0, "YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3}
    assert found["properties"] == {"1": {**constants, "VOLUME_ACCELERATION": [3.0, -2.0, -9.81]}}
    bottom, top = (model.mesh.node_ids[model.mesh.nodes(side)].tolist() for side in ("z-", "z+"))
    expected = [[i, axis, 0.0] for i in bottom for axis in "xyz"] + [[i, "x", 1e-6] for i in top]
    assert sorted(found["fixed"]) == sorted(expected)


@pytest.mark.parametrize("kind", KINDS)
def test_volume_of_each_element_is_that_of_kratos(cubes, kind):
    """A wrong node order of the file would twist the cells."""
    model, found = cubes[kind, "sheared"]
    volumes = model.element_groups()[0].at(model.mesh.points).volume()
    theirs = [sum(element["weights"]) for element in found["elements"].values()]
    close(volumes, np.array(theirs), 1e-14)


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
            square = ((-1, -1), (1, -1), (1, 1), (-1, 1))
            upright = [(1 + a * x) * (1 + b * y) * (1 - z * z) / 4 for a, b in square]
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
            close(ours, np.array(found["elements"][str(number)]["K"]), 1e-12)


@pytest.mark.parametrize("kind", sorted({*KINDS} - {*OTHER_FUNCTIONS}))
@pytest.mark.parametrize("n", [1, 2])
def test_displacements_and_reactions_are_those_of_kratos_at_its_points(cubes, kind, n):
    model, found = cubes[kind, n]
    copy = cube(model.mesh)
    copy.use_rule(kratos_rule(cubes, kind))
    result = copy.solve()
    close(result.displacement(), by_node(model.mesh, found["displacement"]), 1e-12)
    close(result.reaction(), by_node(model.mesh, found["reaction"]), 1e-11)


@pytest.mark.parametrize("kind", [*SAME_RULE, 10])
@pytest.mark.parametrize("n", [1, 2])
def test_displacements_with_our_own_points_are_those_of_kratos(cubes, kind, n):
    """The points of Kratos for 10 nodes are given to 8 digits only."""
    model, found = cubes[kind, n]
    expected = by_node(model.mesh, found["displacement"])
    close(model.solve().displacement(), expected, 2e-8 if kind == 10 else 1e-12)


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


# ---- loads on surfaces and points ----------------------------------------------------------------


def with_conditions(mesh, name, variable, value):
    """Return a document of a cube held at the bottom, with conditions on top, all loaded alike."""
    (face,) = mesh.faces("z+")
    ids = np.arange(1, len(face) + 1)
    conditions = [kl.Block(f"{name}3D{face.nodes.shape[1]}N", face.nodes, ids, 0 * ids + 1, face.shape)]
    loaded = kl.Mesh(mesh.points, mesh.blocks, conditions=conditions)
    bottom = mesh.node_ids[mesh.nodes("z-")]
    held, free = np.ones(len(bottom), dtype=bool), np.zeros(len(ids), dtype=bool)
    values = np.array([value] * len(ids), dtype=float)
    properties = Properties(1, {"DENSITY": 7620.0, "YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3})
    return Document(
        loaded,
        {1: properties},
        nodal_data=[Data(f"DISPLACEMENT_{a}", bottom, held, np.zeros(len(bottom))) for a in "XYZ"],
        condition_data=[Data(variable, ids, free, values)],
    )


def distance_to_kratos(tmp_path, meshes, load, name, variable, value):
    """Return by nodes of a face how far displacements lie apart, read from the file and by hand."""
    apart = {}
    paths = [tmp_path / f"{i}.mdpa" for i in range(len(meshes))]
    for path, mesh in zip(paths, meshes, strict=True):
        kl.write(path, with_conditions(mesh, name, variable, value))
    answers = ask(tmp_path, [{"mdpa": str(path), "solve": True} for path in paths])
    for path, mesh, found in zip(paths, meshes, answers, strict=True):
        read, by_hand = kl.read(path), kl.Model(mesh, STEEL)
        count = 8 if mesh.blocks[0].shape.corners == 4 else 4
        assert found["conditions"] == read.mesh.n_conditions == count
        by_hand.fix("z-")
        by_hand.add(load("z+", value))
        expected = by_node(mesh, found["displacement"])
        apart[read.mesh.conditions[0].nodes.shape[1]] = max(
            float(np.abs(model.solve().displacement() - expected).max() / np.abs(expected).max())
            for model in (read, by_hand)
        )
    return apart


TRACTION = (kl.Traction, "SurfaceLoadCondition", "SURFACE_LOAD", (2e5, -1e5, -3e5))
PRESSURE = (kl.Pressure, "SmallDisplacementSurfaceLoadCondition", "POSITIVE_FACE_PRESSURE", 1e6)


@pytest.mark.parametrize("load", [TRACTION, PRESSURE], ids=["traction", "pressure"])
def test_loads_on_plane_faces_are_those_of_kratos(tmp_path, load):
    apart = distance_to_kratos(tmp_path, [sheared_cube(kind, 2) for kind in WITH_FACES], *load)
    assert sorted(apart) == [3, 4, 6, 8, 9]
    assert apart.pop(6) <= 2e-8  # for its rule of the elements with 10 nodes
    assert max(apart.values()) <= 1e-10


def test_pressures_on_warped_faces_are_those_of_kratos_but_for_six_nodes(tmp_path):
    """Our rule is exact for a pressure on any quadratic triangle; Kratos takes three points, too few."""
    apart = distance_to_kratos(tmp_path, [distorted_cube(kind, 2) for kind in WITH_FACES], *PRESSURE)
    assert 1e-4 < apart.pop(6) < 2e-3
    assert sorted(apart) == [3, 4, 8, 9]
    assert max(apart.values()) <= 1e-10


def test_tractions_on_warped_faces_differ_from_kratos_by_quadrature_only(tmp_path):
    """The area of a warped face is no polynomial; rules of different degree give different numbers."""
    apart = distance_to_kratos(tmp_path, [distorted_cube(kind, 2) for kind in WITH_FACES], *TRACTION)
    assert apart.pop(3) <= 1e-10
    assert sorted(apart) == [4, 6, 8, 9]
    assert max(apart.values()) < 1e-3


def test_point_loads_and_prescribed_displacements_are_those_of_kratos(tmp_path):
    model = kl.Model(distorted_cube(20, 2), STEEL)
    model.fix("z-", "xyz", [1e-5, -2e-5, 3e-5])
    model.fix("z+", "y", 4e-5)
    model.add(kl.PointLoad("x+", (100.0, 200.0, -300.0), each=True))
    found = solved_by_kratos(tmp_path / "a.mdpa", model)
    assert found["conditions"] == len(model.mesh.nodes("x+"))
    for ours in (model, kl.read(tmp_path / "a.mdpa")):
        result = ours.solve()
        close(result.displacement(), by_node(model.mesh, found["displacement"]), 1e-12)
        close(result.reaction(), by_node(model.mesh, found["reaction"]), 1e-11)


# ---- materials and constraints ---------------------------------------------------------------------


def test_orthotropic_body_is_that_of_kratos(tmp_path):
    """Kratos gets the inverse of the compliance that is written out here, and the file that we write."""
    (ex, ey, ez), (nxy, nyz, nxz), (gxy, gyz, gxz) = (11e9, 2e9, 1e9), (0.4, 0.3, 0.35), (0.7e9, 0.2e9, 0.6e9)
    compliance = np.zeros((6, 6))
    normal = [[1 / ex, -nxy / ex, -nxz / ex], [-nxy / ex, 1 / ey, -nyz / ey], [-nxz / ex, -nyz / ey, 1 / ez]]
    compliance[:3, :3] = normal
    compliance[3:, 3:] = np.diag([1 / gxy, 1 / gyz, 1 / gxz])
    wood = kl.Orthotropic3D(ex, ey, ez, nxy, nyz, nxz, gxy, gyz, gxz, density=500.0)
    model = cube(distorted_cube(8, 2), GRAVITY)
    model.assign(wood)
    path = tmp_path / "a.mdpa"
    kl.write(path, model)
    job = {"mdpa": str(path), "solve": True}
    by_matrix, by_file = ask(tmp_path, [{**job, "elasticity": np.linalg.inv(compliance).tolist()}, job])
    expected = by_node(model.mesh, by_matrix["displacement"])
    close(by_node(model.mesh, by_file["displacement"]), expected, 1e-12)
    close(model.solve().displacement(), expected, 1e-12)
    again = kl.read(path)
    assert again.element_groups()[0].material == wood
    path.write_text(path.read_text().replace("YOUNG_MODULUS_X 11", "YOUNG_MODULUS_X 12"))
    with pytest.raises(kl.InputError, match=r"a\.mdpa:1\d*: Properties 1: ELASTICITY_TENSOR is not"):
        kl.read(path)


def test_a_crystal_that_is_turned_is_that_of_kratos(tmp_path):
    C = 1e9 * (np.diag([3.0, 2, 4, 1.5, 1, 2]) + np.cos(np.add.outer(np.arange(6), np.arange(6))) / 4)
    crystal = kl.Anisotropic3D(C, density=500.0).turned(kl.Cartesian((1, 2, 3)).directions((0, 0, 0)))
    model = cube(distorted_cube(8, 2), GRAVITY)
    model.assign(crystal)
    kl.write(tmp_path / "a.mdpa", model)
    (theirs,) = ask(tmp_path, [{"mdpa": str(tmp_path / "a.mdpa"), "solve": True}])
    close(model.solve().displacement(), by_node(model.mesh, theirs["displacement"]), 1e-12)


def hanging(links):
    """Return a cube held at the bottom, with constraints between corners of its top."""
    model = kl.Model(distorted_cube(8, 2), STEEL)
    model.fix("z-")
    model.add(GRAVITY)
    top = model.mesh.nodes("z+").tolist()
    for (dependent, axis), independents, constant in links:
        weights = {(top[i], a): weight for (i, a), weight in independents.items()}
        model.constrain((top[dependent], axis), weights, constant)
    return model


def test_multi_point_constraints_are_those_of_kratos(tmp_path):
    two, moved = ((0, "z"), {(1, "z"): 0.5, (2, "z"): 0.25}, 0.0), ((6, "z"), {(8, "z"): 1.0}, 1e-6)
    model = hanging([two, ((3, "x"), {(4, "x"): -1.5}, 0.0), moved])
    found = solved_by_kratos(tmp_path / "a.mdpa", model)
    assert found["constraints"] == 3
    expected = by_node(model.mesh, found["displacement"])
    close(model.solve().displacement(), expected, 1e-12)
    close(kl.read(tmp_path / "a.mdpa").solve().displacement(), expected, 1e-12)


def test_kratos_shifts_the_directions_of_constraints_that_mix_them(tmp_path):
    """A known fault of its reader: the first independent gets the direction of the dependent, and so on.

    We read such a file as it is written; the numbers of Kratos come out of the shifted directions.
    """
    written = hanging([((3, "x"), {(4, "y"): 1.0, (5, "z"): -0.5}, 0.0)])
    shifted = hanging([((3, "x"), {(4, "x"): 1.0, (5, "y"): -0.5}, 0.0)])
    found = solved_by_kratos(tmp_path / "a.mdpa", written)
    expected = by_node(written.mesh, found["displacement"])
    close(shifted.solve().displacement(), expected, 1e-12)
    close(kl.read(tmp_path / "a.mdpa").solve().displacement(), written.solve().displacement(), 1e-12)


# ---- what Kratos writes, we read -------------------------------------------------------------------


def test_we_read_what_kratos_writes(cubes, tmp_path):
    """Kratos writes ten digits, and loses vectors of the Properties."""
    model, _ = cubes[27, "sheared"]
    ours, theirs = tmp_path / "ours.mdpa", tmp_path / "theirs.mdpa"
    kl.write(ours, model)
    ask(tmp_path, [{"mdpa": str(ours), "write": str(theirs)}])
    first, second = read_document(ours), read_document(theirs)
    close(second.mesh.points, first.mesh.points, 1e-10)
    assert np.array_equal(first.mesh.node_ids, second.mesh.node_ids)
    for one, other in zip(first.mesh.blocks, second.mesh.blocks, strict=True):
        assert one.name == other.name
        for column in ("nodes", "ids", "properties"):
            assert np.array_equal(getattr(one, column), getattr(other, column))
    parts = [{name: part.nodes.tolist() for name, part in d.mesh.parts.items()} for d in (first, second)]
    assert parts[0] == parts[1]
    for key in ("DENSITY", "YOUNG_MODULUS", "POISSON_RATIO"):
        assert second.properties[1].values[key] == first.properties[1].values[key]
    again = kl.read(theirs)
    assert np.array_equal(again.supports.fixed, model.supports.fixed)
    again.add(GRAVITY)
    close(again.solve().displacement(), model.solve().displacement(), 1e-8)


# ---- elements of a solved model ------------------------------------------------------------------

QUANTITIES = (
    "CAUCHY_STRESS_VECTOR", "CAUCHY_STRESS_TENSOR", "PK2_STRESS_VECTOR", "PK2_STRESS_TENSOR",
    "VON_MISES_STRESS", "GREEN_LAGRANGE_STRAIN_VECTOR", "GREEN_LAGRANGE_STRAIN_TENSOR", "STRAIN_ENERGY",
    "CONSTITUTIVE_MATRIX", "INTEGRATION_WEIGHT",
)  # fmt: skip
"""What SmallDisplacementElement offers of our quantities, apart from the places of the points."""


@pytest.mark.parametrize("kind", SAME_RULE)
def test_values_at_integration_points_and_local_systems_are_those_of_kratos(kind, tmp_path):
    model = cube(distorted_cube(kind, 2))
    names = ["INTEGRATION_COORDINATES", *QUANTITIES]
    found = solved_by_kratos(tmp_path / "cube.mdpa", model, values=names)
    result = model.solve()
    for element in (1, model.mesh.n_elements):
        theirs = found["values"][str(element)]
        at = np.array(theirs["INTEGRATION_COORDINATES"])
        ours = result.at_integration_points("INTEGRATION_COORDINATES", element=element)
        order = np.abs(ours[None] - at[:, None]).max(axis=2).argmin(axis=1)  # ours of each point of theirs
        close(ours[order], at, 1e-12)
        for name in QUANTITIES:
            value = result.at_integration_points(name, element=element)[order]
            close(value, np.array(theirs[name]), 1e-9)
        local = model.local_system(element, result.u)
        close(local.K, np.array(theirs["K"]), 1e-12)
        close(local.r, np.array(theirs["r"]), 1e-9)
        # by other rules on distorted cells
        assert abs(local.M.sum() / np.array(theirs["M"]).sum() - 1) < 1e-3


def test_mean_dilatation_is_that_of_kratos(tmp_path):
    """SmallDisplacementBbarElement3D8N against BBar3D8N, on distorted cells with ν near ½."""
    rubber = kl.Isotropic3D(E=1e6, nu=0.499, density=1000.0)
    model = kl.Model(distorted_cube(8, 2), rubber, formulation="b_bar")
    model.fix("z-", "xyz")
    model.fix("z+", "x", 1e-3)
    model.add(GRAVITY)
    assert kl.write(tmp_path / "cube.mdpa", model) == []
    found = solved_by_kratos(tmp_path / "cube.mdpa", model)
    for element in (1, model.mesh.n_elements):
        close(model.local_system(element).K, np.array(found["elements"][str(element)]["K"]), 1e-12)
    close(model.solve().u, by_node(model.mesh, found["displacement"]), 1e-9)
    assert [group.element for group in kl.read(tmp_path / "cube.mdpa").element_groups()] == [kl.BBar3D8N]


def test_springs_and_masses_on_nodes_are_those_of_kratos(tmp_path):
    """A block that stands on four springs, with the weight of masses, and a horizontal force."""
    model = kl.Model(sheared_cube(8, 2), STEEL)
    corners = model.mesh.points[[0, 2, 6, 8]]
    for k, corner in zip((1e5, 2e5, 3e5, 4e5), corners, strict=True):
        model.add(kl.ElasticSupport(corner, (k, 2 * k, 3 * k)))
    model.add_mass(corners[0], 1e3)
    model.add_mass(model.mesh.points[-1], 2e3)
    model.add(GRAVITY)
    found = solved_by_kratos(tmp_path / "springs.mdpa", model)
    u = by_node(model.mesh, found["displacement"])
    assert np.abs(model.solve().u - u).max() < 1e-8 * np.abs(u).max()
    assert np.abs(kl.read(tmp_path / "springs.mdpa").solve().u - u).max() < 1e-8 * np.abs(u).max()
