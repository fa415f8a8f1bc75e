"""The five-file sets NAME.node, .elem, .cond, .prop and .init (Kratos data of 2008)."""

from kratos_lite.io.formats.elem.reader import read_elem
from kratos_lite.io.formats.elem.writer import write_elem

__all__ = ["read_elem", "write_elem"]
