"""Files of CalculiX: lines as the definition of the format has them, and values that a reader finds again."""

import numpy as np
import pytest
from calculix_files import blocks, warped

import kratos_lite as kl
from kratos_lite.io.writers.calculix import at_nodes
from kratos_lite.io.writers.frd import FrdStep, write_frd

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7800.0, alpha=1e-5)
CUBE = """\
    2C                             8                                     1
 -1         1 0.00000E+00 0.00000E+00 0.00000E+00
 -1         2 2.00000E+00 0.00000E+00 0.00000E+00
 -1         3 0.00000E+00 1.00000E+00 0.00000E+00
 -1         4 2.00000E+00 1.00000E+00 0.00000E+00
 -1         5 0.00000E+00 0.00000E+00-5.00000E-01
 -1         6 2.00000E+00 0.00000E+00-5.00000E-01
 -1         7 0.00000E+00 1.00000E+00-5.00000E-01
 -1         8 2.00000E+00 1.00000E+00-5.00000E-01
 -3
    3C                             1                                     1
 -1         7    1    0    1
 -2         5         6         8         7         1         2         4         3
 -3
    1PSTEP                         1           3           2          
  100CL  101 2.500000000           8                     1    1           1
 -4  NDTEMP      1    1
 -5  T           1    1    0    0
"""
LINES = {
    "DISP": [
        "D1          1    2    1    0",
        "D3          1    2    3    0",
        "ALL         1    2    0    0    1ALL",
    ],
    "STRESS": [
        "SXX         1    4    1    1",
        "SXY         1    4    1    2",
        "SZX         1    4    3    1",
    ],
    "TOSTRAIN": ["EZZ         1    4    3    3"],
    "ERROR": ["STR(%)      1    1    0    0"],
    "PDISP": ["MAG3        1   12    3    0", "PHA1        1   12    4    0"],
    "PSTRESS": ["MAGZX       1   14    3    1", "PHAXX       1   14    1    1"],
}
WIDTH = {"DISP": 3, "STRESS": 6, "TOSTRAIN": 6, "ERROR": 1, "PDISP": 6, "PSTRESS": 12}


def cube():
    """Return a cell with one element 7 whose nodes are counted from its top."""
    points = [[x, y, z] for z in (0, -0.5) for y in (0, 1) for x in (0, 2)]
    return kl.Mesh(points, [kl.Block("KinematicLinear3D8N", [[4, 5, 7, 6, 0, 1, 3, 2]], ids=[7])])


def test_lines_are_those_of_the_format(tmp_path):
    step = FrdStep({"NDTEMP": np.full(8, 20.0)}, 2.5, "time", step=2, increment=3)
    write_frd(tmp_path / "c.frd", cube(), [step], {1: "STEEL"})
    text = (tmp_path / "c.frd").read_text()
    assert text.startswith("    1C\n    1UUSER")
    assert f"    1UMAT    1{'STEEL':58}\n{CUBE}" in text
    assert text.endswith(" -1         8 2.00000E+01\n -3\n 9999\n")


@pytest.mark.parametrize("name", LINES)
def test_components_have_the_names_and_kinds_of_calculix(name, tmp_path):
    values = np.random.default_rng(1).normal(size=(8, WIDTH[name]))
    write_frd(tmp_path / "c.frd", cube(), [FrdStep({name: values})])
    text = (tmp_path / "c.frd").read_text()
    assert all(f" -5  {line}\n" in text for line in LINES[name])
    ((_, found, parts, ids, read),) = blocks(text)
    count = int(text.split(f" -4  {name:<8}")[1][:5])
    assert (found, len(parts), ids) == (name, count, list(range(1, 9)))
    assert np.abs(read - values).max() <= 5.1e-6 * np.abs(values).max()


NUMBERS = [0.0, -0.0, 1.0, -9.999996, 99999.95, 0.5, 1e-38, -3.4e38, 1.0000005, 123456.5, 2.5e-5, 1.5e-45]


def test_numbers_are_rounded_as_c_rounds_them(tmp_path):
    """Those of single precision by ``%12.5E``, also halfway between two numbers of six digits."""
    many = np.random.default_rng(2).normal(size=4000) * 10.0 ** np.random.default_rng(3).integers(
        -30, 30, 4000
    )
    halfway = 1.0 + (2 * np.arange(4000) + 1) / 2**12
    values = np.concatenate([NUMBERS, many, halfway])
    points = np.random.default_rng(4).uniform(size=(len(values), 3))
    mesh = kl.Mesh(points, {"KinematicLinear3D4N": np.arange(len(values)).reshape(-1, 4)})
    write_frd(tmp_path / "n.frd", mesh, [FrdStep({"PE": values})])
    written = (tmp_path / "n.frd").read_text().split("PE          1    1    0    0\n")[1].splitlines()
    expected = [f"{abs(v) if v == 0 else v:12.5E}" for v in values.astype(np.float32).tolist()]
    assert [line[13:] for line in written[: len(values)]] == expected


VALUES = {
    1: "1.000000000",
    0: " 0.00000E+00",
    0.25: "2.50000E-01",
    831.43449341: "831.4344934",
    21869359.431: "21869359.43",
}


@pytest.mark.parametrize("value", VALUES)
def test_values_of_steps_have_ten_digits(value, tmp_path):
    write_frd(tmp_path / "c.frd", cube(), [FrdStep({"PE": np.zeros(8)}, value)])
    assert f"  100CL  101{VALUES[value]:>12}           8" in (tmp_path / "c.frd").read_text()


def test_steps_count_through_and_keep_numbers_that_are_given(tmp_path):
    steps = [
        FrdStep({"PE": np.zeros(8)}),
        FrdStep({"PE": np.zeros(8)}, 8.0, number=5),
        FrdStep({"PE": np.zeros(8)}),
    ]
    write_frd(tmp_path / "c.frd", cube(), steps)
    assert [head[7:12] for head, *_ in blocks((tmp_path / "c.frd").read_text())] == [
        "  101",
        "  105",
        "  106",
    ]


KINDS = {
    "KinematicLinear3D4N": 3, "KinematicLinear3D5N": 1, "KinematicLinear3D6N": 2, "KinematicLinear3D8N": 1,
    "KinematicLinear3D10N": 6, "KinematicLinear3D13N": 4, "KinematicLinear3D15N": 5,
    "KinematicLinear3D20N": 4, "KinematicLinear3D27N": 4,
}  # fmt: skip
SIZES = {3: 4, 1: 8, 2: 6, 6: 10, 4: 20, 5: 15}


@pytest.mark.parametrize("name", KINDS)
def test_cells_have_their_type_and_nodes_in_its_order(name, tmp_path):
    mesh = kl.box((1, 1, 1), (1, 1, 1), name)
    write_frd(tmp_path / "c.frd", mesh, [])
    nodes, cells = (tmp_path / "c.frd").read_text().split("    2C")[1].split(" -3\n")[:2]
    place = {
        int(line[3:13]): [float(line[at : at + 12]) for at in (13, 25, 37)] for line in nodes.splitlines()[1:]
    }
    lines = cells.splitlines()[1:]
    first = lines[1 : 1 + -(-SIZES[KINDS[name]] // 10)]
    ids = [int(line[at : at + 10]) for line in first for at in range(3, len(line), 10)]
    assert (int(lines[0][13:18]), len(ids)) == (KINDS[name], SIZES[KINDS[name]])
    if len(ids) in (15, 20):  # edges of the first face, those between the faces, those of the last one
        corners, ends = (3, 6) if len(ids) == 15 else (4, 8)
        sides = [(i, (i + 1) % corners) for i in range(corners)]
        edges = [
            *sides,
            *((i, i + corners) for i in range(corners)),
            *((a + corners, b + corners) for a, b in sides),
        ]
        for node, (a, b) in zip(ids[ends:], edges, strict=True):
            middle = np.mean([place[ids[a]], place[ids[b]]], axis=0)
            assert np.abs(middle - place[node]).max() < 1e-5
    assert set(place) >= set(ids)
    assert len(place) == mesh.n_nodes - (7 if name.endswith("27N") else 0)


BAD = [
    (FrdStep({"SPIN": np.zeros(8)}), "field of .frd"),
    (FrdStep({"PE": np.zeros(8)}, kind="modal"), "the kind of a step"),
    (FrdStep({"PE": np.full(8, 1e39)}), "PE is up to 1.0e\\+39, beyond the 3.4e38 of .frd"),
]


@pytest.mark.parametrize(("step", "text"), BAD)
def test_what_the_format_has_not_is_refused_and_the_old_file_stays(step, text, tmp_path):
    (tmp_path / "c.frd").write_text("old")
    with pytest.raises(kl.InputError, match=text):
        write_frd(tmp_path / "c.frd", cube(), [step])
    assert [p.read_text() for p in tmp_path.iterdir()] == ["old"]


def test_unknown_cells_and_numbers_that_are_not_finite_are_refused(tmp_path):
    other = kl.Mesh(np.eye(3), [kl.Block("Shell3N", [[0, 1, 2]])])
    with pytest.raises(kl.InputError, match=r"no cells such as those of Shell3N; write \.vtu"):
        write_frd(tmp_path / "c.frd", other, [])
    with pytest.raises(kl.SolveError, match="PE is not finite"):
        write_frd(tmp_path / "c.frd", cube(), [FrdStep({"PE": np.full(8, np.nan)})])


def heated(name="KinematicLinear3D8N"):
    model = kl.Model(warped(name), STEEL)
    model.fix("x-")
    model.add(kl.Temperature(70.0, reference=20.0))
    model.add(kl.Traction("x+", (1e6, 0, 2e6)))
    return model


def test_results_hold_temperatures_and_the_forces_of_supports_and_loads(tmp_path):
    result = heated().solve()
    kl.write(tmp_path / "r.frd", result)
    found = {name: values for _, name, _, _, values in blocks((tmp_path / "r.frd").read_text())}
    assert list(found) == ["DISP", "NDTEMP", "STRESS", "TOSTRAIN", "FORC", "ENER", "ERROR"]
    assert (found["NDTEMP"] == 70).all()
    size = np.abs(found["FORC"]).max()
    assert np.abs(found["FORC"].sum(axis=0)).max() < 1e-4 * size
    assert np.abs(found["FORC"] - result.reactions - result.loads).max() < 1e-5 * size
    mechanical = at_nodes(result, ["MESTRAIN", "TOSTRAIN"])
    free = mechanical["TOSTRAIN"] - mechanical["MESTRAIN"]
    assert np.abs(free - 5e-4 * np.array([1, 1, 1, 0, 0, 0])).max() < 3e-8  # the fit has four digits


def test_a_uniform_state_is_found_by_every_rule():
    """The matrices of CalculiX add up to 1 within their digits: σ = E ε, shear of tensors γ / 2."""
    for name in KINDS:
        mesh = warped(name)
        model = kl.Model(mesh, STEEL)
        x, y, _ = mesh.points.T
        model.fix(np.arange(mesh.n_nodes), "xyz", np.column_stack([1e-3 * x + 2e-3 * y, -3e-4 * y, 0 * x]))
        found = at_nodes(model.solve(), ["STRESS", "TOSTRAIN", "ERROR"])
        if any(name.endswith(f"D{n}N") for n in (4, 8, 10, 20)):
            assert np.abs(found["ERROR"]).max() < 1e-8
        else:
            assert "ERROR" not in found  # cells and rules that CalculiX has not
        assert np.abs(found["TOSTRAIN"] - [1e-3, -3e-4, 0, 1e-3, 0, 0]).max() < 1e-7
        shear = 2 * STEEL.C[3, 3] * 1e-3
        assert np.abs(found["STRESS"][:, 3] / shear - 1).max() < 1e-4


def test_the_error_is_that_of_the_stress_that_varies_most_in_an_element(tmp_path):
    """u = (x z, 0, 0) has σ = E z and τ = E x / 2, whose larger principal stress varies by r of its size."""
    mesh = kl.box((1, 1, 1), (1, 1, 1), "KinematicLinear3D8N")
    model = kl.Model(mesh, kl.Isotropic3D(E=1e6, nu=0.0))
    x, _, z = mesh.points.T
    model.fix(np.arange(8), "xyz", np.column_stack([1e-3 * x * z, 0 * x, 0 * x]))
    s, t = np.meshgrid(1e3 * (0.5 + np.array([-1, 1]) / 12**0.5), 5e2 * (0.5 + np.array([-1, 1]) / 12**0.5))
    principal = s / 2 + np.hypot(s / 2, t)
    r = 1 - principal.min() / principal.max()
    found = at_nodes(model.solve(), ["ERROR"])["ERROR"]
    assert np.abs(found - (85.324 * r - 8.396)).max() < 1e-3


def test_plastic_strain_is_there_where_a_law_has_it(tmp_path):
    law = kl.J2Plasticity3D(E=2e11, nu=0.3, yield_stress=2e8, hardening=1e10)
    model = kl.Model(kl.box((1, 1, 1)), law)
    model.fix("z-")
    model.fix("z+", "z", 5e-3)
    kl.write(tmp_path / "p.frd", result := model.solve())
    found = {name: values for _, name, _, _, values in blocks((tmp_path / "p.frd").read_text())}
    gauss = np.array(result.field("accumulated_plastic_strain"))
    assert abs(found["PE"].mean() / gauss.mean() - 1) < 1e-4


def test_modes_and_factors_have_their_values_and_shapes(tmp_path):
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), STEEL)
    model.fix("x-")
    omega, shapes = model.modes(2)
    kl.write_modes(tmp_path / "m.frd", model.mesh, omega, shapes)
    text = (tmp_path / "m.frd").read_text()
    found = blocks(text)
    assert [head[56:] for head, *_ in found] == [" 2    1MODAL      1", " 2    2MODAL      1"]
    for (head, *_, values), w, shape in zip(found, omega, shapes, strict=True):
        assert abs(float(head[12:24]) / (w / (2 * np.pi)) - 1) < 1e-8
        assert np.abs(values - shape).max() < 1e-5 * np.abs(shape).max()
        assert f"    1PGK{w**2:28.6E}" in text
    kl.write_modes(tmp_path / "b.frd", model.mesh, [7.5], shapes[:1], buckling=True)
    assert (
        "  100CL  101 7.500000000          20                     4    1           1\n"
        in (tmp_path / "b.frd").read_text()
    )


def test_complex_modes_have_real_and_imaginary_parts(tmp_path):
    model = kl.Model(kl.box((1, 1, 1)), STEEL)
    shapes = np.zeros((1, 8, 3)) + (1 - 2j)
    kl.write_modes(tmp_path / "m.frd", model.mesh, [-1 + 2j * np.pi], shapes)
    found = blocks((tmp_path / "m.frd").read_text())
    assert [(name, values[0, 0]) for _, name, _, _, values in found] == [("DISP", 1.0), ("DISPI", -2.0)]
    assert float(found[0][0][12:24]) == 1.0


def test_states_in_time_are_increments(tmp_path):
    model = kl.Model(kl.box((1, 1, 1)), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1e6)))
    transient = model.transient()
    with kl.SeriesWriter(tmp_path / "t.frd", transient) as series:
        for state in kl.integrate(transient, dt=1e-5, steps=2):
            series.add(state)
    found = blocks((tmp_path / "t.frd").read_text())
    names = ["DISP", "VELO", "STRESS", "TOSTRAIN", "FORC", "ENER", "ERROR"]
    count = len(found) // len(names)
    assert [name for _, name, *_ in found] == names * count
    last = {name: (head, values) for head, name, _, _, values in found}
    assert abs(float(last["DISP"][0][12:24]) - 2e-5) < 1e-12
    assert last["DISP"][0][36:58].split() == ["1"]
    for name, values in (("DISP", state.u), ("VELO", state.v)):
        assert np.abs(last[name][1] - values).max() < 1e-5 * np.abs(values).max()


def test_bodies_have_displacements_and_velocities(tmp_path):
    body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    with kl.SeriesWriter(tmp_path / "b.frd", body) as series:
        series.add()
    assert [name for _, name, *_ in blocks((tmp_path / "b.frd").read_text())] == ["DISP", "VELO"]


def test_steps_of_a_load_that_grows_are_static_increments(tmp_path):
    model = kl.Model(kl.box((1, 1, 1)), STEEL)
    model.fix("z-")
    model.add(kl.Traction("z+", (0, 0, 1e6)))
    steps = model.quasi_static()
    with kl.SeriesWriter(tmp_path / "q.frd", steps) as series:
        for state in kl.integrate(steps, dt=0.5, steps=2):
            series.add(state)
    heads = [head for head, name, *_ in blocks((tmp_path / "q.frd").read_text()) if name == "DISP"]
    assert [(float(head[12:24]), head[36:58].split()) for head in heads][-2:] == [(0.5, ["0"]), (1.0, ["0"])]
