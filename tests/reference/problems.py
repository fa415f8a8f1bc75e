"""Random problems from a seed: distorted boxes of all kinds of cells, random supports, loads and links."""

from itertools import product

import numpy as np

from tests.reference import shapes, solid
from tests.reference.solid import Problem

QUADRATIC = {4: 10, 5: 13, 6: 15, 8: 20}
UPPER = np.array(list(product((0, 1), repeat=3)))
"""Corners of a box: 4 x + 2 y + z."""
BRICK = (0, 4, 6, 2, 1, 5, 7, 3)
WEDGES = ((0, 4, 6, 1, 5, 7), (0, 6, 2, 1, 7, 3))
TETS = [(0, 4, 6, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7), (0, 1, 5, 7), (0, 5, 4, 7)]
"""Six tetrahedra about the diagonal; on each side the diagonal runs from the least to the largest corner."""
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Sides x- x+ y- y+ z- z+, counter-clockwise from outside."""


def random_problem(seed):
    """Return the problem of a seed."""
    rng = np.random.default_rng(seed)
    points, cells = random_mesh(rng)
    materials = [random_material(rng) for _ in range(rng.integers(1, 4))]
    cells = [(kind, nodes, int(rng.integers(len(materials)))) for kind, nodes in cells]
    problem = Problem(points, cells, materials)
    add_loads(problem, rng)
    add_supports(problem, rng)
    if rng.random() < 0.3:
        problem.prestress = 1e4 * rng.uniform(-1, 1, (len(cells), 6))
    if rng.random() < 0.3:
        problem.stress_free = 1e-3 * rng.uniform(-1, 1, points.shape)
    return problem


# ---- meshes ----------------------------------------------------------------------------------------


def random_mesh(rng):
    """Return points (n, 3) and cells (kind, nodes) of a distorted box."""
    counts = rng.integers(1, 3, 3) + (rng.random(3) < 0.15)
    order = rng.choice(["linear", "quadratic", "27"], p=[0.5, 0.35, 0.15])
    if order != "linear":
        counts = np.minimum(counts, 2)
        counts[rng.integers(3)] = 1
    boxes = list(np.ndindex(*counts))
    if len(boxes) > 2 and rng.random() < 0.15:  # a gap, which may leave a hinge
        boxes.pop(int(rng.integers(len(boxes))))
    kinds = random_kinds(rng, boxes, order)
    shape = counts + 1
    lines = [np.cumsum([0.0, *rng.uniform(0.5, 1.5, count)]) for count in counts]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = []
    for box, kind in kinds.items():
        corners = [int(np.ravel_multi_index(np.add(box, upper), shape)) for upper in UPPER]
        points = fill(points, cells, corners, kind, box, kinds)
    points = points + (rng.random() < 0.8) * rng.uniform(-0.05, 0.05, points.shape)
    if order != "linear":
        points, cells = with_middles(points, cells, order, rng)
    return without_lone_nodes(points @ random_frame(rng).T, cells)


def random_kinds(rng, boxes, order):
    """Return how each box is cut: brick, wedges, tets or pyramids (with tets) about its center.

    A side has its diagonal where a neighbor cut into wedges or tets has one; boxes that disagree are cut
    about their center, where each side is a pyramid or two tetrahedra.
    """
    if order == "27":
        return dict.fromkeys(boxes, "brick")
    choice = rng.choice(["brick", "wedges", "tets", "center", "mixed"], p=[0.15, 0.1, 0.15, 0.1, 0.5])
    names = ["brick", "wedges", "tets", "center"] if choice == "mixed" else [choice]
    kinds = {box: str(rng.choice(names)) for box in boxes}
    for box in boxes:
        for side in range(6):
            other = kinds.get(neighbor(box, side), "center")
            if "center" not in (kinds[box], other) and split(kinds[box], side) != split(other, side):
                kinds[box] = "center"
    return kinds


def neighbor(box, side):
    step = np.zeros(3, dtype=int)
    step[side // 2] = 2 * (side % 2) - 1
    return tuple(int(i) for i in np.add(box, step))


def split(kind, side):
    """Return whether a box of some kind has triangles on a side."""
    return kind == "tets" or (kind == "wedges" and side >= 4)


def fill(points, cells, corners, kind, box, kinds):
    """Add the cells of a box; return the points, with a center where there is one."""
    cuts = {"brick": [(8, BRICK)], "wedges": [(6, w) for w in WEDGES], "tets": [(4, t) for t in TETS]}
    for number, local in cuts.get(kind, []):
        cells.append((number, tuple(corners[i] for i in local)))
    if kind != "center":
        return points
    center = len(points)
    for side, face in enumerate(SIDES):
        a, b, c, d = (corners[i] for i in reversed(face))  # from inside
        if split(kinds.get(neighbor(box, side), "brick"), side):
            low, high = min(face), max(face)
            others = [i for i in face if i not in (low, high)]
            for other in others:
                face_nodes = oriented(points, corners[low], corners[high], corners[other], corners)
                cells.append((4, (*face_nodes, center)))
        else:
            cells.append((5, (a, b, c, d, center)))
    return np.vstack([points, points[corners].mean(axis=0)])


def oriented(points, a, b, c, corners):
    """Return three nodes counter-clockwise as seen from the middle of the corners."""
    inward = points[corners].mean(axis=0) - points[a]
    turn = np.cross(points[b] - points[a], points[c] - points[a]) @ inward
    return (a, b, c) if turn > 0 else (a, c, b)


def with_middles(points, cells, order, rng):
    """Return points and cells with nodes on edges, and in faces and cells of 27 nodes."""
    points, made, full = list(points), {}, []
    curved = rng.random() < 0.6

    def middle(nodes):
        key = frozenset(nodes)
        if key not in made:
            made[key] = len(points)
            points.append(
                np.mean([points[n] for n in nodes], axis=0) + curved * rng.uniform(-0.015, 0.015, 3)
            )
        return made[key]

    for kind, nodes in cells:
        new = 27 if order == "27" else QUADRATIC[kind]
        more = [middle([nodes[i] for i in edge]) for edge in shapes.EDGES[new]]
        if new == 27:
            more += [middle([nodes[i] for i in face]) for face in [*shapes.BRICK_FACES, range(8)]]
        full.append((new, (*nodes, *more)))
    return np.array(points), full


def random_frame(rng):
    """Return a rotation or 1."""
    if rng.random() < 0.5:
        return np.eye(3)
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q)) if np.linalg.det(Q) else R


def without_lone_nodes(points, cells):
    """Return points and cells without the nodes that no cell uses."""
    used = sorted({node for _, nodes in cells for node in nodes})
    new = {node: row for row, node in enumerate(used)}
    return points[used], [(kind, tuple(new[node] for node in nodes)) for kind, nodes in cells]


# ---- materials, loads and supports -------------------------------------------------------------------


def random_material(rng):
    """Return C, the density, and the constants that it was made of."""
    density, E = rng.uniform(500, 9000), 10 ** rng.uniform(7, 8)
    if rng.random() < 0.5:
        constants = (E, rng.uniform(-0.3, 0.45))
        return solid.isotropic(*constants), density, constants
    constants = (*(E * rng.uniform(0.5, 2, 3)), *rng.uniform(0, 0.25, 3), *(E * rng.uniform(0.2, 0.6, 3)))
    return solid.orthotropic(*constants), density, constants


def add_loads(problem, rng):
    n = len(problem.points)
    faces = solid.boundary(problem)

    def some_faces():
        chosen = rng.choice(len(faces), min(len(faces), int(rng.integers(1, 4))), replace=False)
        return sorted({node for f in chosen for node in faces[f]})

    if rng.random() < 0.6:
        problem.gravity = rng.uniform(-10, 10, 3)
    if rng.random() < 0.4:
        problem.body_force = 1e4 * rng.uniform(-1, 1, (n, 3))
    if rng.random() < 0.5:
        problem.forces = {int(node): 1e3 * rng.uniform(-1, 1, 3) for node in rng.choice(n, 3, replace=False)}
    if rng.random() < 0.5:
        problem.tractions = [(some_faces(), 1e4 * rng.uniform(-1, 1, 3)) for _ in range(2)]
    if rng.random() < 0.5:
        problem.pressures = [(some_faces(), 1e4 * rng.uniform(-1, 1, n)) for _ in range(2)]


def add_supports(problem, rng):
    """Fix a face, enough single displacements, or too few; tie some others."""
    n = len(problem.points)
    faces = solid.boundary(problem)
    way = rng.choice(["face", "scattered", "few"], p=[0.6, 0.25, 0.15])
    if way == "face":
        held = [3 * node + axis for node in faces[rng.integers(len(faces))] for axis in range(3)]
    else:
        count = int(rng.integers(8, 14) if way == "scattered" else rng.integers(0, 7))
        held = rng.choice(3 * n, min(count, 3 * n), replace=False).tolist()
    moved = rng.random() < 0.5
    problem.fixed = {int(dof): float(moved * 1e-3 * rng.uniform(-1, 1)) for dof in held}
    free = [dof for dof in range(3 * n) if dof not in problem.fixed]
    rng.shuffle(free)
    while rng.random() < 0.4 and len(free) > 6:
        dependent, *independents = (int(free.pop()) for _ in range(int(rng.integers(2, 4))))
        weights = rng.uniform(0.3, 1.5, len(independents)) * rng.choice([-1, 1], len(independents))
        constant = float(moved * 1e-3 * rng.uniform(-1, 1))
        problem.links.append((dependent, dict(zip(independents, weights.tolist(), strict=True)), constant))
