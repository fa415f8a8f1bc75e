"""Multi-point constraints of an `.mdpa` file."""

from __future__ import annotations

import re

from kratos_lite.io.formats.document import Constraint
from kratos_lite.io.formats.mdpa.scan import WORD, Frame, Source
from kratos_lite.io.text import integer, real
from kratos_lite.typing import Ints

CONSTRAINT = re.compile(rb"\s*([^\s\[\]]+)\s+([^\s\[\]]+)\s*\[([^\[\]]*)\]")


def read_constraints(source: Source, frame: Frame, nodes: Ints) -> list[Constraint]:
    """Return the rows ``id constant [w1, w2] dependent independent …`` of a block.

    The variables in the header are those of the dependent and of each independent node, or one for all.
    The nodes must be among `nodes`.
    """
    if len(frame.arguments) < 2:
        source.problem("expected 'Begin Constraints NAME VARIABLE [VARIABLE …]'", frame.offset)
        return []
    node_ids = set(nodes.tolist())

    def read(at: int, end: int) -> tuple[Constraint, int]:
        constraint, after = _constraint(source, frame, (at, end))
        named = [node for node, _ in (constraint.dependent, *constraint.independents)]
        missing = [node for node in named if node not in node_ids]
        if missing:
            raise ValueError(f"there is no node {missing[0]}")
        return constraint, after

    constraints = list(source.each(frame.spans[0], "constraint", read))
    if len({len(c.independents) for c in constraints}) > 1:
        text = (
            "Kratos misreads a block of Constraints with different numbers of independent nodes; "
            "kratos_lite reads it as written; give each number a block of its own"
        )
        source.note(text, frame.offset)
    return constraints


def _constraint(source: Source, frame: Frame, span: tuple[int, int]) -> tuple[Constraint, int]:
    match = CONSTRAINT.match(source.data, *span)
    if match is None:
        raise ValueError("expected 'id constant [w1, w2, …] dependent independent …'")
    number, constant = integer(match.group(1)), real(match.group(2))
    weights = tuple(real(part.strip()) for part in match.group(3).split(b","))
    at = match.end()
    ids: list[int] = []
    for _ in range(len(weights) + 1):
        word = WORD.search(source.data, at, span[1])
        if word is None:
            raise ValueError(f"has {len(weights)} weights, but {len(ids)} nodes; expected {len(weights) + 1}")
        ids.append(integer(word.group()))
        at = word.end()
    name, dependent, *independents = frame.arguments
    if len(independents) != len(weights):
        if len(independents) > 1:
            raise ValueError(
                f"has {len(weights)} independent nodes, but the header names {len(independents)} variables"
            )
        independents = (independents or [dependent]) * len(weights)
    pairs = tuple(zip(ids[1:], independents, strict=True))
    line = source.line(span[0])
    return Constraint(number, (ids[0], dependent), pairs, weights, constant, line, name), at
