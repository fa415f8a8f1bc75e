"""What is easily lost or accepted: initial stress, changed models, nonsense from functions."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.dynamics.modal import critical_rate


def wheel(motion=None):
    model = kl.Model(
        kl.annulus(0.3, 1.0, 0.25, cells=(2, 24, 1), element="KinematicLinear3D8N"),
        kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0),
    )
    model.fix("inner")
    if motion is not None:
        model.add(motion)
    return model


def strained(model, how):
    if how == "prestress":
        model.add_prestress((1e3, 1e3, 1e3, 0, 0, 0))
    else:
        model.stress_free_at(1e-3 * model.mesh.points)
    return model


@pytest.mark.parametrize("how", ["prestress", "stress-free"])
def test_initial_stress_acts_in_motion_too(how):
    plain = strained(wheel(), how).solve()
    slow = strained(wheel(kl.ale.Rotation("z", 1e-9)), how).solve()
    np.testing.assert_allclose(slow.u, plain.u, rtol=0, atol=1e-9 * np.abs(plain.u).max())
    np.testing.assert_allclose(slow.von_mises("node"), plain.von_mises("node"), rtol=1e-6)
    *_, late = strained(wheel(), how).transient(rayleigh=(400.0, 0.0)).march(2e-3, 400, every=400)
    np.testing.assert_allclose(late.u, plain.u, rtol=0, atol=1e-6 * np.abs(plain.u).max())


def test_a_changed_model_is_noticed():
    model = wheel()
    transient = model.transient()
    list(transient.march(1e-3, 2))
    model.fix("outer")
    with pytest.raises(kl.ModelError, match="the model has changed"):
        transient.march(1e-3, 2)
    other = wheel()
    transient = other.transient()
    other.add(kl.Gravity((0, 0, -9.81)))
    with pytest.raises(kl.ModelError, match="the model has changed"):
        transient.march(1e-3, 2)


def test_nonsense_is_told():
    assert kl.ale.Rotation((1e200, 0, 0)).direction.tolist() == [1, 0, 0]
    for value in (lambda t: None, lambda t: "fast", lambda t: [1.0, 2.0], lambda t: np.nan):
        with pytest.raises(kl.InputError, match="a rate at t = 0 s must be"):
            wheel(kl.ale.Rotation("z", rate=value)).solve()
    transient = wheel().transient()
    (moment,) = transient.march(1e-3, 1)
    with pytest.raises(kl.InputError, match="v of this moment has shape"):
        transient.put(kl.Moment(0.0, 0, moment.u, moment.v[:4], moment.a, moment.reactions))
    with pytest.raises(kl.InputError, match="a Moment is needed"):
        transient.put(None)
    with pytest.raises(kl.InputError, match="count must be"):
        critical_rate(wheel(kl.ale.Rotation("z", 1.0)), -1)
    bar = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.3, density=1e3))
    bar.add(kl.ale.Translation((1, 1, 0), 2.0))
    with pytest.raises(kl.ModelError, match="no face across the direction"):
        list(bar.transient().march(1e-3, 1))
