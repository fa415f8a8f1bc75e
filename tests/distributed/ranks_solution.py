"""Statics of whole models over ranks: displacements, reactions and report are those of one process."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.distributed.scatter import scattered
from kratos_lite.errors import InputError, ModelError

STEEL = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)
EXACT = -1.3221477551020406e-4


# ---- ways to cut a mesh ------------------------------------------------------------------------


def slabs(mesh, ranks):
    """Cut across z."""
    z = np.concatenate([mesh.points[block.nodes].mean(axis=1)[:, 2] for block in mesh.blocks])
    return np.minimum((z / np.ptp(mesh.points[:, 2]) * ranks.size).astype(int), ranks.size - 1)


def at_random(mesh, ranks):
    return np.random.default_rng(1).integers(0, ranks.size, mesh.n_elements)


def one_empty(mesh, ranks):
    """Leave the first rank without elements, if there are several."""
    return at_random(mesh, ranks) % max(ranks.size - 1, 1) + (ranks.size > 1)


# ---- models of a mesh, whole or shared ---------------------------------------------------------


def rows_of(mesh, ids):
    """Return the rows of nodes here by their ids, None for the others."""
    place = {int(node): row for row, node in enumerate(mesh.node_ids)}
    return [place.get(node) for node in ids]


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
    model.add(kl.PointLoad("y+", (0.0, 5.0, 7.0)))
    return model


def displaced(mesh):
    model = clamped(mesh)
    model.fix("z+", "xz", (1e-3, -2e-3))
    return model


def initial(mesh):
    model = clamped(mesh)
    ids = mesh.element_ids[:, None] + np.arange(6)
    model.add_prestress(1e3 * np.sin(ids))
    model.stress_free_at(1e-4 * np.cos(mesh.points[:, [1, 2, 0]] * 5))
    return model


def tied(mesh):
    """A chain of constraints through the body, and one with weights."""
    model = clamped(mesh)
    for (slave, axis), masters, constant in CHAIN:
        rows = rows_of(mesh, [slave, *(node for node, _ in masters)])
        if None not in rows:
            named = dict(
                zip(zip(rows[1:], (a for _, a in masters), strict=True), masters.values(), strict=True)
            )
            model.constrain((rows[0], axis), named, constant)
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
    model.add(kl.PointLoad(lambda x: (x[:, 2] > 0.99) & (x[:, 0] < 1.5), (1.0, 2.0, -3.0)))
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
    rows = rows_of(mesh, [105, 32])
    for axis in "xyz" if None not in rows else "":
        model.constrain((rows[0], axis), {(rows[1], axis): 1.0}, 1e-4)
    return model


def box(cells=4, element="8N"):
    return kl.box(cells=(cells,) * 3, element=element)


def quadratic():
    return box(3, "27N")


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


# ---- the same over ranks -----------------------------------------------------------------------


def share_of(mesh, ranks, cut):
    tied = [np.array(rows_of(mesh, [slave, *(n for n, _ in masters)])) for (slave, _), masters, _ in CHAIN]
    together = tied if mesh.n_nodes == 125 else ()
    return scattered(mesh, ranks, cut(mesh, ranks), together=together)


def same(found, expected, rows):
    """Check a result of this rank against the whole one."""
    for name in ("u", "reactions"):
        whole = getattr(expected, name)
        off = np.abs(getattr(found, name) - whole[rows]).max(initial=0.0)
        assert off <= 1e-8 * np.abs(whole).max(), name
    for name in ("unknowns", "warnings", "notes", "formulation"):
        assert getattr(found.report, name) == getattr(expected.report, name)
    for name in ("total_load", "total_reaction"):
        size = np.abs(expected.loads).sum() + np.abs(expected.reactions).max()
        assert np.allclose(
            getattr(found.report, name), getattr(expected.report, name), atol=1e-8 * size, rtol=0
        )
    assert found.report.backward_error < 1e-12


def check(ranks, build, make, cut, solver):
    whole = make()
    mesh = share_of(whole, ranks, cut)
    expected = build(whole).solve(tolerance=1e-12, engine="own")
    found = build(mesh).solve(solver, 1e-12)
    assert "(PETSc)" in found.report.solver
    same(found, expected, np.searchsorted(whole.node_ids, mesh.node_ids))
    return found


def test_same_as_one_process(ranks, build, make, cut, solver):
    check(ranks, build, make, cut, solver)


test_same_as_one_process.cases = [
    (build, make, cut, solver)
    for build, make in (
        *((build, box) for build in (cube, clamped, pulled, displaced, initial, tied, free, free_and_tied)),
        *((pulled, make) for make in (quadratic, tetrahedra, wedges)),
        (two_bodies, bodies),
        (free, bodies),
    )
    for cut, solver in ((slabs, "direct"), (slabs, "amg"), (at_random, "amg"), (one_empty, "amg"))
]


def test_gravity_cube(ranks):
    found = check(ranks, cube, box, slabs, "auto")
    assert np.allclose(found.u[np.isclose(found.mesh.points[:, 2], 1.0), 2], EXACT, rtol=1e-12, atol=0)


def test_box_of_each_rank(ranks):
    mesh = kl.box(cells=(6, 5, 4), comm=ranks.comm)
    whole = kl.box(cells=(6, 5, 4))
    expected = clamped(whole).solve(tolerance=1e-12, engine="own")
    same(clamped(mesh).solve(tolerance=1e-12), expected, np.searchsorted(whole.node_ids, mesh.node_ids))


def test_load_cases_and_one_matrix(ranks):
    whole = box()
    mesh = share_of(whole, ranks, at_random)
    cases = {
        "down": kl.Gravity((0.0, 0.0, -9.81)),
        "pull": [kl.Traction("z+", (0.0, 1.0, 50.0)), kl.PointLoad("x+", (1.0, 0.0, 0.0))],
    }
    expected = clamped(whole).solve_cases(cases)
    found = clamped(mesh).solve_cases(cases)
    rows = np.searchsorted(whole.node_ids, mesh.node_ids)
    for name in cases:
        same(found[name], expected[name], rows)


def test_new_values_of_supports_and_another_start(ranks):
    whole = box()
    mesh = share_of(whole, ranks, at_random)
    rows = np.searchsorted(whole.node_ids, mesh.node_ids)
    models = [displaced(one) for one in (whole, mesh)]
    analyses = [models[0].static(tolerance=1e-12), models[1].static("amg", 1e-12)]
    first = analyses[1].solve()
    system = analyses[1].system
    for model in models:
        model.fix("z+", "xz", (2e-3, 5e-3), override=True)
    results = [analysis.solve() for analysis in analyses]
    assert analyses[1].system is system
    same(results[1], results[0], rows)
    again = analyses[1].solve(start=results[1].u)
    assert again.report.iterations < first.report.iterations
    analyses[1].release()


def test_one_process_with_petsc(ranks):
    if ranks.size > 1:
        with pytest.raises(InputError, match=r"comm=MPI.COMM_WORLD"):
            clamped(box()).solve(engine="petsc")
        return
    expected = clamped(box()).solve()
    same(clamped(box()).solve(engine="petsc"), expected, slice(None))
    found = clamped(box()).solve(petsc="-ksp_type cg -pc_type jacobi -ksp_rtol 1e-12")
    same(found, expected, slice(None))
    assert found.report.solver == "cg + jacobi (PETSc)"


def test_options_of_petsc(ranks):
    mesh = share_of(box(), ranks, slabs)
    found = clamped(mesh).solve(petsc="-ksp_type fgmres -pc_type bjacobi -pc_bjacobi_blcks 2")
    assert found.report.solver == "fgmres + bjacobi (PETSc)"
    assert any("-pc_bjacobi_blcks; they may be misspelt" in text for text in found.report.warnings)
    for text in ("ksp_type cg", "-ksp_type cg gmres", "-ksp_type 'cg"):
        with pytest.raises(InputError, match="PETSc options"):
            clamped(mesh).solve(petsc=text)


def test_what_needs_the_whole_mesh_is_refused(ranks):
    model = clamped(share_of(box(), ranks, slabs))
    if ranks.size == 1:
        assert model.modes(2)[0].shape == (2,)
        assert model.solve(engine="own").report.solver != "cg"
        return
    with pytest.raises(InputError, match="share this mesh"):
        model.solve(engine="own")
    for ask in (model.modes, model.matrices, model.transient, lambda: model.solve(error=0.1)):
        with pytest.raises(ModelError, match="needs the whole mesh"):
            ask()


def test_progress_comes_from_one_rank(ranks):
    said = []
    clamped(share_of(box(), ranks, slabs)).solve(
        "amg", progress=lambda phase, share: said.append((phase, share))
    )
    if ranks.rank:
        assert not said
    else:
        assert [phase for phase, share in said if share == 1.0][-3:] == ["solve", "solve", "verify"]
        assert ("set up", 1.0) in said
