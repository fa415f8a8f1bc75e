"""The structure of the package: floors, start-up cost, public names, links."""

import ast
import subprocess
import sys
from functools import lru_cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
import structure
from structure import FLOORS

import kratos_lite

PACKAGE = Path(kratos_lite.__file__).parent


def floor(module):
    """Return number and name of the floor entry that a module belongs to."""
    for number, names in enumerate(FLOORS):
        for name in names:
            if module == name or module.startswith(name + "."):
                return number, name
    pytest.fail(f"{module} has no floor; give it one in docs/structure.py and docs/about/architecture.md")


MODULES = list(structure.modules())
NAMES = {name for name, _ in MODULES}


def imports(path):
    return structure.imports(path, NAMES)


def test_imports_are_written_in_full():
    """Neither relative nor ``import kratos_lite.…``, which the other tests would not see."""
    for _, path in MODULES:
        for node in structure.statements(path):
            assert not getattr(node, "level", 0), f"{path.name}: relative import"
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith("kratos_lite.") for alias in node.names)


def test_imports_point_to_floors_below():
    up = []
    for module, path in MODULES:
        own, name = floor(module)
        for target in imports(path):
            below, target_name = floor(target)
            if not (below < own or target_name == name or below == own == 0):
                up.append(f"{module} imports {target}")
    assert up == []


def test_no_files_import_each_other():
    TopologicalSorter({name: set(imports(path)) - {name} for name, path in MODULES}).prepare()


def test_the_picture_of_the_structure_is_current():
    message = "run python docs/structure.py"
    assert structure.PICTURE.read_text(encoding="utf-8") == structure.picture(), message


def test_few_floors_and_few_modules_at_the_root():
    root = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert len(root) <= 8, sorted(root)
    assert len(FLOORS) <= 13


@pytest.mark.parametrize("package", ["pyamg", "meshio", "matplotlib"])
def test_heavy_packages_appear_in_one_file_each(package):
    words = (f"import {package}", f"from {package}")
    assert sum(any(word in path.read_text() for word in words) for _, path in MODULES) == 1


@lru_cache
def loaded(code):
    """Return the modules loaded by a fresh interpreter that runs `code`."""
    run = f"import sys\n{code}\nprint(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, check=True)
    return frozenset(out.stdout.split())


def test_import_loads_not_even_numpy():
    assert not {"numpy", "scipy", "pyamg", "meshio"} & loaded("import kratos_lite")


def small_scene(cells, element):
    """Return the modules loaded by the solution of a box."""
    return loaded(
        "import kratos_lite as kl\n"
        f"mesh = kl.box(cells=({cells},) * 3, element={element!r})\n"
        "model = kl.Model(mesh, kl.Isotropic3D(1.0, 0.3, 1.0))\n"
        "model.fix('z-')\nmodel.add(kl.Gravity((0, 0, -1)))\nmodel.solve()"
    )


@pytest.mark.parametrize(("cells", "element"), [(1, "Element3D8N"), (3, "Element3D8N"), (2, "Element3D27N")])
def test_small_scene_loads_nothing_heavy(cells, element):
    heavy = {"scipy", "pyamg", "meshio", "matplotlib"}
    heavy |= {f"numpy.{name}" for name in ("ma", "polynomial", "random")}
    assert not heavy & small_scene(cells, element) - loaded("import numpy")


def test_a_scene_loads_its_own_element_and_family_of_shapes_alone():
    names = small_scene(1, "KinematicLinear3D8N")
    assert [name for name in names if "_3d" in name] == ["kratos_lite.elements.kinematic_linear_3d8n"]
    families = ("hexahedra", "pyramids", "tetrahedra", "wedges")
    assert [name for name in families if f"kratos_lite.shapes.{name}" in names] == ["hexahedra"]


def test_one_element_loads_nothing_of_what_larger_models_and_results_need():
    larger = ("mesh.hanging", "mesh.refined_mesh", "mesh.locate", "mesh.refinement", "model.loads.surface")
    larger += ("solvers.multigrid", "solvers.coarse_level", "solvers.dilatation", "analysis.error_estimate")
    names = small_scene(1, "Element3D8N") - loaded("import numpy")
    assert not {"html", "pathlib", "numpy.typing", *(f"kratos_lite.{name}" for name in larger)} & names


SOLVED_AT_REST = {
    "kl": "import kratos_lite as kl\nkl.read({cube!r}).solve()",
    "cli": "from kratos_lite.cli import main\nmain(['solve', {cube!r}, '--quiet'])",
}


@pytest.mark.parametrize("code", SOLVED_AT_REST.values(), ids=SOLVED_AT_REST)
def test_statics_loads_no_module_of_other_analyses(code):
    names = loaded(code.format(cube=str(PACKAGE.parent / "examples" / "gravity_cube.mdpa")))
    others = ("ale", "bodies", "analysis.integrators", "analysis.modal", "analysis.transient")
    assert not {name for name in names for other in others if name.startswith(f"kratos_lite.{other}")}


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
    with pytest.raises(AttributeError, match=r"no attribute 'RBE3'; it is model\.distribute here"):
        kratos_lite.RBE3  # noqa: B018


@pytest.mark.parametrize("name", ["elements", "materials"])
def test_a_link_at_the_root_shows_its_package_and_tools_read_it_once(name):
    link = PACKAGE.parent / name
    if not link.is_symlink():
        pytest.skip("not a checkout: links are not packed")
    assert link.readlink() == Path("kratos_lite", name)
    pytest.importorskip("ruff")
    words = [sys.executable, "-m", "ruff", "check", "--show-files", PACKAGE.parent]
    seen = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
    assert str(PACKAGE / name / "__init__.py") in seen
    assert str(link / "__init__.py") not in seen
    assert f"prune {name}" in (PACKAGE.parent / "MANIFEST.in").read_text().splitlines()
