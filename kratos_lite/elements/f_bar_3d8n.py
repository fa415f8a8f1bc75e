"""FBar3D8N: eight-node hexahedron for large displacements with the mean change of volume of each element."""

from kratos_lite.elements.b_bar_3d8n import BBar3D8N


class FBar3D8N(BBar3D8N):
    """Eight-node hexahedron for large strains and ν → ½; for small displacements it is `BBar3D8N`.

    The law sees F̄ = (J̄ / J)^⅓ F, with J = det F and J̄ the volume of the element over that at rest.  Forces
    are derivatives of the energy at F̄, so that the tangent is symmetric where that of the law is.

    Source: Simo, Taylor & Pister, CMAME 51 (1985) 177; Moran, Ortiz & Shih, IJNME 29 (1990) 483.  De Souza
    Neto et al., Int. J. Solids Structures 33 (1996) 3277 take J̄ at the center, and K is not symmetric.
    """

    formulation = "f_bar"
    finite = True
