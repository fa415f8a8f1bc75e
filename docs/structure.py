"""Draw the packages and their imports, from the source: ``python docs/structure.py``.

The picture, ``docs/images/structure.svg``, has one row for each layer. An arrow leads from a package to one
that it imports, unless a path through other packages leads there, too.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PACKAGE = DOCS.parent / "kratos_lite"
PICTURE = DOCS / "images" / "structure.svg"
GROUND = "errors typing validation tabular registry voigt time_series atomic"
FLOORS = [
    {name: (1.5, "") for name in GROUND.split()},
    {"native": (0, "compiled kernels"), "shapes": (1, "N, dN, faces"), "quadrature": (2, "Gauss points")},
    {"elements": (1, "B-operator"), "materials": (3, "stress from strain")},
    {"mesh": (0, "nodes, cells, parts")},
    {"view": (0, "pictures"), "assembly": (1, "K, M, fields at Gauss points")},
    {"solvers": (1, "K u = f, constraints, modes")},
    {"distributed": (0, "one model over many processes")},
    {"model": (1, "loads, supports, checks")},
    {"ale": (1, "material moves through mesh"), "bodies": (2, "rigid, pseudo-rigid, FE")},
    {"analysis": (1, "static, modal, integrators")},
    {
        "io": (1, "file formats, cases, writers"),
        "verification": (2, "problems with known answers"),
        "testing": (3, "conformance kit"),
    },
    {"cli": (1, "commands and options")},
    {"__main__": (1, "python -m kratos_lite")},
]
"""The packages of each layer, lowest first, with column in the picture and contents."""

COLUMN, ROW, BOX, HEIGHT, TIP = 220, 72, 196, 44, 7
TEXT = 'text-anchor="middle" font-family="Helvetica, Arial, sans-serif"'


def modules() -> Iterator[tuple[str, Path]]:
    """Yield the dotted name, without ``kratos_lite``, and the file of each module."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name:
            yield name, path


@cache
def statements(path: Path) -> list[ast.stmt]:
    """Return the imports of a file: at the top, in functions, and for type checking."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]


def imports(path: Path, names: set[str]) -> Iterator[str]:
    """Yield the modules of the package that a file imports."""
    for node in statements(path):
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("kratos_lite."):
            home = str(node.module).removeprefix("kratos_lite").removeprefix(".")
            for alias in node.names:
                one = f"{home}.{alias.name}".removeprefix(".")
                if one in names or home:
                    yield one if one in names else home


def room(module: str) -> str:
    """Return the package of a module; the modules at the root are grouped as base modules."""
    top = module.partition(".")[0]
    return "base modules" if top in FLOORS[0] else top


def arrows() -> list[tuple[str, str]]:
    """Return the pairs (package, imported package) that other imports do not imply."""
    names = {name for name, _ in modules()}
    below: dict[str, set[str]] = {room(name): set() for name in names}
    for name, path in modules():
        below[room(name)] |= {room(target) for target in imports(path, names)} - {room(name)}
    floor = {name: level for level, names in enumerate(FLOORS) for name in map(room, names)}
    reached: dict[str, set[str]] = {}
    for name in sorted(below, key=lambda name: floor[name]):
        reached[name] = below[name].union(*(reached.get(other, set()) for other in below[name]))
    return sorted(
        (name, other)
        for name, others in below.items()
        for other in others
        if not any(other in reached[third] for third in others - {other})
    )


def places() -> dict[str, tuple[float, float]]:
    """Return the center of the box of each package."""
    return {
        room(name): (COLUMN * (column + 0.5), ROW * (len(FLOORS) - level - 0.5))
        for level, names in enumerate(FLOORS)
        for name, (column, _) in names.items()
    }


def picture() -> str:
    """Return the picture as the text of an SVG file."""
    at, words = places(), {name: words for names in FLOORS for name, (_, words) in names.items()}
    words["base modules"] = GROUND
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {4 * COLUMN} {ROW * len(FLOORS)}">',
        '<marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto">'
        '<path d="M 0 0 L 8 4 L 0 8 z" fill="#667"/></marker>',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for name, other in arrows():
        (x, y), (x2, y2) = at[name], at[other]
        x2 = x if other == "base modules" else x2
        # The head turns with the last line, which must have a length.
        y, turned, y2 = y + HEIGHT / 2, y + ROW - HEIGHT / 2 - TIP, y2 - HEIGHT / 2
        curve = f"M {x:g} {y:g} C {x:g} {turned:g} {x2:g} {y:g} {x2:g} {turned:g} V {y2:g}"
        lines.append(f'<path d="{curve}" fill="none" stroke="#667" marker-end="url(#tip)"/>')
    for name, (x, y) in at.items():
        width = BOX + 3 * COLUMN if name == "base modules" else BOX
        box = f'x="{x - width / 2:g}" y="{y - HEIGHT / 2:g}" width="{width:g}" height="{HEIGHT}" rx="6"'
        lines += [
            f'<rect {box} fill="#eef3fa" stroke="#357"/>',
            f'<text x="{x:g}" y="{y - 3:g}" font-size="15" font-weight="bold" {TEXT}>{name}</text>',
            f'<text x="{x:g}" y="{y + 14:g}" font-size="12" {TEXT}>{words[name]}</text>',
        ]
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
