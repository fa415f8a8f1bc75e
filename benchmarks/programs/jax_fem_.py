"""JAX-FEM: element matrices by its compiled derivative of the weak form; K solved by the common routine."""

from __future__ import annotations

from typing import Any

from benchmarks.programs.common import Array, Job, assembled

ELEMENTS = {"4N": "TET4", "8N": "HEX8", "10N": "TET10", "27N": "HEX27"}
DEGREES = {"4N": 1, "8N": 3, "10N": 2, "27N": 5}
"""Of the rules of integration; its own choice for 27N takes 6³ points."""


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import importlib.metadata

        import jax

        jax.config.update("jax_enable_x64", True)
        import jax_fem.problem
        import scipy.sparse
    jax_fem.logger.setLevel("ERROR")
    job.answer["version"] = importlib.metadata.version("jax-fem")
    job.read()
    with job.phase("mesh"):
        problem = make_problem(job, jax, jax_fem)

    def stiffness() -> Any:
        zero = jax.numpy.zeros(job.points.shape)
        problem.newton_update([zero])
        return scipy.sparse.csr_matrix((problem.V, (problem.I, problem.J)), shape=(zero.size, zero.size))

    return assembled(job, stiffness)


def make_problem(job: Job, jax: Any, jax_fem: Any) -> Any:
    """Return the problem without supports and loads."""
    E, nu = job.elasticity.tolist()
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    class Elasticity(jax_fem.problem.Problem):  # type: ignore[misc]
        def get_tensor_map(self) -> Any:
            def stress(gradient: Any) -> Any:
                strain = (gradient + gradient.T) / 2
                return lam * jax.numpy.trace(strain) * jax.numpy.eye(3) + 2 * mu * strain

            return stress

    kind = ELEMENTS[job.kind]
    mesh = jax_fem.problem.Mesh(job.points, job.cells, ele_type=kind)
    return Elasticity(mesh, vec=3, dim=3, ele_type=kind, gauss_order=DEGREES[job.kind])
