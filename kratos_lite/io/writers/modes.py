"""Modes to files."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import InputError
from kratos_lite.io.writers.endings import check_ending
from kratos_lite.mesh import Mesh
from kratos_lite.validation import instance, path_of


def write_modes(path: str | Path, mesh: Mesh, values: ArrayLike, shapes: ArrayLike) -> None:
    """Write modes as a page for the browser, which lets them swing.

    Parameters
    ----------
    path : the file, .html.
    mesh : of n nodes.
    values : (k,) frequencies ω in rad/s as of ``model.modes``, or complex λ in 1/s as of
        ``model.complex_modes``.
    shapes : (k, n, 3) of any size, real or complex; each is shown with the largest displacement 1.

    Raises
    ------
    InputError
        Another ending, arrays of other shapes or not finite, or the file cannot be written.
    KratosLiteError
        three.js is missing, which a page needs.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> beam = kl.Model(kl.box((5, 1, 1), (5, 1, 1)), kl.Isotropic3D(E=2e11, nu=0.3, density=7800.0))
    >>> beam.fix("x-")
    >>> write_modes(getfixture("tmp_path") / "beam.html", beam.mesh, *beam.modes(3))
    """
    path = path_of(path)
    check_ending(path, ".html")
    instance(mesh, "the mesh of modes", Mesh, "model.mesh")
    found, forms = np.asarray(values), np.asarray(shapes)
    if found.ndim != 1 or forms.shape != (len(found), mesh.n_nodes, 3) or not len(found):
        wanted = f"(k,) and (k, {mesh.n_nodes}, 3)"
        raise InputError(
            f"{path}: values and shapes of modes are {wanted}; got {found.shape} and {forms.shape}"
        )
    if not (np.isfinite(found).all() and np.isfinite(forms).all()):
        raise InputError(f"{path}: not written: modes are not finite everywhere")
    from kratos_lite.io.writers.page.write import write_modes_page  # rarely needed

    write_modes_page(path, mesh, [f"{i}: {_name(value)}" for i, value in enumerate(found.tolist(), 1)], forms)


def _name(value: complex) -> str:
    """Return the frequency of a mode, and its growth if it is complex."""
    if isinstance(value, complex):
        return f"{abs(value.imag) / (2 * pi):.5g} Hz, growth {value.real:.3g} 1/s"
    return f"{value / (2 * pi):.5g} Hz"
