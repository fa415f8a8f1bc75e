"""Run files in JSON: ``ProjectParameters.json`` of Kratos, and our own."""

from kratos_lite.io.project.run_file import read_project

__all__ = ["read_project"]
