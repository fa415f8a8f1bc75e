"""Scripts: plain Python that defines `body`, `dt` and `steps`."""

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
from kratos_lite.errors import InputError, KratosLiteError, nearest
from kratos_lite.io.case import Case, Outputs, TimeIntegration
from kratos_lite.io.readers.body_file import OUTPUTS, outputs_of

NEEDED = ("body", "dt", "steps")
"""Names that a script defines."""


def is_script(path: Path) -> bool:
    """Return whether a .py file assigns the names of a script, without running it."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError, OSError):
        return False
    targets = [t for node in tree.body if isinstance(node, ast.Assign) for t in node.targets]
    names = {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return names.issuperset(NEEDED)


def read_script(path: Path) -> Case:
    """Run a script, with ``__name__ == "case"``, and return the case that it defines.

    It may also define `every`, `substeps` and `output`, a dictionary such as ``{"csv": "swing.csv"}``.

    Raises
    ------
    InputError
        With file and line of what is wrong.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    names = _run(path)
    missing = [name for name in NEEDED if name not in names]
    if missing:
        hint = nearest(missing[0], [name for name in names if not name.startswith("__")])
        raise InputError(f"{path}: a script defines {', '.join(NEEDED)}; {missing[0]!r} is missing.{hint}")
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
    return Case(body, time, outputs=_outputs(path, names.get("output", {})), files=[path])


def _outputs(path: Path, output: Any) -> Outputs:
    """Return the files to write; they count from the folder of the script."""
    if not isinstance(output, dict) or not all(isinstance(name, (str, Path)) for name in output.values()):
        raise InputError(f'{path}: output must be a dict such as {{"pvd": "swing.pvd"}}; got {output!r}')
    for key in output:
        if key not in OUTPUTS:
            hint = nearest(str(key), OUTPUTS)
            raise InputError(f"{path}: unknown output {key!r}.{hint} There are {', '.join(OUTPUTS)}")
    return outputs_of({key: str(path.parent / name) for key, name in output.items()})


def _run(path: Path) -> dict[str, Any]:
    """Run a file beside its own modules; it gets no arguments, and an error has its place in one line."""
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
