"""Inputs read by several ranks, each of which gets its share."""

from pathlib import Path

import numpy as np

import kratos_lite as kl

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"


def inputs():
    """Return model files and run files of real scenes; none where they are absent."""
    found = sorted(CASES.glob("*/*.mdpa")) + sorted(CASES.glob("*/ProjectParameters.json"))
    found += sorted(CASES.glob("*/*.elem"))
    return [path for path in found if not path.parent.name.startswith("parse_")]


def read(path, **options):
    """Return the case of an input, or the text of its error."""
    try:
        return kl.read_case(path, **options), ""
    except kl.KratosLiteError as error:
        return None, str(error)


def test_the_shares_make_the_whole(ranks, path):
    whole, expected = read(path)
    case, error = read(path, comm=ranks)
    assert error == expected
    if whole is None or case is None:
        return
    mesh, all_of = case.model.mesh, whole.model.mesh
    assert ranks.sum(int(mesh.own_nodes.sum())) == all_of.n_nodes
    assert ranks.sum(int(mesh.own_elements.sum())) == all_of.n_elements
    rows = all_of.node_rows(mesh.node_ids)
    assert np.array_equal(mesh.points, all_of.points[rows])
    assert np.array_equal(case.model.supports.fixed, whole.model.supports.fixed[rows])
    assert np.array_equal(case.model.supports.values, whole.model.supports.values[rows])
    assert list(mesh.parts) == list(all_of.parts)


test_the_shares_make_the_whole.cases = inputs()
