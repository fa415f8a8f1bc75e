"""Scripts: plain Python that defines a `case`, or `body`, `dt` and `steps`."""

from __future__ import annotations

import ast
import runpy
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kratos_lite.bodies import Body
from kratos_lite.bodies.batched import batch
from kratos_lite.errors import InputError, KratosLiteError, nearest, no_such_file
from kratos_lite.io.case import Case, Outputs, TimeIntegration
from kratos_lite.io.formats import SERIES

NEEDED = ("body", "dt", "steps")
"""Names that a script without a `case` defines."""
OUTPUTS = (*(ending[1:] for ending in SERIES), "picture", "state")
"""Keys of `output` in a script without a `case`."""


def is_script(path: Path) -> bool:
    """Return whether a .py file assigns the names of a script, without running it."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError, OSError):
        return False
    targets = [t for node in tree.body if isinstance(node, ast.Assign) for t in node.targets]
    names = {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return "case" in names or names.issuperset(NEEDED)


def read_script(path: Path) -> Case:
    """Run a script, with ``__name__ == "case"``, and return the case that it defines.

    It defines `case`; or `body`, `dt` and `steps`, and if wanted `every`, `substeps` and `output`, a
    dictionary such as ``{"csv": "swing.csv"}``.  Errors are InputError with file and line.
    """
    if not path.is_file():
        raise no_such_file(path)
    names = _run(path)
    case = names["case"] if "case" in names else _case_of_body(path, names)
    if not isinstance(case, Case):
        raise InputError(f"{path}: case must be a kl.Case; got {case!r}")
    case.files = [path, *case.files]
    if case.is_of_model and case.model.mesh.source:
        case.files.append(Path(case.model.mesh.source))
    return case


def _case_of_body(path: Path, names: dict[str, Any]) -> Case:
    missing = [name for name in NEEDED if name not in names]
    if missing:
        hint = nearest(missing[0], [name for name in names if not name.startswith("__")])
        raise InputError(
            f"{path}: a script defines case, or {', '.join(NEEDED)}; {missing[0]!r} is missing.{hint}"
        )
    body = names["body"]
    if isinstance(body, Sequence):
        body = batch(body)
    if not isinstance(body, Body):
        raise InputError(f"{path}: body must be a body such as kl.RigidBody, or a list of them; got {body!r}")
    given = {name: names[name] for name in ("every", "substeps") if name in names}
    try:
        time = TimeIntegration(names["dt"], names["steps"], **given, place=str(path))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return Case(body, time, outputs=_outputs(path, names.get("output", {})))


def _outputs(path: Path, output: Any) -> Outputs:
    """Return the files to write, named from the folder of the script."""
    if not isinstance(output, dict) or not all(isinstance(name, (str, Path)) for name in output.values()):
        raise InputError(f'{path}: output must be a dict such as {{"pvd": "swing.pvd"}}; got {output!r}')
    for key in output:
        if key not in OUTPUTS:
            hint = nearest(str(key), OUTPUTS)
            raise InputError(f"{path}: unknown output {key!r}.{hint} There are {', '.join(OUTPUTS)}")
    paths = {key: str(path.parent / name) for key, name in output.items()}
    results = [name for key, name in paths.items() if key not in ("picture", "state")]
    return Outputs(results, picture=paths.get("picture"), state=paths.get("state"))


def _run(path: Path) -> dict[str, Any]:
    """Run a file beside its own modules, without arguments; an error gets its place, in one line."""
    folder, words = str(path.parent.absolute()), sys.argv
    sys.path.insert(0, folder)
    sys.argv = [str(path)]
    try:
        return runpy.run_path(str(path), run_name="case")
    except SyntaxError as error:
        raise InputError(f"{error.filename}:{error.lineno}: {error.msg}") from error
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        line = next((f":{frame.lineno}" for frame in reversed(frames) if frame.filename == str(path)), "")
        kind = "" if isinstance(error, KratosLiteError) else f"{type(error).__name__}: "
        raise InputError(f"{path}{line}: {kind}{error}") from error
    finally:
        sys.path.remove(folder)
        sys.argv = words
