"""Mesh: points, blocks of elements and conditions on them, and named parts; it does not change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import (
    NO_ROWS,
    Block,
    Part,
    blocks_of,
    distinct,
    ids_of,
    mask_of,
    rows_of_ids,
    select,
    with_rows,
)
from kratos_lite.mesh.selection import SKEW, Where, WhereElements, find_elements, find_nodes, find_part
from kratos_lite.mesh.topology import Faces, inverted, mirror
from kratos_lite.tabular import UNITS, Tabular
from kratos_lite.typing import Array, ArrayLike, Ints, Mask
from kratos_lite.validation import choice, finite, instance, read_only, whole_numbers

if TYPE_CHECKING:
    from kratos_lite.mesh.hanging import HangingNodes
    from kratos_lite.mesh.locate import Located, Search

PART = "kl.Part(nodes=[4, 5])"


class Mesh(Tabular):
    """Points (n, 3) in m, element blocks, condition blocks and named parts.

    A mesh does not change, and its arrays are read-only; `replace` makes another one from it.

    Parameters
    ----------
    points : (n, 3) float, m.
    blocks : cells (m, k) by element name, indices of `points` from 0; or a list of `Block`.
    node_ids : (n,) int, ids of the nodes; 1 … n if not given.
    conditions : condition blocks.
    parts : named parts; a child of part ``A`` is named ``A.b``.
    source : name of the file it came from, used in messages.
    hanging : nodes inside edges or faces of larger neighbors, as `refine` finds them.
    whole : False for one part of a larger mesh, where named parts may be empty.
    units : consistent set of units that its numbers are in, ``SI``, ``mm N MPa t``, ``m kN kPa t``,
        ``mm kN GPa kg ms`` or ``in lbf psi slinch``; see `use_units`.

    Raises
    ------
    MeshError
        If points, cells or ids have the wrong shape or are no finite numbers, an id occurs twice, a cell or a
        part has indices that do not exist, or there is no such element.

    Examples
    --------
    >>> points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = Mesh(points, {"KinematicLinear3D4N": [[0, 1, 2, 3]]})
    >>> mesh.n_nodes, mesh.n_elements
    (4, 1)
    """

    points: Array
    node_ids: Ints
    blocks: tuple[Block, ...]
    conditions: tuple[Block, ...]
    _parts: dict[str, Part]
    source: str
    hanging: HangingNodes | None
    whole: bool
    units: str

    def __init__(
        self,
        points: ArrayLike,
        blocks: Mapping[str, ArrayLike] | Sequence[Block] = (),
        *,
        node_ids: ArrayLike | None = None,
        conditions: Mapping[str, ArrayLike] | Sequence[Block] = (),
        parts: Mapping[str, Part] | None = None,
        source: str = "",
        hanging: HangingNodes | None = None,
        whole: bool = True,
        units: str = "SI",
    ) -> None:
        X = finite(points, "points", ("n", 3), error=MeshError)
        n = len(X)
        ids = np.arange(1, n + 1) if node_ids is None else node_ids
        named = instance(parts or {}, "parts", Mapping, f"{{'top': {PART}}}", error=MeshError)
        vars(self).update(
            points=read_only(np.ascontiguousarray(X)),
            node_ids=read_only(whole_numbers(ids, "node_ids", (n,), error=MeshError)),
            blocks=blocks_of(blocks),
            conditions=blocks_of(conditions, "conditions"),
            _parts=dict(named),
            source=source,
            hanging=hanging,
            whole=whole,
            units=choice(units, "units", UNITS, error=MeshError),
        )
        if not self._is_counting:
            ordered = self.node_ids[self._node_order]
            twice = ordered[1:][ordered[1:] == ordered[:-1]]
            if len(twice):
                raise MeshError(f"node id {twice[0]} occurs more than once; give every node its own")
        self._check_rows((*self.blocks, *self.conditions))
        self._check_parts()

    def _arguments(self) -> dict[str, Any]:
        """Return what an equal mesh is made of."""
        names = ("points", "blocks", "node_ids", "conditions", "source", "hanging", "whole", "units")
        return {"parts": self._parts, **{name: getattr(self, name) for name in names}}

    def __reduce__(self) -> tuple[Any, ...]:  # copies and unpickled meshes are made as all others are
        return partial(Mesh, **self._arguments()), ()

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise MeshError(f"a mesh does not change; make another one, as in mesh = mesh.replace({name}=...)")

    def __delattr__(self, name: str) -> NoReturn:
        self.__setattr__(name, None)

    def _check_rows(self, blocks: Sequence[Block]) -> None:
        """Raise MeshError for cells with indices of points that do not exist."""
        for block in blocks:
            if block.nodes.max(initial=-1) >= self.n_nodes:
                cell = int(np.argmax((block.nodes >= self.n_nodes).any(axis=1)))
                raise MeshError(
                    f"{self.place(block, cell)} uses node indices {block.nodes[cell].tolist()}; "
                    f"indices are 0 … {self.n_nodes - 1}"
                )

    def _check_parts(self) -> None:
        """Raise MeshError for indices of parts that do not exist."""
        for name, part in self.parts.items():
            instance(part, f"part {name!r}", Part, PART, error=MeshError)
            for what in ("nodes", "elements", "conditions"):
                size, label = getattr(self, f"n_{what}"), f"part {name!r}: indices of {what}"
                whole_numbers(getattr(part, what), label, size=size, error=MeshError)

    def replace(
        self,
        *,
        points: ArrayLike | None = None,
        blocks: Mapping[str, ArrayLike] | Sequence[Block] | None = None,
        conditions: Mapping[str, ArrayLike] | Sequence[Block] | None = None,
        parts: Mapping[str, Part] | None = None,
        whole: bool | None = None,
    ) -> Mesh:
        """Return a mesh in which some of these are others; ids of nodes and all the rest stay.

        Parameters
        ----------
        points : (n, 3) float, m.
        blocks, conditions, parts, whole : as for a new mesh.

        Returns
        -------
        Mesh

        Examples
        --------
        >>> from kratos_lite import box
        >>> mesh = box()
        >>> mesh.replace(points=mesh.points * [1, 1, 2]).points.max(axis=0)
        array([1., 1., 2.])
        """
        changes = dict(points=points, blocks=blocks, conditions=conditions, parts=parts, whole=whole)
        given = {name: value for name, value in changes.items() if value is not None}
        return Mesh(**{**self._arguments(), **given})

    def use_units(self, units: str) -> None:
        """Say in which units all numbers of the mesh and of its models are; no number changes.

        Tables, headers and pictures show these units, and checks of magnitudes go by them.  Materials, loads
        and supports are to be given in them: with ``mm N MPa t`` lengths in mm, forces in N, stresses in MPa,
        densities in t/mm³ (steel: 7.85e-9), accelerations in mm/s² (gravity: 9810), energies are in mJ.

        Parameters
        ----------
        units : as for a new mesh.

        Raises
        ------
        MeshError
            There is no such set of units, or other ones than those of SI were said before.
        """
        if self.units not in ("SI", choice(units, "units", UNITS, error=MeshError)):
            raise MeshError(f"the mesh is said to be in {self.units}, on which models rely; make another one")
        vars(self)["units"] = units

    # ---- nodes and elements ----------------------------------------------------------------

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def n_elements(self) -> int:
        """Number of elements in all blocks."""
        return sum(len(block) for block in self.blocks)

    @property
    def n_conditions(self) -> int:
        """Number of conditions in all blocks."""
        return sum(len(block) for block in self.conditions)

    @property
    def element_ids(self) -> Ints:
        """(m,) element ids through all blocks in order."""
        return ids_of(self.blocks)

    @cached_property
    def _node_order(self) -> Ints:
        return np.argsort(self.node_ids, kind="stable")

    def node_rows(self, ids: ArrayLike) -> Ints:
        """Return the indices of nodes by their ids.

        Parameters
        ----------
        ids : (...) int.

        Returns
        -------
        (...) int
            -1 where there is no such id.
        """
        ids = whole_numbers(ids, "ids of nodes", error=MeshError)
        if self._is_counting:
            return np.where((ids >= 1) & (ids <= self.n_nodes), ids - 1, -1)
        return rows_of_ids(self.node_ids, ids, self._node_order)

    @cached_property
    def _is_counting(self) -> bool:
        """Whether the ids are 1 … n in order."""
        return bool((self.node_ids == np.arange(1, self.n_nodes + 1)).all())

    def place(self, block: Block, cell: int) -> str:
        """Return a readable place of a cell for messages: ``cube.mdpa:22: element 1 (…3D8N)``.

        Parameters
        ----------
        block : an element block.
        cell : index of the cell in the block.

        Returns
        -------
        str
        """
        line = f":{block.lines[cell]}" if block.lines is not None else ""
        where = f"{self.source}{line}: " if self.source else ""
        return f"{where}element {block.ids[cell]} ({block.name})"

    def used_nodes(self, elements: Mask | None = None) -> Mask:
        """Return which nodes belong to an element.

        Parameters
        ----------
        elements : mask (m,) of those that count; all if not given.

        Returns
        -------
        (n,) bool
        """
        if elements is None:
            return self._used_nodes
        nodes = [block.nodes[elements[at]].ravel() for block, at in with_rows(self.blocks)]
        return mask_of(np.concatenate([NO_ROWS, *nodes]), self.n_nodes)

    @cached_property
    def _used_nodes(self) -> Mask:
        used = np.zeros(self.n_nodes, dtype=bool)
        for block in self.blocks:
            used[block.nodes] = True
        return read_only(used)

    @cached_property
    def places(self) -> tuple[Array, Ints]:
        """How far the nodes are along `selection.SKEW`, in order (n,), and the nodes in this order."""
        along = (self.points - self.extent[0]) @ SKEW
        order = np.argsort(along)
        return along[order], order

    @cached_property
    def extent(self) -> Array:
        """(2, 3) float, m, the lowest and the highest coordinates of the nodes.

        Without nodes they are infinite.
        """
        columns = self.points.T  # one by one, which is faster
        low = np.array([x.min(initial=np.inf) for x in columns])
        high = np.array([x.max(initial=-np.inf) for x in columns])
        return read_only(np.stack([low, high]))

    # ---- parts -----------------------------------------------------------------------------

    @property
    def parts(self) -> Mapping[str, Part]:
        """Named parts; `add_part` adds one."""
        return MappingProxyType(self._parts)

    def part(self, name: str) -> Part:
        """Return a part by its full name, or by its last word when that is unique.

        ``x- x+ y- y+ z- z+`` mean the nodes on the sides of the bounding box where the mesh
        has no part of that name.

        Parameters
        ----------
        name : of the part.

        Returns
        -------
        Part

        Raises
        ------
        MeshError
            If there is no such part, or several.
        """
        return find_part(name, self._parts, self)

    def add_part(self, name: str, where: Where) -> None:
        """Give nodes a name.

        Parameters
        ----------
        name : of the new part.  A part does not change, as supports and loads may rely on it.
        where : part name, point (x, y, z) in m, predicate on the points (n, 3), mask (n,) or indices.

        Raises
        ------
        MeshError
            If no node is chosen, or there is a part of this name with other nodes.

        Examples
        --------
        >>> mesh = Mesh([[0, 0, 0], [1, 0, 0]])
        >>> mesh.add_part("tip", lambda X: X[:, 0] > 0.5)
        >>> mesh.nodes("tip")
        array([1])
        """
        if not isinstance(name, str) or not name:
            raise MeshError(f"a part needs a name; got {name!r}")
        rows = self.nodes(where)
        if self.whole and not len(rows):
            raise MeshError(f"no node is chosen for part {name!r}")
        known = self._parts.setdefault(name, Part(nodes=rows))
        if not np.array_equal(distinct(known.nodes), distinct(rows)):
            raise MeshError(
                f"there is a part {name!r} with other nodes already, on which supports and loads may "
                "rely; take another name, or make the mesh anew"
            )

    def nodes(self, where: Where) -> Ints:
        """Return the indices of nodes, each once and in the order in which they are given.

        Parameters
        ----------
        where : part name, point (x, y, z) in m, predicate on the points (n, 3), mask (n,) or indices.

        Returns
        -------
        (k,) int

        Raises
        ------
        MeshError
            If there is no such part, or a row or a mask does not fit the mesh.

        Examples
        --------
        >>> mesh = Mesh([[0, 0, 0], [1, 0, 0]])
        >>> mesh.nodes(lambda X: X[:, 0] > 0.5)
        array([1])
        """
        return self.part(where).nodes if isinstance(where, str) else find_nodes(where, self)

    def elements(self, where: WhereElements = None) -> Ints:
        """Return the indices of elements.

        A part without elements of its own gives the elements that have all their nodes in it.

        Parameters
        ----------
        where : part name, property id, indices, a mask, or None for all.

        Returns
        -------
        (k,) int

        Raises
        ------
        MeshError
            If there is no such part, property or row.
        """
        if where is None:
            return np.arange(self.n_elements)
        return find_elements(where, self.part(where) if isinstance(where, str) else None, self)

    def locate(self, points: ArrayLike, *, required: bool = False) -> Located:
        """Return which elements contain points, and where in them the points lie.

        A point on a face, edge or node of several elements belongs to the one in the lowest row.

        Parameters
        ----------
        points : (..., 3) float, m.
        required : raise MeshError where a point lies outside; otherwise its ``inside`` is False.

        Returns
        -------
        Located

        Raises
        ------
        InputError
            If the points are not finite or have the wrong shape.
        MeshError
            If a required point lies outside, or a node has no finite coordinates.

        Examples
        --------
        >>> from kratos_lite import box
        >>> located = box(cells=(2, 1, 1)).locate([[0.75, 0.5, 0.5], [3.0, 0.0, 0.0]])
        >>> located.rows.tolist(), located.xi[0].tolist()
        ([1, -1], [0.0, 0.0, 0.0])
        """
        from kratos_lite.mesh.locate import locate  # a quick start without it

        located = locate(self, points, self._search)
        return located.require() if required else located

    @cached_property
    def _search(self) -> Search:
        """The elements with their boxes, made once."""
        from kratos_lite.mesh.locate import Search  # a quick start without it

        return Search(self)

    # ---- for other programs ------------------------------------------------------------------

    def to_pyvista(self) -> Any:
        """Return a pyvista.UnstructuredGrid, with the ids of nodes, elements and properties.

        Raises
        ------
        InputError, KratosLiteError
            VTK has no number for the shape of an element; PyVista is not installed.
        """
        from kratos_lite.mesh.vtk import mesh_fields, pyvista_grid  # rarely needed

        return pyvista_grid(self, *mesh_fields(self))

    # ---- summary ---------------------------------------------------------------------------

    def table(self) -> list[tuple[str, str]]:
        """Return labels and values of a summary: nodes, extent, elements, conditions and parts.

        Examples
        --------
        >>> print(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], {"KinematicLinear3D4N": [[0, 1, 2, 3]]}))
        nodes     4
        extent    [0, 1] × [0, 1] × [0, 1] m
        elements  1 KinematicLinear3D4N
        """
        rows = [("nodes", str(self.n_nodes))]
        if np.isfinite(self.extent).all():
            sides = [f"[{a + 0.0:g}, {b + 0.0:g}]" for a, b in self.extent.T]  # no -0
            rows.append(("extent", " × ".join(sides) + " m"))
        for label, blocks in (("elements", self.blocks), ("conditions", self.conditions)):
            rows += [(label, f"{len(block)} {block.name}") for block in blocks if len(block)]
        return rows + [("part", f"{name}: {part}") for name, part in self.parts.items()]

    def __repr__(self) -> str:
        return f"Mesh({self.n_nodes} nodes, {self.n_elements} elements)"

    # ---- faces -----------------------------------------------------------------------------

    @cached_property
    def all_faces(self) -> Faces:
        """All faces of the elements, and which coincide."""
        return Faces(self.blocks, self.hanging)

    @property
    def boundary(self) -> list[Block]:
        """Faces that belong to one element only, outward, one block per face shape.

        ``ids`` holds the row of the parent element.
        """
        return self.all_faces.boundary

    def reoriented(self) -> Mesh:
        """Return the mesh in which inverted elements have the node order of their mirror image."""
        blocks = []
        for block in self.blocks:
            turn = inverted(block, self.points)
            nodes = block.nodes.copy()
            if turn.any() and block.shape is not None:
                nodes[turn] = nodes[turn][:, mirror(block.shape)]
            blocks.append(replace(block, nodes=nodes))
        return self.replace(blocks=blocks)

    def area(self, where: Where) -> float:
        """Return the area of a part.

        Parameters
        ----------
        where : as for `faces`.

        Returns
        -------
        m², of its faces.

        Examples
        --------
        >>> from kratos_lite import box
        >>> box((2.0, 3.0, 1.0)).area("z+")
        6.0
        """
        from kratos_lite.elements.surface import FUNCTION, area_vectors, face_rule  # above this floor's start

        areas = [
            area_vectors(b.shape, self.points[b.nodes], face_rule(b.shape, FUNCTION))
            for b in self.faces(where)
            if b.shape is not None
        ]
        return float(sum(np.linalg.norm(area, axis=-1).sum() for area in areas))

    def faces(self, where: Where) -> list[Block]:
        """Return the faces of a part: its conditions, or else the boundary faces among its nodes.

        Parameters
        ----------
        where : part name, point (x, y, z) in m, predicate on the points (n, 3), mask (n,) or indices.

        Returns
        -------
        list of Block
            One block for each shape of faces.
        """
        rows = self.face_rows(where)
        return select(self.face_blocks(rows), rows)

    def face_rows(self, where: Where) -> Ints:
        """Return the faces of a part as rows, which count through conditions, then boundary faces.

        Parameters
        ----------
        where : as for `faces`.

        Returns
        -------
        (k,) int
        """
        rows = self.part(where).conditions if isinstance(where, str) else NO_ROWS
        if len(rows):
            return rows
        nodes = self.nodes(where)
        return self.n_conditions + self.all_faces.among(nodes, mask_of(nodes, self.n_nodes))

    def face_blocks(self, rows: Ints) -> Sequence[Block]:
        """Return the blocks through which rows of faces count.

        Parameters
        ----------
        rows : (k,) int, as of `face_rows`.

        Returns
        -------
        sequence of Block
            The conditions, and the boundary faces if some of the rows are theirs.
        """
        of_conditions = rows.max(initial=-1) < self.n_conditions
        return self.conditions if of_conditions else (*self.conditions, *self.boundary)


def place_of(mesh: Mesh, element: int) -> str:
    """Return a readable place of an element for messages, by its index in the mesh."""
    block, at = next(each for each in with_rows(mesh.blocks) if element < each[1].stop)
    return mesh.place(block, element - at.start)
