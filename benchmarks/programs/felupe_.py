"""FElupe: its linear-elastic material and solid body; K solved by the common routine."""

from __future__ import annotations

from benchmarks.programs.common import Array, Job, assembled

REGIONS = {
    "4N": ("tetra", "RegionTetra"),
    "8N": ("hexahedron", "RegionHexahedron"),
    "10N": ("tetra10", "RegionQuadraticTetra"),
    "20N": ("hexahedron20", "RegionQuadraticHexahedron"),
    "27N": ("hexahedron27", "RegionTriQuadraticHexahedron"),
}


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import felupe
    job.answer["version"] = felupe.__version__
    job.read()
    cell, region = REGIONS[job.kind]
    with job.phase("mesh"):
        mesh = felupe.Mesh(job.points, job.cells, cell)
        field = felupe.FieldContainer([felupe.Field(getattr(felupe, region)(mesh), dim=3)])
        E, nu = job.elasticity
        material = felupe.LinearElastic(E=E, nu=nu)
    return assembled(job, felupe.SolidBody(material, field).assemble.matrix)
