"""Results to files: `.vtu`, `.pvtu` for ParaView, `.vtk`, `.json`, `.html`, `.csv` of nodes, `.frd`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite import __version__
from kratos_lite.analysis.fields import fields
from kratos_lite.analysis.peak import peak
from kratos_lite.analysis.report import element_counts
from kratos_lite.atomic import refuse_nan, write_whole
from kratos_lite.errors import SolveError
from kratos_lite.io.formats import check_ending, check_result
from kratos_lite.typing import Numbers

if TYPE_CHECKING:
    from kratos_lite.analysis.result import Result
    from kratos_lite.analysis.section import Section


def write_result(path: str | Path, result: Result, mode: str | None = None) -> None:
    """Write a result by the ending of `path`: .vtu or .pvtu (in a mode), .vtk, .json, .html, .csv, .frd."""
    ending = Path(path).suffix.lower()
    check_result(path, mode)
    if ending == ".json":
        write_json(path, result)
    elif ending == ".csv":
        write_table(path, result.columns())
    elif ending == ".html":
        from kratos_lite.io.writers.page.write import write_result_page  # rarely needed

        write_result_page(path, result)
    elif ending == ".frd":
        from kratos_lite.io.writers.calculix import at_nodes  # rarely needed
        from kratos_lite.io.writers.frd import FrdStep, write_frd

        write_frd(path, result.mesh, [FrdStep(at_nodes(result))])
    elif ending == ".pvtu":
        from kratos_lite.io.writers.pvtu import write_pieces  # rarely needed

        write_pieces(path, result, mode or "binary")
    elif ending == ".vtu":
        from kratos_lite.io.formats.vtu import write_vtu

        write_vtu(path, result.mesh, *fields(result), mode or "binary")
    else:
        from kratos_lite.io.formats.meshio import write_meshio

        write_meshio(path, result.mesh, *fields(result))


def summary(result: Result) -> dict[str, Any]:
    """Return the numbers of the table, for programs."""
    report, mesh = result.report, result.mesh
    length, node, _ = result.largest_displacement()
    mises, element, _ = result.largest_von_mises()
    top, asked = peak(result), dict[str, Any]()
    if report.error is not None:
        history = [vars(step) for step in report.history]
        asked = {"requested_error": {"relative": report.error, "of": report.error_of, "history": history}}
    return {
        "nodes": mesh.n_nodes,
        "elements": element_counts(mesh, result.groups, report.formulation),
        **({"formulation": report.formulation} if report.formulation else {}),
        "unknowns": report.unknowns,
        "total_load": report.total_load.tolist(),
        "total_reaction": report.total_reaction.tolist(),
        "largest_displacement": {"value": length, "node": node},
        "strain_energy": result.energy(),
        **_estimate(result),
        **asked,
        "largest_von_mises_stress": {"value": mises, "element": element, **(vars(top) if top else {})},
        **{
            f"largest_{name}": {"value": value, "element": element}
            for name, (value, element, _) in result.largest_variables().items()
        },
        "solver": report.solver,
        "reason": report.reason,
        "iterations": report.iterations,
        **({"steps": [vars(step) for step in report.steps]} if report.steps else {}),
        **({} if report.work is None else {"work": report.work}),
        "backward_error": report.backward_error,
        "force_error": report.force_error,
        "moment_error": report.moment_error,
        "seconds": report.seconds,
        "peak_memory": report.peak_memory,
        "kernels": report.kernels,
        **({"motion": report.motion} if report.motion else {}),
        "skipped": report.skipped,
        "warnings": report.warnings,
        "notes": report.notes,
    }


def _estimate(result: Result) -> dict[str, Any]:
    """Return the estimated error, which a result that is not linear does not have."""
    if not result.is_linear:
        return {}
    error = result.error()
    names = ("relative", "absolute", "method", "warnings")
    return {"estimated_error": {name: getattr(error, name) for name in names}}


def write_json(path: str | Path, result: Result, sections: Sequence[Any] = ()) -> None:
    """Write the table, displacements and reactions (m, N) by node id, and sections by planes and parts."""
    import json

    content = {"kratos_lite": __version__, "units": result.units, **summary(result), **_by_node(result)}
    if sections:
        content["sections"] = [_section(result.section(where, part=part)) for where, part in sections]
    try:
        text = json.dumps(content, ensure_ascii=False, allow_nan=False)
    except ValueError:
        raise SolveError(
            f"{path}: not written: some results exceed the numbers that a computer holds (1.8e308); "
            "look for loads, supports or constants in wrong units"
        ) from None
    write_whole(path, text.encode())


def _section(section: Section) -> dict[str, Any]:
    names = ("normal", "centroid", "force", "moment", "stress_force", "stress_moment")
    vectors = {name: getattr(section, name).tolist() for name in names}
    return {"where": section.where, "area": section.area, **vectors}


def _by_node(result: Result) -> dict[str, Any]:
    """Return displacements, and reactions where there are any, by node id."""
    ids = list(map(str, result.mesh.node_ids.tolist()))
    supported = np.flatnonzero((result.reactions != 0).any(axis=1))
    return {
        "displacement": dict(zip(ids, result.u.tolist(), strict=True)),
        "reaction": dict(
            zip([ids[row] for row in supported], result.reactions[supported].tolist(), strict=True)
        ),
    }


def write_table(path: str | Path, columns: Mapping[str, Numbers]) -> None:
    """Write columns (k,) by their headers, as a whole or not at all; numbers are not rounded.

    >>> path = getfixture("tmp_path") / "two.csv"
    >>> write_table(path, {"node": np.array([1, 2]), "x [m]": np.array([0.1, 1.0])})
    >>> print(path.read_text())
    node,x [m]
    1,0.1
    2,1.0
    <BLANKLINE>
    """
    check_ending(path, ".csv")
    for name, values in columns.items():
        refuse_nan(path, name, values)
    cells = [map(repr, np.asarray(values).tolist()) for values in columns.values()]
    lines = [",".join(columns), *map(",".join, zip(*cells, strict=True))]
    write_whole(path, ("\n".join(lines) + "\n").encode())
