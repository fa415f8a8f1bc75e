"""Options of PETSc, and backends where it is not installed."""

import sys

import pytest

import kratos_lite as kl
from kratos_lite.distributed import petsc as module
from kratos_lite.distributed.petsc import parsed
from kratos_lite.errors import InputError, ModelError

STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0)


def model():
    body = kl.Model(kl.box(cells=(2, 2, 2)), STEEL)
    body.fix("z-")
    body.add(kl.Gravity((0, 0, -9.81)))
    return body


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, {}),
        ("", {}),
        ("-ksp_view", {"ksp_view": None}),
        ("-ksp_type cg -ksp_rtol -1e-9", {"ksp_type": "cg", "ksp_rtol": "-1e-9"}),
        (
            "-pc_type gamg\n-pc_gamg_threshold '0.01, 0.02'",
            {"pc_type": "gamg", "pc_gamg_threshold": "0.01, 0.02"},
        ),
    ],
)
def test_options(text, expected):
    assert parsed(text) == expected


@pytest.mark.parametrize(
    "text", ["cg", "-ksp_type cg gamg", "-ksp_type 'cg", "-ksp_type --x", "- cg", 3, ["-ksp_type"]]
)
def test_options_that_cannot_be_read(text):
    with pytest.raises(InputError, match="PETSc options"):
        parsed(text)


@pytest.fixture
def absent(monkeypatch):
    """Let petsc4py be absent, wherever it is."""
    monkeypatch.setitem(sys.modules, "petsc4py", None)
    monkeypatch.setattr(module, "DEBIAN", "/nowhere")
    module.petsc.cache_clear()
    yield
    module.petsc.cache_clear()


@pytest.mark.parametrize("ask", [{"backend": "petsc"}, {"petsc": "-ksp_view"}])
def test_the_cure_where_petsc_is_absent(absent, ask, monkeypatch):
    with pytest.raises(InputError, match=r"(?s)petsc4py.*does not load.*apt-get install python3-petsc4py"):
        model().solve(**ask)


def test_backends():
    assert model().solve(backend="own").report.solver != "mumps (PETSc)"
    with pytest.raises(InputError, match=r"backend.*petsc"):
        model().solve(backend="trilinos")
    with pytest.raises(InputError, match="PETSc options are for backend='petsc'"):
        model().solve(backend="own", petsc="-ksp_view")


def test_what_the_own_backend_alone_solves(monkeypatch):
    monkeypatch.setattr("kratos_lite.analysis.prepared.backend_of", lambda backend, petsc: backend or "own")
    with pytest.raises(InputError, match="a requested error is solved by the own backend alone"):
        model().solve(backend="petsc", error=0.1)
    spinning = model()
    spinning.add(kl.ale.Translation("x", rate=1.0, boundaries="natural"))
    with pytest.raises((InputError, ModelError), match="own backend alone"):
        spinning.solve(backend="petsc")
