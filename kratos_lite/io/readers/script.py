"""Scenes as scripts: plain Python that defines `body`, `dt` and `steps`."""

from __future__ import annotations

import runpy
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kratos_lite.bodies import Body
from kratos_lite.bodies.batched import together
from kratos_lite.errors import InputError, KratosLiteError, nearest
from kratos_lite.io.scenes.kinds import NEEDED
from kratos_lite.io.scenes.scene import OUTPUTS, BodyScene

OPTIONAL = ("every", "substeps", "output")


def run_script(path: Path) -> BodyScene:
    """Run a script, with ``__name__ == "scene"``, and return the scene that it defines."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    names = _run(path)
    missing = [name for name in NEEDED if name not in names]
    if missing:
        hint = nearest(missing[0], [name for name in names if not name.startswith("__")])
        raise InputError(f"{path}: a scene defines {', '.join(NEEDED)}; {missing[0]!r} is missing.{hint}")
    body = names["body"]
    if isinstance(body, Sequence):
        body = together(body)
    if not isinstance(body, Body):
        raise InputError(f"{path}: body must be a body such as kl.RigidBody, or a list of them; got {body!r}")
    given = {name: names[name] for name in OPTIONAL if name in names}
    given["output"] = _outputs(path, given.get("output", {}))
    return BodyScene(body, names["dt"], names["steps"], files=[path], place=str(path), **given)


def _outputs(path: Path, output: Any) -> dict[str, str]:
    """Return the files to write; they count from the folder of the script."""
    if not isinstance(output, dict) or not all(isinstance(name, (str, Path)) for name in output.values()):
        raise InputError(f'{path}: output must be a dict such as {{"pvd": "swing.pvd"}}; got {output!r}')
    for key in output:
        if key not in OUTPUTS:
            raise InputError(
                f"{path}: unknown output {key!r}.{nearest(str(key), OUTPUTS)} There are {', '.join(OUTPUTS)}"
            )
    return {key: str(path.parent / name) for key, name in output.items()}


def _run(path: Path) -> dict[str, Any]:
    """Run a file beside its own modules; it gets no arguments, and an error has its place in one line."""
    folder, words = str(path.parent.absolute()), sys.argv
    sys.path.insert(0, folder)
    sys.argv = [str(path)]
    try:
        return runpy.run_path(str(path), run_name="scene")
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
