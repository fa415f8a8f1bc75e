"""Own element classes with hourglass modes are refused before they are solved: against dense eigenvalues."""

from dataclasses import replace

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.quadrature import hexahedron, tetrahedron

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)


@pytest.fixture(autouse=True)
def _forgotten():
    with kl.ELEMENTS.temporary():
        yield


def cantilever(element, cells=(6, 1, 1)):
    model = kl.Model(kl.box((6, 1, 1), cells, element.__name__), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e3)))
    return model


def own(base, **members):
    return type("Own", (base,), members)


def dense_modes(element):
    """Return how many eigenvalues of the stiffness of a skew cell are 0, beside six."""
    X = element.nodes @ np.array([[1.0, 0.1, 0.0], [0.2, 1.1, 0.1], [0.0, 0.1, 0.9]])
    values = np.linalg.eigvalsh(element(X).stiffness(STEEL.C))
    return int((values < 1e-9 * values[-1]).sum()) - 6


@pytest.mark.parametrize(
    ("base", "rule", "modes"),
    [
        (kl.KinematicLinear3D8N, hexahedron(degree=1), 12),
        (kl.KinematicLinear3D20N, hexahedron(degree=3), 6),
        (kl.KinematicLinear3D27N, hexahedron(degree=3), 27),
        (kl.KinematicLinear3D10N, tetrahedron(degree=1), 18),
    ],
)
def test_an_own_rule_with_too_few_points_is_refused_with_the_number_of_modes_and_the_cure(base, rule, modes):
    element = own(base, rule=rule)
    assert dense_modes(element) == modes
    with pytest.raises(kl.ModelError, match=rf"^Own has {modes} hourglass modes .*{base.__name__}\.rule has"):
        cantilever(element).solve()
    with pytest.raises(kl.ModelError, match=f"{modes} hourglass modes"):
        cantilever(element).modes(3)
    with pytest.raises(kl.ModelError, match=f"{modes} hourglass modes"):
        kl.FiniteElementBody(kl.box(element="Own"), STEEL)


CENTER = np.zeros(3)


def one_strain(element, xi):
    """Return B of the center, at all points."""
    return kl.KinematicLinear3D8N.B(element, 0 * np.asarray(xi))


def one_point(element, C, u):
    """Return a local system written by hand, of one point."""
    B = element.B(CENTER)
    K = B.T @ C @ B * 8 * element.detJ(CENTER)
    return K, (K @ u.ravel()).reshape(u.shape)


@pytest.mark.parametrize(("step", "method"), [("B", one_strain), ("local_system", one_point)])
def test_an_own_step_that_leaves_hourglass_modes_is_refused_and_named(step, method):
    model = cantilever(own(kl.KinematicLinear3D8N, **{step: method}))
    with pytest.raises(kl.ModelError, match=f"12 hourglass modes .*correct {step}, which the class"):
        model.check()


def test_a_step_that_fails_on_regular_cells_alone_is_found():
    class Jumping(kl.KinematicLinear3D8N):
        def local_system(self, C, u):
            opposite = self.X[0] + self.X[6] - self.X[1] - self.X[7]
            return super().local_system(C, u) if np.abs(opposite).max() > 1e-3 else one_point(self, C, u)

    with pytest.raises(kl.ModelError, match="12 hourglass modes"):
        cantilever(Jumping).check()


def test_sound_own_classes_are_solved_and_checked_once(monkeypatch):
    count = []

    class Counted(kl.KinematicLinear3D8N):
        def B(self, xi):
            count.append(1)
            return super().B(xi)

    model = cantilever(Counted)
    assert not model.check()
    before = len(count)
    assert before
    assert not model.check()
    assert not cantilever(Counted, (3, 1, 1)).check()
    assert len(count) == before
    assert not cantilever(own(kl.KinematicLinear3D8N, rule=hexahedron(degree=5))).check()


def test_modes_that_a_class_states_are_a_warning_but_further_ones_an_error():
    few = {"rule": hexahedron(degree=1)}
    stated = own(kl.KinematicLinear3D8N, spurious_modes=12, **few)
    assert cantilever(stated).check() == [
        "Own has 12 hourglass modes, as it states; whether neighbors stop them is not checked"
    ]
    with pytest.raises(kl.ModelError, match="state spurious_modes = 12"):
        cantilever(own(kl.KinematicLinear3D8N, spurious_modes=6, **few)).check()
    block = cantilever(own(kl.Reduced3D20N), (2, 2, 2))
    assert not block.check()
    with pytest.raises(kl.ModelError, match="neighbors along one axis"):
        cantilever(own(kl.Reduced3D20N)).check()


def test_a_better_rule_of_the_model_cures_an_own_class():
    element = own(kl.KinematicLinear3D8N, rule=hexahedron(degree=1))
    model = cantilever(element)
    model.use_rule(kl.KinematicLinear3D8N.rule)
    assert not model.check()
    model.use_rule(replace(element.rule, name="another"))
    assert model.check() == [
        "Own with 1 Gauss point has 12 hourglass modes; its own rule has 1 Gauss point and 12"
    ]


@pytest.mark.parametrize("rule", [None, (np.zeros((1, 3)), np.array([8.0])), hexahedron])
def test_an_own_rule_that_is_none_is_refused_with_its_class(rule):
    with pytest.raises(kl.InputError, match=r"^Own\.rule must be a Rule, .*hexahedron\(degree=3\); got"):
        own(kl.KinematicLinear3D8N, rule=rule)
