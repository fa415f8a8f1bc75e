"""Real scenes: a folder of `.mdpa` files, each with a `case.json` that adds materials, supports and loads."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import kratos_lite as kl

AXES = "xyz"


def prepared(folder: Path, target: Path) -> list[Path]:
    """Write every case of a folder that states a linear problem as one whole `.mdpa` file each."""
    written = []
    for statement in sorted(folder.glob("*/case.json")):
        case = json.loads(statement.read_text())
        if case.get("parse_only") or case.get("pin_minimal"):
            continue
        model = model_of(statement.parent, case)
        path = target / f"{statement.parent.name}.mdpa"
        write_for_kratos(path, model)
        written.append(path)
    return written


def write_for_kratos(path: Path, model: kl.Model) -> None:
    """Write a model as `.mdpa` with the names that Kratos has for its elements."""
    kl.write(path, model)
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r"\bKinematicLinear3D", "SmallDisplacementElement3D", text), encoding="utf-8")


def model_of(folder: Path, case: dict[str, Any]) -> kl.Model:
    """Return the model of a case: its file plus what `case.json` adds."""
    materials = case.get("materials", [])
    model = kl.read(folder / case["mdpa"], materials=not materials)
    for m in materials:
        model.assign(kl.Isotropic3D(m["E"], m["nu"], m["rho"]), m["part"])
    for fix in case.get("fix", []):
        for axis, value in zip(AXES, fix["value"], strict=True):
            if value is not None:
                model.fix(fix["part"], axis, value, override=True)
    for plane in case.get("fix_plane", []):
        model.fix(AXES[plane["axis"]] + "-+"[plane["at"] == "max"], "xyz")
    if "gravity" in case:
        model.add(kl.Gravity(case["gravity"]))
    for load in case.get("surface_load", []):
        model.add(kl.Traction(load["part"], load["value"]))
    for load in case.get("surface_pressure", []):
        model.add(kl.Pressure(load["part"], load["value"], normal="nodes"))
    for load in case.get("point_load", []):
        model.add(kl.PointLoad(load["part"], load["value"]))
    return model
