"""Random inputs by grammar: mostly right, with numbers, sizes and references that may not be."""

from __future__ import annotations

import json
from random import Random
from typing import Any

from kratos_lite.io.names import SOLIDS
from tests.fuzz.seeds import KRATOS, MATERIALS, SOLVED, Seed

KINDS = (4, 5, 6, 8, 10, 20)
VARIABLES = ("DISPLACEMENT_X", "DISPLACEMENT_Y", "DISPLACEMENT_Z", "TEMPERATURE", "VELOCITY_X", "FOO")
FAMILIES = ("KinematicLinear", "SmallDisplacementElement", "TotalLagrangian", "Element", "Foo")


def number(rng: Random) -> str:
    """Return a number, mostly a plain one."""
    odd = ("0", "-1", "1e308", "1e-300", "nan", "1e154", "-0.0", "1e9", "1e-9", "inf", "1.0D3")
    return rng.choice(odd) if rng.random() < 0.1 else repr(round(rng.uniform(-2, 2), 2))


def _mesh(rng: Random) -> tuple[list[str], list[str], int]:
    """Return rows of nodes and cells (``nodes``, comma separated) of one kind, and the nodes of each."""
    from kratos_lite.shapes import SHAPES

    kind = rng.choice(KINDS)
    shape = SHAPES[SOLIDS[kind]]
    size, shift = rng.choice((1, 1, 1, 1e-9, 1e9, 1e160, 0)), rng.choice((0, 0, 0, 1e9))
    points = [[size * x + shift for x in point] for point in shape.nodes.tolist()]
    step = rng.choice((1, 1, 1, 2, 10**9, 2**40))
    ids = [1 + step * i for i in range(len(points))]
    if rng.random() < 0.2:
        rng.shuffle(points)
    rows = [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in zip(ids, points, strict=True)]
    cells = [" ".join(map(str, ids))]
    if rng.random() < 0.2:
        cells.append(" ".join(str(rng.choice(ids)) for _ in ids))
    return rows, cells, kind


def mdpa(rng: Random) -> bytes:
    """Return an .mdpa file."""
    rows, cells, kind = _mesh(rng)
    ids = [row.split()[0] for row in rows]
    law = {"YOUNG_MODULUS": "1e9", "POISSON_RATIO": "0.3", "DENSITY": "1000"}
    for name in law:
        if rng.random() < 0.15:
            law[name] = number(rng)
    if rng.random() < 0.3:
        law["VOLUME_ACCELERATION"] = f"[3] ({number(rng)}, {number(rng)}, {number(rng)})"
    if rng.random() < 0.3:
        law["PRESTRESS"] = "[6] (" + ", ".join(number(rng) for _ in range(6)) + ")"
    blocks = [
        ("Properties 1", [f"{key} {value}" for key, value in law.items()]),
        ("Nodes", rows),
        (f"Elements {rng.choice(FAMILIES[:3] if rng.random() < 0.9 else FAMILIES)}3D{kind}N", [
            f"{i} 1 {cell}" for i, cell in enumerate(cells, 1)
        ]),
    ]  # fmt: skip
    for name in VARIABLES[:3] if rng.random() < 0.8 else VARIABLES:
        held = [i for i in ids if rng.random() < 0.6]
        fixed = rng.choice((1, 1, 1, 0))
        blocks.append((f"NodalData {name}", [f"{i} {fixed} {number(rng)}" for i in held]))
    if rng.random() < 0.3:
        weights, independents = [number(rng) for _ in range(2)], [rng.choice(ids) for _ in range(3)]
        row = f"1 {number(rng)} [{', '.join(weights)}] {' '.join(independents)}"
        blocks.append(("Constraints LinearMasterSlaveConstraint DISPLACEMENT_X", [row]))
    if rng.random() < 0.4:
        conditions = [f"1 1 {' '.join(rng.choice(ids) for _ in range(3))}", f"2 1 {' '.join(ids[:3])}"]
        blocks.append(("Conditions SurfaceLoadCondition3D3N", conditions[rng.randrange(2) :]))
        blocks.append((f"ConditionalData {rng.choice(('SURFACE_LOAD', 'POSITIVE_FACE_PRESSURE'))}", [
            f"2 {number(rng)}" if rng.random() < 0.5 else f"2 [3] ({number(rng)}, {number(rng)}, 0)"
        ]))  # fmt: skip
    if rng.random() < 0.2:
        rng.shuffle(blocks)
    text = "".join(f"Begin {head}\n{''.join(f' {row}' + chr(10) for row in body)}End {head.split()[0]}\n"
                   for head, body in blocks)  # fmt: skip
    return text.encode()


def elem(rng: Random) -> dict[str, bytes]:
    """Return a five-file set."""
    rows, cells, kind = _mesh(rng)
    ids = [row.split()[0] for row in rows]
    nodes = ",\n".join(f"[{', '.join(row.split())}]" for row in rows)
    family = rng.choice(FAMILIES)
    held = [(i, axis) for i in ids for axis in "XYZ" if rng.random() < 0.6]
    lines = {
        "node": f"NODES = NodesList([\n{nodes}\n])\n",
        "elem": "".join(
            f"ELEMENTS[{n}] = {family}3D{kind}N([{','.join(cell.split())}],{rng.choice((1, 1, 1, 0, 2))});\n"
            for n, cell in enumerate(cells, 1)
        ),
        "cond": "".join(f"NODES[{i}].Fix(DISPLACEMENT_{axis});\n" for i, axis in held),
        "prop": "".join(
            f"PROPERTIES[1][{name}] = {number(rng) if rng.random() < 0.1 else value};\n"
            for name, value in (("DENSITY", 1), ("YOUNG_MODULUS", 1e6), ("POISSON_RATIO", 0.2))
        )
        + f"PROPERTIES[1][GRAVITY] = [{number(rng)}, 0, {number(rng)}];\n",
        "init": "".join(
            f"NODES[{i}](DISPLACEMENT_{rng.choice('XYZ')}, 0) = {number(rng)};\n" for i in ids[:3]
        ),
    }
    return {f"set.{name}": text.encode() for name, text in lines.items()}


def _value(rng: Random) -> Any:
    return float(number(rng).replace("D", "e").replace("nan", "1e300").replace("inf", "-1e300"))


def kratos(rng: Random) -> dict[str, Any]:
    """Return a run file of Kratos."""
    found = json.loads(json.dumps(KRATOS))
    terms = ("x", "t", "y", "1.5", "sin(t)", "exp(x)", "(t-1)", "sqrt(y)", "2**t", "1e300", "log(z)", "z%2")
    for section in found["processes"].values():
        for entry in section:
            text = rng.choice("+-*/^").join(rng.choice(terms) for _ in range(rng.randrange(1, 5)))
            for key in ("modulus", "value"):
                if key in entry["Parameters"]:
                    is_vector = isinstance(entry["Parameters"][key], list)
                    entry["Parameters"][key] = [text, None, _value(rng)] if is_vector else text
            entry["Parameters"]["interval"] = [rng.choice((0, 0.5, -1)), rng.choice(("End", 1, 0.2))]
    found["solver_settings"]["time_stepping"]["time_step"] = rng.choice((0.1, 1.0, 3.0, 1e-12))
    if rng.random() < 0.4:
        more = {"solver_type": "Dynamic", "scheme_type": rng.choice(("newmark", "bossak", "bdf2"))}
        found["solver_settings"] |= more | {"rayleigh_beta": _value(rng)}
    if rng.random() < 0.3:
        axis = rng.choice(("x", "z", [0, 0, 0], [1, 1, 1]))
        rotation = {"rotation": {"axis": axis, "rate": _value(rng)}}
        translation = {"translation": {"direction": "x", "rate": _value(rng), "boundaries": "natural"}}
        found["ale"] = rng.choice((rotation, translation))
    return found


def generated(rng: Random, mesh: bytes) -> Seed:
    """Return a random input of a random kind; `mesh` is a good .mdpa file."""
    kind = rng.choice(("mdpa", "mdpa", "elem", "kratos", "kratos", "msh"))
    if kind == "mdpa":
        return Seed(kind, {"mesh.mdpa": mdpa(rng)}, "mesh.mdpa")
    if kind == "elem":
        return Seed(kind, elem(rng), "set.elem")
    if kind == "msh":
        rows, cells, _ = _mesh(rng)
        width = len(cells[0].split())
        number_of = {4: 4, 5: 7, 6: 6, 8: 5, 10: 11, 20: 17}[width]
        lines = [f"{n} {number_of} 2 {rng.randrange(3)} 1 {cell}" for n, cell in enumerate(cells, 1)]
        text = ["$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes", str(len(rows)), *rows, "$EndNodes\n$Elements"]
        text += [str(len(lines)), *lines, "$EndElements\n"]
        return Seed(kind, {"a.msh": "\n".join(text).encode()}, "a.msh", SOLVED)
    content = kratos(rng)
    files = {"run.json": json.dumps(content, indent=1).encode(), "mesh.mdpa": mesh}
    files["materials.json"] = json.dumps(MATERIALS).encode()
    in_time = content["solver_settings"]["solver_type"] == "Dynamic"
    return Seed(kind, files, "run.json", in_time=in_time)
