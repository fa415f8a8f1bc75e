"""A registry imports the modules that it expects when an item of theirs is asked for, and not before."""

import sys

import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError
from kratos_lite.registry import Registry

COLORS = Registry("color")
MODULE = """
from test_registry import COLORS
class {name}: pass
COLORS.add({name!r}, {name}, aliases={aliases!r})
"""


@pytest.fixture
def colors(tmp_path, monkeypatch):
    """Give a registry that expects two modules of one class each."""
    registry = Registry("color")
    monkeypatch.setattr(sys.modules[__name__], "COLORS", registry)
    monkeypatch.setitem(sys.modules, "test_registry", sys.modules[__name__])
    monkeypatch.syspath_prepend(tmp_path)
    for name, aliases in (("Red", ["rouge"]), ("Blue", ["azure", "bleu"])):
        monkeypatch.delitem(sys.modules, f"module_of_{name}", raising=False)
        (tmp_path / f"module_of_{name}.py").write_text(MODULE.format(name=name, aliases=aliases))
        registry.expect(name, f"module_of_{name}", aliases[:1])
    yield registry
    for name in ("Red", "Blue"):
        sys.modules.pop(f"module_of_{name}", None)


def imported():
    return {name for name in ("Red", "Blue") if f"module_of_{name}" in sys.modules}


def test_names_and_expected_aliases_are_known_before_any_import(colors):
    assert list(colors) == ["Red", "Blue"]
    assert "Red" in colors
    assert "azure" in colors
    assert colors.aliases("Blue") == ["azure"]
    assert imported() == set()


@pytest.mark.parametrize(
    ("name", "asked"), [("Blue", {"Blue"}), ("azure", {"Blue"}), ("bleu", {"Red", "Blue"})]
)
def test_only_the_module_of_the_item_asked_for_is_imported_if_it_is_known(colors, name, asked):
    assert colors[name].__name__ == "Blue"
    assert imported() == asked


def test_an_unknown_name_is_refused_after_all_modules_have_been_asked_and_a_few_names_are_listed(colors):
    with pytest.raises(InputError, match=r"unknown color 'xyz'\. There are Red, Blue"):
        colors["xyz"]
    assert imported() == {"Red", "Blue"}


def test_classes_are_attributes_of_the_packages_that_register_them():
    from kratos_lite.elements import KinematicLinear3D8N
    from kratos_lite.materials import Isotropic3D

    assert (KinematicLinear3D8N, Isotropic3D) == (kl.KinematicLinear3D8N, kl.Isotropic3D)
    with pytest.raises(ImportError, match="Isotropci3D"):
        from kratos_lite.materials import Isotropci3D  # noqa: F401


def test_values_import_all_or_those_whose_names_end_alike(colors):
    assert [item.__name__ for item in colors.values("ue")] == ["Blue"]
    assert imported() == {"Blue"}
    assert [item.__name__ for item in colors.values()] == ["Red", "Blue"]


def test_own_items_stand_among_the_values_whatever_they_are_called(colors):
    own = type("Own", (), {})
    colors.add("Own", own)
    assert colors.values("ue")[-1] is own


def test_two_classes_of_one_name_are_an_error_that_names_both_files(colors):
    match = r"two classes of the color Red: one in .*module_of_Red\.py, one in .*test_registry\.py"
    with pytest.raises(InputError, match=match):
        colors.add("Red", type("Red", (), {}))
    assert colors["Red"].__module__ == "module_of_Red"


@pytest.mark.parametrize(("name", "aliases"), [("azure", ()), ("Own", ["bleu"]), ("Own", ["Blue"])])
def test_names_and_aliases_of_others_are_taken(colors, name, aliases):
    assert colors["Blue"]
    word = aliases[0] if aliases else name
    with pytest.raises(InputError, match=f"two classes of the color {word}: one in .*module_of_Blue"):
        colors.add(name, type(name, (), {}), aliases)
    assert colors[word].__name__ == "Blue"


def test_a_class_of_a_script_or_a_cell_that_is_run_twice_is_replaced(colors):
    for module in (__name__, "no_module"):
        first, second = (type("Own", (), {"__module__": module}) for _ in range(2))
        with colors.temporary():
            colors.add("Own", first)
            colors.add("Own", second)
            assert colors["Own"] is second


def test_a_class_of_a_cell_and_one_of_a_file_are_two(colors):
    colors.add("Own", type("Own", (), {}))
    with pytest.raises(InputError, match=r"one in .*test_registry\.py, one in the session \(no_module\)"):
        colors.add("Own", type("Own", (), {"__module__": "no_module"}))


def test_what_was_imported_in_between_is_not_forgotten_with_temporary_items(colors):
    with colors.temporary():
        colors.add("Own", type("Own", (), {}))
        assert colors["Red"]
    assert list(colors) == ["Red", "Blue"]
    assert colors["Red"].__name__ == "Red"
