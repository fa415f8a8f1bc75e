"""The line of progress: in a terminal, in a notebook, and nowhere else."""

import copy
import pickle
import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest

import kratos_lite as kl
from kratos_lite.view import progress
from kratos_lite.view.progress import SWITCH, Line, watched

LONG = 60.0
"""Seconds after which a test that waits has failed."""


def test_a_line_moves_while_nobody_calls_and_is_wiped_at_the_end():
    texts, thrice = [], threading.Event()

    def write(text):
        texts.append(text)
        if len(texts) == 3:
            thrice.set()

    with Line(write, "read", patience=0.01, every=0.01) as line:
        assert thrice.wait(LONG)
        line("solve", 0.5)
    assert texts[0].split()[0] == "read"
    assert texts[-1] == ""
    line("late", 1.0)
    assert texts[-1] == ""


def test_what_ends_before_the_patience_shows_nothing():
    texts = []
    with Line(texts.append, "read", patience=LONG):
        pass
    assert texts == []


def test_other_output_has_the_line_for_itself():
    texts = []
    with Line(texts.append, "read", patience=0.0) as line:
        line("verify", 0.25)
        assert texts[-1].split()[:2] == ["verify", "25%"]
        with line.hidden():
            assert texts[-1] == ""
            count = len(texts)
            assert len(texts) == count


def test_a_display_that_is_gone_stops_nothing():
    def write(text):
        raise BrokenPipeError

    with Line(write, patience=0.0) as line:
        line("solve", 0.1)


def test_a_result_that_is_copied_or_pickled_keeps_no_line():
    with Line(print, patience=LONG) as line:
        assert pickle.loads(pickle.dumps([line])) == [None]
        assert copy.deepcopy([line]) == [None]


@pytest.fixture
def notebook(monkeypatch):
    """Return the texts that a notebook shows: one list for each line."""
    cells = []

    def display(data, raw, display_id):
        assert raw
        assert display_id
        cells.append([data["text/plain"]])
        return SimpleNamespace(update=lambda data, raw: cells[-1].append(data["text/plain"]))

    shell = SimpleNamespace(kernel=object())
    ipython = SimpleNamespace(get_ipython=lambda: shell, display=SimpleNamespace(display=display))
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", ipython.display)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress.Line.__init__, "__defaults__", ("", 0.0, progress.EVERY))
    monkeypatch.delenv(SWITCH, raising=False)
    return SimpleNamespace(cells=cells, shell=shell)


def bar():
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    model.fix("x-")
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    return model


def phases(cell):
    return list(dict.fromkeys(text.split()[0] for text in cell if text))


def test_a_notebook_shows_the_phases_of_a_solution_in_one_line_that_vanishes(notebook):
    bar().solve()
    (cell,) = notebook.cells
    assert {"check", "assemble", "solve"} <= set(phases(cell))
    assert cell[-1] == ""


def test_a_notebook_shows_modes_states_and_files(notebook, tmp_path):
    model = bar()
    model.modes(2)
    assert "modes" in phases(notebook.cells[-1])
    list(kl.integrate(model.transient(), dt=1e-4, steps=3))
    assert phases(notebook.cells[-1]) == ["integrate"]
    kl.run(kl.Case(model))
    assert len(notebook.cells) == 3
    assert all(cell[-1] == "" for cell in notebook.cells)


def test_a_progress_of_ones_own_or_the_switch_shows_nothing_else(notebook, monkeypatch):
    mine = []
    bar().solve(progress=lambda phase, share: mine.append(phase))
    assert "solve" in mine
    monkeypatch.setenv(SWITCH, "off")
    bar().solve()
    assert notebook.cells == []


def test_ipython_in_a_terminal_shows_a_line_there(notebook, monkeypatch):
    notebook.shell.kernel = None
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with watched(None, "read") as line:
        assert line is not None
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False, raising=False)
    with watched(None, "read") as line:
        assert line is None


def test_a_script_shows_nothing_and_imports_nothing():
    code = (
        "import sys\nfrom kratos_lite.view.progress import watched\n"
        "with watched(None, 'read') as line:\n    assert line is None\n"
        "assert not {'IPython', 'threading'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
