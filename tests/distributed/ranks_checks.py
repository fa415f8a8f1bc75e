"""Checks of a model over ranks: errors and warnings are those of the whole model on one process."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.distributed.scatter import scattered
from kratos_lite.errors import KratosLiteError, MeshError, ModelError

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)


def random_parts(mesh, size):
    return np.random.default_rng(5).integers(size, size=mesh.n_elements)


def halves(mesh, size):
    """Slabs along x."""
    x = np.concatenate([mesh.points[block.nodes].mean(axis=1)[:, 0] for block in mesh.blocks])
    return np.argsort(np.argsort(x, kind="stable")) * size // len(x)


CUTS = [random_parts, halves]


def cube(cells=(4, 3, 2), element="EnhancedStrain3D8N"):
    return kl.box((4.0, 3.0, 2.0), cells, element)


def moved(mesh, row, place):
    points = mesh.points.copy()
    points[row] = place
    return mesh.replace(points=points)


def two_boxes(gap=0.0, element="EnhancedStrain3D8N"):
    """Two boxes along x with nodes of their own."""
    one = kl.box((2.0, 2.0, 2.0), (3, 2, 2), element)
    points = np.concatenate([one.points, one.points + np.array([2.0 + gap, 0, 0])])
    (block,) = one.blocks
    return kl.Mesh(points, {element: np.concatenate([block.nodes, block.nodes + one.n_nodes])})


def with_nodes(mesh, *places):
    ids = np.arange(1, mesh.n_nodes + len(places) + 1)
    return kl.Mesh(np.vstack([mesh.points, *places]), mesh.blocks, node_ids=ids, parts=mesh.parts)


def held(mesh, material=STEEL):
    model = kl.Model(mesh, material)
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def free(mesh):
    model = kl.Model(mesh, STEEL)
    model.add(kl.Gravity((0, 0, -9.81)))
    return model


def at_an_edge(mesh):
    model = free(mesh)
    model.fix("y-")
    return model


def both_ends(mesh):
    model = held(mesh)
    model.fix("x+")
    return model


def along_x_only(mesh):
    model = free(mesh)
    model.fix("x-", "x")
    return model


def on_a_line(mesh):
    model = free(mesh)
    model.fix(lambda X: (X[:, 0] == 0) & (X[:, 2] == 0))
    return model


def part_held(mesh):
    """The first of several pieces is fixed."""
    model = free(mesh)
    model.fix("x-")
    return model


def without_material(mesh):
    mesh.add_part("left", lambda X: X[:, 0] <= 2.0)
    model = kl.Model(mesh, {"left": STEEL})
    model.fix("x-")
    return model


def idle(mesh):
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    model.add(kl.PointLoad("x-", (0, 1.0, 0)))
    return model


def nothing(mesh):
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    return model


def without_mass(mesh):
    return held(mesh, kl.Isotropic3D(E=210e9, nu=0.3))


def loaded_outside(mesh):
    model = held(mesh)
    model.add(kl.PointLoad(lambda X: X[:, 0] > 4.5, (0, 1.0, 0)))
    return model


def constrained_outside(mesh):
    model = held(mesh)
    rows = mesh.node_rows([mesh.node_ids.max()])
    if rows[0] >= 0:
        model.constrain((int(rows[0]), "x"), {}, 0.0)
    return model


def twice(mesh):
    model = held(mesh)
    model.fix(lambda X: (X[:, 0] == 4) & (X[:, 1] == 3) & (X[:, 2] == 2), "z", 1e-3)
    model.fix(lambda X: (X[:, 0] == 4) & (X[:, 1] == 3), "z", 2e-3)
    return model


def nobody(mesh):
    model = held(mesh)
    model.fix(lambda X: X[:, 0] > 100)
    return model


def no_face(mesh):
    model = held(mesh)
    model.add(kl.Traction(lambda X: X[:, 0] == 2.0, (1e6, 0, 0)))
    return model


def no_part(mesh):
    model = held(mesh)
    model.fix("clamp")
    return model


def equal(mesh):
    model = held(mesh)
    model.loads += [kl.Traction("x+", (1e6, 0, 0)), kl.Traction("x+", (1e6, 0, 0))]
    return model


def units(mesh):
    return held(mesh, kl.Isotropic3D(E=210e3, nu=0.3, density=1.0))


def soft_and_hard(mesh):
    mesh.add_part("left", lambda X: X[:, 0] <= 2.0)
    model = kl.Model(mesh, kl.Isotropic3D(E=2e-1, nu=0.3))
    model.assign(STEEL, "left")
    model.fix("x-")
    return model


def near_half(mesh):
    return held(mesh, kl.Isotropic3D(E=1e7, nu=0.4999, density=1000.0))


def hinged():
    """Two boxes that share the nodes of one edge."""
    mesh = two_boxes(0.0)
    points, nodes = mesh.points, mesh.blocks[0].nodes.copy()
    n = len(points) // 2
    for row in np.flatnonzero((points[n:, 0] == 2.0) & (points[n:, 2] == 0.0)) + n:
        nodes[nodes == row] = np.flatnonzero((points[:n] == points[row]).all(axis=1))[0]
    return kl.Mesh(points, {"EnhancedStrain3D8N": nodes})


def many():
    """More loose cubes than are looked at with full matrices."""
    one = kl.box((1.0, 1.0, 1.0))
    shifts = [[1.5 * i, 0, 0] for i in range(45)]
    points = np.concatenate([one.points + shift for shift in shifts])
    nodes = np.concatenate([one.blocks[0].nodes + 8 * i for i in range(45)])
    return kl.Mesh(points, {"EnhancedStrain3D8N": nodes})


def wall(element, cells=(6, 6, 4), taper=0.0):
    """A thin plate with some cells through its thickness, along x, which the ranks cut."""
    mesh = kl.box((1.0, 20.0, 20.0), cells[::-1], element)
    points = mesh.points.copy()
    points[:, 1] *= 1 + taper * points[:, 0]
    return mesh.replace(points=points)


def doubled(mesh):
    blocks = [mesh.blocks[0].take(np.append(np.arange(mesh.n_elements), [0, 5]))]
    ids = np.arange(1, len(blocks[0]) + 1)
    return mesh.replace(blocks=[kl.Block(blocks[0].name, blocks[0].nodes, ids)])


def inverted():
    """Two nodes far off, so that elements around are turned inside out."""
    mesh = cube()
    rows = [np.flatnonzero((mesh.points == place).all(axis=1))[0] for place in ([1, 1, 1], [3, 2, 1])]
    return moved(mesh, rows, [[3.5, 1, 1], [0.5, 2, 1]])


def uses_a_node_twice():
    mesh = cube()
    nodes = mesh.blocks[0].nodes.copy()
    nodes[7, 3] = nodes[7, 2]
    nodes[11, 3] = nodes[11, 2]
    return mesh.replace(blocks={"EnhancedStrain3D8N": nodes})


def half_held(mesh):
    model = free(mesh)
    model.fix(lambda X: X[:, 0] < 1.0)
    return model


def tied(count):
    """Build two boxes of which the first is held, and some nodes of the second follow those of the first."""

    def build(mesh):
        model = part_held(mesh)
        for one, other in TIES[:count]:
            rows = mesh.node_rows([one, other])
            if (rows >= 0).all():
                for axis in "xyz":
                    model.constrain((int(rows[1]), axis), {(int(rows[0]), axis): 1.0})
        return model

    return build


TIES = [(28, 37), (36, 45), (30, 39), (34, 43), (29, 38)]
"""Ids of nodes at the same place in two boxes."""


def orders():
    """Bricks of 20 nodes between those of 8, which have the same corners alone."""
    mesh = cube((4, 2, 2), "KinematicLinear3D20N")
    nodes = mesh.blocks[0].nodes
    linear = np.zeros(len(nodes), dtype=bool)
    linear[::3] = True
    cells = {"KinematicLinear3D20N": nodes[~linear], "KinematicLinear3D8N": nodes[linear][:, :8]}
    return kl.Mesh(mesh.points, cells)


def halved():
    """Bricks beside tetrahedra without pyramids between, on nodes of a grid."""
    one = cube((4, 2, 2), "KinematicLinear3D8N")
    left = one.points[one.blocks[0].nodes].mean(axis=1)[:, 0] < 2
    other = cube((4, 2, 2), "KinematicLinear3D4N")
    right = other.points[other.blocks[0].nodes].mean(axis=1)[:, 0] > 2
    bricks, tetrahedra = one.blocks[0].nodes[left], other.blocks[0].nodes[right]
    return kl.Mesh(one.points, {"KinematicLinear3D8N": bricks, "KinematicLinear3D4N": tetrahedra})


def own_rule(mesh):
    model = held(mesh)
    model.use_rule(1)
    return model


MODELS = {
    "sound": (held, cube),
    "free": (free, cube),
    "free_along_yz": (along_x_only, cube),
    "free_to_turn": (on_a_line, cube),
    "loose": (part_held, lambda: two_boxes(1.0)),
    "coincident": (both_ends, two_boxes),
    "hinged": (half_held, hinged),
    "many": (half_held, many),
    "without_material": (without_material, cube),
    "inverted": (held, inverted),
    "node_twice": (held, uses_a_node_twice),
    "idle": (idle, cube),
    "nothing": (nothing, cube),
    "without_mass": (without_mass, cube),
    "unused": (held, lambda: with_nodes(cube(), [[5.0, 0, 0]], [[5.0, 1, 0]])),
    "unused_and_loaded": (loaded_outside, lambda: with_nodes(cube(), [[5.0, 0, 0]])),
    "unused_and_constrained": (constrained_outside, lambda: with_nodes(cube(), [[5.0, 0, 0]])),
    "twice": (twice, cube),
    "nobody": (nobody, cube),
    "no_face": (no_face, cube),
    "no_part": (no_part, cube),
    "equal_loads": (equal, cube),
    "units": (units, cube),
    "soft_and_hard": (soft_and_hard, cube),
    "near_half": (near_half, lambda: cube(element="KinematicLinear3D8N")),
    "bending": (at_an_edge, lambda: wall("KinematicLinear3D8N")),
    "one_layer": (at_an_edge, lambda: wall("KinematicLinear3D8N", (6, 6, 1))),
    "b_bar": (at_an_edge, lambda: wall("BBar3D8N", (6, 6, 1))),
    "tapered": (at_an_edge, lambda: wall("EnhancedStrain3D8N", (4, 4, 2), 0.4)),
    "wedges": (at_an_edge, lambda: wall("KinematicLinear3D6N", (4, 4, 3))),
    "tetrahedra": (held, lambda: cube(element="KinematicLinear3D4N")),
    "reduced_chain": (held, lambda: kl.box((4.0, 1.0, 1.0), (4, 1, 1), "Reduced3D20N")),
    "reduced_block": (held, lambda: kl.box((4.0, 2.0, 2.0), (4, 2, 2), "Reduced3D20N")),
    "doubled": (held, lambda: doubled(cube())),
    "tied_by_3": (tied(3), two_boxes),
    "tied_by_2": (tied(2), two_boxes),
    "tied_by_1": (tied(1), two_boxes),
    "orders": (held, orders),
    "halved": (held, halved),
    "own_rule": (own_rule, cube),
    "far_off": (held, lambda: cube().replace(points=cube().points + 1e9)),
}


def said(build, mesh):
    """Return the text of the error, or the warnings and the table of a model."""
    try:
        model = build(mesh)
        warnings = StaticAnalysis(model).check()
        return [*warnings, *map(": ".join, model.table())]
    except KratosLiteError as error:
        return f"{type(error).__name__}: {error}"


def test_text(ranks, name, cut):
    build, make = MODELS[name]
    whole = make()
    together = [whole.node_rows(list(pair)) for pair in TIES] if name.startswith("tied") else []
    mesh = scattered(whole, ranks, cut(whole, ranks.size), together=together)
    assert said(build, mesh) == said(build, whole)


test_text.cases = [(name, cut) for name in MODELS for cut in CUTS]


def test_ranks_without_elements(ranks):
    whole = cube()
    mesh = scattered(whole, ranks, np.zeros(whole.n_elements, dtype=int))
    assert said(held, mesh) == said(held, whole)
    assert said(free, mesh) == said(free, whole)


def test_parts(ranks):
    whole = cube()
    mesh = scattered(whole, ranks, halves(whole, ranks.size))
    with pytest.raises(MeshError, match="there is no node at"):
        mesh.nodes((0.1, 0.2, 0.3))
    corner = mesh.nodes((4.0, 3.0, 2.0))
    assert ranks.sum(int(mesh.own_nodes[corner].sum())) == 1
    with pytest.raises(MeshError, match=r"no element has property 7; the properties are \[1\]"):
        mesh.elements(7)
    with pytest.raises(ModelError, match="nothing is prescribed"):
        kl.Model(mesh, STEEL).release("x-")


def test_a_load_at_a_point(ranks):
    whole = cube()
    for cut in CUTS:
        mesh = scattered(whole, ranks, cut(whole, ranks.size))
        for place in ((4.0, 3.0, 2.0), (2.0, 1.5, 1.0), (1.3, 0.7, 0.2)):
            load = kl.PointLoad(place, (1.0, 2.0, 3.0))
            load.check(mesh)
            given, expected = load.forces(mesh, []), load.forces(whole, [])
            own = mesh.own_nodes
            assert np.allclose(given[own], expected[whole.node_rows(mesh.node_ids[own])], atol=1e-15)
            assert np.allclose(ranks.sum(given[own].sum(axis=0)), [1.0, 2.0, 3.0])
        with pytest.raises(MeshError, match="outside the mesh"), ranks.together():
            kl.PointLoad((9.0, 0.0, 0.0), (1.0, 0, 0)).check(mesh)
