"""Statics over ranks: displacements, reactions, stresses, errors and the table are those of one process."""

import re

import numpy as np
import pytest
from ranks_checks import CUTS, cube, held, random_parts

import kratos_lite as kl
from kratos_lite.distributed.scatter import scattered
from kratos_lite.errors import ModelError

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)
SOFT = kl.Isotropic3D(E=3e9, nu=0.35, density=1200.0)


def bent(mesh):
    """A cantilever of two materials under its weight, a traction, a pressure and a force at a point."""
    mesh.add_part("right", lambda X: X[:, 0] >= 2.0)
    model = kl.Model(mesh, STEEL)
    model.assign(SOFT, "right")
    model.fix("x-")
    model.fix((4.0, 0.0, 0.0), "y", 1e-6)
    model.add(kl.Gravity((0, 0, -9.81)))
    model.add(kl.Traction("x+", (0, 2e3, -1e4)))
    model.add(kl.Pressure("z+", 5e3))
    model.add(kl.PointLoad((1.3, 0.7, 0.2), (1e3, 0.0, 2e3)))
    return model


def prestressed(mesh):
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    x = mesh.points[:, :1]
    model.stress_free_at(1e-6 * np.hstack([x, x**2, 0 * x]))
    model.add_prestress([1e5, 0, 0, 2e4, 0, 0])
    model.add(kl.Traction("x+", (0, 2e3, -1e4)))
    return model


def still(mesh):
    model = kl.Model(mesh, STEEL)
    model.fix("x-")
    return model


def close(found, expected, scale=None):
    size = np.abs(expected).max(initial=0.0) if scale is None else scale
    return np.abs(found - expected).max(initial=0.0) <= 1e-8 * max(size, 1e-300)


def check(ranks, build, whole, parts):
    serial = build(whole).solve()
    mesh = scattered(whole, ranks, parts)
    result = build(mesh).solve()
    rows = whole.node_rows(mesh.node_ids)
    place = {one: i for i, one in enumerate(whole.element_ids.tolist())}
    cells = np.array([place[one] for one in mesh.element_ids.tolist()], dtype=int)
    assert close(result.u, serial.u[rows], np.abs(serial.u).max())
    assert close(result.reactions, serial.reactions[rows], np.abs(serial.reactions).max())
    assert close(result.loads, serial.loads[rows], np.abs(serial.loads).max())
    for stress in (result.stress, result.strain):
        expected = getattr(serial, stress.__name__)
        for at, mine in (("element", cells), ("averaged", rows), ("node", rows)):
            assert close(stress(at), expected(at)[mine], np.abs(expected(at)).max()), at
    assert abs(result.energy() / serial.energy() - 1) < 1e-8
    found, expected = result.error(), serial.error()
    own = mesh.own_elements
    size = (2 * serial.energy()) ** 0.5
    assert close(found.per_element[own], expected.per_element[cells[own]], size)
    assert found.warnings == expected.warnings
    assert abs(found.relative - expected.relative) <= 1e-8
    assert abs(result.largest_von_mises()[0] - serial.largest_von_mises()[0]) <= 1e-8 * 1e12
    point = [[0.3, 0.4, 0.5], [2.0, 1.0, 1.0], [3.9, 2.9, 1.9]]
    at, there = result.at(point), serial.at(point)
    assert close(at.displacement, there.displacement)
    assert close(at.strain[[0, 2]], there.strain[[0, 2]])
    return table(result), table(serial)


def table(result):
    """Return the rows that the way of solving does not change, with numbers to six digits."""
    own = ("solver", "iterations", "backward error", "equilibrium", "seconds", "peak memory", "kernels")
    rows = [(name, text) for name, text in result.table() if name not in (*own, "skipped")]
    number = re.compile(r"-?\d+\.\d+(?:e[+-]\d+)?|-?\d+e[+-]\d+")
    return [(name, number.sub(lambda m: f"{float(m[0]):.4g}", text)) for name, text in rows]


ELEMENTS = [
    ("EnhancedStrain3D8N", (5, 4, 3)),
    ("KinematicLinear3D8N", (4, 1, 1)),
    ("KinematicLinear3D4N", (4, 3, 2)),
    ("KinematicLinear3D10N", (4, 2, 2)),
    ("KinematicLinear3D6N", (4, 3, 2)),
    ("KinematicLinear3D15N", (4, 2, 2)),
    ("KinematicLinear3D20N", (4, 3, 3)),
    ("KinematicLinear3D27N", (4, 2, 2)),
    ("BBar3D8N", (4, 3, 3)),
]


def test_result(ranks, element, cells, cut):
    whole = cube(cells, element)
    found, expected = check(ranks, bent, whole, cut(whole, ranks.size))
    assert found == expected


test_result.cases = [(*one, cut) for one in ELEMENTS for cut in CUTS]


def test_initial_stress(ranks):
    whole = cube((5, 4, 3))
    stress = check(ranks, prestressed, whole, random_parts(whole, ranks.size))
    assert stress[0] == stress[1]


def test_nothing_moves(ranks):
    whole = cube()
    mesh = scattered(whole, ranks, random_parts(whole, ranks.size))
    result = still(mesh).solve()
    assert not result.u.any()
    assert table(result) == table(still(whole).solve())


def test_more_ranks_than_elements(ranks):
    whole = kl.box((4.0, 3.0, 2.0), (2, 1, 1))
    found, expected = check(ranks, held, whole, np.zeros(2, dtype=int))
    assert found == expected


def test_changes_are_followed(ranks):
    whole = cube()
    mesh = scattered(whole, ranks, random_parts(whole, ranks.size))
    one, other = bent(whole).static(), bent(mesh).static()
    rows = whole.node_rows(mesh.node_ids)
    for change in (
        lambda model: model.fix((4.0, 0.0, 0.0), "y", 3e-6, override=True),
        lambda model: model.fix("x+", "z", 1e-6),
        lambda model: model.assign(SOFT),
    ):
        change(one.model)
        change(other.model)
        expected = one.solve().u
        assert close(other.solve().u, expected[rows], np.abs(expected).max())
    cases = {"weight": kl.Gravity((0, 0, -9.81)), "pull": kl.Traction("x+", (1e6, 0, 0))}
    both = one.solve_cases(cases), other.solve_cases(cases)
    for name in cases:
        assert close(both[1][name].u, both[0][name].u[rows], np.abs(both[0][name].u).max())
    other.release()


def test_what_needs_the_whole_mesh_is_refused(ranks):
    whole = cube()
    mesh = scattered(whole, ranks, random_parts(whole, ranks.size))
    model = bent(mesh)
    result = model.solve()
    if ranks.size == 1:
        return
    for ask in (
        model.plot,
        lambda: kl.RigidBody(mesh=mesh, material=STEEL),
        result.plot,
        lambda: result.error(of=kl.MeanDisplacement("x+", "z")),
        lambda: result.at([[0.3, 0.4, 0.5]], recovered=True).stress,
        lambda: result.along((0, 1, 1), (4, 1, 1), recovered=True).stress,
    ):
        with pytest.raises(ModelError, match="whole mesh"), ranks.together():
            ask()
