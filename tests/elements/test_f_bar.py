"""F-bar: the mean change of volume of a hexahedron at large strains."""

from dataclasses import replace

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.assembly.gauss_point_fields import totals
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.errors import ModelError, SolveError
from kratos_lite.verification.meshes import warped

RUBBER = kl.MooneyRivlin3D(0.3, 0.1, 400.0)
F = np.array([[1.2, 0.3, -0.1], [0.1, 0.9, 0.2], [-0.2, 0.1, 1.1]])


def law(model):
    """Return what evaluates a model, and a random large deformation (3n,)."""
    found = model.quasi_static().assembly
    u = found.points @ (F - np.eye(3)).T + 0.02 * np.random.default_rng(3).normal(size=found.points.shape)
    return found, u.ravel()


def rubber(mesh=None, material=RUBBER, formulation=None):
    model = kl.Model(warped("Element3D8N", 2) if mesh is None else mesh, material, formulation=formulation)
    model.fix("x-")
    return model


def test_nearly_incompressible_rubber_in_bricks_takes_it():
    soft = kl.NeoHookean3D(1.0, 0.3)
    for material, name in ((RUBBER, "FBar3D8N"), (soft, "TotalLagrangianElement3D8N")):
        for word in (None, "non_locking"):
            (group,) = rubber(material=material, formulation=word).element_groups()
            assert group.element.__name__ == name
    (group,) = rubber(kl.box(element="Element3D10N")).element_groups()
    assert group.element.__name__ == "TotalLagrangianElement3D10N"


def test_forces_are_derivatives_of_the_energy_and_the_tangent_of_the_forces():
    evaluate, u = law(rubber())
    (group,), start = evaluate.groups, evaluate.start()
    K = evaluate.evaluate(u, start, 1.0)[1].scipy().toarray()
    assert np.abs(K - K.T).max() < 1e-14 * np.abs(K).max()
    way, h = np.random.default_rng(4).normal(size=u.shape), 1e-6
    forces, energies = [], []
    for place in (u - h * way, u, u + h * way):
        f, _, states = evaluate.evaluate(place, start, 1.0, tangent=False)
        forces.append(f)
        energies.append(totals(evaluate.points, [replace(group, states=states[0])], place.reshape(-1, 3))[0])
    assert np.abs((forces[2] - forces[0]) / (2 * h) - K @ way).max() < 1e-8 * np.abs(K).max()
    assert abs((energies[2] - energies[0]) / (2 * h) / (forces[1] @ way) - 1) < 1e-7


def test_at_rest_it_is_b_bar():
    evaluate, u = law(rubber())
    (group,) = evaluate.groups
    K = evaluate.evaluate(0 * u, evaluate.start(), 1.0)[1]
    small = replace(group, element=kl.BBar3D8N)
    exact = assemble_stiffness(evaluate.points, [small], evaluate.pattern)
    assert np.abs(K.data - exact.data).max() < 1e-14 * np.abs(exact.data).max()


def test_an_element_turned_inside_out_is_named():
    evaluate, u = law(rubber(kl.box()))
    u[-1] -= 3.0  # its last node below the first face
    with pytest.raises(SolveError, match=r"element 1 .*turned inside out"):
        evaluate.evaluate(u, evaluate.start(), 1.0)


def test_a_law_linear_in_green_s_strain_is_refused():
    for material in (kl.SaintVenantKirchhoff3D(1.0, 0.499), kl.Isotropic3D(1.0, 0.499)):
        with pytest.raises(ModelError, match=r"element 1.*has no pressure.*NeoHookean3D"):
            rubber(material=material, formulation="f_bar").element_groups()
