"""Reader and writer of the five-file sets NAME.node, .elem, .cond, .prop and .init (Kratos data of 2008)."""

from __future__ import annotations

from pathlib import Path

from kratos_lite.io.document import Document
from kratos_lite.io.elem_data import read_nodal_data, read_properties, use_properties
from kratos_lite.io.elem_files import ElemFiles
from kratos_lite.io.elem_mesh import read_mesh


def read_elem(path: str | Path) -> Document:
    """Read a five-file set.

    Kratos skips what it does not understand in these files; here it is an error with its place.

    Parameters
    ----------
    path : any file of the set (also gzipped, ``.gz``), or the name without ending.  ``.node`` and
        ``.elem`` must exist; absent others are noted.

    Returns
    -------
    Document
        Coordinates in m; fixed degrees of freedom carry the value of ``.init``, or 0.  If the set declares no
        property at all, the ids that its elements use become empty properties.

    Raises
    ------
    InputError
        All problems of the set, up to 20, each as ``file:line:column: …``.

    Examples
    --------
    >>> stem = getfixture("tmp_path") / "bar"
    >>> _ = stem.with_suffix(".node").write_text("NODES = NodesList([[1, 0, 0, 0], [2, 1, 0, 0]])")
    >>> _ = stem.with_suffix(".elem").write_text("ELEMENTS[7] = Bar3D2N([1, 2], 0);")
    >>> document = read_elem(stem)
    >>> document.mesh.n_nodes, document.mesh.element_ids
    (2, array([7]))
    """
    files = ElemFiles(path)
    mesh = read_mesh(files)
    properties = read_properties(files)
    use_properties(files, mesh, properties)
    nodal_data = read_nodal_data(files, mesh)
    files.problems.raise_if_any()
    return Document(mesh, properties, nodal_data, notes=files.notes)
