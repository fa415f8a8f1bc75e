"""Mesh: points, blocks of cells of one type, and named parts.  It knows no physics."""

from kratos_lite.mesh.blocks import (
    NO_ROWS,
    Block,
    Part,
    distinct,
    ids_of,
    mask_of,
    rows_of_ids,
    select,
    with_rows,
    without_repeats,
)
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.selection import SIDES, Where, WhereElements
from kratos_lite.mesh.topology import Faces, components, equal_sets

__all__ = [
    "NO_ROWS",
    "SIDES",
    "Block",
    "Faces",
    "Mesh",
    "Part",
    "Where",
    "WhereElements",
    "components",
    "distinct",
    "equal_sets",
    "ids_of",
    "mask_of",
    "rows_of_ids",
    "select",
    "with_rows",
    "without_repeats",
]
