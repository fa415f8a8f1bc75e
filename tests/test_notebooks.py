"""Every tutorial and every solution ends by asserting its number; building the site runs them."""

import re
from itertools import pairwise

from pages import DOCS

SOLUTIONS = DOCS / "exercises" / "solutions"
NOTEBOOKS = sorted([*(DOCS / "tutorials").glob("[0-9]*.md"), *SOLUTIONS.glob("*.md")])


def test_the_last_code_of_each_notebook_asserts():
    for page in NOTEBOOKS:
        *_, last = re.findall(r"(?ms)^```\{code-cell\}[^\n]*\n(.*?)^```$", page.read_text(encoding="utf-8"))
        assert "assert " in last, page.name


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
