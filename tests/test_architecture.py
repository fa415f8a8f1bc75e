"""The structure of the package: floors, start-up cost, public names, style."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import kratos_lite

PACKAGE = Path(kratos_lite.__file__).parent
FLOORS = [
    {"errors", "typing", "validation", "registry", "voigt", "time_series"},
    {"native", "shapes", "quadrature"},
    {"elements", "materials"},
    {"mesh"},
    {"assembly", "view"},
    {"solvers"},
    {"model"},
    {"ale", "bodies"},
    {"analysis"},
    {"io", "testing"},
    {"cli"},
    {"__main__"},
]
"""Each module (or package) imports only from floors above it in this list."""


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
        if parts[-1] == "__init__":
            parts.pop()
        if parts:
            yield ".".join(parts), path


def floor(module):
    """Return number and name of the floor entry that a module belongs to."""
    for number, names in enumerate(FLOORS):
        for name in names:
            if module == name or module.startswith(name + "."):
                return number, name
    pytest.fail(f"{module} has no floor; give it one in FLOORS and in docs/architecture.md")


def imports(path):
    """Yield the modules of the package that a file imports at run time, wherever the import stands."""
    tree = ast.parse(path.read_text())
    typing_only = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if node in typing_only:
            continue
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: relative import"
            if node.module and node.module.startswith("kratos_lite."):
                yield node.module.removeprefix("kratos_lite.")
            elif node.module == "kratos_lite":
                yield from (alias.name for alias in node.names if alias.name != "__version__")
        elif isinstance(node, ast.Import):
            assert not any(alias.name.startswith("kratos_lite.") for alias in node.names)


MODULES = list(modules())


@pytest.mark.parametrize(("module", "path"), MODULES, ids=[name for name, _ in MODULES])
def test_imports_point_to_floors_below(module, path):
    own, name = floor(module)
    for target in imports(path):
        below, target_name = floor(target)
        assert below < own or target_name == name or below == own == 0, f"{module} imports {target}"


@pytest.mark.parametrize("package", ["pyamg", "meshio", "matplotlib"])
def test_heavy_packages_appear_in_one_file_each(package):
    users = [
        name
        for name, path in MODULES
        if f"import {package}" in path.read_text() or f"from {package}" in path.read_text()
    ]
    assert len(users) == 1


def loaded(code):
    """Return the modules loaded by a fresh interpreter that runs `code`."""
    run = f"import sys\n{code}\nprint(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, check=True)
    return set(out.stdout.split())


def test_import_loads_not_even_numpy():
    assert not {"numpy", "scipy", "pyamg", "meshio"} & loaded("import kratos_lite")


def test_small_scene_loads_nothing_heavy():
    code = (
        "import kratos_lite as kl\n"
        "model = kl.Model(kl.box(), kl.Isotropic3D(1.0, 0.3, 1.0))\n"
        "model.fix('z-')\nmodel.add(kl.Gravity((0, 0, -1)))\nmodel.solve()"
    )
    assert not {"scipy", "pyamg", "meshio", "matplotlib"} & loaded(code)


def test_public_names_exist_and_are_documented():
    for name in kratos_lite.__all__:
        thing = getattr(kratos_lite, name)
        assert name.startswith("__") or thing.__doc__, name


def test_dir_shows_the_public_names_and_nothing_else():
    assert sorted(kratos_lite.__all__) == dir(kratos_lite)
    lines = map(str.split, (PACKAGE / "__init__.pyi").read_text().splitlines())
    listed = [(words[3], words[5]) for words in lines if words[:1] == ["from"]]
    assert sorted(["__version__", *(name for name, _ in listed)]) == dir(kratos_lite)  # each once
    assert all(name == alias for name, alias in listed)


def test_unknown_public_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Modell'"):
        kratos_lite.Modell  # noqa: B018


@pytest.mark.parametrize(
    "command",
    [["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"]],
    ids=["ruff", "format", "mypy"],
)
def test_style(command):
    pytest.importorskip(command[0])
    words = [sys.executable, "-m", *command]
    run = subprocess.run(words, cwd=PACKAGE.parent, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
