"""The benchmarks: exact fields, the error routine, the programs on one discrete problem, and the report.

Nothing here asserts a time.
"""

import doctest
import json
import os
import platform
import sys
from importlib.metadata import distributions
from pathlib import Path

import numpy as np
import pytest
from over_ranks import OPEN_MPI, needs_mpi
from run_files import CLAMP, box_mdpa, materials, process, run_file, write
from scenes import OURS
from scipy import sparse

import kratos_lite as kl

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import __main__ as command  # noqa: E402
from benchmarks import (  # noqa: E402
    accuracy,
    ale,
    cases,
    curves,
    driver,
    dynamics,
    folders,
    hard_scenes,
    laws,
    motion,
    report,
    scaling,
    scenes,
    sets,
    stall,
    tables,
)
from benchmarks.programs import PROGRAMS, RANKS, SOLVERS  # noqa: E402
from kratos_lite.verification import errors, fields  # noqa: E402

CONSTITUTIVE_LAWS = any(one.name == "KratosConstitutiveLawsApplication" for one in distributions())
E, NU = 1.0, 0.3
RNG = np.random.default_rng(5)


# ---- exact fields ------------------------------------------------------------------------------------


def stress(field, X):
    lam, mu = fields.lame(E, NU)
    G = fields.gradient(field, X)
    strain = (G + np.swapaxes(G, -1, -2)) / 2
    return lam * np.trace(strain, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) + 2 * mu * strain


def divergence(field, X, h=1e-3):
    steps = [(stress(field, X + h * axis) - stress(field, X - h * axis)) / (2 * h) for axis in np.eye(3)]
    return sum(step[..., j] for j, step in enumerate(steps))


@pytest.mark.parametrize(
    "field",
    [
        fields.hollow_sphere(E, NU, 1.0, 2.0, 1.0),
        fields.bending(0.1, NU),
        fields.l_domain(E, NU),
        fields.cavity(E, NU, 1.0, 1.0),
    ],
    ids=["sphere", "bending", "l_domain", "cavity"],
)
def test_exact_fields_are_in_equilibrium(field):
    X = RNG.uniform(1.2, 1.8, (6, 3))
    assert np.abs(divergence(field, X)).max() < 2e-6 * np.abs(stress(field, X)).max()


def test_manufactured_force_is_what_the_field_needs():
    X = RNG.uniform(0.1, 0.9, (6, 3))
    force = fields.manufactured_force(X, E, NU)
    assert np.abs(divergence(fields.manufactured, X) + force).max() < 1e-4 * np.abs(force).max()


def test_surfaces_carry_the_stress_that_they_should():
    normal = RNG.uniform(0.2, 1, (6, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]

    def traction(field, X, n):
        return np.einsum("pij,pj->pi", stress(field, X), n)

    sphere = fields.hollow_sphere(E, NU, 1.0, 2.0, 1.0)
    np.testing.assert_allclose(traction(sphere, normal, normal), -normal, atol=1e-8)
    np.testing.assert_allclose(traction(sphere, 2 * normal, normal), 0, atol=1e-8)
    assert np.linalg.norm(sphere(normal), axis=1) == pytest.approx(np.full(6, 0.8))
    cavity = fields.cavity(E, NU, 1.0, 1.0)
    np.testing.assert_allclose(traction(cavity, normal, normal), 0, atol=1e-8)
    equator = stress(cavity, np.array([[1.0, 1e-9, 0.0]]))[0, 2, 2]
    assert equator == pytest.approx((27 - 15 * NU) / (2 * (7 - 5 * NU)), abs=1e-7)
    # inside the L, next to its two free sides
    corner, near = fields.l_domain(E, NU), 2e-5
    sides = np.array([[-0.5, near, 0.1], [near, -0.3, 0.1]])
    np.testing.assert_allclose(traction(corner, sides, np.eye(3)[[1, 0]]), 0, atol=3e-4)


# ---- errors ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["10N", "20N", "27N"])
def test_quadratic_elements_hold_the_bent_bar_exactly_and_a_factor_is_the_error(kind):
    scene = scenes.make("bending", kind, 1)
    exact = scene.exact(scene.model.mesh.points)
    found = errors.errors(scene, exact)
    assert found["displacement"] < 1e-14
    assert found["nodal"] == 0
    assert found["energy"] < 1e-9
    for factor in (0.0, 1.25):
        found = errors.errors(scene, factor * exact)
        assert found == pytest.approx(dict.fromkeys(found, abs(factor - 1)), rel=1e-8)
    assert errors.errors(scene, scene.model.solve().displacement())["displacement"] < 1e-9


def test_error_without_a_field_is_that_of_the_work():
    scene = scenes.make("cook", "8N", 2)
    u = scene.model.solve().displacement()
    scene.energy = float((scene.forces() * u).sum()) / 2
    assert errors.errors(scene, u)["displacement"] == 0
    assert errors.errors(scene, 1.01 * u) == pytest.approx({"displacement": 0.01, "energy": 0.1})
    scene.energy = None
    assert errors.errors(scene, u) == {}


@pytest.mark.parametrize("name", sets.ERROR_SCENES)
@pytest.mark.parametrize("kind", ["8N", "10N"])
def test_finer_meshes_of_every_scene_are_better(name, kind):
    found = []
    for n in (1, 3):
        scene = scenes.make(name, kind, n)
        found.append(errors.errors(scene, scene.model.solve().displacement())["displacement"])
    assert found[1] < 0.9 * found[0] or found[1] < 1e-9


# ---- one discrete problem in all programs --------------------------------------------------------------


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Measure runs of several programs once and return the rows of one; skip a test of an absent one."""
    pythons = command.arguments(["quick"]).pythons
    made = driver.Driver(tmp_path_factory.mktemp("runs"), 1, pythons, tell=lambda line: None)
    known = {}

    def rows_of(program, runs):
        if program not in made.absent and tuple(runs) not in known:
            known[tuple(runs)] = made.measure(runs)
        if program in made.absent:
            pytest.skip(f"{program} is absent: {made.absent[program]}")
        rows = known[tuple(runs)]
        assert [row.get("failed") for row in rows] == [None] * len(rows)
        return [row for row in rows if row["program"] == program]

    return rows_of


COMPARED = [name for name in PROGRAMS if name not in (tables.OURS, tables.ADAPTIVE)]


def kinds_of(name, scene):
    """Return the elements of a scene with which a program is compared."""
    kinds = [kind for kind in scenes.KINDS if sets.takes(name, scene, kind)]
    return ["8N", "10N"] if scene == "block" and name == "Kratos" else kinds[-1:]


@pytest.mark.parametrize("name", COMPARED)
@pytest.mark.parametrize("scene", ["block", "manufactured", "cavity"])
def test_programs_agree_on_one_discrete_problem(name, scene, measured):
    for kind in kinds_of(name, scene) or pytest.skip(f"{name} has no element with curved edges"):
        programs = [tables.OURS, *(other for other in COMPARED if kind in kinds_of(other, scene))]
        options = (("tolerance", 1e-12),)
        runs = [driver.Run("test", program, scene, kind, 2, options=options) for program in programs]
        (ours,), (row,) = measured(tables.OURS, runs), measured(name, runs)
        assert ours["peak"] > 1e7
        assert set(row["phases"]) >= {"import", "read", "solve"}
        assert row["errors"]["difference"] < 10.0 ** -min(8, PROGRAMS[name].digits - 1)


def test_a_program_that_fails_is_a_row_that_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(PROGRAMS, "broken", driver.Program("no_such_module"))
    rows = driver.Driver(tmp_path, 2, tell=lambda line: None).measure(
        [driver.Run("growth", "broken", "block", "8N", n) for n in (1, 2)]
    )
    assert [row["n"] for row in rows] == [1]  # and no larger size is tried
    assert rows[0]["failed"].startswith("failed: ")
    assert "no_such_module" in rows[0]["failed"]
    assert str(ROOT) not in rows[0]["failed"]


def test_one_element_stands_beside_a_process_that_imports_numpy(tmp_path):
    rows = driver.Driver(tmp_path, 1, tell=lambda line: None).measure(
        sets.cube1_runs((tables.OURS, "import numpy"))
    )
    lines = report.text(rows).splitlines()
    assert [line.split(" | ")[:2] for line in lines[-2:]] == [
        ["| cube 8N n = 1", name] for name in ("import numpy", "kratos_lite")
    ]


def test_a_run_is_stopped_at_its_limit(tmp_path):
    short = driver.Driver(tmp_path, 1, limit=0.01, tell=lambda line: None)
    (row,) = short.measure([driver.Run("goal", "kratos_lite", "block", "8N", 1)])
    assert row["failed"] == "stopped at the time limit"


def test_scenes_of_a_folder_are_written_whole(tmp_path):
    files = cases.prepared(OURS, tmp_path)
    assert sorted(path.name for path in files) == ["bar_8N.mdpa", "elem_column_27N.mdpa"]
    model = kl.read(tmp_path / "bar_8N.mdpa")
    assert model.supports.fixed.sum() == 4 + 6 + 6
    assert model.loads


def test_real_scenes_are_written_whole(shared, tmp_path):
    files = cases.prepared(shared / "cases", tmp_path)
    assert len(files) >= 8
    model = kl.read(tmp_path / "eigen_cube_8N.mdpa")
    assert model.supports.fixed.any()
    assert model.loads


@pytest.mark.parametrize("name", [name for name in motion.MOTIONS if not name.startswith("many")])
def test_motions_keep_what_they_should(name):
    found = motion.measured(kl, name, divisor=100)
    exact = 1e-12 if "em" in name else 1e-4
    assert found["step"] > 0
    assert found["energy"] < exact
    assert not found["momentum"] > exact


def test_motions_have_rows_beside_solfec():
    rows = [
        {"group": "motion", "program": program, "scene": name, "kind": "", "n": 0, "task": "motion"}
        | {"phases": {"step": 2e-6}, "process": 1.0, "drift": {"energy": 1e-9, "momentum": float("nan")}}
        for name in ("rigid", "many_rigid")
        for program in ("kratos_lite", "kratos_lite NumPy")
    ]
    text = report.motions(rows)
    assert "| 2 | 2 | 7 … 9 | 0.29 | 1e-09 |  |" in text
    assert text.count("\n") == 4


@pytest.mark.parametrize("name", ["kratos_lite NumPy", "GetFEM"])
def test_matrices_of_a_wheel_are_the_same_entry_by_entry(name, measured):
    programs, kinds = (tables.OURS, "kratos_lite NumPy", "GetFEM"), (("8N", 1), ("27N", 1))
    rows = measured(name, sets.ale_runs(programs, kinds, repeat=2))
    assert len(rows) == 2
    for row in rows:
        assert set(ale.NAMES) <= set(row["phases"])
        assert row["errors"]["difference"] < 1e-13


def test_wheels_have_rows_beside_getfem():
    common = {"group": "ale", "scene": "wheel", "kind": "8N", "n": 8}
    times = {"M": 0.03, "M, again": 0.02, "pattern": 0.03, "M+G+H": 0.05, "K": 0.5, "K, again": 1.0}
    rows = [common | {"program": "kratos_lite", "phases": times}]
    assert "| wheel 8N n = 8 | M | 0.020 |  |  |  |  |  |" in report.wheels(rows)
    theirs = {"phases": {"M": 0.2, "M+G+H": 0.5}, "errors": {"difference": 1e-15}}
    text = report.wheels([*rows, common | {"program": "GetFEM"} | theirs])
    assert "| wheel 8N n = 8 | M+G+H | 0.050 |  | 0.500 | 0.1 | 0.16 | 1e-15 |" in text
    assert "| wheel 8N n = 8 | K | 0.500 |  |  |  |  | 1e-15 |" in text
    assert text.count("\n") == 5


def stall_row(scene, program="kratos_lite", kind="8N enhanced", **words):
    phases = {"setup": 0.25, "solve": 0.75}
    plain = {"group": "stall", "n": 8, "unknowns": 1000, "phases": phases, "iterations": 13, "memory": 10**6}
    plain |= {"solver": "amg", "residual": 5e-9, "rounding": 1e-12}
    return plain | {"scene": scene, "program": program, "kind": kind} | words


def test_modes_and_steps_beside_statics(monkeypatch):
    monkeypatch.setattr(dynamics, "REPEATS", 1)
    row = dynamics.of("8N", 3)
    times = [row[name] for name in ("static", "modes 6", "modes 20", "first step", "further step")]
    assert row["unknowns"] == 3 * 4 * 4 * 7
    assert min(times) > 0
    more = [[what, 3 * m.mesh.n_nodes, 3.0, 2.0] for what, m, *_ in dynamics.others((1, 1, 1, 2))]
    monkeypatch.delitem(dynamics.RUNS, "6 modes")
    runs, large = [*dynamics.processes("", 2)], dynamics.one("1") | dict.fromkeys(laws.CLOCKS, 8.0)
    assert [run["ours"]["unknowns"] for run in runs] == [135]
    rows = [row | {"static": 2.0, "modes 6": 5.0}]
    page = dynamics.page({"rows": rows, "others": more, "processes": runs, "million": large})
    assert "| 8N | 336 | 2 | 5 (2.5) | " in page
    assert "| `matrices()` / assembly of K | 135 | 3 | 2 | 1.5 |" in page
    assert "135 unknowns of 27N in such a process: 8 / 8 s" in page


def test_laws_beside_another_program():
    row = laws.timed(sys.executable, "ours", "J2", 2)
    assert row["unknowns"] == 3 * 3 * 3 * 5
    assert row["iterations"] > 10
    other = row | {"seconds": 2 * row["seconds"], "u": row["u"] * (1 + 1e-9)}
    other["processors"] = 4 * row["processors"]
    rows = [{"law": "J2", "n": 2, "ours": row, "Kratos": other}]
    page = laws.page(
        {"rows": [*rows, rows[0] | {"Kratos": {"failed": "> 9 s"}}], "points": {"one core": {"J2": 3.14}}}
    )
    assert "| 0.5 / 0.25 | 1e-09 |" in page
    assert "| > 9 s |" in page
    assert page.endswith("one core, in millions: J2 3.1.\n")
    assert "failed" in laws.timed(sys.executable, "ours", "clay", 2)


def folder_rows(folder, monkeypatch, law, *names, **solver):
    """Return the rows of a pulled box with a law, in a folder below that from which names count."""
    lift = process("assign_scalar_variable_process", "Structure.Top", "DISPLACEMENT_Z", value="0.01*t")
    variables = {"YIELD_STRESS": 4e6, "ISOTROPIC_HARDENING_MODULUS": 1e8}
    write(folder, box_mdpa(), "box.mdpa")
    write(folder, materials("Body", 7800.0, 2e9, 0.3, law, **variables), "materials.json")
    (folder / "below").mkdir()
    for name in names:
        content = run_file([CLAMP, lift], [], mesh=name, step=0.5, analysis_type="non_linear", **solver)
        write(folder / "below", content, f"{name}_parameters.json")
    monkeypatch.setattr(folders, "PAGE", folder / "page.md")
    command.main(["folders", str(folder), "--python", sys.executable])
    return (folder / "page.md").read_text()


def test_folders_of_kratos_that_are_refused_say_why(tmp_path, monkeypatch):
    page = folder_rows(tmp_path, monkeypatch, "Clay", "box", "none")
    element = "SmallDisplacementElement3D8N"
    refused = "refused |  |  | 'Clay' is not a law that kratos_lite has |"
    assert f"| below/box | {element} | Clay |  | {refused}\n" in page
    assert "| below/none |  | Clay |  | file not at hand |  |  | none |\n" in page
    assert "\n1 refused, 1 file not at hand.\n" in page


@pytest.mark.skipif(not CONSTITUTIVE_LAWS, reason="KratosConstitutiveLawsApplication is not installed")
def test_folders_of_kratos_agree(tmp_path, monkeypatch):
    page = folder_rows(tmp_path, monkeypatch, "PlasticityIsotropicKinematicJ2Law", "box")
    assert "| 2 | agrees | " in page


@pytest.mark.skipif(not CONSTITUTIVE_LAWS, reason="KratosConstitutiveLawsApplication is not installed")
def test_frequencies_of_kratos_agree_with_those_asked_of_a_solver_that_it_lacks(tmp_path, monkeypatch):
    settings = {"solver_type": "feast", "search_dimension": 3}
    solver = {"solver_type": "eigen_value", "eigensolver_settings": settings}
    page = folder_rows(tmp_path, monkeypatch, "LinearElastic3DLaw", "box", **solver)
    assert "| 3 | agrees | " in page


def test_scenes_that_may_stall_have_ratios_to_the_block_and_to_other_solvers():
    rows = [
        stall_row("block"),
        stall_row("block", "PARDISO", phases={"setup": 4.0, "solve": 1.0}, iterations=0),
        stall_row("flat_100", phases={"setup": 2.0, "solve": 2.0}, iterations=90, memory=2 * 10**6),
        stall_row("flat_100", "pyamg", residual=1e-3, iterations=1000),
        {"group": "stall", "scene": "flat_100", "kind": "8N enhanced", "n": 8, "program": "Kratos"}
        | {"failed": "stopped at the time limit"},
        stall_row("block_nu_49", kind="27N B-bar"),
    ]
    text = stall.tables(rows)
    assert "| block | 8N enhanced | 1000 | amg, 13 | 0.250 | 0.750 | 1 | 1 | 1 | 5e-09 |" in text
    assert "| flat_100 | 8N enhanced | 1000 | amg, 90 | 2 | 2 | 4 | 2 | 2 | 5e-09 |" in text
    assert "| block_nu_49 | 27N B-bar | 1000 | amg, 13 | 0.250 | 0.750 |  | 1 |  | 5e-09 |" in text
    assert "| block 8N enhanced | 1 (13), 1 MB |  |  | 5, 1 MB | PARDISO | 0.2 |" in text
    failed = "stopped at the time limit | residual 1e-03 (1000) |"
    assert f"| flat_100 8N enhanced | 4 (90), 2 MB | {failed}  |  |  |" in text
    assert "- more than 3 times the time of the block: 1\n" in text
    assert "- more than 40 iterations, or a factorization: 1\n" in text
    assert report.failures(rows) == ""


@pytest.mark.parametrize("name", [tables.OURS, *SOLVERS])
def test_solvers_take_one_linear_system(name, measured):
    runs = stall.runs([tables.OURS, *SOLVERS], 250, ["links_tied"])
    (row,) = measured(name, [run for run in runs if (run.scene, run.kind) == ("links_tied", "8N")])
    assert row["residual"] < 3e-8
    assert row["unknowns"] == 246
    assert set(row["phases"]) >= {"solve"}


@pytest.mark.parametrize("name", hard_scenes.MAKERS)
def test_systems_of_files_are_those_of_the_models(name, tmp_path):
    scene = scenes.make(name, stall.ELEMENTS[name][-1], 2)
    with np.load(f"{scenes.write_system(scene, tmp_path)}.npz") as file:
        A = sparse.bsr_array((file["data"], file["indices"], file["indptr"])).toarray()
        q, points = np.linalg.solve(A, file["load"]), file["points"]
    u = scene.model.solve(tolerance=1e-13).displacement()
    free = scene.model.supports.constraint_map(np.arange(len(u))).free
    assert len(q) == len(free)
    off = q - u.ravel()[free]
    assert off @ A @ off < 1e-6 * (q @ A @ q)  # rounding leaves thin plates few digits
    np.testing.assert_array_equal(points, scene.model.mesh.points[free[::3] // 3])


# ---- over ranks ----------------------------------------------------------------------------------------


def rank_row(n, backend, ranks, seconds, *, twice=False, threads=1, **words):
    cells = scaling.cube(n, twice)
    unknowns = 3 * cells[0] * n * n
    plain = {"kind": "8N", "n": n, "backend": backend, "ranks": ranks, "cells": cells, "threads": threads}
    plain |= {"unknowns": unknowns, "iterations": 10 + n // 10, "mesh": 0.0, "seconds": seconds}
    plain |= {"phases": {"assemble": seconds / 4, "solve": seconds / 2}, "difference": 1e-12}
    return plain | {"memory": 2e3 * unknowns / ranks, "imports": 1e8, "bytes written": 100 * unknowns} | words


def test_page_of_scaling_has_efficiencies_goals_and_a_plan():
    rows = [
        rank_row(100, "own", 1, 20.0),
        rank_row(100, "petsc", 1, 25.0),
        rank_row(100, "petsc", 2, 12.5),
        rank_row(100, "petsc", 2, 26.0, twice=True),
        rank_row(10, "petsc", 2, 0.1),
        rank_row(10, "plain", 2, 1.0) | {"failed": "killed"},
    ]
    assert "| 8N n = 100 | 1.00 | 0.96 | 2.00 | 1.25 |" in scaling.goals(rows)
    line = "| 8N 200×100×100 | 6000000 | 2 | 0.00 | 6.50 | 13.00 | 26.00 | 20 | 0.96 weak |  | 2.00 | 1e-12 |"
    assert line in scaling.scaling(rows)
    assert "| 8N n = 100 | own backend, 1 thread | 5.00 | 10.00 | 20.00 | 20 | 2.00 |" in scaling.others(rows)
    files = [{"kind": "8N", "bytes": 30, "unknowns": 3}]
    found = {"rows": rows, "files": files, "date": "", "machine": driver.machine(), "versions": {}}
    text = scaling.page(found | {"repeats": 1})
    # 8 iterations more for 6e6 / 3e3 unknowns; a rank of 5e5 takes a sixth of the 26 s, half of it in solve
    assert "| 8N 1e9 | 2000 | 2200 | 10.0 | 100.0 | 26 | 5 |" in text
    assert "- 8N 10x10x10 plain, 2 ranks: killed\n" in text


@pytest.fixture
def on_one_processor(monkeypatch):
    """Keep what the test starts on one processor, where ranks leave it to those for which they wait."""
    monkeypatch.setenv("OMPI_MCA_mpi_yield_when_idle", OPEN_MPI["OMPI_MCA_mpi_yield_when_idle"])
    processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(processors)})
    yield
    os.sched_setaffinity(0, processors)


@needs_mpi
@pytest.mark.usefixtures("on_one_processor")
def test_backends_over_ranks_solve_the_same_block(tmp_path, monkeypatch, capsys):
    out = tmp_path / "distributed.json"
    monkeypatch.setattr(scaling, "PAGE", tmp_path / "scaling.md")
    backends = [("own", 1), ("petsc", 2), ("whole", 2), ("plain", 2)]
    monkeypatch.setattr(scaling, "BACKENDS", backends)
    monkeypatch.delenv("KRATOS_LITE_BENCH_PYTHON", raising=False)
    words = ["distributed", "--cells", "3", "--elements", "8N", "--repeats", "1", "--out", str(out)]
    assert command.main(words) == 0
    found = json.loads(out.read_text())
    assert [row.get("failed") for row in found["rows"]] == [None] * 5
    for row in found["rows"]:
        assert row.get("difference", 0.0) < 1e-8
        assert row["imports"] > 0
    assert {row["kind"] for row in found["files"]} == {"8N", "27N"}
    page = (tmp_path / "scaling.md").read_text()
    assert "| 8N 6×3×3 |" in page
    assert "| 8N n = 3 | over ranks, the mesh on rank 0, 2 ranks |" in page


# ---- sets, results and report --------------------------------------------------------------------------


def test_every_set_names_scenes_and_programs_that_exist(tmp_path):
    for name, make in command.COMMANDS.items():
        options = command.arguments([name, "--cases", str(tmp_path)])
        options.folder = tmp_path
        runs = make(options)
        assert runs, name
        assert {run.scene for run in runs} <= {*scenes.SCENES, *motion.MOTIONS, ale.SCENE}
        assert {run.program for run in runs} <= {*PROGRAMS, *command.HELPERS, *RANKS}
        assert len(set(runs)) == len(runs)


def test_command_writes_results_and_the_page(tmp_path, monkeypatch, capsys):
    out = tmp_path / "results" / "error.json"
    monkeypatch.setattr(sets, "KINDS", ("8N", "27N"))
    words = ["error", "--programs", "kratos_lite", "--scenes", "manufactured", "--cells", "1", "2"]
    assert command.main([*words, "--repeats", "1", "--out", str(out)]) == 0
    kept = json.loads(out.read_text())
    assert [(row["kind"], row["n"]) for row in kept["rows"]] == [("8N", 1), ("8N", 2), ("27N", 1), ("27N", 2)]
    assert kept["machine"]["cores"] >= 1
    assert kept["versions"]["kratos_lite"] == kl.__version__
    assert platform.node() not in json.dumps(kept) or len(platform.node()) < 3
    for name, path in (("RESULTS", out.parent), ("PAGE", tmp_path / "p.md"), ("PICTURES", tmp_path)):
        monkeypatch.setattr(command, name, path)
    assert command.main(["report"]) == 0
    page = (tmp_path / "p.md").read_text()
    assert "| manufactured | 1 % | " in page
    assert "- manufactured: " in page
    assert "![manufactured: error over seconds](../images/benchmarks/manufactured.png)" in page
    assert (tmp_path / "manufactured.png").read_bytes().startswith(b"\x89PNG")
    assert "seconds" in capsys.readouterr().out.lower()


def rows_of(times, program="kratos_lite"):
    return [
        {"group": "error", "scene": "s", "program": program, "kind": kind, "n": n, "warm": t,
         "errors": {"displacement": e}, "process": t + 1.0}
        for kind, points in times.items()
        for n, (t, e) in enumerate(points)
    ]  # fmt: skip


def test_sentence_names_the_cheapest_element():
    bricks = {"8N": [(1.0, 0.1), (100.0, 0.001)], "27N": [(1.0, 0.01), (2.0, 0.001)]}
    rows = rows_of(bricks | {"4N": [(1.0, 0.9)]})
    (sentence,) = curves.cheapest(rows)
    assert sentence.startswith("s: for an error of 0.10% take 27N (2 s); 8N takes 50.0 times as long;")
    assert sentence.endswith("; 4N do not reach it.")
    assert curves.time_to(1e-4, np.array([1.0]), np.array([1e-3])) is None
    assert curves.time_to(1e-2, np.array([1.0]), np.array([1e-3])) == (1.0, True)


def test_summary_has_the_best_element_of_each_program_and_the_ratio_to_the_best_library():
    rows = rows_of({"8N": [(1.0, 0.1), (100.0, 0.001)], "27N": [(1.0, 0.02), (2.0, 0.001)]})
    rows += rows_of({"20N": [(4.0, 0.1), (9.0, 0.001)]}, "FElupe") + rows_of({"20N": [(0.1, 1e-5)]}, "Kratos")
    warm = curves.summary(rows, "warm")
    assert "| s | 1 % | 1.17 27N | ≤ 0.100 20N | 6 20N | 0.2 |" in warm
    assert "| s | 0.01 % | — | ≤ 0.100 20N | — |  |" in warm
    assert "| s | 0.1 % | 3 27N | ≤ 1.1 20N | 10 20N | 0.3 |" in curves.summary(rows, "cold")


def test_adaptive_solutions_are_listed_with_their_true_error(tmp_path):
    options = (("errors", True), ("warm", True), ("scene", "sphere"), ("n", 2), ("goal", 0.2))
    run = driver.Run("error", tables.ADAPTIVE, "sphere", "20N", 2, options=options, variant="0.2")
    (row,) = driver.Driver(tmp_path, 1, tell=lambda line: None).measure([run])
    row = driver.kept(row)
    assert 0 < row["errors"]["displacement"] < row["errors"]["energy"] < row["reported"] < 0.2
    assert f"| sphere | 20 % | {100 * row['reported']:.2g} % |" in report.promises([row])
    assert report.promises(rows_of({"8N": [(1.0, 0.1)]})) == ""


def test_rows_kept_stay_unless_they_are_measured_again(tmp_path):
    made = driver.Driver(tmp_path, 1)
    old = driver.results(
        made, "error", rows_of({"8N": [(1.0, 0.1)]}) + rows_of({"8N": [(2.0, 0.1)]}, "FElupe")
    )
    new = driver.results(made, "error", rows_of({"8N": [(3.0, 0.1), (9.0, 0.01)]}), old)
    found = [(row["program"], row["n"], row["warm"]) for row in new["rows"]]
    assert found == [("kratos_lite", 0, 3.0), ("FElupe", 0, 2.0), ("kratos_lite", 1, 9.0)]


def test_missing_rows_alone_are_measured_and_curves_that_ended_stay_so(tmp_path):
    words = {"options": (("warm", True), ("arrays", True))}
    kinds = ("8N", "20N")
    runs = [driver.Run("error", "kratos_lite", "block", kind, n, **words) for kind in kinds for n in (1, 2)]
    known = rows_of({"8N": [(1.0, 0.1)], "20N": [(9.0, 0.1)]})
    told = []
    made = driver.Driver(tmp_path, 1, tell=told.append)
    made.known = [row | {"scene": "block", "n": 1} for row in known]
    assert [(row["kind"], row["n"]) for row in made.measure(runs)] == [("8N", 2)]


def test_a_curve_ends_where_it_is_exact_or_would_take_too_long(tmp_path):
    runs = [driver.Run("error", "kratos_lite", "block", "8N", n) for n in (2, 4)]
    row = {"group": "error", "program": "kratos_lite", "scene": "block", "kind": "8N", "n": 2}
    made = driver.Driver(tmp_path, point=10.0)
    for work, error, last in ((1.0, 0.1, False), (2.0, 0.1, True), (1.0, 1e-6, True)):
        assert made._is_last(row | {"warm": work, "errors": {"displacement": error}}, runs) is last
    assert made._is_last(row | {"failed": "stopped"}, runs)


def test_no_scene_is_begun_after_the_time_is_used_up(tmp_path):
    told = []
    made = driver.Driver(tmp_path, 1, budget=0.0, tell=told.append)
    assert made.measure([driver.Run("goal", "kratos_lite", "block", "8N", 1)]) == []
    assert told == ["the time is used up; the rest is left out"]


def test_solutions_unlike_the_first_are_listed():
    row = {"scene": "block", "kind": "8N", "n": 4, "program": "Kratos"}
    listed = report.failures([row | {"errors": {"difference": d}} for d in (1e-9, 0.5)])
    assert listed.count("Kratos") == 1
    assert "differ by 5e-01" in listed


def test_goal_table_gives_ratios():
    common = {"group": "goal", "scene": "block", "kind": "8N", "n": 20, "unknowns": 25200}
    ours = {"process": 1.0, "peak": 6e7, "phases": {"setup": 0.1, "solve": 0.2}}
    theirs = {"process": 4.0, "peak": 1e8, "phases": {"solve": 0.5}, "errors": {"difference": 1e-9}}
    rows = [common | {"program": "kratos_lite"} | ours, common | {"program": "Kratos"} | theirs]
    line = "| block 8N n = 20 | 25200 | 1 |  | 4 | 0.25 | 60 | 100 | 0.6 | 0.6 |  | 1e-09 |"
    assert line in report.goals(rows)


@pytest.mark.parametrize(
    "module",
    [accuracy, curves, driver, dynamics, laws, tables, sets, stall, hard_scenes, report, scaling, command],
)
def test_examples_of_the_modules_hold(module):
    assert doctest.testmod(module).failed == 0


def test_interpreters_are_given_by_program():
    assert command.pythons(["a/python", "GetFEM=b"]) == {"": "a/python", "GetFEM": "b"}
    with pytest.raises(SystemExit, match="Getfem is no program"):
        command.pythons(["Getfem=b"])
