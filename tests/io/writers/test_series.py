"""Series of states as files for ParaView, tables and arrays; pictures of trajectories; turned bodies."""

import re

import numpy as np
import pytest
from figures import words_of
from rounding import EPS

import kratos_lite as kl
from kratos_lite.analysis.state import at
from kratos_lite.bodies.rotations import exp
from kratos_lite.io.writers.recorded import OF_BODIES as COLUMNS

RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)
kinds = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)


def thrown(kind):
    body = kind(kl.box((0.4, 0.6, 1.0), cells=(1, 2, 2)), RUBBER)
    body.set_velocity((1, 2, 3), (0.05, 10, 0.05))
    body.add(kl.Gravity((0, 0, -9.81)))
    return body


@kinds
def test_frames_hold_the_motion_of_the_nodes(tmp_path, kind):
    meshio = pytest.importorskip("meshio")
    body = thrown(kind)
    with kl.SeriesWriter(tmp_path / "fly.pvd", body) as series:
        series.add()
        for state in kl.integrate(body, 0.01, 10, every=5):
            series.add(state)
    names = [f"fly_0000{i}.vtu" for i in range(3)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fly.pvd", *names]
    index = re.findall(r'timestep="(\S+)" part="0" file="(\S+)"', (tmp_path / "fly.pvd").read_text())
    assert [name for _, name in index] == names
    assert [float(time) for time, _ in index] == pytest.approx([0.0, 0.05, 0.1])
    first, last = (meshio.read(tmp_path / names[i]) for i in (0, 2))
    assert (first.point_data["DISPLACEMENT"] == 0).all()
    X = body.mesh.points
    np.testing.assert_array_equal(last.points, X)
    np.testing.assert_array_equal(last.point_data["DISPLACEMENT"], body.position(X) - X)
    np.testing.assert_array_equal(last.point_data["VELOCITY"], body.velocity(X))


@kinds
def test_table_and_arrays_hold_each_state(tmp_path, kind):
    body = thrown(kind)
    with (
        kl.SeriesWriter(tmp_path / "a.csv", body) as table,
        kl.SeriesWriter(tmp_path / "a.npz", body) as arrays,
    ):
        states = list(kl.integrate(body, 0.01, 20, every=10))
        for state in states:  # the body is at the end already: each state is looked at as itself
            table.add(state)
            arrays.add(state)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[0].split(",") == list(COLUMNS)
    rows = np.array([list(map(float, line.split(","))) for line in lines[1:]])
    np.testing.assert_allclose(rows[:, 0], [0.1, 0.2])
    terms = rows[:, 1:4]  # their sum is rounded twice, in any order
    assert (np.abs(terms.sum(axis=1) - rows[:, 4]) <= 4 * EPS * np.abs(terms).sum(axis=1)).all()
    np.testing.assert_array_equal(rows[1, 6:9], body.mass_center())
    np.testing.assert_array_equal(rows[1, 12:], body.angular_momentum())
    np.testing.assert_allclose(rows[0, 6:9], [0.3, 0.5, 0.8 - 9.81 / 200], atol=1e-12)
    # what gravity has done is missing in the potential energy
    fallen = 240 * 9.81 * (rows[1, 8] - rows[0, 8])
    assert rows[1, 5] - rows[0, 5] == pytest.approx(-fallen, rel=1e-9)
    found = np.load(tmp_path / "a.npz")
    assert str(found["kind"]) == body.kind
    np.testing.assert_array_equal(found["q"], [state.q for state in states])
    np.testing.assert_array_equal(found["u"][1], body.u)
    assert found["step"].tolist() == [10, 20]


@pytest.mark.parametrize("name", ["a.pvd", "a.csv", "a.npz"])
def test_an_error_leaves_what_there_is(tmp_path, name):
    body = thrown(kl.RigidBody)

    def stopped():
        with kl.SeriesWriter(tmp_path / name, body) as series:
            for state in kl.integrate(body, 0.01, 100):
                series.add(state)
                if state.step == 3:
                    raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    if name == "a.pvd":
        assert (tmp_path / name).read_text().count("<DataSet") == 3
    elif name == "a.csv":
        assert len((tmp_path / name).read_text().splitlines()) == 4
    else:
        assert np.load(tmp_path / name)["step"].tolist() == [1, 2, 3]


def test_a_missing_folder_is_made_with_the_first_state(tmp_path):
    for name in ("a.pvd", "a.csv", "a.npz"):
        with kl.SeriesWriter(tmp_path / "new" / name[2:] / name, thrown(kl.RigidBody)) as series:
            assert not (tmp_path / "new" / name[2:]).exists()
            series.add()
        assert (tmp_path / "new" / name[2:] / name).is_file()
    (tmp_path / "taken").write_text("")
    with pytest.raises(kl.InputError, match=r"a\.csv: its folder cannot be made"):
        kl.SeriesWriter(tmp_path / "taken" / "a.csv", thrown(kl.RigidBody)).add()


def test_a_series_is_of_one_body(tmp_path):
    body = thrown(kl.RigidBody)
    with pytest.raises(kl.InputError, match=r"a\.pvd: a series holds the states of one body.*got list"):
        kl.SeriesWriter(tmp_path / "a.pvd", [body, body])


def test_no_state_no_file(tmp_path):
    with kl.SeriesWriter(tmp_path / "a.csv", thrown(kl.RigidBody)) as series:
        assert series.count == 0
    assert list(tmp_path.iterdir()) == []


def test_many_bodies_are_written_as_arrays_only(tmp_path):
    many = kl.RigidBody(mass_properties=kl.MassProperties.box([(1, 1, 1), (1, 2, 3)], density=1.0))
    with kl.SeriesWriter(tmp_path / "a.npz", many) as series:
        for state in kl.integrate(many, 0.1, 3):
            series.add(state)
    assert np.load(tmp_path / "a.npz")["q"].shape == (3, 2, 12)
    for name in ("a.csv", "a.pvd"):
        with pytest.raises(
            kl.ModelError, match=r"only a single body can be written so; write batches of bodies as \.npz"
        ):
            kl.SeriesWriter(tmp_path / name, many)


def test_bad_targets_are_refused_at_once(tmp_path):
    body = thrown(kl.RigidBody)
    with pytest.raises(kl.InputError, match=r"a\.txt: states in time are written as \.pvd"):
        kl.SeriesWriter(tmp_path / "a.txt", body)
    with pytest.raises(kl.InputError, match="is written as binary, compressed, ascii; got 'zip'"):
        kl.SeriesWriter(tmp_path / "a.pvd", body, mode="zip")
    top = kl.RigidBody(mass_properties=kl.MassProperties(mass=1.0, inertia=np.diag([5.0, 5.0, 1.0])))
    with pytest.raises(kl.ModelError, match="has no mesh to be shown"):
        kl.SeriesWriter(tmp_path / "a.pvd", top)
    with pytest.raises(kl.ModelError, match="has no mesh to be drawn"):
        kl.plot(top, tmp_path / "a.png", states=[kl.State.of(top)])


@pytest.mark.parametrize("kind", [kl.RigidBody, kl.FiniteElementBody])
def test_a_picture_shows_path_and_energies(kind):
    body = thrown(kind)
    words = words_of(kl.plot(body, states=kl.integrate(body, 0.01, 20, every=2), title="a throw"))
    assert {"a throw", "kinetic", "potential", "sum", "time in s", "energy in J"} <= words
    assert ("internal" in words) == (kind is not kl.RigidBody)
    assert body.step == 20


def test_a_picture_of_one_state_has_no_curves(tmp_path):
    body = thrown(kl.RigidBody)
    words = words_of(kl.plot(body, tmp_path / "a.svg", states=[kl.State.of(body)], title="at rest"))
    assert {"at rest", "0 s", "x", "y", "z"} <= words
    assert [word for word in words if word.endswith(" m")]
    assert not {"time in s", "sum"} & words
    assert "<!-- at rest -->" in (tmp_path / "a.svg").read_text()


def test_a_picture_says_when_a_body_starts_and_ends():
    body = thrown(kl.RigidBody)
    figure = kl.plot(body, states=[kl.State.of(body), *kl.integrate(body, 0.01, 20)])
    assert {"0 s", "0.2 s"} <= words_of(figure)
    body = kl.RigidBody(kl.box(), RUBBER)
    body.set_velocity(angular=(0, 0, 2 * np.pi))
    states = [kl.State.of(body), *kl.integrate(body, 0.01, 100)]  # once around
    assert "0 s and 1 s" in words_of(kl.plot(body, states=states))


def test_turning_points_are_among_the_positions_drawn():
    from kratos_lite.analysis.path_picture import telling

    body = kl.RigidBody(kl.box((0.1, 0.1, 0.1)), RUBBER)
    body.constrain(kl.PrescribedDisplacement(body.center, (1, 0, 0), lambda t: np.sin(2 * np.pi * t)))
    q = [kl.State.of(body).q, *(state.q for state in kl.integrate(body, 0.01, 100))]
    assert telling(body, q, 4) == [0, 25, 75, 100]
    assert telling(body, q[:1], 6) == [0]
    assert telling(body, q, 1) == [100]
    assert telling(body, [q[0]] * 5, 6) == [0, 4]


def test_a_picture_without_states_is_refused(tmp_path):
    with pytest.raises(kl.InputError, match="there is no state to draw"):
        kl.plot(thrown(kl.RigidBody), tmp_path / "a.png", states=[])
    assert list(tmp_path.iterdir()) == []


@kinds
def test_a_body_is_turned_about_its_mass_center(kind):
    body = kind(kl.box((0.4, 0.6, 1.0), cells=(1, 2, 2)), RUBBER)
    body.rotate(exp(np.array([0.0, 0.0, np.pi / 2])))
    X = body.mesh.points
    A = X - body.center
    turned = body.center + np.stack([-A[:, 1], A[:, 0], A[:, 2]], axis=1)
    np.testing.assert_allclose(body.position(X), turned, atol=1e-15)
    assert abs(body.internal_energy()) < 1e-9
    with pytest.raises(kl.InputError, match="must be orthogonal"):
        body.rotate(2 * np.eye(3))


def test_a_body_comes_back_from_a_state():
    body = thrown(kl.PseudoRigidBody)
    start = kl.State.of(body)
    *_, end = kl.integrate(body, 0.01, 5)
    with at(body, start):
        assert body.time == 0.0
        np.testing.assert_array_equal(body.u, start.u)
    assert body.time == end.time
    np.testing.assert_array_equal(body.q, end.q)
