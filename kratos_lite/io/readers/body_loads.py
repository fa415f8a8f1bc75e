"""Loads and constraints of bodies in JSON: objects with a type, and the arguments of its class as keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kratos_lite import bodies
from kratos_lite.bodies import Body
from kratos_lite.errors import nearest
from kratos_lite.io.readers.values import (
    Read,
    function,
    number,
    number_or_series,
    part,
    points,
    text,
    vector,
)
from kratos_lite.io.settings import Settings
from kratos_lite.model.loads import Gravity, PointLoad, Pressure, Traction


@dataclass(frozen=True)
class Kind:
    """A type of load or constraint: its class, and the keys that it needs and takes."""

    build: Any
    needs: tuple[str, ...]
    takes: tuple[str, ...] = ()


LOADS = {
    "gravity": Kind(Gravity, ("acceleration",)),
    "force": Kind(bodies.Force, ("point", "force"), ("frame",)),
    "torque": Kind(bodies.Torque, ("torque",), ("frame",)),
    "traction": Kind(Traction, ("on", "traction")),
    "pressure": Kind(Pressure, ("on", "pressure")),
    "follower_pressure": Kind(bodies.FollowerPressure, ("on", "pressure")),
    "point_load": Kind(PointLoad, ("on", "force")),
    "spring": Kind(bodies.Spring, ("point", "anchor", "stiffness"), ("damping", "length")),
}
CONSTRAINTS = {
    "fix_point": Kind(bodies.FixPoint, ("points",)),
    "fix_direction": Kind(bodies.FixDirection, ("points", "direction")),
    "prescribed_displacement": Kind(bodies.PrescribedDisplacement, ("points", "direction", "displacement")),
    "prescribed_velocity": Kind(bodies.PrescribedVelocity, ("points", "direction", "velocity")),
    "prescribed_acceleration": Kind(bodies.PrescribedAcceleration, ("points", "direction", "acceleration")),
    "rigid_link": Kind(bodies.RigidLink, ("point", "anchor")),
}
OF_LOADS: dict[str, Read] = {
    "on": part,
    **dict.fromkeys(("acceleration", "force", "torque", "traction", "point", "anchor"), vector),
    **dict.fromkeys(("pressure", "stiffness", "damping", "length"), number),
    "frame": text,
}
OF_CONSTRAINTS: dict[str, Read] = {
    "points": points,
    **dict.fromkeys(("direction", "point", "anchor"), vector),
    **dict.fromkeys(("displacement", "velocity", "acceleration"), function),
}


def add_load(body: Body, section: Settings) -> None:
    """Let the load of an object act on a body."""
    load = _build(section, body, LOADS, OF_LOADS, ("amplitude",))
    amplitude = number_or_series(section, "amplitude") if "amplitude" in section else None
    section.placed("type", body.add, load, amplitude=amplitude)


def add_constraint(body: Body, section: Settings) -> None:
    """Hold a body by the constraint of an object."""
    section.placed("type", body.constrain, _build(section, body, CONSTRAINTS, OF_CONSTRAINTS))


def _build(
    section: Settings,
    body: Body,
    kinds: Mapping[str, Kind],
    readers: Mapping[str, Read],
    more: tuple[str, ...] = (),
) -> Any:
    name = section.text("type")
    if name not in kinds:
        raise section.error(
            "type", f"unknown type {name!r}.{nearest(name, kinds)} The types are {', '.join(kinds)}"
        )
    kind = kinds[name]
    section.check_keys(("type", *kind.needs, *kind.takes, *more))
    missing = [key for key in kind.needs if key not in section]
    if missing:
        raise section.error("type", f"{section.path}: a {name} also needs {', '.join(missing)}")
    given = [key for key in (*kind.needs, *kind.takes) if key in section]
    values = {"where" if key == "on" else key: readers[key](section, key, body.mesh) for key in given}
    return section.placed("type", kind.build, **values)
