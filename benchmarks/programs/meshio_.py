"""meshio: reads nodes and cells of the `.mdpa` file (elements get a wrong cell type, but are read)."""

from __future__ import annotations

from benchmarks.programs.common import Array, Job


def work(job: Job) -> Array | None:
    """Do the job."""
    with job.phase("import"):
        import meshio
    job.answer["version"] = meshio.__version__
    with job.phase("read"):
        meshio.read(f"{job.stem}.mdpa")
