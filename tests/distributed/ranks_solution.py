"""Statics over ranks: displacements, reactions and report are those of one process."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed import cut
from kratos_lite.distributed.communicator import started
from kratos_lite.errors import InputError, SolveError
from kratos_lite.mesh import Block

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
EXACT = -1.3221477551020406e-4


# ---- ways to cut a mesh ------------------------------------------------------------------------


def slabs(points, groups, size):
    """Cut across z."""
    z = np.concatenate([points[group.nodes].mean(axis=1)[:, 2] for group in groups])
    return np.minimum((z / np.ptp(points[:, 2]) * size).astype(int), size - 1)


def at_random(points, groups, size):
    return np.random.default_rng(1).integers(0, size, sum(map(len, groups)))


def one_empty(points, groups, size):
    """Leave the first rank without elements, if there are several."""
    return at_random(points, groups, size) % max(size - 1, 1) + (size > 1)


# ---- models of a mesh ---------------------------------------------------------


def cube(mesh):
    model = kl.Model(mesh, STEEL)
    for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
        model.fix(side, axis)
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    return model


def clamped(mesh):
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    model.add(kl.Gravity((3.0, 5.0, -9.81)))
    return model


def pulled(mesh):
    """Loads on faces and nodes, materials by element."""
    model = kl.Model(mesh, STEEL)
    model.fix("z-")
    right = [mesh.points[block.nodes].mean(axis=1)[:, 0] > 0.5 for block in mesh.blocks]
    model.assign(kl.Isotropic3D(E=2e4, nu=0.4, density=900.0), np.flatnonzero(np.concatenate(right)))
    model.add(kl.Traction("z+", (10.0, 20.0, -30.0)))
    model.add(kl.Pressure("x+", 50.0))
    model.add(kl.PointLoad("y+", (0.0, 5.0, 7.0), each=True))
    return model


def displaced(mesh):
    model = clamped(mesh)
    model.fix("z+", "xz", (1e-3, -2e-3))
    return model


def initial(mesh):
    model = clamped(mesh)
    ids = mesh.element_ids[:, None] + np.arange(6)
    model.add_prestress(1e3 * np.sin(ids))
    model.set_stress_free_state(1e-4 * np.cos(mesh.points[:, [1, 2, 0]] * 5))
    return model


def tied(mesh):
    """A chain of constraints through the body, and one with weights."""
    model = clamped(mesh)
    for (dependent, axis), independents, constant in CHAIN:
        model.constrain(
            (dependent - 1, axis), {(node - 1, a): w for (node, a), w in independents.items()}, constant
        )
    return model


CHAIN = (
    ((105, "z"), {(32, "z"): 1.0}, 0.0),
    ((32, "z"), {(15, "z"): 0.5, (67, "z"): 0.5}, 1e-4),
    ((15, "z"), {(125, "z"): 1.0}, 0.0),
    ((120, "x"), {(27, "y"): -2.0, (92, "z"): 1.0}, -2e-4),
)


def two_bodies(mesh):
    """Only one of two bodies is loaded."""
    model = kl.Model(mesh, STEEL)
    model.fix(lambda x: x[:, 2] < 1e-9)
    model.add(kl.PointLoad(lambda x: (x[:, 2] > 0.99) & (x[:, 0] < 1.5), (1.0, 2.0, -3.0), each=True))
    return model


def free(mesh):
    """Nothing holds what is pulled apart and has own stress."""
    model = kl.Model(mesh, STEEL)
    for side, force in (("z-", -30.0), ("z+", 30.0)):
        model.add(kl.Traction(side, (0.0, 0.0, force)))
    model.add_prestress(np.sin(mesh.element_ids[:, None] + np.arange(6)))
    return model


def free_and_tied(mesh):
    """Two nodes move alike, but for a step: what is left free turns about the line between them."""
    model = free(mesh)
    for axis in "xyz":
        model.constrain((104, axis), {(31, axis): 1.0}, 1e-4)
    return model


def carried(mesh):
    """All supports displace alike: the whole body moves along."""
    model = clamped(mesh)
    model.fix("z-", "x", 3.0, override=True)
    return model


def nearly_incompressible(mesh):
    model = clamped(mesh)
    model.assign(kl.Isotropic3D(E=1e6, nu=0.4999, density=1000.0))
    return model


def tied_to_supports(mesh):
    """Independents that are prescribed, of which one moves."""
    model = clamped(mesh)
    model.fix(lambda x: (x[:, 0] == 1) & (x[:, 2] > 0), "y", 1e-3)
    top, side = model.mesh.nodes("z+"), model.mesh.nodes("x+")
    model.constrain((top[0], "y"), {(side[-1], "y"): 0.5, (top[1], "x"): 0.25})
    return model


def box(cells=4, element="8N"):
    return kl.box(cells=(cells,) * 3, element=element)


def small():
    return box(3)


def quadratic():
    return box(2, "27N")


def tetrahedra():
    return box(2, "10N")


def wedges():
    return box(3, "6N")


def bodies():
    """Two boxes apart from one another."""
    one = box(3)
    (block,) = one.blocks
    points = np.vstack([one.points, one.points + np.array([2.0, 0.0, 0.0])])
    return kl.Mesh(points, {block.name: np.vstack([block.nodes, block.nodes + one.n_nodes])})


def mixed_cells():
    """Bricks, of which one is cut into pyramids, one into wedges and one into tetrahedra."""
    mesh = kl.box(cells=(3, 3, 3))
    cells, center = mesh.blocks[0].nodes, mesh.n_nodes
    faces = ([0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])
    pyramids = [[*cells[-1][face][::-1], center] for face in faces]
    wedges = cells[-2][[[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]
    corners = ([0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7])
    blocks, first = [], 1
    kinds = (("8N", cells[:-3]), ("5N", pyramids), ("6N", wedges), ("4N", cells[-3][list(corners)]))
    for name, nodes in kinds:
        rows = np.asarray(nodes, dtype=np.int32)
        blocks.append(
            Block(f"Element3D{name}", rows, np.arange(first, first + len(rows)), np.zeros(len(rows), int))
        )
        first += len(rows)
    points = np.vstack([mesh.points, mesh.points[cells[-1]].mean(axis=0)])
    return kl.Mesh(points, blocks)


# ---- the same over ranks -----------------------------------------------------------------------


def same(found, expected):
    for name in ("u", "reactions"):
        whole = getattr(expected, name)
        assert np.abs(getattr(found, name) - whole).max() <= 1e-8 * np.abs(whole).max(), name
    for name in ("unknowns", "notes", "formulation"):
        assert getattr(found.report, name) == getattr(expected.report, name)
    assert set(expected.report.warnings) <= set(found.report.warnings)
    assert "(PETSc)" in found.report.solver
    assert found.report.backward_error < 1e-12


CASES = (
    *((build, small) for build in (cube, clamped, pulled, displaced, initial)),
    *((build, small) for build in (carried, nearly_incompressible, free)),
    *((build, box) for build in (tied, tied_to_supports, free_and_tied)),
    *((pulled, make) for make in (quadratic, tetrahedra, wedges)),
    (clamped, mixed_cells),
    (two_bodies, bodies),
    (free, bodies),
)


WAYS = (
    *(
        (build, make, way, solver)
        for build, make in CASES
        for way, solver in ((slabs, "direct"), (at_random, "amg"))
    ),
    *((build, box, way, "amg") for build in (pulled, tied, free) for way in (slabs, one_empty)),
)


@pytest.mark.parametrize(("build", "make", "way", "solver"), WAYS)
def test_same_as_one_process(build, make, way, solver, monkeypatch):
    monkeypatch.setattr(cut, "parts_of", way)
    model = build(make())
    same(model.solve(solver, 1e-12, backend="petsc"), model.solve(tolerance=1e-12))


@pytest.mark.parametrize("build", [clamped, tied])
def test_multigrid_of_petsc(build):
    model = build(box())
    found = model.solve("amg", 1e-12, petsc="-pc_type gamg")
    assert "gamg" in found.report.solver
    same(found, model.solve(tolerance=1e-12))


def test_gravity_cube():
    found = cube(box()).solve(backend="petsc")
    assert np.allclose(found.u[np.isclose(found.mesh.points[:, 2], 1.0), 2], EXACT, rtol=1e-12, atol=0)
    assert found.report.solver == "mumps (PETSc)"


def test_load_cases_and_one_matrix():
    cases = {
        "down": kl.Gravity((0.0, 0.0, -9.81)),
        "pull": [kl.Traction("z+", (0.0, 1.0, 50.0)), kl.PointLoad("x+", (1.0, 0.0, 0.0), each=True)],
    }
    model = clamped(box())
    expected, found = model.solve_cases(cases), model.solve_cases(cases, backend="petsc")
    for name in cases:
        same(found[name], expected[name])


def test_new_values_of_supports_and_another_start():
    model = tied_to_supports(box())
    serial, shared = model.static(tolerance=1e-12), model.static("amg", 1e-12, backend="petsc")
    first = shared.solve()
    system = shared.system
    model.fix(lambda x: (x[:, 0] == 1) & (x[:, 2] > 0), "y", 3e-3, override=True)
    found = shared.solve()
    assert shared.system is system
    same(found, serial.solve())
    assert shared.solve(start=found.u).report.iterations < first.report.iterations
    shared.release()


def test_options_of_petsc():
    model = clamped(box())
    found = model.solve(petsc="-ksp_type fgmres -pc_type bjacobi -pc_bjacobi_blcks 2")
    assert found.report.solver == "fgmres + bjacobi (PETSc)"
    assert any("-pc_bjacobi_blcks; they may be misspelt" in text for text in found.report.warnings)
    with pytest.raises(InputError, match="gamgg"):
        model.solve(petsc="-pc_type gamgg")
    with pytest.raises(SolveError, match="not converged after 3 iterations"):
        model.solve(petsc="-pc_type jacobi -ksp_max_it 3")


@pytest.mark.parametrize("solver", ["direct", "amg"])
def test_a_matrix_that_is_singular(solver, monkeypatch):
    """Supports are checked before; here that does not happen."""
    monkeypatch.setattr("kratos_lite.model.free_motions.FreeMotions.any", False)
    model = kl.Model(box(), STEEL)
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    with pytest.raises(SolveError, match="singular"):
        model.solve(solver, backend="petsc")


def test_a_slender_body_is_not_taken_for_a_singular_one():
    model = kl.Model(kl.box((1000, 1, 1), (60, 1, 1), element="Element3D20N"), STEEL)
    model.fix("x-")
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    one, many = (model.solve(backend=backend).energy() for backend in ("own", "petsc"))
    assert abs(many / one - 1) < 5e-3  # K has lost all digits but these


def test_progress_and_an_error_in_it():
    said = []
    model = clamped(box())
    model.solve("amg", backend="petsc", progress=lambda phase, share: said.append((phase, share)))
    assert [phase for phase, share in said if share == 1.0][-3:] == ["solve", "solve", "verify"]
    assert ("set up", 1.0) in said

    def stop(phase, share):
        if phase == "set up":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        model.solve("amg", backend="petsc", progress=stop)
    assert started().run(count) == started().size


def count(ranks):
    return ranks.sum(1)


def test_a_material_that_cannot_be_sent():
    class Local(kl.Isotropic3D):
        """Known in this function alone."""

    model = clamped(box())
    model.assign(Local(E=1e9, nu=0.3, density=1e3))
    if started().size == 1:
        assert model.solve(backend="petsc").u.any()
        return
    with pytest.raises(InputError, match=r"cannot be sent to other ranks: .* a module that all"):
        model.solve(backend="petsc")
    same(clamped(box()).solve(backend="petsc"), clamped(box()).solve())
