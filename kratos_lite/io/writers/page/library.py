"""The library of pages: three.js, as the package trimesh holds it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from zipfile import BadZipFile, ZipFile

from kratos_lite.errors import KratosLiteError, installing

THREE = "/**\n * @license\n * Copyright 2010", "THREE.TrackballControls=TrackballControls;})();"
"""How three.js with its trackball begins and ends in the template of trimesh."""


def library() -> str:
    """Return three.js and its trackball, which trimesh embeds in pages of its own."""
    spec = find_spec("trimesh")
    if spec is None or spec.origin is None:
        raise KratosLiteError(f"pages for the browser need three.js: {installing('page')}")
    template = Path(spec.origin).parent / "resources" / "templates" / "viewer.zip"
    try:
        with ZipFile(template) as file:
            text = file.read("viewer.html.template").decode()
        start = text.index(THREE[0])
        return text[start : text.index(THREE[1], start) + len(THREE[1])]
    except (OSError, KeyError, ValueError, BadZipFile) as error:
        raise KratosLiteError(
            f"{template}: no three.js is found there; pip install 'trimesh>=4.8.3,<6' brings it"
        ) from error
