"""Check a student's file: run it aside and check every element, shape and material that it defines."""

from __future__ import annotations

import sys
import traceback
from contextlib import ExitStack
from math import nan
from pathlib import Path
from types import ModuleType
from typing import Any

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

Named = tuple[str, list[Finding]]


def run_file(path: str | Path) -> list[Named]:
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
        mine = [v for _, v in defined if isinstance(v, type) and v.__module__ == MODULE]
        found = _check_all(defined, mine)
        _add_mistakes(found, mine, library, Path(path))
    if not found:
        raise InputError(
            f"{path}: nothing to check; a file defines a subclass of KinematicLinear, Shape or LinearMaterial"
        )
    return found


def _check_all(defined: list[tuple[str, Any]], mine: list[type]) -> list[Named]:
    """Check elements, the shapes that none of them uses, and materials by their instances."""
    found = [(kind.__name__, check_element(kind)) for kind in mine if issubclass(kind, KinematicLinear)]
    used = {getattr(kind, "shape", None) for kind in mine}
    shapes = [kind for kind in mine if issubclass(kind, Shape) and kind not in used]
    found += [(kind.__name__, check_shape(kind)) for kind in shapes]
    materials = [(n, v) for n, v in defined if isinstance(v, LinearMaterial)]
    found += [(f"{n} ({type(v).__name__})", check_material(v)) for n, v in materials]
    made = {type(v) for _, v in materials}
    laws = [kind for kind in mine if issubclass(kind, LinearMaterial) and kind not in made]
    return found + [(kind.__name__, [_no_instance(kind)]) for kind in laws]


def _add_mistakes(
    found: list[Named], mine: list[type], library: dict[tuple[str, str], Any], path: Path
) -> None:
    """Add what a class lacks or replaces to its findings."""
    for kind in mine:
        extra = mistakes(kind) + replaced(kind, library, path)
        name = kind.__name__
        same = [findings for own, findings in found if own == name or own.endswith(f" ({name})")]
        if same:
            same[0].extend(extra)
        elif extra:
            found.append((name, extra))


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
