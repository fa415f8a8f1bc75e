"""Descriptions of scenes: what a body is, and what acts on it."""

from __future__ import annotations

from kratos_lite.bodies.deformable import Deformable
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.io.scenes.scene import BodyScene

WIDTH = 22
"""Of the left column of tables."""


def line(name: str, value: str) -> str:
    """Return a line of a table."""
    return f"{name:<{WIDTH}}{value}"


def body_lines(scene: BodyScene) -> list[str]:
    """Return the lines that say what the body of a scene is."""
    body = scene.body
    formulation = f" {body.formulation.name}" if isinstance(body, FiniteElementBody) else ""
    many = f"{len(body.q)} × " if body.q.ndim > 1 else ""
    lines = [line("body", f"{many}{body.kind}{formulation}, {body.dofs} velocities, {body.scheme}")]
    if body.mesh is not None:
        elements = ", ".join(f"{len(block)} {block.name}" for block in body.mesh.blocks if len(block))
        lines.append(line("mesh", f"{body.mesh.n_nodes} nodes, {elements}"))
    if body.q.ndim == 1:
        lines.append(line("mass", f"{float(body.mass):.7g} kg"))
    if isinstance(body, Deformable) and body.damping:
        lines.append(line("damping", f"{body.damping:g} s"))
    return lines + [line("doubtful", warning) for warning in body.warnings()]


def describe_scene(scene: BodyScene) -> str:
    """Return what a scene says, as a table."""
    body = scene.body
    lines = body_lines(scene)
    if body.q.ndim == 1:
        moments = ", ".join(f"{value:.7g}" for value in body.mass_properties.inertia.diagonal())
        lines += [
            line("mass center", f"{vector(body.mass_center())} m"),
            line("inertia xx, yy, zz", f"{moments} kg m²"),
            line("energy", f"{float(body.energy()):.7g} J"),
        ]
    if isinstance(body, Deformable):
        lines.append(line("critical step", f"{body.critical_step():.4g} s, of DEF_EXP"))
    held = [f"{type(constraint).__name__} ({constraint.count})" for constraint in body.constraints]
    lines += [
        line("loads", str(len(body.loads)) if body.loads else "none"),
        line("constraints", ", ".join(held) or "none"),
        line("time", f"from {body.time:g} s, {scene.steps} steps of {scene.dt:g} s"),
    ]
    return "\n".join(lines + [line(key, name) for key, name in scene.output.items()])


def vector(values: object) -> str:
    """Return three numbers for a table."""
    import numpy as np

    return "(" + ", ".join(f"{value:.6g}" for value in np.asarray(values)) + ")"
