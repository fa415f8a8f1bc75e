"""Every tutorial and every solution of an exercise runs without Jupyter, and ends by asserting its number."""

import re
from itertools import pairwise

import pytest
from pages import DOCS, run_scripts, text_of

SOLUTIONS = DOCS / "exercises" / "solutions"
NOTEBOOKS = sorted([*(DOCS / "tutorials").glob("[0-9]*.md"), *SOLUTIONS.glob("*.md")])


def cells(page):
    """Return the code of a notebook, cell by cell."""
    return re.findall(r"(?ms)^```\{code-cell\}[^\n]*\n(.*?)^```$", text_of(page.relative_to(DOCS).as_posix()))


@pytest.mark.parametrize("folder", [DOCS / "tutorials", SOLUTIONS], ids=lambda folder: folder.name)
def test_notebooks_run_and_reach_their_numbers(folder, tmp_path):
    pytest.importorskip("matplotlib")
    pages = {page.name: cells(page) for page in NOTEBOOKS if page.parent == folder}
    assert all("assert " in code[-1] for code in pages.values())
    data = [file for file in folder.iterdir() if file.suffix in (".msh", ".mdpa")]
    run_scripts(tmp_path, {name: "\n".join(code) for name, code in pages.items()}, dict.fromkeys(pages, data))


def test_there_are_eleven_tutorials_and_each_leads_to_the_next():
    tutorials = [page for page in NOTEBOOKS if page.parent != SOLUTIONS]
    assert len(tutorials) == 11
    for page, following in pairwise(tutorials):
        assert f"({following.name})" in page.read_text()


def test_each_exercise_states_a_number_and_a_level_and_has_a_solution():
    text = (DOCS / "exercises" / "index.md").read_text()
    exercises = re.split(r"^### ", text, flags=re.MULTILINE)[1:]
    linked = [re.findall(r"\(solutions/(.*?\.md)\)", exercise) for exercise in exercises]
    assert linked == [[page.name] for page in sorted(SOLUTIONS.glob("*.md"))]
    for number, exercise in enumerate(exercises, 1):
        title, question = exercise.split("\n", 1)
        assert re.fullmatch(rf"{number}\. .* \((beginner|intermediate|advanced)\)", title)
        assert re.search(r"\*\*[^*]*\d[^*]*\*\*", question), title
