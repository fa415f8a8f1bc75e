"""Pretension of bolts: the force that tightens, the length that locks, and what further loads add."""

import numpy as np
import pytest

import kratos_lite as kl

BOLT, SLEEVE = kl.Isotropic3D(E=200e9, nu=0.0, density=7800.0), kl.Isotropic3D(E=70e9, nu=0.0, density=2700.0)
LENGTH, AREAS, FORCE, FURTHER = 0.5, (0.01, 0.03), 4e5, 9e5
STIFFNESS = np.array([m.E * A / LENGTH for m, A in zip((BOLT, SLEEVE), AREAS, strict=True)])
ALONG = np.eye(3)
TURN = np.linalg.qr(np.array([[1.0, 2, 0.5], [-0.3, 1, 2], [1, -1, 1.5]]))[0]


def joint(turn=ALONG, element="8N"):
    """Return a bolt beside a sleeve, both as bars between a wall and a plate that moves along them alone."""
    bolt = kl.split(kl.box((0.1, 0.1, LENGTH), (2, 1, 4), element), lambda X: np.isclose(X[:, 2], LENGTH / 2))
    sleeve = kl.box((0.3, 0.1, LENGTH), (2, 1, 3), element, origin=(0.2, 0, 0))
    mesh = kl.join({"bolt": bolt, "sleeve": sleeve})
    top, bottom = np.flatnonzero(mesh.points[:, 2] == LENGTH), np.flatnonzero(mesh.points[:, 2] == 0)
    axes = kl.Cartesian(turn[:, 0], turn[:, 1])
    model = kl.Model(mesh.replace(points=mesh.points @ turn.T), {"bolt": BOLT, "sleeve": SLEEVE})
    model.fix(bottom, "xyz")
    model.fix(top, "xy", local=axes)
    free = 3 * top + int(np.abs(turn[:, 2]).argmax())
    model.constrain(free[1:], np.full(len(free) - 1, free[0]))  # the plate stays plane
    return model


def further(model, turn=ALONG):
    return kl.Traction("sleeve.z+", FURTHER / AREAS[1] * turn[:, 2])


def bolt_force(result, turn=ALONG):
    """Return the tension in the bolt in N from the forces at its foot."""
    return -float(result.reaction("bolt.z-").sum(axis=0) @ turn[:, 2])


def shortening(result, turn=ALONG):
    ways = (result.displacement("bolt.cut-") - result.displacement("bolt.cut+")) @ turn[:, 2]
    assert np.ptp(ways) < 1e-12
    return float(ways.mean())


@pytest.mark.parametrize("turn", [ALONG, TURN], ids=["along z", "turned"])
def test_a_bolt_is_tightened_by_a_force_and_locked(turn):
    """Two springs: the length is F (1/k + 1/K); a further load P adds P k / (k + K) to the bolt."""
    model = joint(turn)
    model.pretension("bolt.cut-", "bolt.cut+", force=FORCE)
    tight = model.solve()
    length = FORCE * (1 / STIFFNESS).sum()
    assert abs(bolt_force(tight, turn) / FORCE - 1) < 1e-9
    assert abs(shortening(tight, turn) / length - 1) < 1e-9
    model.pretension("bolt.cut-", "bolt.cut+", length=length)
    assert not model.loads
    locked = model.solve()
    assert np.abs(locked.u - tight.u).max() < 1e-9 * np.abs(tight.u).max()
    model.add(further(model, turn))
    worked = model.solve()
    exact = FORCE + FURTHER * STIFFNESS[0] / STIFFNESS.sum()
    assert abs(bolt_force(worked, turn) / exact - 1) < 1e-9
    assert abs(float(worked.reaction("bolt.cut-").sum(axis=0) @ turn[:, 2]) / exact - 1) < 1e-9


@pytest.mark.parametrize("name", [None, "M12"])
@pytest.mark.parametrize("amplitude", [None, lambda t: 1.0])
def test_a_length_takes_the_place_of_a_force_of_any_name(name, amplitude):
    model = joint()
    model.pretension("bolt.cut-", "bolt.cut+", force=2 * FORCE, name=name)
    model.pretension("bolt.cut-", "bolt.cut+", force=FORCE, name="again", amplitude=amplitude)
    assert len(model.loads) == 1
    assert abs(bolt_force(model.solve()) / FORCE - 1) < 1e-9
    model.pretension("bolt.cut-", "bolt.cut+", length=0.0)
    assert not model.loads


def test_load_cases_take_the_force_or_leave_the_bolt_loose():
    model = joint()
    model.pretension("bolt.cut-", "bolt.cut+", force=FORCE, name="M12")
    tight = model.named_loads["M12"]
    cases = model.solve_cases({"tight": [tight], "loose": [further(model)], "both": [tight, further(model)]})
    forces = [bolt_force(cases[name]) for name in ("tight", "loose", "both")]
    assert np.abs(np.array(forces) - [FORCE, 0, FORCE]).max() < 1e-6 * FORCE


def test_large_displacements_are_warned_of():
    model = joint()
    model.formulation = "total_lagrangian"
    model.pretension("bolt.cut-", "bolt.cut+", force=FORCE)
    assert any("keeps its normal" in text for text in model.check())
    model.pretension("bolt.cut-", "bolt.cut+", length=0.0)
    assert not any("keeps its normal" in text for text in model.check())


def test_an_amplitude_scales_the_force():
    model = joint()
    model.pretension("bolt.cut-", "bolt.cut+", force=FORCE, amplitude=lambda t: 0.5 + t)
    assert abs(bolt_force(model.solve()) / (0.5 * FORCE) - 1) < 1e-9


def two_bolts():
    """Two bars, each cut in half and held at both ends."""
    bars = {
        name: kl.split(kl.box((1, 1, 2), (1, 1, 2), origin=(x, 0, 0)), lambda X: X[:, 2] == 1)
        for name, x in (("one", 0.0), ("other", 3.0))
    }
    model = kl.Model(kl.join(bars), kl.Isotropic3D(E=1e9, nu=0.0))
    model.fix("z-")
    model.fix("z+")
    return model


def pulls(model):
    result = model.solve()
    return [-result.reaction(f"{name}.z-")[:, 2].sum().round(6) for name in ("one", "other")]


def test_each_bolt_keeps_its_force():
    model = two_bolts()
    model.pretension("one.cut-", "one.cut+", force=1e3)
    model.pretension("other.cut-", "other.cut+", force=2e3)
    assert pulls(model) == [1e3, 2e3]
    model.pretension("one.cut-", "one.cut+", length=0.0)
    assert pulls(model) == [0, 2e3]
    model.pretension("other.cut-", "other.cut+", force=3e3, amplitude=2.0)
    assert pulls(model) == [0, 6e3]
    model.add(kl.Gravity((0, 0, -9.81)), name="weight")
    with pytest.raises(kl.ModelError, match="another load 'weight'"):
        model.pretension("one.cut-", "one.cut+", force=1e3, name="weight")
    assert pulls(model) == [0, 6e3]


def test_a_joined_and_cut_mesh_is_a_file_of_kratos(tmp_path):
    kl.write(tmp_path / "two.mdpa", two_bolts().mesh)
    parts = kl.read(tmp_path / "two.mdpa").mesh.parts
    assert {"one", "one.z_minus", "other.cut_plus"} <= set(parts)


def test_the_sides_of_a_cut_may_be_named_in_either_order():
    model = two_bolts()
    model.pretension("one.cut+", "one.cut-", force=1e3)
    model.pretension("other.cut-", "other.cut+", force=1e3)
    assert pulls(model) == [1e3, 1e3]
    model.pretension("one.cut-", "one.cut+", force=2e3)
    model.pretension("other.cut+", "other.cut-", length=2e-6)
    assert len(model.loads) == 1
    assert pulls(model) == [2e3, 1e3]


def test_a_locked_cut_without_length_is_none():
    """Frequencies of the bolt are those of one that was never cut."""
    whole = kl.Model(kl.box((0.1, 0.1, LENGTH), (2, 1, 4), "8N"), BOLT)
    cut = kl.Model(kl.split(whole.mesh, lambda X: np.isclose(X[:, 2], LENGTH / 2)), BOLT)
    cut.pretension("cut-", "cut+", length=0.0)
    for model in (whole, cut):
        model.fix("z-")
    assert np.abs(cut.modes(4)[0] / whole.modes(4)[0] - 1).max() < 1e-8


def test_a_bolt_is_at_rest_in_a_harmonic_response():
    whole = kl.Model(kl.box((0.1, 0.1, LENGTH), (2, 1, 4), "8N"), BOLT)
    cut = kl.Model(kl.split(whole.mesh, lambda X: np.isclose(X[:, 2], LENGTH / 2)), BOLT)
    for model in (whole, cut):
        model.fix("z-")
        model.fix("z+", "z")
    options = {"loads": [kl.Traction("z+", (1e3, 0, 0))], "damping": 0.02}
    for how in ({"force": 1e3}, {"length": 1e-5}):
        cut.pretension("cut-", "cut+", **how)
        with pytest.raises(kl.ModelError, match="about its tight state; lock it"):
            cut.harmonic([0.0], **options)
    cut.pretension("cut-", "cut+", length=0.0)
    one, other = (m.harmonic([0.0, 100.0], **options).at((0, 0, LENGTH)) for m in (whole, cut))
    assert np.abs(one - other).max() < 1e-8 * np.abs(one).max()


def test_half_a_bolt_on_a_plane_of_symmetry():
    """Supports hold both sides of the cut across its normal."""
    model = kl.Model(kl.split(kl.box((1, 1, 2), (2, 2, 4), "20N"), lambda X: X[:, 2] == 1), SLEEVE)
    for side, axis in (("z-", "z"), ("z+", "z"), ("y-", "y"), ("x-", "x")):
        model.fix(side, axis)
    model.pretension("cut-", "cut+", force=1e6)
    stress = model.solve().stress()
    assert np.abs(stress - [0, 0, 1e6, 0, 0, 0]).max() < 1e-2


def test_the_summary_says_what_is_tight():
    model = joint()
    model.pretension("bolt.cut-", "bolt.cut+", force=FORCE, name="M12")
    assert "cut from bolt.cut- to bolt.cut+, free along its normal" in str(model)
    assert "M12: BoltForce(a='bolt.cut-', b='bolt.cut+', force=400000.0)" in str(model)
    model.pretension("bolt.cut-", "bolt.cut+", length=1e-4, name="M12")
    assert "cut from bolt.cut- to bolt.cut+, 0.0001 m shorter" in str(model)
    assert "BoltForce" not in str(model)


def test_a_cut_of_a_free_bar_is_found_free():
    model = kl.Model(kl.split(kl.box(cells=(1, 1, 4)), lambda X: X[:, 2] == 0.5), BOLT)
    model.fix("z-")
    model.pretension("cut-", "cut+", force=1e6)
    with pytest.raises(kl.ModelError, match="can still move: translation z"):
        model.solve()


def test_a_split_keeps_the_rest():
    mesh = kl.box((1, 1, 2), (2, 2, 4))
    cut = kl.split(mesh, lambda X: X[:, 2] == 1, ("lower", "upper"))
    assert (cut.n_nodes, cut.n_elements) == (mesh.n_nodes + 9, mesh.n_elements)
    assert np.array_equal(cut.points[cut.nodes("lower")], cut.points[cut.nodes("upper")])
    assert len(cut.nodes("x-")) == len(mesh.nodes("x-")) + 3
    assert [sum(map(len, cut.faces(part))) for part in ("lower", "upper")] == [4, 4]


@pytest.mark.parametrize(
    ("where", "message"),
    [
        (lambda X: X[:, 2] < 0.6, "three or more nodes in one plane"),
        (lambda X: (X[:, 2] == 0.5) & (X[:, 0] == 0), "three or more nodes in one plane"),
        ("z+", "on one side of the cut alone"),
        (lambda X: np.isclose(X[:, 0], X[:, 2]), "elements cross the plane"),
    ],
)
def test_what_is_no_cut_of_a_mesh_is_refused(where, message):
    with pytest.raises(kl.MeshError, match=message):
        kl.split(kl.box(cells=(2, 2, 2)), where)


def held_at_the_cut(model):
    model.fix("bolt.cut+")
    model.pretension("bolt.cut-", "bolt.cut+", force=1.0)
    model.solve()


def held_on_both_sides(model):
    model.fix("bolt.cut-", "z")
    model.fix("bolt.cut+", "z")
    model.pretension("bolt.cut-", "bolt.cut+", length=1e-3)
    model.solve()


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda m: m.pretension("bolt.cut-", "bolt.cut+"), "give one of them"),
        (lambda m: m.pretension("bolt.cut-", "bolt.cut+", force=1.0, length=1.0), "give one of them"),
        (lambda m: m.pretension("bolt.cut-", "bolt.cut+", force=np.inf), "force of a bolt"),
        (lambda m: m.pretension("bolt.cut-", "bolt.cut+", force=1.0, name=[]), "the name of a load"),
        (lambda m: kl.split(None, "z+"), "a mesh"),
        (lambda m: kl.split(m.mesh, "bolt.cut+", "ab"), "names of both sides"),
        (lambda m: m.pretension("bolt.cut-", "bolt.z+", force=1.0), "not in the same places"),
        (lambda m: m.pretension("bolt.cut-", "bolt.cut-", force=1.0), "both have node"),
        (held_at_the_cut, "supports or constraints hold the cut"),
        (
            held_on_both_sides,
            r"contradicts itself: node 31 along z = node 3 along z \+ -0\.001 m; node 3 along z = 0",
        ),
    ],
)
def test_what_is_no_pretension_is_refused(act, message):
    with pytest.raises(kl.KratosLiteError, match=message):
        act(joint())
