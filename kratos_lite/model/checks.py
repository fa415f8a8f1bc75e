"""Checks of a model before it is solved: geometry, rules, numbers.

Each check either raises one clear error or returns warnings for the report.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, element_class
from kratos_lite.assembly.gauss_point_fields import clearly_positive, volumes
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.tables import gradients_at_nodes, tabulate
from kratos_lite.errors import MAX_PROBLEMS, InputError, MeshError, ModelError, Problems, SolveError
from kratos_lite.materials import LinearMaterial, Material
from kratos_lite.mesh import Block, Mesh
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.supports import Supports
from kratos_lite.shapes import Shape
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.tabular import UNITS, size_in_si, unit_name
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.validation import instance

SLOWEST, QUICKEST = 1.0, 2.5e4
"""Speeds of waves in m/s: jelly is above the one, diamond and graphene below the other."""
SOFTEST, STIFFEST = 1.0, 1.2e14
"""Young's moduli in Pa: a hundredth of that of the softest gels, and a hundred times that of diamond."""
LIGHTEST, HEAVIEST = 0.01, 2.26e6
"""Densities in kg/m³: a hundredth of that of aerogel, and a hundred times that of osmium."""
HEAVY, HARD = 2300.0, 1e7
"""Above this density in kg/m³ there are concrete, rock and metals, all far stiffer than this E in Pa."""
METAL, BULKY = 6e10, 1e3
"""Young's modulus in Pa of light metals, above that of concrete; volume in m³ that no part of metal has."""
REAL = (1e10, 1.2e12, 1400.0, 2.3e4), (1e5, 1e12, 100.0, 2500.0), (1e3, 1e9, 5.0, 700.0)
"""Young's moduli in Pa and densities in kg/m³, the least and the largest, of metals, ceramics, rock and fibre
composites, then of polymers, wood, rubber and soil, then of foams: the likelier first."""
FASTEST = 1.85e4
"""Speed of waves in m/s above that of diamond."""
CLEAR = {"SI": (1e10, 1.2e12), "mm N MPa t": (4e4, 4.2e5)}
"""Young's moduli from magnesium to alumina, and those that nothing has in other units."""
FOLD = 0.2
"""Fraction of the mean det J by which it may be negative at a node; two swapped nodes give 0.7 and more."""
LOADS_ON_SUPPORTS = "all loads act on fixed components, so nothing moves"
"""The warning of loads that only supports carry."""


def checked_linear_material(material: object) -> LinearMaterial:
    """Return a linear material, which bodies need; InputError if it is none."""
    return instance(checked_material(material), "a linear material", LinearMaterial, "kl.Isotropic3D(…)")


def checked_material(material: object) -> Material:
    """Return a material; InputError if it is not a material."""
    law = instance(material, "a material", Material, "kl.Isotropic3D(E=210e9, nu=0.3)")
    frozen = getattr(type(law), "__dataclass_params__", None)
    if not law.is_linear and not (frozen and frozen.frozen and hasattr(law, "density")):
        raise InputError(
            f"{type(law).__name__} must be a frozen dataclass with a density: @dataclass(frozen=True) above "
            "it, and density: float = 0.0 among its constants"
        )
    return law


def check_geometry(mesh: Mesh, formulation: str | None = None) -> list[str]:
    """Check node lists and det J of all elements, whatever their material; return warnings.

    Raises MeshError, or InputError for elements of unknown types.
    """
    elements = [element_class(mesh, block, formulation) for block in mesh.blocks]
    for block, element in zip(mesh.blocks, elements, strict=True):
        width = block.nodes.shape[1]
        if width != len(element.nodes):
            raise MeshError(
                f"block {block.name}: nodes must have shape (m, {len(element.nodes)}); "
                f"got {block.nodes.shape}"
            )
        ordered = np.sort(block.nodes, axis=1)
        for cell, place in np.argwhere(ordered[:, 1:] == ordered[:, :-1])[:1]:
            raise MeshError(
                f"{mesh.place(block, cell)} uses node {mesh.node_ids[ordered[cell, place]]} more than once; "
                f"give it {width} different nodes or use an element with fewer"
            )
    return check_jacobians(mesh, elements)


def check_jacobians(mesh: Mesh, elements: Sequence[type[KinematicLinear]]) -> list[str]:
    """Raise MeshError for elements with det J ≤ 0 at a Gauss point or clearly < 0 at a node."""
    # `elements` holds the class of each block. det J = 0 at a corner node alone (quarter-point elements) is
    # allowed and noted; so is a slight fold at a node, at most FOLD of the mean det J, which badly shaped but
    # useful elements have.
    problems = Problems(kind=MeshError)
    flat = folded = inverted = 0
    for block, element in zip(mesh.blocks, elements, strict=True):
        shape, g = element.shape, len(element.rule)
        dN = np.concatenate([tabulate(shape, element.rule)[1], gradients_at_nodes(shape)])
        doubtful = np.flatnonzero(~clearly_positive(mesh.points, block.nodes, element, dN, g))
        step = max(1, 4_000_000 // (72 * len(dN)))
        for start in range(0, len(doubtful), step):
            cells = doubtful[start : start + step]
            det = element(mesh.points[block.nodes[cells]]).determinants(dN)
            scale = np.abs(det[:, :g]).mean(axis=1, keepdims=True)
            inside, at_nodes = det[:, :g], det[:, g:] / np.where(scale > 0, scale, 1.0)
            flat += int((np.abs(at_nodes) <= 1e-10).any(axis=1).sum())
            folded += int((at_nodes < -1e-10).any(axis=1).sum())
            wrong = np.flatnonzero((inside <= 0).any(axis=1) | (at_nodes < -FOLD).any(axis=1))
            for e in wrong[:MAX_PROBLEMS]:
                problems.add(_describe_inverted(mesh, block, int(cells[e]), det[e], g, shape))
            problems.count += len(wrong[MAX_PROBLEMS:])
            inverted += int((det < 0).all(axis=1).sum())
    if 1 < inverted == problems.count:
        raise MeshError(f"{problems.messages[0]}; {inverted - 1} more elements are inverted, too")
    problems.raise_if_any()
    warnings = [f"{flat} elements have det J = 0 at a corner node (singular corner)"] if flat else []
    if folded:
        warnings.append(f"{folded} elements have det J slightly < 0 at a node: badly shaped, less accurate")
    return warnings


def _describe_inverted(mesh: Mesh, block: Block, cell: int, det: Array, g: int, shape: type[Shape]) -> str:
    worst = int(np.argmax(det <= det.min() + 1e-10 * np.abs(det).max()))  # the first of equal ones
    where = f"Gauss point {worst + 1}" if worst < g else f"its node {worst - g + 1}"
    nodes = " ".join(str(i) for i in mesh.node_ids[block.nodes[cell]])
    if (det < 0).all():
        cure = "the element is inverted; mesh.reoriented() corrects the node order"
    elif (det == 0).all():
        cure = "the element has no volume; two of its nodes may coincide"
    elif _is_curved(mesh.points[block.nodes[cell]], shape):
        cure = "its curved edges fold it; mesh finer where the surface bends, in Gmsh by "
        cure += "-setnumber Mesh.MeshSizeFromCurvature 12, or -optimize_ho"
    else:
        cure = "two of its nodes look swapped or one lies too far off"
    return (
        f"{mesh.place(block, cell)}: det J = {det[worst]:.3g} at {where} must be > 0; nodes {nodes}; {cure}"
    )


def _is_curved(X: Array, shape: type[Shape]) -> bool:
    """Return whether each edge has a node near its middle: with straight edges the element would do."""
    start, end = (X[list(nodes)] for nodes in zip(*shape.edges, strict=True))
    middle = X[shape.corners : shape.corners + len(start)]
    if len(middle) < len(start):
        return False
    bow = np.linalg.norm(middle - (start + end) / 2, axis=1)
    return bool((bow < np.linalg.norm(end - start, axis=1) / 4).all())


def check_scales(mesh: Mesh, groups: Sequence[ElementGroup]) -> Iterator[str]:
    """Warn where the numbers themselves cost accuracy: far from the origin, or a large stiffness contrast."""
    low, high = mesh.extent
    spacing = float((high - low).max()) / max(1.0, mesh.n_elements ** (1 / 3))
    loss = float(np.finfo(float).eps * np.maximum(-low, high).max()) / (spacing or np.inf)
    if loss > 1e-9:
        yield (
            f"the body lies so far from the origin that coordinates carry an error of {loss:.1e} of an "
            "element; move it to the origin"
        )
    stiff = [float(np.abs(group.material.C).max()) for group in groups]
    if stiff and max(stiff) > 1e10 * min(stiff):
        yield f"stiffnesses differ by a factor of {max(stiff) / min(stiff):.1e}; expect fewer digits"
    bulky, metal = BULKY / size_in_si("m³", mesh.units), METAL / size_in_si("Pa", mesh.units)
    if float((high - low).prod()) > bulky:
        moduli = [young_moduli(group.material)[1] for group in groups]
        stiff_ones = (g for g, E in zip(groups, moduli, strict=True) if E > metal or 1 < 1e6 * E / metal < 10)
        volume = sum(float(volumes(mesh.points, group).sum()) for group in stiff_ones)
        if volume > bulky:
            cure = "are lengths in mm (read with scale=1e-3, --scale mm, or units= where E is in MPa)?"
            yield f"{volume:.3g} m³ are as stiff as metal: {cure}"
    yield from check_wave_speeds((group.material for group in groups), mesh.units)


def check_nodes(mesh: Mesh, tied: Constraints) -> Iterator[str]:
    """Warn of nodes that no element uses, but for reference nodes, which are tied to others."""
    used = mesh.used_nodes().copy()
    used[np.append(tied.dependents, tied.independents) // 3] = True
    unused = mesh.node_ids[~used]
    if len(unused):
        shown = " ".join(map(str, unused[:5])) + (" …" if len(unused) > 5 else "")
        yield f"{len(unused)} nodes belong to no element and carry no equations: {shown}"


def check_wave_speeds(materials: Iterable[Material], units: str = "SI") -> list[str]:
    """Warn where the speed of waves sqrt(E/ρ) says that E and ρ can hardly both be in their units."""
    slowest, quickest = (speed / size_in_si("m/s", units) for speed in (SLOWEST, QUICKEST))
    speeds = {
        str(material): float(np.sqrt(young_moduli(material)[1]) / np.sqrt(material.density))
        for material in materials
        if material.density > 0
    }  # E/ρ may be too large a number
    return [
        f"the speed of waves sqrt(E/density) is {speed:.3g} m/s in {material}; solids have "
        f"{slowest:g} to {quickest:g} m/s: are E in {unit_name('Pa', units)} and the density in "
        f"{unit_name('kg/m³', units)}?"
        for material, speed in speeds.items()
        if not slowest <= speed <= quickest
    ]


def unusual_constants(materials: Iterable[Material], units: str = "SI") -> Iterator[str]:
    """Note constants far from those of all engineering materials, so that units may be wrong."""
    pascal, dense = (size_in_si(unit, units) for unit in ("Pa", "kg/m³"))
    E_unit, unit = unit_name("Pa", units), unit_name("kg/m³", units)
    for material in materials:
        low, high, density = *(pascal * E for E in young_moduli(material)), dense * material.density
        soft = high < SOFTEST * (1 - 1e-9)
        if soft or low > STIFFEST:
            yield (
                f"E of {material} is far {'below' if soft else 'above'} that of any engineering "
                f"material, from {100 / pascal:g} (gels) to {1.2e12 / pascal:g} Pa (diamond): is it in "
                f"{E_unit}?"
            )
        elif density > HEAVY and high < HARD:
            yield (
                f"{material} is as heavy as concrete, rock or metal, whose E is {1e10 / pascal:g} Pa and "
                f"more, but soft as rubber: is E in {E_unit} (steel: {210e9 / pascal:g})?"
            )
        if getattr(material, "yield_stress", 0.0) * pascal > high:
            yield f"the yield stress of {material} is larger than E: are both in {E_unit}?"
        if density > 0 and not LIGHTEST <= density <= HEAVIEST:
            yield (
                f"the density of {material} is far from that of any engineering material, {1 / dense:g} "
                f"(aerogel) to {22600 / dense:,g} kg/m³ (osmium): is it in {unit} (steel: {7850 / dense:g})?"
            )


def recognized_units(materials: Iterable[Material]) -> str | None:
    """Return the consistent set of units in which E and density of all materials are those of real ones.

    Where several sets fit, that of the likelier kinds; without any density the one in which E alone is clear.
    None where no set fits, or several alike.

    >>> from kratos_lite import Isotropic3D
    >>> recognized_units([Isotropic3D(E=30e6, nu=0.3, density=7.3e-4)])
    'in lbf psi slinch'
    """
    constants = [(young_moduli(material)[1], material.density) for material in materials]
    fits: dict[str, int] = {}
    clear = {units for units, (low, high) in CLEAR.items() if any(low <= E <= high for E, _ in constants)}
    for units in UNITS if any(density for _, density in constants) else sorted(clear):
        kinds = [_kind(size_in_si("Pa", units) * E, size_in_si("kg/m³", units) * x) for E, x in constants]
        if -1 not in kinds:
            fits[units] = sum(kinds)
    best = [units for units, kind in fits.items() if kind == min(fits.values())]
    return best[0] if len(best) == 1 else None


def _kind(E: float, density: float) -> int:
    """Return the number in REAL of the first kind with E in Pa and a density in kg/m³; -1 without any."""
    for i, (soft, stiff, light, heavy) in enumerate(REAL):
        if soft <= E <= stiff and (not density or (light <= density <= heavy and E < FASTEST**2 * density)):
            return i
    return -1


def young_moduli(material: Material) -> tuple[float, float]:
    """Return the smallest and the largest of Young's moduli along the axes, in Pa."""
    flexible = np.linalg.inv(material.C).diagonal()[:3]
    return 1 / float(flexible.max()), 1 / float(flexible.min())


def _doubted(text: str, refused: bool) -> list[str]:
    """Return a warning of a solution; SolveError where it means nothing."""
    if refused:
        raise SolveError(text)
    return [text]


def check_rounding(
    roundoff: float, loads: Array, initial: Array, reactions: Array, supports: Supports
) -> list[str]:
    """Warn where rounding of the internal forces, `roundoff` in N per node, is not small beside the loads.

    Raises SolveError where it is as large as the loads, to two digits: the solution means nothing.
    """
    size = float(max(np.abs(part).max(initial=0.0) for part in (loads, initial, reactions)))
    if supports.displaced or roundoff <= 1e-6 * size:
        return []
    return _doubted(
        f"rounding errors may reach {roundoff / size:.0e} of the loads: something hardly resists them; "
        "look for nearly free parts, spurious modes or a large stiffness contrast",
        refused=roundoff > 1e-2 * size,
    )


def work_of(u: Array, inner: Array, loads: Array, reactions: Array) -> Array:
    """Return the work (2,) in J of `inner` forces, and what loads and reactions miss to it."""
    return np.array([(u * inner).sum(), (u * (inner - loads - reactions)).sum()])


def check_energy(work: Array, rounding: float = 0.0) -> list[str]:
    """Warn where loads and reactions do another work than twice the strain energy, `work` as of `work_of`."""
    # Raises SolveError where 5 % are missing. In thin bodies rounding of K, which no residual shows, makes
    # the body stiffer or softer; strains, and what stresses do, are as exact as the displacements.
    twice, missing = np.abs(work).tolist()
    if missing <= max(1e-3 * twice, rounding):
        return []
    return _doubted(
        f"the work of the loads is {100 * missing / twice:.2g} % off twice the strain energy: the "
        "stiffness has lost its digits, as in very thin bodies; displacements are as wrong or more.  Take "
        "cells less flat (smaller in the plane, fewer layers), or a shell program for bodies this thin",
        refused=missing > 0.05 * twice,
    )


def check_attached(masses: bool, motion: object) -> list[str]:
    """Raise ModelError for added masses on material that moves through the mesh."""
    if masses and motion is not None:
        raise ModelError("added masses are for material that does not move through the mesh")
    return []


def check_loads(
    loads: Sequence[Load], groups: Sequence[ElementGroup], forces: Array, supports: Supports
) -> list[str]:
    """Warn of loads that do nothing: gravity without mass or in m/s², forces on fixed components alone."""
    size = size_in_si("m/s²", supports.mesh.units)
    weights = [load.force for load in loads if isinstance(load, Gravity) and np.shape(load.force) == (3,)]
    if size != 1 and any(9.7 < np.linalg.norm(g) < 9.9 for g in weights):
        return [f"gravity is 9.81 in m/s²; this model is in {supports.mesh.units}: give {9.81 / size:g}"]
    massless = all(g.material.density == 0 for g in groups) and not forces.any()
    if massless and any(isinstance(load, Gravity) for load in loads):
        unit = unit_name("kg/m³", supports.mesh.units)
        return [f"gravity acts on no mass: every material has density 0; give density in {unit}"]
    if forces[~supports.fixed].any() or supports.displaced:
        return []
    if forces.any():
        return [LOADS_ON_SUPPORTS]
    return ["no load acts and no displacement is prescribed, so nothing moves"]


def check_carried(mesh: Mesh, nodes: Ints, forces: Array, used: Mask) -> None:
    """Raise ModelError for forces (k, 3) on nodes (k,) that no element uses, by a mask (n,) of those used."""
    for node in nodes[~used[nodes] & (forces != 0).any(axis=1)][:1]:
        raise ModelError(
            f"node {mesh.node_ids[node]} carries a load but belongs to no element; load another node, or "
            "give it an element"
        )


def equilibrium(
    points: Array, loads: Array, reactions: Array, internal: Array, roundoff: float = 0.0
) -> tuple[float, float]:
    """Return what forces and moments miss to equilibrium, relative to the sizes of loads and reactions."""
    # The larger of the sum over all nodes and of what nodes miss one by one, beside the internal forces of
    # the stresses. Forces that are together below `roundoff` in N are rounding, and in balance.
    total = loads + reactions
    X = points - points.mean(axis=0)
    size = float(np.abs(loads).sum() + np.abs(reactions).sum())
    arm = float(np.abs(X).max(initial=0.0))
    if size <= roundoff:
        return 0.0, 0.0
    nodal = float(np.abs(total - internal).sum()) / size
    force = float(np.abs(total.sum(axis=0)).max() / size)
    M = X.T @ total
    moment = float(np.abs(M - M.T).max() / (size * arm)) if arm > 0 else 0.0
    return max(force, nodal), moment
