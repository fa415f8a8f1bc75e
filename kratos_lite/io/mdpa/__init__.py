"""Kratos model files, `.mdpa`."""

from kratos_lite.io.mdpa.reader import read_mdpa
from kratos_lite.io.mdpa.writer import write_mdpa

__all__ = ["read_mdpa", "write_mdpa"]
