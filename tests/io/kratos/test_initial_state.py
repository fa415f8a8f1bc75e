"""Initial state of files: prestress with the sign of Kratos, and the displacement without stress."""

from __future__ import annotations

import numpy as np
import pytest

import kratos_lite as kl

BOX = kl.box()
E = 1e6


@pytest.fixture
def write(tmp_path):
    """Write a unit cube that stands on z = 0 and slides there; E = 1 MPa and nu = 0."""

    def write(properties="", data="", element="KinematicLinear3D8N", fixed="XYZ"):
        material = f"YOUNG_MODULUS {E}\nPOISSON_RATIO 0\nDENSITY 1"
        text = f"Begin Properties 1\n{material}\n{properties}\nEnd Properties\n"
        rows = "".join(f"{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(BOX.points, 1))
        nodes = " ".join(map(str, BOX.blocks[0].nodes[0] + 1))
        text += f"Begin Nodes\n{rows}End Nodes\nBegin Elements {element}\n1 1 {nodes}\nEnd Elements\n"
        for axis in fixed:
            held = np.flatnonzero(BOX.points[:, "XYZ".index(axis)] == 0) + 1
            lines = "".join(f"{node} 1 0.0\n" for node in held)
            text += f"Begin NodalData DISPLACEMENT_{axis}\n{lines}End NodalData\n"
        path = tmp_path / "cube.mdpa"
        path.write_text(text + data)
        return path

    return write


def top(value, axis="Z"):
    rows = np.flatnonzero(BOX.points[:, 2] == 1) + 1
    lines = "".join(f"{node} 0 {value}\n" for node in rows)
    return f"Begin NodalData DISPLACEMENT_{axis}\n{lines}End NodalData\n"


def forces(text):
    return [float(word) for word in text[text.index("(") + 1 : text.index(")")].split(",")]


STRETCH = np.where(BOX.points == 1, [0, 0, 1e-3], 0.0)
"""Displacement of the cube by which a strain of 1e-3 along z lets it be free of stress."""


BOTH = "PRESTRESS [6] (0,0,{},0,0,0)\nINSITU_STRESS [6] (0,0,1000,0,0,0)"


@pytest.mark.parametrize(
    "properties",
    [
        "PRESTRESS [6] (0,0,1000,0,0,0)",
        "INSITU_STRESS [6] (0,0,1000,0,0,0)",
        "PRESTRESS [6] (0,0,-500,0,0,0)\nPRESTRESS_FACTOR -2",
        BOTH.format(1000),
    ],
)
def test_a_positive_prestress_of_a_file_is_compression_that_lengthens_the_body(write, properties):
    assert np.abs(kl.read(write(properties)).solve().u - STRETCH).max() < 1e-12


def test_both_names_of_the_prestress_must_agree(write):
    with pytest.raises(kl.InputError, match=r"cube\.mdpa:\d+: .*two names of one stress"):
        kl.read(write(BOTH.format(999)))


def test_the_stress_of_a_held_body_is_the_negative_prestress(write):
    model = kl.read(write("PRESTRESS [6] (1,2,3,4,5,6)", fixed=""))
    model.fix(range(8))
    stress = model.solve().stress("gauss")
    assert np.abs(stress - [-1, -2, -3, -4, -5, -6]).max() < 1e-12


def test_a_prestress_of_elements_is_written_and_read_back(tmp_path):
    model = kl.Model(kl.box(cells=(2, 1, 1)), kl.Isotropic3D(E=E, nu=0.3, density=1.0))
    model.fix("z-")
    model.add_prestress((1.0, -2.0, 300.0, 4.0, 5.0, 6.0), where=[1])
    expected = model.solve().u
    for name in ("two.mdpa", "two.elem"):
        assert not [note for note in kl.write(tmp_path / name, model) if "PRESTRESS" in note]
        again = kl.read(tmp_path / name)
        assert np.array_equal(again.prestress, model.prestress)
        assert np.abs(again.solve().u - expected).max() < 1e-15
    assert "PRESTRESS [6] (-1.0,2.0,-300.0,-4.0,-5.0,-6.0)" in (tmp_path / "two.mdpa").read_text()


def test_convert_keeps_the_sign_of_the_prestress(write, run, tmp_path):
    assert run("convert", write("PRESTRESS [6] (0,0,1000,0,0,0)"), tmp_path / "b.elem").code == 0
    assert run("convert", tmp_path / "b.elem", tmp_path / "c.mdpa").code == 0
    assert np.abs(kl.read(tmp_path / "c.mdpa").solve().u - STRETCH).max() < 1e-12


def test_elements_are_free_of_stress_at_the_displacement_of_free_nodes(write):
    model = kl.read(write(data=top(1e-3)))
    result = model.solve()
    assert np.abs(result.u - STRETCH).max() < 1e-15
    assert np.abs(result.stress("gauss")).max() < 1e-9
    assert any("initial DISPLACEMENT of 4 free nodes" in note for note in result.report.notes)


def test_the_initial_displacement_can_be_ignored(write, run):
    path = write(data=top(1e-3))
    assert not kl.read(path, initial_displacement=False).solve().u.any()
    assert (
        "0.000000e+00 m" in run("solve", path, "--ignore-initial-displacement").rows["largest displacement"]
    )
    assert "1.000000e-03 m" in run("solve", path).rows["largest displacement"]


def test_the_init_file_of_a_set_is_the_state_without_stress(write, run, tmp_path):
    assert run("convert", write(data=top(1e-3)), tmp_path / "set.elem").code == 0
    assert "NODES[8](DISPLACEMENT_Z, 0) = 0.001;" in (tmp_path / "set.init").read_text()
    assert np.abs(kl.read(tmp_path / "set.elem").solve().u - STRETCH).max() < 1e-15


def test_present_elements_of_kratos_take_it_for_a_guess(write):
    model = kl.read(write(data=top(1e-3), element="SmallDisplacementElement3D8N"))
    assert model.initial_displacement is None
    assert any("takes it for a guess" in note for note in model.notes)
    assert not model.solve().u.any()


def test_the_value_of_a_fixed_node_stays_its_support(write):
    model = kl.read(write(data=top(1e-3).replace(" 0 0.001", " 1 0.001")))
    assert model.initial_displacement is None
    assert np.abs(model.solve().stress("gauss")[..., 2] - 1e3).max() < 1e-6


def test_a_model_in_time_starts_from_the_initial_displacement_and_stays(write, run):
    out = run("solve", write(data=top(1e-3)), "--time", "1e-3:3")
    assert "1.000000e-03 m" in out.rows["largest displacement"]
    assert np.abs(forces(out.rows["total reaction"])).max() < 1e-10


def test_a_written_model_is_free_of_stress_at_the_same_displacement(write, tmp_path):
    model = kl.read(write(data=top(1e-3)))
    for name in ("again.mdpa", "again.elem"):
        kl.write(tmp_path / name, model)
        assert np.abs(kl.read(tmp_path / name).solve().u - STRETCH).max() < 1e-15


def test_a_model_whose_initial_displacement_has_no_place_in_a_file_is_not_written(write, tmp_path):
    model = kl.read(write())
    model.set_stress_free_state(np.full((8, 3), 1e-3))
    with pytest.raises(kl.InputError, match="prescribed degrees of freedom cannot be written"):
        kl.write(tmp_path / "x.mdpa", model)
