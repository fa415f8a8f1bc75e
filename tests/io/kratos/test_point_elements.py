"""Elements of one node in files of Kratos: springs to ground and masses, read and written."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, KratosLiteError

FILE = """
Begin Properties 0
{properties}
End Properties
Begin Properties 1
 YOUNG_MODULUS 1e9
 POISSON_RATIO 0.0
 DENSITY 1200.0
End Properties
Begin Nodes
 1 0 0 0
 2 1 0 0
 3 1 1 0
 4 0 1 0
 5 0 0 1
 6 1 0 1
 7 1 1 1
 8 0 1 1
 9 3 3 3
End Nodes
Begin Elements NodalConcentratedElement3D1N
 11 0 {node}
 12 0 2
 13 0 3
 14 0 4
End Elements
Begin Elements SmallDisplacementElement3D8N
 1 1 1 2 3 4 5 6 7 8
End Elements
Begin ElementalData NODAL_DISPLACEMENT_STIFFNESS
 11 [3] (1e4,2e4,3e4)
 12 [3] (1e4,2e4,3e4)
 13 [3] (1e4,2e4,3e4)
 14 [3] (1e4,2e4,{stiffness})
End ElementalData
Begin ElementalData NODAL_MASS
 12 100.0
 14 50.0
End ElementalData
{data}
Begin NodalData VOLUME_ACCELERATION
{weight}
End NodalData
Begin SubModelPart solid
 Begin SubModelPartElements
  13
  1
 End SubModelPartElements
End SubModelPart
"""


def read(folder, node=1, stiffness=3e4, properties="", data=""):
    weight = "\n".join(f" {i} 0 [3] (0,0,-10.0)" for i in range(1, 9))
    text = FILE.format(node=node, stiffness=stiffness, properties=properties, data=data, weight=weight)
    (folder / "point.mdpa").write_text(text)
    return kl.read(folder / "point.mdpa")


def test_springs_and_masses_on_nodes_carry_a_solid_and_are_written_again(tmp_path):
    """The block stands on its springs alone: 1200 + 150 kg, and ω² of the first mode < Σ k / m."""
    model = read(tmp_path)
    assert [block.name for block in model.mesh.blocks] == ["SmallDisplacementElement3D8N"]
    assert model.mesh.parts["solid"].elements.tolist() == [0]
    result = model.solve()
    assert np.abs(result.reactions.sum(axis=0) - [0, 0, 13500.0]).max() < 1e-6
    below = result.displacement([0, 1, 2, 3])[:, 2]
    assert np.abs(result.reaction([0, 1, 2, 3])[:, 2] + 3e4 * below).max() < 1e-6
    assert abs(below.sum() + 13500.0 / 3e4) < 1e-9
    assert "stiffness (40000, 80000, 120000) N/m on 4 nodes in all" in str(model)
    assert "mass 150 kg on 4 nodes in all" in str(model)
    path = tmp_path / "again.mdpa"
    kl.write(path, model)
    again = kl.read(path)
    assert np.abs(again.solve().u - result.u).max() < 1e-12
    assert np.abs(again.modes(6)[0] / model.modes(6)[0] - 1).max() < 1e-9
    model.plot(tmp_path / "springs.png")


def test_springs_and_masses_on_points_that_are_nodes_are_written_as_elements_of_one_node(tmp_path):
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.0, density=1200.0))
    for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)):
        model.add(kl.ElasticSupport((x, y, 0.0), (1e4, 2e4, 3e4)))
    model.add_mass((1.0, 0, 0), 100.0)
    model.add_mass((0.0, 1, 0), 50.0)
    model.add(kl.Gravity((0, 0, -10.0)))
    kl.write(tmp_path / "model.mdpa", model)
    assert np.abs(kl.read(tmp_path / "model.mdpa").solve().u - model.solve().u).max() < 1e-9


def test_they_stand_on_a_finer_mesh(tmp_path):
    from kratos_lite.mesh.refinement import refine
    from kratos_lite.model.refined import refined

    model = read(tmp_path)
    finer = refined(model, refine(model.mesh, np.ones(1, dtype=bool)))
    assert finer.mesh.n_elements == 8
    below = finer.solve().displacement([0, 1, 2, 3])[:, 2]
    assert abs(below.sum() + 13500.0 / 3e4) < 1e-9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"node": 9}, "at node 9, which no solid has"),
        ({"stiffness": -1.0}, "≥ 0; got -1"),
        ({"properties": " NODAL_MASS 5.0"}, "NODAL_MASS of Properties 0 is unknown to NodalConc"),
        (
            {"data": "Begin ElementalData NODAL_ROTATIONAL_STIFFNESS\n 11 [3] (1,1,1)\nEnd ElementalData"},
            "NODAL_ROTATIONAL_STIFFNESS of NodalConcentratedElement3D1N is not supported",
        ),
        (
            {"data": "Begin ElementalData NODAL_DAMPING_RATIO\n 11 [3] (1,1,1)\nEnd ElementalData"},
            "NODAL_DAMPING_RATIO of .* it takes NODAL_DISPLACEMENT_STIFFNESS and NODAL_MASS",
        ),
    ],
)
def test_what_they_cannot_have_is_refused(tmp_path, options, message):
    with pytest.raises(KratosLiteError, match=message):
        read(tmp_path, **options)


def test_springs_between_nodes_are_not_written(tmp_path):
    model = read(tmp_path)
    model.add(kl.ElasticSupport((0.0, 0, 0), (1e3, 0, 0), to=(1.0, 0, 0)))
    with pytest.raises(InputError, match="an elastic support or added mass cannot be written"):
        kl.write(tmp_path / "again.mdpa", model)
