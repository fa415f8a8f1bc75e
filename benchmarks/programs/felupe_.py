"""FElupe: its linear-elastic material and solid body; K solved by the common routine."""

from __future__ import annotations

from typing import Any

from benchmarks.programs.common import Array, Job, dof_numbers, run, solve

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

    def stiffness() -> Any:
        return felupe.SolidBody(material, field).assemble.matrix()

    K = job.fastest("matrix", stiffness)
    if job.task == "assembly":
        return None
    return solve(job, K, dof_numbers(len(job.points)))


if __name__ == "__main__":
    run(work)
