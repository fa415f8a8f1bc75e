"""fedoo: its stress-equilibrium weak form; K solved by the common routine."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.programs.common import Array, Job, assembled

ELEMENTS = {"4N": "tet4", "8N": "hex8", "10N": "tet10", "20N": "hex20"}


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import fedoo
    job.answer["version"] = getattr(fedoo, "__version__", "")
    job.read()
    with job.phase("mesh"):
        fedoo.ModelingSpace("3D")
        mesh = fedoo.Mesh(job.points, job.cells, ELEMENTS[job.kind])
        E, nu = job.elasticity
        weak = fedoo.weakform.StressEquilibrium(fedoo.constitutivelaw.ElasticIsotrop(E, nu))

        assembly = fedoo.Assembly.create(weak, mesh)
        fedoo.problem.Linear(assembly)

    def stiffness() -> Any:
        assembly.assemble_global_mat("matrix")
        return assembly.get_global_matrix()

    n = len(job.points)
    return assembled(job, stiffness, np.arange(n)[:, None] + n * np.arange(3))
