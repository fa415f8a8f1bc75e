"""Errors: one family, and a collector that reports every problem of an input at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

MAX_PROBLEMS = 20
"""Problems shown in one message; the rest are counted."""


class KratosLiteError(ValueError):
    """Base of every error that kratos_lite raises on purpose.

    The text says where, what was found, what was expected and the cure.
    """


class InputError(KratosLiteError):
    """A file, an option or an argument cannot be understood as written."""


class MeshError(KratosLiteError):
    """A mesh is broken: an inverted element, a repeated node, a missing name."""


class MaterialError(KratosLiteError):
    """A material constant lies outside its physical bounds."""


class ModelError(KratosLiteError):
    """A model has no unique solution: missing supports, missing material, contradicting values."""


class SolveError(KratosLiteError):
    """The equations could not be solved to the accuracy requested."""


def installing(extra: str) -> str:
    """Return the command that installs an extra: before a release from a clone of the source.

    >>> installing("view")
    'pip install -e ".[view]" in a clone of kratos_lite'
    """
    return f'pip install -e ".[{extra}]" in a clone of kratos_lite'


class Problems:
    """Collect problems and raise them together."""

    def __init__(self, source: str = "", kind: type[KratosLiteError] = InputError) -> None:
        self.source = source
        self.kind = kind
        self.messages: list[str] = []
        self.count = 0

    def add(self, message: str, line: int | None = None) -> None:
        """Note one problem, at a line (from 1) of the source if known."""
        self.count += 1
        if self.count <= MAX_PROBLEMS:
            place = ":".join(str(part) for part in (self.source or None, line) if part is not None)
            self.messages.append(f"{place}: {message}" if place else message)

    def __bool__(self) -> bool:
        return self.count > 0

    def raise_if_any(self) -> None:
        """Raise one error that holds every problem noted so far, if there is one."""
        if self.count:
            more = self.count - len(self.messages)
            text = "\n".join(self.messages) + (f"\n… and {more} more" if more else "")
            raise self.kind(text)


RENAMED = {
    **{"scheme": "integrator", "ends": "boundaries", "march": "time"},
    **{"pvd": "output", "csv": "output", "npz": "output", "generalised_alpha": "generalized_alpha"},
    **{f"{C}3D{n}": f"KinematicLinear3D{n}N" for C in ("C", "") for n in (4, 6, 8, 10, 15, 20, 27)},
    **{"C3D8I": "EnhancedStrain3D8N", "C3D20R": "Reduced3D20N", "MISES": "von_mises"},
    **{"U1": "ux", "U2": "uy", "U3": "uz", "S11": "sxx", "S22": "syy", "S33": "szz", "S12": "sxy"},
    **{"S23": "syz", "S13": "szx", "E11": "exx", "E22": "eyy", "E33": "ezz", "E12": "exy", "E23": "eyz"},
    "E13": "ezx",
}
"""Words that other programs, or earlier versions, have for what is known here by another word."""


@contextmanager
def naming(source: str) -> Iterator[None]:
    """Let errors of the library name the file that they come from, where they do not yet."""
    try:
        yield
    except KratosLiteError as error:
        stem = source.rpartition("/")[2].partition(".")[0]
        if not source or f"{stem}." in str(error) or str(error).startswith(f"{source}: "):
            raise
        raise type(error)(f"{source}: {error}") from None


@contextmanager
def within_numbers(source: str) -> Iterator[None]:
    """Let an overflow or NaN in what is done with a file be an error in words."""
    import numpy as np

    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            yield
    except (FloatingPointError, OverflowError):
        raise SolveError(
            f"{source}: numbers exceed what a computer holds (1.8e308); "
            "look for coordinates, constants, supports or loads in wrong units"
        ) from None


def _plain(word: str) -> str:
    """Return a word without what is often mistaken: capitals, and what joins its parts."""
    return word.lower().replace("-", "_").replace(" ", "_")


def nearest(name: str, known: Iterable[str], count: int = 3) -> str:
    """Return a hint that names the known words closest to `name`, or an empty string, as for one of them."""
    from difflib import get_close_matches

    known = list(dict.fromkeys(known))
    if name in known:
        return ""
    if RENAMED.get(name) in known:
        return f" It is called {RENAMED[name]} here."
    plain = {_plain(word): word for word in known}
    close = get_close_matches(name, known, n=count, cutoff=0.6)
    close = close or [plain[word] for word in get_close_matches(_plain(name), list(plain), count, 0.6)]
    close = close or [word for word in known if name and word.startswith(f"{name} ")][:count]
    return f" Did you mean {' or '.join(close)}?" if close else ""


def no_such_file(path: str | Path) -> InputError:
    """Return the error for a path where there is no file, with the files of its folder that are near."""
    from pathlib import Path

    near = nearest(Path(path).name, (file.name for file in Path(path).parent.glob("*")))
    return InputError(f"{path}: there is no such file{'.' * bool(near)}{near}")
