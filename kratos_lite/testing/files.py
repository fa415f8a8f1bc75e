"""Check a student's file: run it aside and check every element, shape and material that it defines."""

from __future__ import annotations

import sys
import traceback
from contextlib import ExitStack
from math import nan
from pathlib import Path
from types import ModuleType

from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.shapes import SHAPES, Shape
from kratos_lite.testing.elements import check_element
from kratos_lite.testing.materials import check_material
from kratos_lite.testing.mistakes import cure, mistakes, names, replaced
from kratos_lite.testing.report import Finding
from kratos_lite.testing.shapes import check_shape

MODULE = "kratos_lite_checked_file"


def run_file(path: str | Path) -> list[tuple[str, list[Finding]]]:
    """Run a Python file and check what it defines; the file can do whatever a program can.

    Parameters
    ----------
    path : the file.  It is run in a module of its own; what it registers is forgotten afterwards.

    Returns
    -------
    list of (name, findings), in the order of the file.  Elements and shapes are checked as
    classes (a shape that an element of the file uses, with that element); materials as
    instances that the file makes at its top level.

    Raises
    ------
    InputError
        If the file cannot be read or run, or defines nothing to check.
    """
    with ExitStack() as stack:
        for registry in (ELEMENTS, SHAPES, MATERIALS):
            stack.enter_context(registry.temporary())
        library = names()
        defined = list(vars(_execute(Path(path))).items())
        mine = [(n, v) for n, v in defined if isinstance(v, type) and v.__module__ == MODULE]
        found = [
            (kind.__name__, check_element(kind)) for _, kind in mine if issubclass(kind, KinematicLinear)
        ]
        used = {getattr(kind, "shape", None) for _, kind in mine}
        shapes = [kind for _, kind in mine if issubclass(kind, Shape) and kind not in used]
        found += [(kind.__name__, check_shape(kind)) for kind in shapes]
        materials = [(n, v) for n, v in defined if isinstance(v, LinearMaterial)]
        found += [(f"{n} ({type(v).__name__})", check_material(v)) for n, v in materials]
        made = {type(v) for _, v in materials}
        found += [
            (kind.__name__, [_no_instance(kind)])
            for _, kind in mine
            if issubclass(kind, LinearMaterial) and kind not in made
        ]
        for _, kind in mine:
            extra = mistakes(kind) + replaced(kind, library, Path(path))
            same = next(
                (f for name, f in found if kind.__name__ in (name, name.partition(" (")[2][:-1])), None
            )
            if same is not None:
                same += extra
            elif extra:
                found.append((kind.__name__, extra))
    if not found:
        raise InputError(
            f"{path}: nothing to check; a file defines a subclass of KinematicLinear, Shape or LinearMaterial"
        )
    return found


def _no_instance(kind: type[LinearMaterial]) -> Finding:
    advice = (
        f"make one at the top level of the file, for example soil = {kind.__name__}(…) with its constants"
    )
    return Finding(
        "instance", False, nan, nan, f"a material is checked as an instance: {advice}", skipped=True
    )


def _execute(path: Path) -> ModuleType:
    """Return the module that the file makes; it can be imported only while it runs."""
    module = ModuleType(MODULE)
    module.__file__ = str(path)
    try:
        code = compile(path.read_bytes(), str(path), "exec")
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); give the path of a Python file"
        ) from None
    except SyntaxError as error:
        place = ":".join(str(part) for part in (path, error.lineno, error.offset) if part)
        raise InputError(f"{place}: not valid Python: {error.msg}") from None
    except ValueError as error:
        raise InputError(f"{path}: not valid Python: {error}") from None
    sys.modules[MODULE] = module  # dataclasses look their module up
    try:
        exec(code, vars(module))
    except (Exception, SystemExit) as error:
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
        place = f"{path}:{lines[-1]}" if lines else str(path)
        text = f"the file stops with {type(error).__name__}: {error}{cure(error, vars(module))}"
        raise InputError(f"{place}: {text}") from None
    finally:
        del sys.modules[MODULE]
    return module
