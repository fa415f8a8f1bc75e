"""The compiled reader of `.elem` statements gives what the patterns give, or leaves it to them."""

import numpy as np
import pytest

from kratos_lite.errors import InputError, Problems
from kratos_lite.io.formats.elem import grammar
from kratos_lite.io.formats.elem.files import FORMS
from kratos_lite.io.formats.elem.grammar import Lists, Source
from kratos_lite.io.formats.elem.sets import read_elem
from kratos_lite.native import kernels

pytestmark = pytest.mark.skipif(kernels("text") is None, reason="the kernels are not built")
ALL = [form for forms in FORMS.values() for form in forms]
ROWS = [form.row for form in ALL if form.row]
SIMPLE = [form for form in (*ALL, *ROWS) if not {"<reals>", "<rows>"} & set(form.text.split())]
SAMPLES = {
    "<id>": ["7", "12", "0", "1234567890123456789", "x"],
    "<number>": ["0", "3", "-1"],
    "<real>": ["1.5", "-2", "+.5", "5.", "1d3", "1.E-2", "1e999", "1,5", "nan", "1e", "--1"],
    "<Name>": ["Bar3D2N", "_a", "9a", "NODES"],
    "<ids>": ["1, 2", "", "3,", "4 5", "0", "1,2 ,3 , ", "6.5"],
    "<next>": [",", "", " , "],
}


@pytest.fixture
def at_any_size(monkeypatch):
    monkeypatch.setattr(grammar, "SMALL", -1)


def plain(column):
    """Return a column as numbers or names, whoever has read it."""
    if isinstance(column, Lists):
        parts = np.split(column.ids, np.cumsum(column.counts)[:-1])
        return [part.tolist() for part in parts]
    return column.tolist() if isinstance(column, np.ndarray) else list(column)


def converted(source, run):
    """Return the columns of words as numbers or names."""
    columns = []
    kinds = [word for word in run.form.text.split() if word.startswith("<") and word != "<next>"]
    for kind, column in zip(kinds, run.columns, strict=True):
        if kind == "<ids>":
            columns.append([source.integers([body], [0] * 9).tolist() if body else [] for body in column])
        elif kind == "<Name>":
            columns.append(list(column))
        else:
            columns.append(
                (source.reals if kind == "<real>" else source.integers)(column, run.starts).tolist()
            )
    return columns


@pytest.mark.parametrize("form", SIMPLE, ids=str)
def test_random_statements(tmp_path, form, at_any_size):
    rng = np.random.default_rng(5)
    taken = 0
    for _ in range(400):
        text = ""
        for _ in range(rng.integers(1, 5)):
            first = rng.random() < 0.6  # mostly right ones
            for word in form.text.split():
                choices = SAMPLES.get(word, [word, word, word, word, "="])
                text += choices[0 if first else rng.integers(len(choices))]
                text += rng.choice(["", " ", "\n", "\t "], p=[0.7, 0.1, 0.1, 0.1])
            text += rng.choice([";", "\n", " ; ;\n", ""], p=[0.6, 0.2, 0.1, 0.1])
        path = tmp_path / "a.elem"
        path.write_text(text)
        source = Source(path, Problems(), [])
        found = source._take_compiled(form, 0)
        words, end = source._take_words(form, 0)
        if found is not None:
            run, after = found
            taken += len(run.starts)
            assert (after, run.starts) == (end, words.starts), text
            if run.starts:
                assert [plain(c) for c in run.columns] == converted(source, words), text
    assert taken > 100


def write_set(folder, break_it=False):
    """Write a set with every form of statement for nodes and elements."""
    n = 300
    nodes = [f"[{i}, {i / 7!r}, {i % 5}, -1.5D-2]" for i in range(1, n + 1)]
    (folder / "a.node").write_text(
        f"NODES = NodesList([{', '.join(nodes[:200])}])\n"
        + "".join(f"NODES[{i}] = Node({i}.5, 0, 1e3);\n" for i in range(n + 1, n + 50))
        + f"NODES = NodesList([{', '.join(nodes[200:])},])\n"
    )
    elements = [f"ELEMENTS[{i}] = Bar3D2N([{i}, {i + 1}], 0);\n" for i in range(1, n)]
    (folder / "a.elem").write_text(
        "".join(elements) + "ELEMENTS = ElementsList(Bar3D3N, [[900, [1, 2, 3], 0], [901, [2, 3, 4,], 0]])"
        "ElementsGroup = Some\n"
        "ELEMENTS[9000000000000000001] = Bar3D2N([1, 9], 0)\n" + "ELEMENTS[5]!" * break_it
    )
    (folder / "a.cond").write_text("".join(f"NODES[{i}].Fix(DISPLACEMENT_X);\n" for i in range(1, 99)))
    (folder / "a.init").write_text(
        "".join(f"NODES[{i}](TEMP, 0) = {i}e-3;\nNODES[{i}](DISPLACEMENT_X, 0) = 1;" for i in range(1, 150))
    )
    return folder / "a.elem"


def said(document):
    mesh = document.mesh
    parts = ("nodes", "ids", "properties", "lines")
    blocks = [(b.name, *(getattr(b, part).tolist() for part in parts)) for b in mesh.blocks]
    data = [
        (d.variable, d.ids.tolist(), d.fixed.tolist(), d.values.tolist(), d.line) for d in document.nodal_data
    ]
    return mesh.points.tolist(), mesh.node_ids.tolist(), blocks, data, document.notes


def test_a_whole_set_is_read_the_same(tmp_path, monkeypatch):
    path = write_set(tmp_path)
    expected = said(read_elem(path))
    assert [name for name, *_ in expected[2]] == ["Bar3D2N", "Bar3D3N", "Bar3D2N"]
    monkeypatch.setattr(grammar, "SMALL", -1)
    assert said(read_elem(path)) == expected


def test_a_mistake_is_told_in_the_same_words(tmp_path, monkeypatch):
    path = write_set(tmp_path, break_it=True)
    with pytest.raises(InputError) as words:
        read_elem(path)
    monkeypatch.setattr(grammar, "SMALL", -1)
    with pytest.raises(InputError) as compiled:
        read_elem(path)
    assert str(compiled.value) == str(words.value)
    assert "a.elem:302:12: found '!'" in str(words.value)


def test_each_of_many_names_stays_itself(tmp_path, at_any_size):
    names = [f"NAME_{i}" for i in range(500)]
    names += names[::-1] + names[::7]
    path = tmp_path / "a.prop"
    path.write_text("".join(f"PROPERTIES[1][{name}] = {i};\n" for i, name in enumerate(names)))
    (run,) = Source(path, Problems(), []).scan(FORMS[".prop"])
    assert run.columns[1] == [name.encode() for name in names]
    assert run.columns[2].tolist() == list(range(len(names)))
