"""The list of mutations fits the sources; ``python -m tests.mutations`` runs them."""

from tests.mutations.__main__ import stale
from tests.mutations.mutations import MUTATIONS


def test_each_text_to_change_occurs_once_and_its_tests_exist():
    assert stale() == []


def test_there_are_enough_of_them():
    assert len(set(MUTATIONS)) == len(MUTATIONS) >= 60
