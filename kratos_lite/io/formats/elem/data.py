"""Properties and nodal data of a five-file set."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from kratos_lite.io.formats.cells import already
from kratos_lite.io.formats.document import Data, Properties
from kratos_lite.io.formats.elem.files import FIX, INIT, MATRIX, VECTOR, ElemFiles
from kratos_lite.io.formats.elem.grammar import Form, Run, Source
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Ints

VECTORS = frozenset((b"DISPLACEMENT", b"VELOCITY", b"ACCELERATION", b"ROTATION", b"REACTION"))
Values: TypeAlias = "dict[int, tuple[float, int]]"
"""Value and line by node id."""


def read_properties(files: ElemFiles) -> dict[int, Properties]:
    """Return the properties by id; values are floats, vectors and matrices."""
    by_id: dict[int, Properties] = {}
    for run in files.runs[".prop"]:
        source = files.sources[".prop"]
        numbers = source.integers(run.columns[0], run.starts, least=0).tolist()
        lines = source.lines(run.starts).tolist()
        for number, line, start, name, text in zip(numbers, lines, run.starts, *run.columns[1:], strict=True):
            properties = by_id.setdefault(number, Properties(number, line=line, source=source.name))
            variable = name.decode("ascii")
            if variable in properties.values:
                source.problem(
                    already(f"{variable} of properties {number}", properties.lines[variable]), start
                )
            properties.values[variable] = _value(source, run.form, text, start)
            properties.lines[variable] = line
    return by_id


def use_properties(files: ElemFiles, mesh: Mesh, properties: dict[int, Properties]) -> None:
    """Check the property ids of the elements; conditions may name any."""
    declared = {0, *properties}
    for block in mesh.blocks:
        used, cells = np.unique(block.properties, return_index=True)
        for number, cell in zip(used.tolist(), cells.tolist(), strict=True):
            if number not in declared and properties:
                have = ", ".join(map(str, sorted(declared - {0})))
                message = f"properties {number} are not declared in {files.stem}.prop; expected one of {have}"
                files.problems.add(f"{mesh.place(block, cell)}: {message}")
    for number in sorted({int(number) for block in mesh.blocks for number in np.unique(block.properties)}):
        properties.setdefault(number, Properties(number))


def read_nodal_data(files: ElemFiles, mesh: Mesh) -> list[Data]:
    """Return one Data per variable for its fixed degrees of freedom, then one for its free ones."""
    fixed, initial = _by_variable(files, ".cond", mesh), _by_variable(files, ".init", mesh)
    cond, init = (files.sources[e].name if e in files.sources else "" for e in (".cond", ".init"))
    data = []
    for variable, nodes in fixed.items():
        values = initial.get(variable, {})
        prescribed = {n: (values.pop(n, at)[0], at[1]) for n, at in nodes.items()}
        data.append(_data(variable, prescribed, True, cond))
    return data + [_data(variable, nodes, False, init) for variable, nodes in initial.items() if nodes]


def _by_variable(files: ElemFiles, ending: str, mesh: Mesh) -> dict[str, Values]:
    """Return the nodes that ``Fix`` or ``.init`` statements name, with their values."""
    by_variable: dict[str, Values] = {}
    for run in files.runs[ending]:
        if run.form not in (FIX, INIT):
            continue
        source = files.sources[ending]
        ids = source.integers(run.columns[0], run.starts)
        for i in np.flatnonzero(mesh.node_rows(ids) < 0) if files.nodes_known else ():
            source.problem(files.no_node(ids[i]), run.starts[i])
        values = _initial(source, run) if run.form is INIT else np.zeros(len(ids))
        _add(by_variable, source, run, ids, values)
        for name in sorted(set(run.columns[1]) & VECTORS):
            start = run.starts[run.columns[1].index(name)]
            text = name.decode("ascii")
            source.problem(f"{text} is a vector; expected one of {text}_X, {text}_Y, {text}_Z", start)
    return by_variable


def _add(by_variable: dict[str, Values], source: Source, run: Run, ids: Ints, values: Array) -> None:
    """Add statements; note which repeat an earlier one, and which contradict it."""
    names, lines, repeated = [name.decode("ascii") for name in run.columns[1]], source.lines(run.starts), []
    for node, name, value, line, start in zip(
        ids.tolist(), names, values.tolist(), lines.tolist(), run.starts, strict=True
    ):
        nodes = by_variable.setdefault(name, {})
        earlier, at = nodes.setdefault(node, (value, line))
        if earlier != value:
            source.problem(already(f"{name} of node {node}", at, " with another value"), start)
        elif at != line:
            repeated.append(start)
    if repeated:
        source.note(f"{len(repeated)} statements repeat earlier ones, from here on", repeated[0])


def _initial(source: Source, run: Run) -> Array:
    """Return the values of ``.init`` statements; their step must be 0."""
    steps = source.integers(run.columns[2], run.starts, least=0)
    for i in np.flatnonzero(steps):
        source.problem(
            f"step {steps[i]} of the solution is not known at the start; expected 0", run.starts[i]
        )
    return source.reals(run.columns[3], run.starts)


def _value(source: Source, form: Form, text: bytes, start: int) -> Any:
    """Return the value of a property: a float, or a vector or matrix as an array."""
    if form is not MATRIX:
        values = source.reals([text], [start] * (text.count(b",") + 1))
        return values if form is VECTOR else float(values[0])
    rows = [row.strip(b", \t\n") for row in text.replace(b"[", b"").split(b"]")[:-1]]
    matrix = [source.reals([row], [start] * (row.count(b",") + 1)) for row in rows]
    if len({len(row) for row in matrix}) > 1:
        counts = [len(row) for row in matrix]
        source.problem(f"the rows of the matrix have {counts} numbers; expected equal rows", start)
        return None
    return np.array(matrix)


def _data(variable: str, nodes: Values, fixed: bool, source: str) -> Data:
    values = np.array([value for value, _ in nodes.values()])
    ids = np.array(list(nodes), dtype=np.int64)
    line = min(line for _, line in nodes.values())
    return Data(variable, ids, np.full(len(ids), fixed), values, line, source)
