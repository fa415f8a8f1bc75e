"""Elements that do not lock in every analysis: loads, modes, transients, moving material, bodies, files."""

import numpy as np
import pytest

import kratos_lite as kl

STEEL = kl.Isotropic3D(E=210e9, nu=0.0, density=7850.0)
RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
OWN = ("EnhancedStrain3D8N", "BBar3D8N", "BBar3D10N", "BBar3D13N", "BBar3D15N", "BBar3D20N", "BBar3D27N")
HEXAHEDRA = ("EnhancedStrain3D8N", "BBar3D8N", "BBar3D20N", "BBar3D27N", "Reduced3D20N")
LENGTH, WIDTH, THICKNESS = 10.0, 1.0, 0.1


def moved(mesh, seed=3):
    """Return a mesh with straight edges whose corners are moved a little."""
    shift = 0.04 * np.sin(5 * mesh.points[:, [1, 2, 0]] + seed) * np.array([1.0, -0.7, 0.4])
    return mesh.replace(points=mesh.points + shift)


def cube(element, material=RUBBER, cells=(2, 2, 2)):
    model = kl.Model(moved(kl.box(cells=cells, element=element)), material)
    model.fix("z-")
    return model


# ---- modes and transients -----------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [10, 20])
def test_frequencies_of_a_thin_cantilever_are_those_of_the_beam(cells):
    """Source: Timoshenko, Vibration Problems in Engineering: ω = (β L)² √(E I / (ρ A L⁴)) for ν = 0."""
    model, plain = (
        kl.Model(kl.box((LENGTH, WIDTH, THICKNESS), (cells, 1, 1), element), STEEL)
        for element in ("Element3D8N", "KinematicLinear3D8N")
    )
    model.fix("x-")
    plain.fix("x-")
    omega, shapes = model.modes(3)
    beam = np.sqrt(210e9 * THICKNESS**2 / 12 / 7850.0) / LENGTH**2
    bending = omega[np.abs(shapes[:, :, 2]).max(axis=1) > 10 * np.abs(shapes[:, :, 1]).max(axis=1)]
    exact = np.array([1.8751041, 4.6940911]) ** 2 * beam
    assert np.abs(bending[:2] / exact - 1).max() < (0.04 if cells == 10 else 0.01)
    assert abs(bending[0] / exact[0] - 1) < (0.005 if cells == 10 else 0.0015)
    assert plain.modes(1)[0][0] > (5 if cells == 10 else 2) * exact[0]


@pytest.mark.parametrize("element", [*OWN, "Reduced3D20N"])
def test_mass_and_loads_are_those_of_the_plain_element_of_the_shape(element):
    plain = f"KinematicLinear{element[element.index('3D') :]}"
    one, other = cube(element), cube(plain)
    for model in (one, other):
        model.add(kl.Gravity((1.0, 2.0, -9.81)))
        model.add(kl.Pressure("z+", 3e3))
        model.add(kl.Traction("x+", (10.0, 0, 5.0)))
    a, b = one.matrices(), other.matrices()
    assert np.abs((a.M - b.M).data).max(initial=0.0) == 0
    assert np.abs(a.f - b.f).max() == 0
    assert np.abs(one.solve().reaction("z-").sum(axis=0) + b.f.reshape(-1, 3).sum(axis=0)).max() < 1e-6


@pytest.mark.parametrize("element", OWN)
def test_stress_at_the_gauss_points_is_the_stress_between_them(element):
    model = cube(element)
    model.add(kl.Traction("z+", (300.0, 200.0, 100.0)))
    result = model.solve()
    group = model.element_groups()[0]
    gauss, scale = result.stress("gauss"), np.abs(result.stress("gauss")).max()
    for row in (0, len(group) - 1):
        cell = group.at(model.mesh.points).X[row]
        x = group.element.shape
        points = np.array([x.N(xi) @ cell for xi in group.rule.points])
        found = model.mesh.locate(points)
        inside = found.rows == group.rows[row]
        assert inside.all()
        assert np.abs(result.at(points).stress - gauss[group.rows[row]]).max() < 1e-9 * scale


# ---- moving material ------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", HEXAHEDRA)
def test_a_spinning_ring_is_stretched_as_the_closed_form_says(element):
    """A thin ring: σ = ρ ω² r², so its radius grows by ρ ω² r³ / E (Timoshenko & Goodier, art. 32)."""
    ring = kl.Model(kl.annulus(0.98, 1.02, 0.04, (2, 40, 1), element), RUBBER)
    for node in np.flatnonzero(np.abs(ring.mesh.points[:, 2]) < 1e-9):
        x, y, _ = ring.mesh.points[node]
        if min(abs(x), abs(y)) < 1e-9:
            ring.fix([node], "y" if abs(y) < 1e-9 else "x")
    ring.fix("z-", "z")
    ring.add(kl.ale.Rotation("z", 3.0))
    u, X = ring.solve().u, ring.mesh.points
    radial = (u[:, :2] * X[:, :2]).sum(axis=1) / np.linalg.norm(X[:, :2], axis=1)
    exact = 1000.0 * 3.0**2 / 1e6
    assert abs(radial.mean() / exact - 1) < 0.02


# ---- bodies ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("formulation", ["corotational", "modal"])
@pytest.mark.parametrize("element", OWN)
def test_bodies_of_small_strains_turn_and_keep_their_energy(element, formulation):
    options = {"modes": 12} if formulation == "modal" else {}
    body = kl.FiniteElementBody(
        kl.box((0.4, 0.6, 1.0), (1, 1, 2), element), RUBBER, formulation=formulation, **options
    )
    body.set_velocity(angular=(0, 2.0, 0.1))
    before = body.kinetic_energy() + body.potential_energy()
    momentum = body.angular_momentum()
    for _ in kl.integrate(body, dt=2e-3, steps=10):
        pass
    assert abs((body.kinetic_energy() + body.potential_energy()) / before - 1) < 1e-2
    assert np.abs(body.angular_momentum() - momentum).max() < 2e-2 * np.abs(momentum).max()


@pytest.mark.parametrize("element", OWN)
def test_large_strains_refuse_operators_of_small_ones_with_the_cure(element):
    with pytest.raises(
        kl.ModelError, match=rf'{element} has a B or local system .*formulation="corotational" or "modal"'
    ):
        kl.FiniteElementBody(kl.box(element=element), RUBBER)


def test_large_strains_take_the_plain_element_of_cells_that_name_no_formulation():
    named = kl.FiniteElementBody(kl.box(cells=(1, 1, 3), element="KinematicLinear3D8N"), RUBBER)
    unnamed = kl.FiniteElementBody(kl.box(cells=(1, 1, 3)), RUBBER)
    q = 0.01 * np.random.default_rng(2).normal(size=named.q.size)
    assert [group.element for group in unnamed.groups] == [kl.KinematicLinear3D8N]
    assert np.abs(named.formulation.load(q) - unnamed.formulation.load(q)).max() == 0
    small = kl.FiniteElementBody(kl.box(), RUBBER, formulation="corotational")
    assert [group.element for group in small.groups] == [kl.EnhancedStrain3D8N]


def test_a_row_of_reduced_bricks_is_no_body():
    with pytest.raises(kl.ModelError, match="can deform without stress"):
        kl.FiniteElementBody(kl.box((1, 1, 3), (1, 1, 3), "Reduced3D20N"), RUBBER)


# ---- files ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["mdpa", "elem"])
@pytest.mark.parametrize("element", [*OWN, "Reduced3D20N"])
def test_a_model_returns_from_its_file_with_the_same_elements(tmp_path, element, ending):
    model = cube(element)
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    notes = kl.write(tmp_path / f"a.{ending}", model)
    again = kl.read(tmp_path / f"a.{ending}")
    assert [group.element.__name__ for group in again.element_groups()] == [element]
    u = model.solve().u
    assert np.abs(again.solve().u - u).max() < 1e-12 * np.abs(u).max()
    unknown = [note for note in notes if "Kratos 10 does not know them" in note]
    assert len(unknown) == (ending == "mdpa" and element != "BBar3D8N")


def test_a_model_is_written_with_the_elements_that_compute_it(tmp_path):
    mesh = kl.box((1, 1, 2), (2, 2, 2), element="Element3D20N")
    mesh.add_part("low", lambda X: X[:, 2] <= 1)
    model = kl.Model(mesh, RUBBER)
    model.assign(kl.Isotropic3D(E=1e6, nu=0.49, density=1000.0), "low")
    model.fix("z-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    kl.write(tmp_path / "a.mdpa", model)
    text = (tmp_path / "a.mdpa").read_text()
    assert "Begin Elements BBar3D20N" in text
    assert "Begin Elements SmallDisplacementElement3D20N" in text
    again = kl.read(tmp_path / "a.mdpa")
    assert again.mesh.element_ids.tolist() == mesh.element_ids.tolist()
    u = model.solve().u
    assert np.abs(again.solve().u - u).max() < 1e-12 * np.abs(u).max()


def test_names_of_kratos_are_kept_and_solved_as_kratos_does(tmp_path):
    model = cube("KinematicLinear3D8N")
    kl.write(tmp_path / "a.mdpa", model)
    text = (tmp_path / "a.mdpa").read_text()
    for name, kind in (
        ("SmallDisplacementElement3D8N", kl.KinematicLinear3D8N),
        ("SmallDisplacementBbarElement3D8N", kl.BBar3D8N),
        ("Element3D8N", kl.EnhancedStrain3D8N),
    ):
        (tmp_path / "b.mdpa").write_text(text.replace("SmallDisplacementElement3D8N", name))
        assert [group.element for group in kl.read(tmp_path / "b.mdpa").element_groups()] == [kind]


def test_a_mesh_without_names_of_elements_does_not_lock(tmp_path):
    kl.write(tmp_path / "a.vtu", kl.box((LENGTH, WIDTH, THICKNESS), (10, 1, 1), "KinematicLinear3D8N"))
    model = kl.read(tmp_path / "a.vtu")
    model.assign(STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 1.0)))
    result = model.solve()
    exact = 4 * THICKNESS * LENGTH**3 / (210e9 * WIDTH * THICKNESS**3)
    assert abs(result.u[:, 2].max() / exact - 1) < 0.01
    assert result.report.formulation.startswith("non_locking, as the mesh names none")
    assert result.report.warnings == []
