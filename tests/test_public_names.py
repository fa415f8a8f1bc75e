"""Docstrings of the public names are complete: numpydoc sections for what is taken, given back and raised."""

import ast
import inspect
import re
import textwrap
from functools import cached_property, lru_cache
from pathlib import Path

import kratos_lite as kl


def public_things():
    """Yield the classes and functions of ``kl.__all__`` and ``kl.ale``."""
    names = [(kl, name) for name in kl.__all__] + [(kl.ale, name) for name in kl.ale.__all__]
    for module, name in names:
        thing = getattr(module, name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            yield thing


@lru_cache
def signs():
    """Return the signs of classes in the reference: ``+`` shows inherited members, ``-`` none."""
    pages = (Path(__file__).parents[1] / "docs" / "reference").glob("*.md")
    return dict(re.findall(r"^(\w+) ([+-])$", "\n".join(page.read_text() for page in pages), re.MULTILINE))


def members(cls):
    """Yield the public methods and getters of a class that the reference shows."""
    for base in {"+": cls.__mro__, "-": ()}.get(signs().get(cls.__name__), [cls]):
        if not base.__module__.startswith("kratos_lite"):
            continue
        for name, member in vars(base).items():
            function = member.__func__ if isinstance(member, (classmethod, staticmethod)) else member
            getter = getattr(function, "fget", None) or getattr(function, "func", None)
            is_getter = isinstance(function, (property, cached_property))
            if not name.startswith("_") and (is_getter or inspect.isfunction(function)):
                yield base, (getter if is_getter else function), is_getter


def sections(doc):
    """Return the summary of a docstring and the text of its sections by their titles."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}$", inspect.cleandoc(doc or ""), flags=re.MULTILINE)
    return parts[0].strip(), dict(zip(parts[1::2], parts[2::2], strict=True))


def entries(text):
    """Return the names that a section lists: ``x, y : float`` lists two."""
    heads = [line.split(":")[0] for line in text.splitlines() if line[:1].strip()]
    return {name.strip(" *") for head in heads for name in head.split(",")}


def arguments(function):
    names = [p.name for p in inspect.signature(function).parameters.values()]
    return {name for name in names if name not in ("self", "cls") and not name.startswith("_")}


def raised(function):
    """Return the error classes that the body of a function raises itself."""
    if function.__code__.co_filename.startswith("<"):  # of a dataclass
        return set()
    todo = list(ast.parse(textwrap.dedent(inspect.getsource(function))).body[0].body)
    found = set()
    while todo:
        node = todo.pop()
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            continue
        if isinstance(node, ast.Raise) and node.exc is not None:
            error = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            found |= {error.id} if isinstance(error, ast.Name) and error.id[0].isupper() else set()
        todo.extend(ast.iter_child_nodes(node))
    return found


def lacks(doc, takes, raises, returns):
    """Say what a docstring lacks."""
    summary, found = sections(doc)
    documented = entries(found.get("Parameters", "") + found.get("Attributes", ""))
    if not summary:
        yield "a summary"
    yield from (f"parameter {name}" for name in sorted(takes - documented))
    if returns and not {"Returns", "Yields"} & found.keys():
        yield "Returns"
    yield from (f"Raises {name}" for name in sorted(raises - entries(found.get("Raises", ""))))


def lacks_of_class(cls):
    """Say what the docstring of a class lacks: it describes the constructor, too."""
    takes = arguments(cls) if "__init__" in vars(cls) else set(getattr(cls, "_fields", ()))
    makers = [vars(cls)[name] for name in ("__init__", "__post_init__") if name in vars(cls)]
    return list(lacks(cls.__doc__, takes, set().union(*map(raised, makers)), returns=False))


def lacks_of_function(function, is_getter=False, overrides=False):
    """Say what a docstring of a function lacks; overrides and what takes nothing need a line, and errors."""
    nothing = inspect.signature(function).return_annotation in (None, "None", "NoReturn", "Never")
    takes = set() if is_getter or overrides else arguments(function)
    return list(lacks(function.__doc__, takes, raised(function), bool(takes) and not nothing))


def all_lacks():
    """Return what is missing by the qualified name of each public class, function, method and getter."""
    found = {}
    for thing in public_things():
        if inspect.isfunction(thing):
            found[thing.__qualname__] = lacks_of_function(thing)
            continue
        found[thing.__qualname__] = lacks_of_class(thing)
        for base, function, is_getter in members(thing):
            overrides = any(function.__name__ in vars(behind) for behind in base.__mro__[1:])
            found[function.__qualname__] = lacks_of_function(function, is_getter, overrides)
    return {name: missing for name, missing in found.items() if missing}


def test_docstrings_of_public_names_are_complete():
    missing = [f"{name} lacks {', '.join(what)}" for name, what in sorted(all_lacks().items())]
    assert not missing, "\n".join(missing)
