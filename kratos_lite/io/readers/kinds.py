"""Whether a file is a scene; told without loading what a scene needs."""

from __future__ import annotations

import ast
from pathlib import Path

NEEDED = ("body", "dt", "steps")
"""Names that a script defines to be a scene."""


def is_scene(path: str | Path) -> bool:
    """Return whether a file is a scene: a .json file with a body, or a script that defines one."""
    path = Path(path)
    if path.suffix.lower() == ".json" and path.is_file():
        from kratos_lite.io.settings import read_settings

        settings = read_settings(path)
        return "body" in settings and "model" not in settings
    if path.suffix.lower() == ".py" and path.is_file():
        return _defines(path, NEEDED)
    return False


def _defines(path: Path, needed: tuple[str, ...]) -> bool:
    """Return whether a script assigns names, without running it."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return False
    targets = [t for node in tree.body if isinstance(node, ast.Assign) for t in node.targets]
    names = {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return names.issuperset(needed)
