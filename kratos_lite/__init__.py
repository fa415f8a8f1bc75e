"""kratos_lite: a small, fast and exact finite-element library for solids.

The public names are listed in ``__init__.pyi`` and imported when they are first used, so that
``import kratos_lite`` loads not even numpy. The ``docs`` folder explains the library,
https://en.wikipedia.org/wiki/Finite_element_method the method.
"""

import sys

__version__ = "0.1.0"


def _homes() -> dict[str, str]:
    """Return the module of each public name; the list has lines ``from module import name as name``."""
    with open(__file__ + "i", encoding="utf-8") as stub:
        words = [line.split() for line in stub if line.startswith("from ")]
    return {name: module for _, module, _, name, *_ in words}


_HOMES = _homes()
_METHODS = {"RBE2": "model.rigid", "RBE3": "model.distribute", "MPC": "model.constrain"}
__all__ = ["__version__", *sorted(_HOMES)]  # noqa: PLE0604


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        said = f"module 'kratos_lite' has no attribute {name!r}"
        said += f"; it is {_METHODS[name]} here" if name in _METHODS else ""
        raise AttributeError(said, name=name, obj=sys.modules[__name__])  # Python names what is near
    from importlib import import_module

    if _HOMES[name] == __name__:
        return import_module(f"{__name__}.{name}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__
