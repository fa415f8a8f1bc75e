"""BodyScene: all that a march needs; read from a JSON file or a script."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kratos_lite.bodies import Body, State, march
from kratos_lite.errors import InputError
from kratos_lite.typing import Progress

OUTPUTS = ("pvd", "csv", "npz", "picture", "state")
"""What a scene can write: series of states, a picture, and the last state for a restart."""


@dataclass
class BodyScene:
    """A body with its loads and constraints, and how it is marched.

    Attributes
    ----------
    body : where it starts, or goes on from.
    dt : step in s.
    steps, every, substeps : as for `march`.
    output : files to write by the keys `OUTPUTS`.
    files : files that were read.
    place : of the step, for messages: file, line and column.
    """

    body: Body
    dt: float
    steps: int
    every: int = 1
    substeps: int | str = 1
    output: dict[str, str] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    place: str = ""

    def march(self, progress: Progress | None = None) -> Iterator[State]:
        """March the body; what can be checked is checked before the first step."""
        options: dict[str, Any] = {"every": self.every, "substeps": self.substeps, "progress": progress}
        try:
            return march(self.body, self.dt, self.steps, **options)
        except InputError as error:
            raise InputError(f"{self.place}: {error}" if self.place else str(error)) from None


def read_scene(path: str | Path, *, strict: bool = True) -> BodyScene:
    """Return the scene of a .json file or a .py script; `strict` is that of `kratos_lite.read` for its mesh.

    Raises
    ------
    InputError, MeshError, ModelError, MaterialError
        With file, line and cure of what is wrong.
    """
    path = Path(path)
    if path.suffix.lower() == ".py":
        from kratos_lite.io.scenes.script import run_script

        return run_script(path)
    if path.suffix.lower() != ".json":
        raise InputError(f"{path}: a scene is a .json file or a .py script")
    from kratos_lite.io.scenes.reader import read_json_scene

    return read_json_scene(path, strict)
