"""Modes to files."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite import __version__
from kratos_lite.analysis.fields import FIELDS
from kratos_lite.atomic import write_whole
from kratos_lite.errors import InputError
from kratos_lite.io.formats import check_modes
from kratos_lite.io.formats.vtu import write_pvd, write_vtu
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Complexes
from kratos_lite.validation import finite, flag, instance, path_of


def write_modes(
    path: str | Path,
    mesh: Mesh,
    values: ArrayLike,
    shapes: ArrayLike,
    *,
    mode: str = "binary",
    buckling: bool = False,
) -> None:
    """Write modes as a page for the browser, which lets them swing, as a series for ParaView or as .frd.

    Parameters
    ----------
    path : the file, .html; or .pvd, an index, and beside it ``NAME_00001.vtu`` … of each mode with
        DISPLACEMENT, of a complex mode also DISPLACEMENT_IMAGINARY; or .frd of CalculiX.
    mesh : of n nodes.
    values : (k,) frequencies ω in rad/s as of ``model.modes``, or complex λ in 1/s as of
        ``model.complex_modes``.
    shapes : (k, n, 3) of any size, real or complex; each is shown with the largest displacement 1, but
        for .frd, which has them as they are.
    mode : of ``.vtu`` files: ``binary``, ``compressed`` or ``ascii``.
    buckling : whether the values are factors as of ``model.buckling``.

    Raises
    ------
    InputError
        Another ending or mode, arrays of other shapes or not finite, or the file cannot be written.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> beam = kl.Model(kl.box((5, 1, 1), (5, 1, 1)), kl.Isotropic3D(E=2e11, nu=0.3, density=7800.0))
    >>> beam.fix("x-")
    >>> write_modes(getfixture("tmp_path") / "beam.pvd", beam.mesh, *beam.modes(3))
    """
    path = path_of(path)
    check_modes(path)
    flag(buckling, "buckling")
    instance(mesh, "the mesh of modes", Mesh, "model.mesh")
    forms = _numbers(shapes, "shapes of modes", ("k", mesh.n_nodes, 3))
    numbers = _numbers(values, "values of modes, one for each shape,", (len(forms),))
    if not len(forms):
        raise InputError(f"{path}: not written: there are no modes")
    if path.suffix.lower() == ".pvd":
        _write_frames(path, mesh, forms, mode)
        return
    if path.suffix.lower() == ".frd":
        from kratos_lite.io.writers.frd import steps_of_modes, write_frd  # rarely needed

        write_frd(path, mesh, steps_of_modes(numbers, forms, buckling))
        return
    from kratos_lite.io.writers.page.write import write_modes_page  # rarely needed

    write_modes_page(path, mesh, names_of_modes(numbers.tolist(), buckling), forms)


def _numbers(value: ArrayLike, what: str, shape: tuple[int | str, ...]) -> Array | Complexes:
    """Return finite numbers, real or complex."""
    with suppress(ValueError):  # lists of unequal lengths
        array = np.asarray(value)
        if array.dtype.kind == "c":
            return finite(array.real, what, shape) + 1j * finite(array.imag, what, shape)
    return finite(value, what, shape)


def _write_frames(path: Path, mesh: Mesh, shapes: Array | Complexes, mode: str) -> None:
    """Write a file for each mode, and their index by the numbers of the modes."""
    frames = []
    for i, shape in enumerate(shapes, 1):
        scaled = shape / (np.linalg.norm(shape, axis=1).max() or 1.0)
        variable = FIELDS["displacement"].kratos
        points = {variable: scaled.real, "NODE_ID": mesh.node_ids}
        if np.iscomplexobj(shape):
            points[f"{variable}_IMAGINARY"] = scaled.imag
        name = f"{path.stem}_{i:05d}.vtu"
        write_vtu(path.with_name(name), mesh, points, {}, mode=mode)
        frames.append((float(i), name))
    write_pvd(path, frames)


def names_of_modes(values: Sequence[complex], buckling: bool = False) -> list[str]:
    """Return the numbers of modes with their frequencies, or factors.

    >>> names_of_modes([2 * pi, 4 * pi])
    ['1: 1 Hz', '2: 2 Hz']
    """
    names = [f"factor {value:.5g}" if buckling else _name(value) for value in values]
    return [f"{i}: {name}" for i, name in enumerate(names, 1)]


def _name(value: complex) -> str:
    """Return the frequency of a mode, and its growth if it is complex."""
    if isinstance(value, complex):
        return f"{abs(value.imag) / (2 * pi):.5g} Hz, growth {value.real:.3g} 1/s"
    return f"{value / (2 * pi):.5g} Hz"


def write_modes_json(path: str | Path, values: Array | Complexes, buckling: bool = False) -> None:
    """Write factors; or frequencies in Hz with ω² as Kratos names it, or with the growth in 1/s."""
    import json

    if buckling:
        numbers = {"factors": values.tolist()}
    elif np.iscomplexobj(values):
        numbers = {"frequencies": (values.imag / (2 * pi)).tolist(), "growth": values.real.tolist()}
    else:
        numbers = {"frequencies": (values / (2 * pi)).tolist(), "EIGENVALUE_VECTOR": (values**2).tolist()}
    write_whole(path, json.dumps({"kratos_lite": __version__, **numbers}).encode())
