"""Element fields: strains, stresses and energies that follow from the displacements of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.fields import QUANTITIES, Field, GaussPoints, known
from kratos_lite.assembly.element_groups import ElementGroup, group_of_element
from kratos_lite.assembly.gauss_point_fields import at_gauss, in_order, totals
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Csr
from kratos_lite.validation import choice, short

if TYPE_CHECKING:
    from kratos_lite.assembly.nodal_extrapolation import Extrapolation
    from kratos_lite.assembly.nodal_recovery import Recovery
    from kratos_lite.mesh.locate import Located
    from kratos_lite.model.local_axes import LocalAxes
    from kratos_lite.model.ties import Coupling

PLACES = ("gauss", "element", "node", "averaged", "raw")


class ElementFields:
    """Strains and stresses of elements under displacements; they are made when requested.

    Parameters
    ----------
    mesh : of n nodes and m elements.
    groups : the elements with their materials.
    u : (n, 3) displacements in m.
    u0 : (n, 3) displacements in m without stress; none if not given.
    """

    def __init__(self, mesh: Mesh, groups: Sequence[ElementGroup], u: Array, u0: Array | None = None) -> None:
        self.mesh = mesh
        self.groups = list(groups)
        self.u = u
        u.setflags(write=False)  # strains and stresses are made of it later
        self._strained = u if u0 is None else u - u0
        self._springs: Csr | None = None  # (3n, 3n) N/m
        self._ties: Sequence[Coupling] = ()

    # ---- strains and stresses ----------------------------------------------------------------------

    def _field(self, at: str, stress: bool) -> Any:
        if not isinstance(at, str):
            raise InputError(
                f"at must be one of {', '.join(PLACES)}; values at points are those of "
                "result.at(points), such as result.at(points).stress"
            )
        place = choice(at, "at", PLACES)
        points, u = self.mesh.points, self._strained
        if place == "gauss":
            return in_order(self.groups, [at_gauss(points, g, u, stress=stress) for g in self.groups])
        if place == "raw":
            from kratos_lite.assembly.nodal_extrapolation import extrapolated

            return in_order(self.groups, [extrapolated(points, g, u, stress=stress) for g in self.groups])
        if place == "node":
            return self._nodal_stress if stress else self._recovery.nodal(u, stress=False)
        return self._averages(stress)[place == "averaged"]

    def at_located(self, located: Located, *, stress: bool = True, recovered: bool = False) -> Array:
        """Return stresses, or strains, at points of the mesh.

        Parameters
        ----------
        located : points (...) of this mesh.
        stress : stresses instead of strains.
        recovered : between those recovered at nodes instead of B u.

        Returns
        -------
        (..., 6) in Pa, strains without unit.

        Raises
        ------
        InputError
            An element class has a strain of its own, but no B-operator.
        """
        from kratos_lite.assembly.nodal_extrapolation import at_located  # as for the recovery
        from kratos_lite.assembly.nodal_recovery import recovered_at

        if recovered:
            return recovered_at(self._recovery, located, self._strained, stress=stress)
        return at_located(self.groups, located, self._strained, stress=stress)

    @cached_property
    def _recovery(self) -> Recovery:
        from kratos_lite.assembly.nodal_recovery import Recovery  # a quick start for results

        return Recovery(self.mesh, self.groups)

    def _averages(self, stress: bool, rule: Extrapolation | None = None) -> tuple[Array, Array]:
        """Return the mean over the volume of each element (m, 6) and averaged nodal values (n, 6)."""
        from kratos_lite.assembly.nodal_extrapolation import averages, extrapolation  # as for the recovery

        how = self.mesh.n_elements, stress, rule or extrapolation
        return averages(self.mesh.points, self.groups, self._strained, *how)

    def strain(self, at: str = "gauss", local: LocalAxes | None = None) -> Any:
        """Return strains in Voigt order xx yy zz xy yz zx, with engineering shear.

        Parameters
        ----------
        at : ``"gauss"`` for Gauss points; ``"element"`` for means over the volume; ``"node"`` for recovered
            values, the most accurate at nodes; ``"averaged"`` for values extrapolated to the nodes of each
            element and averaged there; ``"raw"`` for these of each element.
        local : axes of the components, at nodes and of elements: 11 22 33 12 23 31 in place of xx …

        Returns
        -------
        (m, g, 6) at Gauss points, or a list of (g, 6) where elements have different rules; (m, 6) of
        elements; (n, 6) of nodes; raw (m, k, 6) of k nodes each, or a list of (k, 6) where these differ.

        Raises
        ------
        InputError
            There is no such place.
        """
        return self.field("strain", at, local)

    def stress(self, at: str = "gauss", local: LocalAxes | None = None) -> Any:
        """Return stresses in Voigt order xx yy zz xy yz zx.

        Parameters
        ----------
        at, local : as for `strain`.

        Returns
        -------
        In Pa, shaped as by `strain`.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
        >>> bar.solve().stress("element")[:, 2].round(9).tolist()
        [5.0]
        """
        return self.field("stress", at, local)

    @cached_property
    def _nodal_stress(self) -> Array:
        return self._recovery.nodal(self._strained)

    @cached_property
    def without_prestress(self) -> ElementFields:
        """The same fields, with the stresses that the strains make."""
        if all(group.prestress is None for group in self.groups):
            return self
        groups = [replace(group, prestress=None) for group in self.groups]
        return ElementFields(self.mesh, groups, self._strained)

    @property
    def elastic(self) -> tuple[Array, Array]:
        """Recovered strains and stresses (n, 6) in Pa without prestress."""
        return self.strain("node"), self.without_prestress.stress("node")

    def stress_in(self, group: ElementGroup) -> Array:
        """Return stresses at the Gauss points of elements.

        Parameters
        ----------
        group : some of the elements of the result.

        Returns
        -------
        (m, g, 6) in Pa.
        """
        return at_gauss(self.mesh.points, group, self._strained)

    def gauss_points(self, group: ElementGroup) -> GaussPoints:
        """Return what is known at the Gauss points of elements.

        Parameters
        ----------
        group : some of the elements of the result.

        Returns
        -------
        GaussPoints
        """
        return GaussPoints(self.mesh.points, group, self.u, self._strained)

    def stress_of_material(self, row: int) -> Array:
        """Return recovered stresses at the nodes of one material, which those of its neighbors do not change.

        Parameters
        ----------
        row : of an element of this material.

        Returns
        -------
        (n, 6) in Pa, 0 at nodes that no element of this material has.
        """
        stress = np.zeros((self.mesh.n_nodes, 6))
        for region, values in self._recovery.by_region(self._strained):
            if any((group.rows == row).any() for group in region.groups):
                stress[region.nodes] = values
        return stress

    def field(self, name: str, at: str = "gauss", local: LocalAxes | None = None) -> Any:
        """Return a field by its name in the table of fields.

        Parameters
        ----------
        name : such as ``"stress"``, ``"von_mises"`` or ``"strain_energy_density"``.
        at : as for `strain`, where the field has values there.  In an element a density is the mean over its
            volume, an invariant is that of the mean stress.  Internal variables of laws have their own names,
            such as ``"plastic_strain"``; at nodes they are means of what is extrapolated from Gauss points.
        local : axes of the components of vectors and tensors, at nodes and of elements; x y z if not given.

        Returns
        -------
        Shaped as by `strain`, with as many components as the field has; (m,), (n,), … of a scalar.

        Raises
        ------
        InputError
            There is no such field or place.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 2e3)))
        >>> bar.solve().field("strain_energy_density", "element").round(9).tolist()  # σ² / 2E in J/m³
        [2.0]
        """
        fields = known(self.groups)
        field = fields[choice(name, "a field", fields)].along(local)
        if local is not None and field.kind not in ("scalar", "principal", "vector", "tensor"):
            raise InputError(f"the field {name} has no components along local axes")
        values = self._values(name, field, at)
        return values if field.local is None else field.turned(values, self._places(at))

    def _places(self, at: str) -> Array:
        """Return the nodes (n, 3) or the centers of the elements (m, 3) in m."""
        if at not in ("node", "averaged", "element"):
            raise InputError(
                f"components along local axes are of nodes and elements, at='node', 'averaged' or 'element'; "
                f"got {short(at)}; axes.stresses(values, points) takes those at other points"
            )
        if at != "element":
            return self.mesh.points
        centers = np.zeros((self.mesh.n_elements, 3))
        for group in self.groups:
            centers[group.rows] = self.mesh.points[group.nodes].mean(axis=1)
        return centers

    def _values(self, name: str, field: Field, at: str) -> Any:
        """Return the values of a field along x y z."""
        if name in ("strain", "stress") or field.of:
            tensor = self._field(at, stress=(field.of or name) == "stress")
            of = field.function if field.of else np.asarray
            return [of(t) for t in tensor] if isinstance(tensor, list) else of(tensor)
        place = choice(at, f"the place of the field {name}", field.where)
        if "gauss" not in field.where or (place == "node" and not field.sampled):
            return self.u if name == "displacement" else field.at(self)
        placed = [self.gauss_points(group) for group in self.groups]
        values = [field.at(points) for points in placed]
        if place in ("raw", "averaged", "node"):
            return self._extrapolated(values, place)
        if place == "element":
            values = [points.mean(value) for points, value in zip(placed, values, strict=True)]
        return in_order(self.groups, values)

    def _extrapolated(self, values: list[Array], place: str) -> Any:
        """Return values (m, g, ...) of the groups at nodes of elements, or averaged there."""
        from kratos_lite.assembly.nodal_extrapolation import averaged, extrapolation  # as for the recovery

        tail = values[0].shape[2:]
        flat = [value.reshape(*value.shape[:2], -1) for value in values]
        if place != "raw":
            return averaged(self.groups, flat, self.mesh.n_nodes).reshape(-1, *tail)
        raw = [extrapolation(g.element, g.rule) @ v for g, v in zip(self.groups, flat, strict=True)]
        return in_order(self.groups, [value.reshape(*value.shape[:2], *tail) for value in raw])

    def sampled_at(self, field: Field, located: Located) -> Array:
        """Return a field of Gauss points at points, extrapolated in the element that holds each.

        Parameters
        ----------
        field : that Gauss points have.
        located : points (...) of this mesh.

        Returns
        -------
        (..., parts)
        """
        from kratos_lite.assembly.nodal_extrapolation import extrapolated_at  # as for the recovery

        tail: tuple[int, ...] = ()

        def values(group: ElementGroup) -> Array:
            nonlocal tail
            value = field.at(self.gauss_points(group))
            tail = value.shape[2:]
            return value.reshape(*value.shape[:2], -1)

        flat = extrapolated_at(self.groups, located, values)
        return flat.reshape((*located.rows.shape, *tail))

    def von_mises(self, at: str = "gauss") -> Any:
        """Return von Mises stresses.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        (m, g), (m,), (n,) or (m, k) in Pa.
        """
        return self.field("von_mises", at)

    def tresca(self, at: str = "gauss") -> Any:
        """Return Tresca stresses σ1 - σ3, twice the largest shear stress.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        (m, g), (m,), (n,) or (m, k) in Pa.
        """
        return self.field("tresca", at)

    def principal_stresses(self, at: str = "gauss") -> Any:
        """Return principal stresses σ1 ≥ σ2 ≥ σ3.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        (m, g, 3), (m, 3), (n, 3) or (m, k, 3) in Pa.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, -5.0)))
        >>> (bar.solve().principal_stresses("element").round(9) + 0.0).tolist()
        [[0.0, 0.0, -5.0]]
        """
        return self.field("principal_stresses", at)

    def principal_directions(self, at: str = "gauss") -> Any:
        """Return unit vectors along the principal axes of the stress.

        They are right-handed; those of equal principal stresses are any that are orthogonal.

        Parameters
        ----------
        at : as for `strain`.

        Returns
        -------
        (..., 3, 3), rows in the order σ1 ≥ σ2 ≥ σ3.
        """
        return self.field("principal_directions", at)

    def at_integration_points(self, name: str, element: int | None = None) -> Any:
        """Return a quantity at the integration points by its name in Kratos.

        It is what ``CalculateOnIntegrationPoints`` of KinematicLinear, SmallDisplacementElement or
        TotalLagrangianElement returns.  Where strains are small, the Green-Lagrange strain is the linear one,
        and all stress measures agree.

        Parameters
        ----------
        name : one of

            - ``CAUCHY_STRESS_VECTOR``, ``PK2_STRESS_VECTOR``, ``STRESSES`` (6,), ``CAUCHY_STRESS_TENSOR``,
              ``PK2_STRESS_TENSOR`` (3, 3), ``VON_MISES_STRESS``: Pa, with the prestress;
            - ``GREEN_LAGRANGE_STRAIN_VECTOR``, ``STRAIN`` (6,), ``GREEN_LAGRANGE_STRAIN_TENSOR`` (3, 3);
            - ``DEFORMATION_GRADIENT``: F (3, 3), of small strains 1 + ε;
            - ``PLASTIC_STRAIN_VECTOR``, ``ACCUMULATED_PLASTIC_STRAIN``, ``DAMAGE``, …: the internal variables
              of the laws, those without a name in Kratos by their own;
            - ``STRAIN_ENERGY``: ½ ε:C:ε in J/m³, or the stored energy of a law that is not linear;
            - ``CONSTITUTIVE_MATRIX``: C (6, 6) in Pa, the tangent at rest;
            - ``STRAIN_INTERPOLATION_OPERATOR``: B (6, 3k) in 1/m of k nodes;
            - ``JACOBIAN``, ``JACOBIAN_0``: det J in m³, ``INTEGRATION_WEIGHT``: weight times det J in m³;
            - ``INTEGRATION_COORDINATES``, ``INTEGRATION_POINT_GLOBAL``: X (3,) in m,
              ``INTEGRATION_POINT_LOCAL``: ξ (3,), ``DISPLACEMENT``: (3,) in m.

            Vectors have the order xx yy zz xy yz xz of Kratos, strains engineering shear; strain tensors
            hold half of it.
        element : id of an element; all elements if not given.

        Returns
        -------
        (g, ...) of one element with g points, points in the order of its rule; or (m, g, ...) of all, in the
        order of the mesh; or a list of (g, ...) where elements have different rules.

        Raises
        ------
        InputError
            There is no such name.
        MeshError
            There is no such element, or several have this id.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Traction("z+", (0, 0, 5.0)))
        >>> result = bar.solve()
        >>> result.at_integration_points("CAUCHY_STRESS_VECTOR", element=2)[:, 2].round(9).tolist()
        [5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0]
        >>> weight = result.at_integration_points("INTEGRATION_WEIGHT")
        >>> energy = (result.at_integration_points("STRAIN_ENERGY") * weight).sum()
        >>> bool(abs(energy / result.energy() - 1) < 1e-12)
        True
        """
        known_here = QUANTITIES | {f.kratos: f.at for f in known(self.groups).values() if f.sampled}
        quantity = known_here[choice(name, "a quantity at integration points", known_here)]
        groups = self.groups if element is None else [group_of_element(self.mesh, self.groups, element)]
        made = [quantity(self.gauss_points(g)) for g in groups]
        return in_order(groups, made) if element is None else made[0][0]

    # ---- totals --------------------------------------------------------------------------------

    @cached_property
    def _totals(self) -> tuple[float, float, int]:
        """Strain energy in J, largest von Mises stress at a Gauss point in Pa, row of its element."""
        return totals(self.mesh.points, self.groups, self._strained)

    def totals(self) -> tuple[float, float, int]:
        """Return strain energy in J, largest von Mises stress of Gauss points in Pa, index of its element."""
        return self._totals

    def energy(self) -> float:
        """Return the strain energy ½ ∫ ε:C:ε dV in J, of the elastic strain where a temperature acts."""
        return self._totals[0]

    @cached_property
    def norm(self) -> float:
        """The energy norm √(∫ ε:C:ε dV) in √J of the strains, thermal ones among them."""
        cold = [replace(group, heating=None) for group in self.groups]
        hot = any(group.heating is not None for group in self.groups)
        energy = totals(self.mesh.points, cold, self._strained)[0] if hot else self._totals[0]
        return float(np.sqrt(2 * energy))
