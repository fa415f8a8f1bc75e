"""Mesh: points, blocks of cells of one type, and named parts.  It knows no physics."""

from kratos_lite.mesh.blocks import NO_ROWS as NO_ROWS
from kratos_lite.mesh.blocks import Block as Block
from kratos_lite.mesh.blocks import Part as Part
from kratos_lite.mesh.blocks import distinct as distinct
from kratos_lite.mesh.blocks import ids_of as ids_of
from kratos_lite.mesh.blocks import mask_of as mask_of
from kratos_lite.mesh.blocks import rows_of_ids as rows_of_ids
from kratos_lite.mesh.blocks import select as select
from kratos_lite.mesh.blocks import with_rows as with_rows
from kratos_lite.mesh.blocks import without_repeats as without_repeats
from kratos_lite.mesh.mesh import Mesh as Mesh
from kratos_lite.mesh.selection import SIDES as SIDES
from kratos_lite.mesh.selection import Where as Where
from kratos_lite.mesh.selection import WhereElements as WhereElements
from kratos_lite.mesh.topology import Faces as Faces
from kratos_lite.mesh.topology import components as components
from kratos_lite.mesh.topology import equal_sets as equal_sets
