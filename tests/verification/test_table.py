"""The table of known values: rows pass, the page shows them, graded ones agree with another program."""

import json
from pathlib import Path

import numpy as np
import pytest
from known_page import PAGE, rows_of_page, value_ratio

import kratos_lite as kl
from kratos_lite.cli import main
from kratos_lite.verification import page, pressure, scenes
from kratos_lite.verification.meshes import nearest
from kratos_lite.verification.page import SOURCES
from kratos_lite.verification.problem import ELEMENTS, Problem, Row
from kratos_lite.verification.table import PROBLEMS, chosen, verify

FAMILIES = list(dict.fromkeys(name.partition("/")[0] for name in PROBLEMS))


CLOSER = {
    **dict.fromkeys(
        ("patch/linear", "patch/seven_bricks", "patch/quadratic", "patch/quadratic_moved"), 1e-13
    ),
    "patch/bending": 1e-11,
    "pressure/lame_cylinder_hoop": {"27N": 0.01},
    "pressure/lame_sphere": {"15N": 4e-3, "20N": 2e-3, "27N": 2e-3},
}
"""What our own elements reach beyond the limit of a row: of those that have to pass, or by element."""


BEAM = {
    8: ((0.986, 0.093, 0.025), (0.986, 0.026, 0.010), (0.986, 0.032, 0.014)),
    20: ((0.994, 0.970, 0.961), (0.994, 0.886, 0.920), (0.994, 0.967, 0.941)),
    27: ((0.994, 0.978, 0.977), (0.994, 0.968, 0.966), (0.994, 0.969, 0.967)),
    4: ((0.978, 0.031, 0.009), (0.980, 0.019, 0.006), (0.980, 0.022, 0.007)),
    10: ((0.993, 0.962, 0.957), (0.994, 0.945, 0.943), (0.994, 0.951, 0.945)),
}
"""Displacement of the end / truth of straight cantilevers: extension, in plane, out of plane."""
FLAT = np.sin(np.radians(10)) / np.radians(10)
"""The pressure of linear elements in the thick cylinder acts on plane faces."""
CYLINDER = {0.3: (0.9908 * FLAT, 0.9996, 0.9998), 0.4999: (0.0534 * FLAT, 0.8793, 0.8793)}
INDEPENDENT = {
    (f"macneal_harder/straight_{form}_{load}", f"KinematicLinear3D{nodes}N"): ratio
    for nodes, forms in BEAM.items()
    for form, ratios in zip(("rectangular", "trapezoidal", "parallelogram"), forms, strict=True)
    for load, ratio in zip(("extension", "in_plane", "out_of_plane"), ratios, strict=True)
} | {
    (f"pressure/thick_cylinder_{nu}", f"KinematicLinear3D{nodes}N"): ratio
    for nu, ratios in CYLINDER.items()
    for nodes, ratio in zip((8, 20, 27), ratios, strict=True)
}
"""Values over their references by an independent program, which tells three digits after the point."""


def closer(row):
    """Return the error that a row must not exceed."""
    bound = CLOSER.get(row.problem.name, np.inf)
    if isinstance(bound, dict):
        return bound.get(row.kind, np.inf)
    return bound if row.problem.exact(row.element) else np.inf


def same(text, value):
    """Return whether a value is the one that stands on the page, but for its last digit."""
    return text == value or abs(float(text) - float(value)) <= 2e-3 * abs(float(value))


# ---- rows --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_rows_pass_and_stand_on_the_page(family):
    rows, shown = list(verify([family])), rows_of_page(family)
    assert [page.line(row) for row in rows if row.failed] == []
    assert [(row.problem.name.partition("/")[2], row.kind) for row in rows] == list(shown)
    for row in rows:
        assert row.error <= closer(row), page.line(row)
        cells = shown[row.problem.name.partition("/")[2], row.kind]
        assert cells["reference"] == page.number(row.problem.reference), row.problem.name
        assert cells["limit"] == page.limit(row)
        assert cells["source"] == row.problem.source
        assert f"**{row.problem.cited}**" in PAGE
        assert cells["grade"] == row.grade, page.line(row)
        assert same(cells["value"], page.shown(row, row.value)), (page.line(row), cells)
        ratio = INDEPENDENT.get((row.problem.name, row.element))
        assert ratio is None or abs(row.value / row.problem.reference - ratio) <= 5e-4, page.line(row)


def test_there_are_rows_enough_for_every_element():
    for name in ELEMENTS:
        assert sum(name in problem.elements() for problem in PROBLEMS.values()) >= 50
    assert sum(len(problem.elements()) for problem in PROBLEMS.values()) >= 900


def test_the_problems_of_the_families_are_all_there():
    assert set(page.TITLES) == set(FAMILIES)
    assert all(problem.name == name and problem.quantity for name, problem in PROBLEMS.items())
    used = {problem.cited for problem in PROBLEMS.values()}
    assert used <= set(SOURCES)
    assert all(element in PROBLEMS[name].elements() for name, element in INDEPENDENT)


@pytest.mark.parametrize(
    ("nodes", "nu", "wanted"),
    [(4, 0.3, 0.9679), (4, 0.4999, 0.8608), (10, 0.3, 0.9997), (10, 0.4999, 0.9988)],
)
def test_tetrahedra_in_a_segment_of_the_cylinder_agree_with_an_independent_program(nodes, nu, wanted):
    mesh = kl.box((5, 1, 1), (5, 1, 1), f"KinematicLinear3D{nodes}N")
    r, angle = np.interp(mesh.points[:, 0], range(6), pressure.RADII), np.radians(10) * mesh.points[:, 1]
    bent = np.column_stack([r * np.cos(angle), r * np.sin(angle), mesh.points[:, 2]])
    model = kl.Model(mesh.replace(points=bent), kl.Isotropic3D(E=1000.0, nu=nu))
    for side, axis in (("z-", "z"), ("z+", "z"), (mesh.nodes("y-"), "y")):
        model.fix(side, axis)
    for node in mesh.nodes("y+"):  # the normal displacement of the slanted side is zero
        model.constrain((int(node), "y"), {(int(node), "x"): np.tan(np.radians(10))})
    inner = mesh.nodes("x-")
    model.add(kl.Pressure(inner, 1.0))
    found = np.hypot(*model.solve().u[inner, :2].T).mean() / pressure.lame_cylinder(nu, 1000.0, 3.0, 9.0, 3.0)
    flat = np.sin(np.radians(10)) / np.radians(10) if nodes == 4 else 1.0
    assert found == pytest.approx(wanted * flat, abs=5e-4)


@pytest.mark.parametrize("nodes", [15, 27])
def test_energy_and_loads_of_a_sphere_and_a_cylinder_under_pressure(nodes):
    sphere = scenes.sphere(f"{nodes}N", 3).model.solve()
    assert sphere.energy() == pytest.approx(0.5 * 0.8 * np.pi / 2, rel=4e-3)
    np.testing.assert_allclose(sphere.report.total_load, np.pi / 4, rtol=5e-4)
    cylinder = pressure.cylinder(f"{nodes}N").solve()
    assert cylinder.energy() == pytest.approx(0.5 * 1.906666667 * 2 * np.pi * 0.25, rel=2e-3)
    np.testing.assert_allclose(cylinder.report.total_load, 0, atol=1e-13)
    at = nearest(cylinder.mesh, (1, 0, 0))
    assert cylinder.stress("node")[at, 0] == pytest.approx(-1, rel=0.05)


# ---- grades ------------------------------------------------------------------------------------------


def row(value, **options):
    given = {"name": "a/b", "quantity": "q", "source": "Hooke", "reference": 2.0}
    given |= {"models": None, "measure": lambda kind: value}
    return Problem(**given | options).row("KinematicLinear3D8N")


@pytest.mark.parametrize(
    ("value", "grade"), [(2.04, "A"), (1.96, "A"), (2.05, "B"), (2.3, "C"), (1.1, "D"), (-2.0, "F")]
)
def test_grades_follow_the_relative_error(value, grade):
    assert row(value).grade == grade


def test_a_tolerance_is_met_or_not_whatever_the_sign_and_no_number_fails():
    assert row(2.01, tolerance=0.01).grade == "pass"
    for value in (2.03, 1.97, -2.0, float("nan"), float("inf")):
        assert row(value, tolerance=0.01).failed
    assert row(float("nan")).grade == "F"
    assert row(1e-12, reference=0.0, tolerance=1e-11).grade == "pass"
    assert row(-1e-10, reference=0.0, tolerance=1e-11).failed
    assert row(1.5, tolerance=0.01, exact=lambda kind: False).grade == "D"


def test_an_error_of_the_library_is_a_row_that_fails_with_its_words():
    def measure(kind):
        raise kl.MeshError("element 1 is inverted\nand more")

    failed = row(None, measure=measure)
    assert failed.failed
    assert "element 1 is inverted" in page.line(failed)
    assert "more" not in page.line(failed)
    assert page.line(failed, reported=True).endswith("FAIL    as above")


def test_problems_are_chosen_by_name_family_and_pattern():
    assert len(chosen()) == len(PROBLEMS)
    assert [p.name for p in chosen(["patch/linear"])] == ["patch/linear"]
    assert {p.name.partition("/")[0] for p in chosen(["patch", "*lame*"])} == {
        "patch",
        "pressure",
    }
    with pytest.raises(
        kl.InputError, match=r"no problem fits 'pach'; the families are element, .* Did you mean patch"
    ):
        chosen(["pach"])


# ---- texts -------------------------------------------------------------------------------------------


def test_the_page_shows_other_programs_beside_ours():
    known = PROBLEMS["patch/linear"]
    rows = [
        Row(known, "KinematicLinear3D8N", 1e-15, {"Kratos": 1e-16, "CalculiX": 2.365e-7}),
        Row(known, "KinematicLinear3D27N", 1e-15),
        Row(PROBLEMS["nafems/le10"], "KinematicLinear3D27N", -5.39),
    ]
    text = page.markdown(rows, {"Kratos": "10.4", "CalculiX": "2.20"})
    assert "| linear | 8N | < 1e-11 | < 1e-11 | 2.365e-07 | 0 | exact | pass | Irons |" in text
    assert "| linear | 27N | < 1e-11 |  |  | 0 | exact | pass | Irons |" in text
    assert "| le10 | 27N | -5.39 | -5.38 | graded | A |" in text
    assert "Kratos 10.4, CalculiX 2.20" in text
    assert "Kratos" not in page.markdown(rows[1:])
    assert page.summary(rows) == "3 rows: 2 pass, 1 A"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


OWN = """
from kratos_lite import KinematicLinear, KinematicLinear3D8N
from kratos_lite.shapes.hexahedra import Hexahedron8

class {name}(KinematicLinear):
    shape, rule = Hexahedron8, KinematicLinear3D8N.rule
{more}
"""


def own_element(name, more=""):
    Path("own.py").write_text(
        OWN.format(name=name, more=more and f"    def B(self, xi):\n        return {more}")
    )


def test_an_element_of_ones_own_gets_the_same_rows(folder, capsys):
    own_element("My8N")
    assert main(["verify", "own.py", "element", "patch", "-o", "own.json"]) == 0
    rows = {row["problem"]: row for row in json.loads(Path("own.json").read_text())["rows"]}
    assert set(rows) == {p.name for p in chosen(["element", "patch"]) if ELEMENTS[3] in p.elements()}
    assert {row["element"] for row in rows.values()} == {"My8N"}
    bent = value_ratio("element/bending", "KinematicLinear3D8N")
    assert rows["element/bending"]["value"] == pytest.approx(bent, rel=1e-3)
    assert "My8N" not in kl.ELEMENTS
    assert " pass" in capsys.readouterr().out.splitlines()[-1]


def test_rows_of_a_broken_element_that_fail_stand_first_with_exit_code_1(folder, capsys):
    own_element("Stiff8N", "super().B(xi) * 1.01")
    assert main(["verify", "own.py", "element", "--element", "Stiff8N", "-o", "own.md"]) == 1
    failed = [" FAIL" in line for line in capsys.readouterr().out.splitlines()[1:-1]]
    assert 0 < sum(failed) < len(failed)
    assert failed == sorted(failed, reverse=True)
    assert "| uniaxial | Stiff8N |" in Path("own.md").read_text()


def test_an_error_of_ones_own_element_is_named_with_exit_code_2(folder, capsys):
    own_element("Zero8N", "1 / 0")
    assert main(["verify", "own.py", "element/uniaxial"]) == 2
    err = capsys.readouterr().err
    assert "error: Zero8N raises ZeroDivisionError: division by zero, in element/uniaxial" in err
    assert "internal error" not in err


def test_the_command_lists_and_refuses(folder, capsys):
    assert main(["verify", "--list", "shells"]) == 0
    out = capsys.readouterr().out
    assert out.count("\n") == 5
    assert "[MacNeal, rectangular plates]" in out
    Path("none.py").write_text("x = 1")
    for words, text in (
        (["nothing"], "no problem fits 'nothing'"),
        (["cylindre"], "Did you mean *cylinder*"),
        (["patch", "--element", "3D9N"], "unknown element '3D9N'"),
        (["patch", "-o", "page.txt"], "is written as .md or .json"),
        (["none.py"], "none.py: defines no element"),
        (["gone.py"], "gone.py: there is no such file"),
    ):
        assert main(["verify", *words]) == 2
        assert text in capsys.readouterr().err
