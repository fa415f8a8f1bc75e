"""The list of mutations fits the sources; ``python -m tests.mutations`` runs them."""

from pathlib import Path

import pytest

import kratos_lite
from tests.mutations.mutations import MUTATIONS

PACKAGE = Path(kratos_lite.__file__).parent


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: f"{m.file}: {m.new.strip()}")
def test_the_text_to_change_occurs_once(mutation):
    text = (PACKAGE / mutation.file).read_text()
    assert text.count(mutation.old) == 1
    assert mutation.new not in (mutation.old, "")
    for word in mutation.tests.split():
        assert (Path(__file__).parents[2] / word).exists() or not word.startswith(("tests", "kratos_lite"))


def test_there_are_enough_of_them():
    assert len(set(MUTATIONS)) == len(MUTATIONS) >= 60
