"""Methods of elements take one point or many, and refuse what does not fit with one error of ours."""

import pydoc

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.elements import ELEMENTS

MATERIAL = kl.Isotropic3D(E=1e9, nu=0.3)
MESH = kl.box((1, 1, 1), (2, 2, 1))
MANY = kl.KinematicLinear3D8N(
    MESH.points[MESH.blocks[0].nodes] + 0.01 * np.sin(np.arange(96.0)).reshape(4, 8, 3)
)


@pytest.mark.parametrize("name", ["N", "dN", "J", "detJ", "dNdX", "B", "position"])
@pytest.mark.parametrize("kind", list(ELEMENTS))
def test_a_method_takes_one_point_or_many(kind, name):
    element = ELEMENTS[kind]
    rng = np.random.default_rng(4)
    X = element.nodes + rng.uniform(-0.03, 0.03, (3, *element.nodes.shape))
    xi = rng.uniform(0.1, 0.3, (2, 5, 3))
    C = [MATERIAL.C] if name == "B" else []
    for cells in (element(X), element(X[0])):
        found = getattr(cells, name)(xi, *C)
        lead = () if name in ("N", "dN") else cells.X.shape[:-2]
        for at in np.ndindex(2, 5):
            single = getattr(cells, name)(xi[at], *C)
            assert found.shape == (*lead, 2, 5, *single.shape[len(lead) :])
            np.testing.assert_allclose(found[(*(slice(None),) * len(lead), *at)], single, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda e: e.stiffness(MATERIAL), "matrix C must be made of real numbers; got Isotropic3D"),
        (lambda e: e.stiffness(np.eye(3)), r"shape \(..., 6, 6\); got \(3, 3\); give the C of a material"),
        (lambda e: e.stiffness(np.full((6, 6), np.nan)), "C must be finite"),
        (lambda e: e.stiffness(np.ones((7, 6, 6))), r"does not fit: leading axes must be \(4,\)"),
        (lambda e: e.stiffness_by_axis(None), "C must be made of real numbers; got None"),
        (lambda e: e.stress(np.zeros((8, 3)), MATERIAL.C), "C must have shape"),
        (lambda e: e.strain(np.zeros(24)), r"got \(24,\); reshape a flat array of 24 to \(8, 3\)"),
        (lambda e: e.strain(np.zeros((3, 8, 3))), r"does not fit: leading axes must be \(4,\)"),
        (lambda e: e.strain("u"), "displacements u must be made of real numbers; got 'u'"),
        (lambda e: e.internal_force(np.zeros(6)), r"got \(6,\); there are 8 points of 6"),
        (lambda e: e.body_force(-9.81), r"b must have shape \(..., 3\); got \(\); give its x, y"),
        (lambda e: e.body_force(np.zeros((5, 3))), r"\(3,\), \(4, 3\) or \(4, 8, 3\); got \(5, 3\)"),
        (lambda e: e.body_force(np.zeros((5, 8, 3))), r"does not fit"),
        (lambda e: e.B([0.0, 0.0]), r"points xi must have shape \(..., 3\); got \(2,\)"),
        (lambda e: e.B([[0, 0, np.inf]]), "points xi must be finite"),
        (lambda e: e.J("corner"), "points xi must be made of real numbers; got 'corner'"),
        (lambda e: e.N(1j * np.ones(3)), "points xi must be made of real numbers"),
        (lambda e: e.determinants(np.zeros((8, 3))), r"dN must have shape \(g, 8, 3\); got \(8, 3\)"),
        (lambda e: e.mass(MATERIAL), "a density must be made of real numbers"),
        (lambda e: e.lumped_mass([1.0, 2.0]), r"have shape \(4,\), one for each element; got \(2,\)"),
        (lambda e: e.rule[8], "of a Gauss point must be a whole number from 0 to 7; got 8"),
        (lambda e: e.rule["first"], "the number of a Gauss point must be a whole number from 0 to 7"),
        (lambda e: type(e)(e.X, 2), "rule must be a Rule, such as hexahedron"),
    ],
)
def test_wrong_arguments_are_refused_in_words(call, text):
    with pytest.raises(kl.InputError, match=text):
        call(MANY)


@pytest.mark.parametrize(
    "X", [np.array([[None] * 3] * 8), np.zeros((7, 3)), "cell", None, 1j * np.ones((8, 3))]
)
def test_nodes_that_are_not_places_are_refused(X):
    with pytest.raises(kl.MeshError, match="nodes X of a KinematicLinear3D8N must"):
        kl.KinematicLinear3D8N(X)


def test_a_family_without_shape_is_no_element():
    with pytest.raises(kl.InputError, match="KinematicLinear states no shape and rule"):
        kl.KinematicLinear(np.zeros((8, 3)))


@pytest.mark.parametrize("order", [[1, 0, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 0, 1, 2, 3]])
def test_an_element_whose_nodes_are_crossed_or_mirrored_is_refused(order):
    for X in (kl.KinematicLinear3D8N.nodes[order], kl.KinematicLinear3D8N.nodes * [1, 1, 0]):
        with pytest.raises(kl.InputError, match="KinematicLinear3D8N: det J must be > 0 at all Gauss points"):
            kl.KinematicLinear3D8N(X).stiffness(kl.Isotropic3D(E=1e9, nu=0.3).C)


def test_help_of_an_element_explains_its_nodes_and_not_arrays():
    text = pydoc.plain(pydoc.render_doc(kl.KinematicLinear3D8N))
    assert "coordinates (n, 3) of the nodes" in text
    assert "ndarray(" not in text
