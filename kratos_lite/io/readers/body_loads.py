"""Loads and constraints of bodies in JSON: objects with a type, and the arguments of its class as keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from kratos_lite import bodies
from kratos_lite.bodies import Body
from kratos_lite.errors import nearest
from kratos_lite.io.readers.values import Read, number_or_series, part, points
from kratos_lite.io.settings import Settings
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import PointLoad
from kratos_lite.model.loads.surface import Pressure, Traction


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


def _acceleration(section: Settings, key: str) -> Any:
    """Return that of gravity, a vector, or that of points in a direction."""
    is_gravity = section.text("type") == "gravity"
    return section.vector(key) if is_gravity else number_or_series(section, key)


VALUES: dict[str, Read] = {
    **dict.fromkeys(("force", "torque", "traction", "point", "anchor", "direction"), Settings.vector),
    **dict.fromkeys(("pressure", "stiffness", "damping", "length"), Settings.number),
    **dict.fromkeys(("displacement", "velocity"), number_or_series),
    "acceleration": _acceleration,
    "frame": Settings.text,
}
"""How each key is read, but for those that need the mesh of the body."""
OF_MESH: dict[str, Callable[[Settings, str, Mesh | None], Any]] = {"on": part, "points": points}


def add_load(body: Body, section: Settings) -> None:
    """Let the load of an object act on a body."""
    load = _build(section, body.mesh, LOADS, "amplitude")
    amplitude = number_or_series(section, "amplitude") if "amplitude" in section else None
    section.placed("type", body.add, load, amplitude=amplitude)


def add_constraint(body: Body, section: Settings) -> None:
    """Hold a body by the constraint of an object."""
    section.placed("type", body.constrain, _build(section, body.mesh, CONSTRAINTS))


def _build(section: Settings, mesh: Mesh | None, kinds: Mapping[str, Kind], *more: str) -> Any:
    name = section.text("type")
    known = f"unknown type {name!r}.{nearest(name, kinds)} The types are {', '.join(kinds)}"
    section.expect(name in kinds, "type", known)
    kind = kinds[name]
    section.check_keys(("type", *kind.needs, *kind.takes, *more))
    missing = [key for key in kind.needs if key not in section]
    section.expect(not missing, "type", f"{section.path}: a {name} also needs {', '.join(missing)}")
    given = [key for key in (*kind.needs, *kind.takes) if key in section]
    values = {
        "where" if key == "on" else key: OF_MESH[key](section, key, mesh)
        if key in OF_MESH
        else VALUES[key](section, key)
        for key in given
    }
    return section.placed("type", kind.build, **values)
