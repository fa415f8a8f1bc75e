"""Run files in JSON: ``ProjectParameters.json`` of Kratos, and our own."""

from kratos_lite.io.project.run_file import is_in_time, read_project

__all__ = ["is_in_time", "read_project"]
