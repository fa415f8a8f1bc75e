"""Pictures of cases, and films of those in time: the ending of the path says which."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def is_film(path: str | Path | None) -> bool:
    """Return whether a path is that of a film, and no picture."""
    if path is None:
        return False
    from kratos_lite.view.animation import ENDINGS  # rarely needed

    return Path(path).suffix.lower() in ENDINGS


def check_picture(path: str | Path) -> None:
    """Raise, before any work is done, for a picture or film that cannot be written.

    Raises InputError for another ending, KratosLiteError where matplotlib or ffmpeg is missing.
    """
    if is_film(path):
        from kratos_lite.view.animation import check_animation

        check_animation(path)
        return
    from kratos_lite.view import canvas

    canvas.check_picture(path)


def write_picture(path: str | Path, thing: Any, **options: Any) -> None:
    """Write a picture or a film of a thing, with options that both have."""
    from kratos_lite.analysis.plot import animate, plot  # rarely needed

    if is_film(path):
        animate(path, thing, **options)
    else:
        plot(thing, path, **options)
