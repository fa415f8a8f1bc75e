"""Small decks of a cube, and a live ccx."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import kratos_lite as kl

CUBE = """*HEADING
a cube
** a comment
*NODE, NSET=ALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=Eall
1,1,2,3,4,
5,6,7,8
*NSET, NSET=bottom
1,2,
3,4,
*NSET, NSET=TOP, GENERATE
5,8
*MATERIAL, NAME=Steel
*ELASTIC
1000, .25
*DENSITY
2.
*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL
*BOUNDARY
Bottom,1,3
"""


@pytest.fixture
def read(tmp_path: Path) -> Callable[[str], kl.Case]:
    """Return a function that reads a deck: the cube and what is added."""

    def of(text: str, cube: str = CUBE) -> kl.Case:
        path = tmp_path / "job.inp"
        path.write_text(cube + text)
        return kl.read_case(path)

    return of


@pytest.fixture
def ccx(tmp_path: Path) -> Callable[[str], str]:
    """Return a function that runs a deck in a live ccx and returns its `.dat` file."""
    if shutil.which("ccx") is None:
        pytest.skip("ccx is not installed")

    def of(text: str, cube: str = CUBE) -> str:
        (tmp_path / "theirs.inp").write_text(cube + text)
        subprocess.run(["ccx", "theirs"], cwd=tmp_path, capture_output=True, check=True, timeout=60)
        return (tmp_path / "theirs.dat").read_text()

    return of
