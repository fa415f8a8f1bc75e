"""The page on trust names tests that exist."""

import re
from pathlib import Path

TESTS = Path(__file__).parent
PAGE = (TESTS.parent / "docs" / "about" / "trust.md").read_text()


def test_every_test_that_the_page_names_exists():
    source = "\n".join(path.read_text() for path in TESTS.rglob("*.py"))
    names = re.findall(r"`(test_\w+)`", PAGE)
    assert len(names) > 20
    assert [name for name in names if f"def {name}(" not in source] == []


def test_every_file_of_tests_that_the_page_names_exists():
    files = re.findall(r"`(?:tests/)?(?:\w+/)*(test_\w+\.py|fuzz)`", PAGE)
    assert files
    assert [name for name in files if not list(TESTS.rglob(name))] == []
