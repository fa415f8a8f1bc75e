"""Rule: points and weights on a reference cell, with the degree that they integrate exactly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from kratos_lite.typing import Array
from kratos_lite.validation import whole_number


@dataclass(frozen=True, eq=False)
class Rule:
    """A quadrature rule: sum of weights · f(points) is exact for polynomials up to `degree`.

    Attributes
    ----------
    points : (g, d) float, Gauss points xi in the reference cell.
    weights : (g,) float, weights gamma; they sum to the volume of the reference cell.
    degree : total degree of the polynomials that are integrated exactly.
    name : where the rule comes from.

    Examples
    --------
    >>> from kratos_lite.quadrature import hexahedron
    >>> sum(gamma for xi, gamma in hexahedron(degree=3))
    8.0
    >>> hexahedron(degree=1)[0]
    (array([0., 0., 0.]), 8.0)
    """

    points: Array
    weights: Array
    degree: int
    name: str

    def __post_init__(self) -> None:
        for array in (self.points, self.weights):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.weights)

    def __iter__(self) -> Iterator[tuple[Array, float]]:
        return iter(zip(self.points, self.weights.tolist(), strict=True))

    def __getitem__(self, g: int) -> tuple[Array, float]:
        """Return point (d,) and weight of number g; raise InputError for a number without a point."""
        g = whole_number(g, "the number of a Gauss point", least=0, most=len(self) - 1)
        return self.points[g], float(self.weights[g])

    def __repr__(self) -> str:
        return f"Rule({self.name}: {len(self)} points, degree {self.degree})"
