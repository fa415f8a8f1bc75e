"""Laws and strains of Kratos run files: what is solved in quasi-static steps, and what is made linear."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import KratosLiteError, ModelError
from kratos_lite.io.case import TimeIntegration
from kratos_lite.io.formats.document import Document, Properties
from kratos_lite.io.kratos.context import Omission
from kratos_lite.io.kratos.properties import material_from, names_material
from kratos_lite.io.settings import Settings
from kratos_lite.materials import Material

LOOSEST, TIGHTEST = 1e-8, 1e-10
"""Relative residuals between which that of a file is taken: a looser one would miss what it stands for."""
ITERATIONS = 25
"""Corrections of a step that are allowed at least, as residuals are smaller than those of files."""


def notes_on_laws(document: Document, steps: int) -> list[str]:
    """Return notes on what laws of Kratos mean there, and not here."""
    laws = {type(law).__name__ for _, law in _materials(document) if getattr(law, "has_corners", False)}
    text = "Kratos exchanges the shears yz and zx in its flow; where both are 0 it does the same"
    return [*_notes_on_stress(document, steps), *(Omission(f"{name}: {text}") for name in sorted(laws))]


def _notes_on_stress(document: Document, steps: int) -> list[str]:
    """Return a note on updated Lagrangian elements: of which laws, and steps, Kratos has another stress."""
    names = {b.name for b in document.mesh.blocks if len(b) and b.name.startswith("UpdatedLagrangian")}
    laws = {type(law).__name__ for _, law in _materials(document) if law.strain_measure == "small"}
    text = (
        f"{', '.join(sorted(names))} with {', '.join(sorted(laws))}: C times Green's strain is the second "
        "stress of Piola and Kirchhoff here, Cauchy's in Kratos; KirchhoffSaintVenant3DLaw is one in both"
        if laws
        else f"{', '.join(sorted(names))}: from the second step on Kratos writes other stresses and strains "
        "than of TotalLagrangianElement, whose are written here; displacements are the same"
    )
    return [Omission(text)] if names and (laws or steps > 1) else []


def make_linear(document: Document) -> list[str]:
    """Give a document elements and laws of small strains, with their elasticity at rest; return notes."""
    notes, blocks = list[str](), list(document.mesh.blocks)
    for i, block in enumerate(blocks):
        if len(block) and block.name in ELEMENTS and ELEMENTS[block.name].finite:
            name = ELEMENTS[block.name].__mro__[1].__name__
            blocks[i] = replace(block, name=name)
            notes.append(f"{block.name} is solved as {name} with small displacements")
    document.mesh = document.mesh.replace(blocks=blocks)
    for properties, material in _materials(document):
        if not (material.is_linear and material.strain_measure == "small"):
            law, number = properties.values["CONSTITUTIVE_LAW"], properties.id
            if not getattr(material, "isotropic", False) or "YOUNG_MODULUS" not in properties.values:
                raise ModelError(f"Properties {number}: {law} has no linear solution; set 'non_linear'")
            properties.values["CONSTITUTIVE_LAW"] = "LinearElastic3DLaw"
            notes.append(f"Properties {number}: {law} is solved with its elasticity at rest")
    return notes


def _materials(document: Document) -> Iterator[tuple[Properties, Material]]:
    """Yield the properties of elements that state a material, with it."""
    for properties in document.used_properties():
        if names_material(properties.values):
            with suppress(KratosLiteError):  # `model_from` says where
                yield properties, material_from(properties.values)


def quasi_static_of(solver: Settings, times: Sequence[float]) -> TimeIntegration:
    """Return the steps of a static run file; InputError with the place of what is wrong."""
    kind = solver.section("solving_strategy_settings").text("type", "newton_raphson")
    relative = solver.number("residual_relative_tolerance", 1e-4)
    most = solver.integer("max_iteration", 10)
    for key, value in (("residual_relative_tolerance", relative), ("max_iteration", most)):
        solver.expect(value > 0, key, f"must be > 0; got {value:g}")
    options = {
        "tolerance": min(max(relative, TIGHTEST), LOOSEST),
        "iterations": max(most, ITERATIONS),
        "line_search": solver.flag("line_search", False) or kind == "line_search",
    }
    sizes = [after - before for before, after in pairwise(times)]
    own = () if "time_step" in solver.section("time_stepping") else tuple(sizes)
    return TimeIntegration(sizes[0], len(sizes), quasi_static=options, start=times[0], sizes=own)
