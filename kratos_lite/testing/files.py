"""Files: run a Python file and check every element, shape and material that it defines."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import is_dataclass
from inspect import get_annotations
from math import inf
from pathlib import Path
from types import ModuleType
from typing import Any

from kratos_lite.elements import ELEMENTS, KinematicLinear
from kratos_lite.errors import InputError, no_such_file
from kratos_lite.materials import MATERIALS, LinearMaterial, Material
from kratos_lite.shapes import SHAPES, Shape
from kratos_lite.testing.elements import check_element
from kratos_lite.testing.materials import check_material
from kratos_lite.testing.report import Finding
from kratos_lite.testing.shapes import check_shape

MODULE = "kratos_lite_checked_file"
REGISTRIES = (ELEMENTS, SHAPES, MATERIALS)
BASES: dict[tuple[str, ...], type] = {
    ("compliance",): LinearMaterial,
    ("elasticity",): LinearMaterial,
    ("response",): Material,
    ("N", "dN"): Shape,
    ("shape", "rule"): KinematicLinear,
}
"""What a class defines that is meant to be a subclass of each of these."""
FROZEN = "@dataclass(frozen=True)"


def run_file(path: str | Path) -> list[tuple[str, list[Finding]]]:
    """Run a Python file and check what it defines; the file can do whatever a program can.

    Parameters
    ----------
    path : the file.  It is run in a module of its own, beside the modules of its folder; what it registers
        is forgotten afterwards.

    Returns
    -------
    list of (name, findings)
        In the order of the file.  Elements and shapes are checked as classes (a shape that an element of
        the file uses, with that element); materials as instances that the file makes at its top level.

    Raises
    ------
    InputError
        If the file cannot be read or run, or defines nothing to check.
    """
    with ExitStack() as stack:
        for registry in REGISTRIES:
            stack.enter_context(registry.temporary())
        stack.enter_context(beside(Path(path)))
        defined = vars(run_module(Path(path)))
        kinds = [v for v in list(defined.values()) if isinstance(v, type) and v.__module__ == MODULE]
        results = _check_all(defined, kinds)
        for kind in kinds:
            extra = _forgotten(kind)
            same = [f for name, f in results if name == kind.__name__ or name.endswith(f" ({kind.__name__})")]
            if same:
                same[0].extend(extra)
            elif extra:
                results.append((kind.__name__, extra))
    if not results:
        raise InputError(
            f"{path}: nothing to check; a file defines a subclass of KinematicLinear, Shape or Material"
        )
    return results


def _check_all(defined: dict[str, Any], kinds: list[type]) -> list[tuple[str, list[Finding]]]:
    """Check elements, the shapes that none of them uses, and materials by their instances."""
    used = {getattr(kind, "shape", None) for kind in kinds}
    materials = {name: v for name, v in defined.items() if isinstance(v, Material)}
    made = {type(v) for v in materials.values()}
    results = [(kind.__name__, check_element(kind)) for kind in kinds if issubclass(kind, KinematicLinear)]
    results += [(k.__name__, check_shape(k)) for k in kinds if issubclass(k, Shape) and k not in used]
    results += [(f"{name} ({type(v).__name__})", check_material(v)) for name, v in materials.items()]
    for kind in kinds:
        if not issubclass(kind, Material) or _lacks_decorator(kind):
            continue
        if not any(issubclass(each, kind) for each in made):
            text = "a material is checked as an instance: make one at the top level of the file, for example "
            text += f"soil = {kind.__name__}(…) with its constants"
            results.append((kind.__name__, [Finding("instance", False, inf, 0, text)]))
    return results


@contextmanager
def beside(path: Path) -> Iterator[None]:
    """Let a Python file import the modules of its folder, as if Python ran it, and forget them afterwards."""
    folder, before = str(path.parent.absolute()), set(sys.modules)
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
        for name in sys.modules.keys() - before:
            home = getattr(sys.modules[name], "__file__", None)
            if home and Path(folder) in Path(home).parents:
                del sys.modules[name]


def run_module(path: Path) -> ModuleType:
    """Return the module that a Python file makes; it can be imported only while it runs."""
    module = ModuleType(MODULE)
    module.__file__ = str(path)
    try:
        code = compile(path.read_bytes(), str(path), "exec")
    except FileNotFoundError:
        raise no_such_file(path) from None
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
        text = f"the file stops with {type(error).__name__}: {error}{_cure(error, vars(module))}"
        raise InputError(f"{place}: {text}") from None
    finally:
        del sys.modules[MODULE]
    return module


# ---- mistakes that Python lets pass ------------------------------------------------------------------


def _forgotten(kind: type) -> list[Finding]:
    """Return findings for a class that lacks its base class or its decorator."""
    signs = [names for names in BASES if all(name in vars(kind) for name in names)]
    if signs and not issubclass(kind, tuple(BASES.values())):
        base, what = BASES[signs[0]].__name__, " and ".join(signs[0])
        text = f"{kind.__name__} has {what} but is no {base}, so nothing uses it: "
        return [Finding("base class", False, inf, 0, text + f"write class {kind.__name__}({base})")]
    if issubclass(kind, Material) and is_dataclass(kind) and not kind.__dataclass_params__.frozen:
        return [Finding("dataclass", False, inf, 0, f"{kind.__name__} may change: write {FROZEN} above it")]
    if _lacks_decorator(kind):
        text = f"{kind.__name__} lists constants: add {FROZEN} above it"
        return [Finding("dataclass", False, inf, 0, text)]
    return []


def _lacks_decorator(kind: type) -> bool:
    """Return whether a material lists constants of its own but is not made a dataclass of them."""
    own = [a for a in get_annotations(kind).values() if "ClassVar" not in str(a)]
    is_own = is_dataclass(kind) and "__dataclass_fields__" in vars(kind)
    return issubclass(kind, Material) and bool(own) and not is_own


def _cure(error: BaseException, defined: dict[str, Any]) -> str:
    """Return what to do about an error that a decorator or a type has led to, or an empty text."""
    if "mutable default" in str(error):
        return ": it is no constant; write it without a type"
    if not isinstance(error, TypeError):
        return ""
    if "non-frozen dataclass" in str(error):
        return f"; write {FROZEN}"
    kinds = [v for v in defined.values() if isinstance(v, type) and _lacks_decorator(v)]
    named = [kind.__name__ for kind in kinds if kind.__name__ in str(error)]
    return f"; add {FROZEN} above class {named[0]}" if named else ""
