"""Compiled kernels: the same numbers as NumPy, whatever the threads; a working package without them."""

import os
import shutil
import subprocess
import sys
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from computing import compiled, printed, same_on_all_threads
from rounding import all_close
from scipy.sparse import csr_array, kron
from systems import stiffness_of

import kratos_lite as kl
from kratos_lite import native
from kratos_lite.assembly.block_matrix import BlockMatrix, rows_of_numbers
from kratos_lite.errors import InputError
from kratos_lite.native import described, kernels, threads
from tests.ale.test_kernel import VELOCITY, inertia_matrices
from tests.ale.test_kernel import parts as moving
from tests.assembly.test_stiffness import CRYSTAL, NAMES, STEEL, scene


def matrix(n=2500, seed=1):
    """Return a random matrix of blocks with an empty row."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 9, n)
    counts[7] = 0
    columns = [np.sort(rng.choice(n, c, replace=False)) for c in counts]
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    indices = np.concatenate(columns).astype(np.int32)
    return BlockMatrix(rng.standard_normal((len(indices), 3, 3)), indices, indptr)


@compiled
def test_product_is_that_of_scipy_on_any_number_of_threads():
    A = matrix()
    x = np.random.default_rng(2).standard_normal(A.shape[0])
    np.testing.assert_allclose(A @ x, A.scipy() @ x, rtol=0, atol=1e-13)
    same_on_all_threads(lambda: A @ x)


def test_rows_of_numbers_are_those_of_scipy():
    A = matrix()
    diagonals = csr_array((A.data[:, 1, 2].copy(), A.indices, A.indptr), shape=(len(A.indptr) - 1,) * 2)
    expected = A.scipy().tocsr(), kron(diagonals, np.eye(3), format="csr")
    for given, want in zip((A, diagonals), expected, strict=True):
        found = rows_of_numbers(given)
        assert found.has_canonical_format
        assert abs(found - want).nnz == 0


@compiled
def test_wrong_shapes_are_refused():
    A = matrix()
    with pytest.raises(ValueError, match="data must be"):
        rows_of_numbers(BlockMatrix(A.data[:5], A.indices, A.indptr))
    with pytest.raises(ValueError, match="three numbers for each row"):
        A @ np.zeros(5)


@compiled
@pytest.mark.parametrize("wrong", [-1, 2500])
def test_columns_out_of_range_are_refused(wrong):
    A = matrix()
    A.indices[5] = wrong
    with pytest.raises(ValueError, match="no column of the matrix"):
        A @ np.zeros(A.shape[0])
    nodes, n = np.array([[A.rows()[5]]], np.int32), len(A.indptr) - 1
    with pytest.raises(ValueError, match="column that is not there"):
        kernels("stiffness").add_matrices(nodes, np.ones((1, 1, 1, 3, 3)), A.indptr, A.indices, A.data)
    with pytest.raises(ValueError, match="columns of the matrix"):
        kernels("multigrid").Matrix(A.indptr, A.indices, A.data)
    with pytest.raises(ValueError, match="rows of the matrix"):
        kernels("stiffness").add_matrices(nodes + n, np.ones((1, 1, 1, 3, 3)), A.indptr, A.indices, A.data)


@compiled
@pytest.mark.parametrize("at", [1, -1])
def test_rows_beyond_the_blocks_are_refused(at):
    A = matrix()
    A.indptr[at] += 1000
    with pytest.raises(ValueError, match="indptr must"):
        A @ np.zeros(A.shape[0])
    with pytest.raises(ValueError, match="indptr must"):
        A.norm()


def test_norm_and_diagonal_blocks():
    A = matrix()
    assert A.norm() == pytest.approx(abs(A.scipy()).sum(axis=1).max(), rel=1e-14)
    rows, at = A.rows(), A.diagonal_blocks()
    np.testing.assert_array_equal(rows[at], A.indices[at])


@cache
def computed():
    """Return what kernels compute, by name: a product, stiffness, inertia of moving material, a solution."""
    A = matrix()
    numbers = {"product": A @ np.ones(A.shape[0])}
    for kind in (4, 8, 13, 27):
        made = inertia_matrices(*moving(kind), "MGH", VELOCITY)
        numbers |= {f"{name} of {kind}N": data for name, data in made.items()}
    for case in product(NAMES, (STEEL, CRYSTAL), (0.0, 0.02)):
        name, material, distortion = case
        numbers[f"K of {case}"] = stiffness_of(*scene(name, (3, 1, 1), distortion, material)).data
    mesh = kl.box(cells=(3, 3, 3), element="KinematicLinear3D10N")
    mesh = mesh.replace(points=mesh.points + 0.02 * np.sin(9 * mesh.points[:, [1, 2, 0]]))
    model = kl.Model(mesh, kl.Isotropic3D(1e9, 0.3, 2000.0))
    model.fix("z-")
    model.add(kl.Gravity((1.0, 2.0, -9.81)))
    result = model.solve()
    return numbers | {"u": result.u, "totals": np.array(result.totals()), "stress": result.stress("node")}


@compiled
@pytest.mark.parametrize(
    ("variable", "value", "name"),
    [
        ("ISA", "base", "baseline"),
        ("ISA", "avx2", "AVX"),
        ("ISA", "avx512", "AVX"),
        ("KERNELS", "numpy", "NumPy"),
    ],
)
def test_other_instruction_sets_and_numpy_compute_the_same(variable, value, name, tmp_path):
    code = (
        "from tests.native.test_native import *\n"
        f"np.savez({str(tmp_path / 'made.npz')!r}, **computed())\nprint(described())"
    )
    used = printed(code, **{f"KRATOS_LITE_{variable}": value})
    if variable == "ISA" and "NumPy" in used:
        pytest.skip("kernels were built for the instruction set of this machine alone")
    assert name in used
    with np.load(tmp_path / "made.npz") as made:
        all_close(dict(made), computed(), 1e-11)


def test_a_missing_kernel_is_said_once():
    code = (
        "import sys; sys.stderr = sys.stdout\nfrom kratos_lite.native import kernels\n"
        "print(kernels('nothing'), kernels('nothing'))"
    )
    said = printed(code, KRATOS_LITE_KERNELS="")
    assert said.endswith("\nNone None\n")
    assert said.count("compiled kernels are not available") == 1


@pytest.mark.parametrize("installed", [False, True])
def test_a_source_tree_without_kernels_names_the_cure(tmp_path, installed):
    tree, site = tmp_path / "tree", tmp_path / "site"
    package = Path(native.__file__).parents[1]
    ignored = shutil.ignore_patterns("*.so", "*.pyd", "__pycache__")
    shutil.copytree(package, tree / "kratos_lite", ignore=ignored)
    (tree / "setup.py").touch()
    (site / "kratos_lite" / "native").mkdir(parents=True)
    if installed:
        (site / "kratos_lite" / "native" / "_gauss.so").touch()
    run = subprocess.run(
        [sys.executable, "-c", "from kratos_lite.native import kernels; kernels('gauss')"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(site), "KRATOS_LITE_KERNELS": ""},
    )
    assert f"This is the source tree of kratos_lite in {tree}: " in run.stderr
    assert (f"what is installed in {site}, or" in run.stderr) == installed
    assert run.stderr.strip().endswith("build them here by pip install -e .")


@compiled
def test_described_names_what_computes():
    assert described().startswith("compiled (")


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        *(("KRATOS_LITE_THREADS", value) for value in ("²", "0", "-1", "2.0", "many")),
        ("KRATOS_LITE_KERNELS", "numpi"),
        ("KRATOS_LITE_ISA", "avx"),
    ],
)
def test_nonsense_in_the_environment_is_refused(monkeypatch, variable, value):
    monkeypatch.setenv("KRATOS_LITE_KERNELS", "")
    monkeypatch.setenv(variable, value)
    with pytest.raises(InputError, match=f"{variable}='{value}'; expected"):
        threads() if variable == "KRATOS_LITE_THREADS" else kernels.__wrapped__("sparse")


@pytest.mark.parametrize("value", ["1000000", "9" * 5000])
def test_threads_are_at_most_four_a_core(monkeypatch, value):
    monkeypatch.delenv("KRATOS_LITE_THREADS", raising=False)
    cores = threads()
    monkeypatch.setenv("KRATOS_LITE_THREADS", value)
    assert threads() == 4 * cores
    monkeypatch.setenv("KRATOS_LITE_THREADS", "01")
    assert threads() == 1
