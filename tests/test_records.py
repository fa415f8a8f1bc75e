"""Records behave as dataclasses with the same fields do."""

import copy
import dataclasses
import inspect
import pickle
from typing import ClassVar

import pytest

from kratos_lite.records import field, names_of, record, replace


def pair(**options):
    """Return the same class as a record and as a dataclass."""
    kinds = []
    for make, default in ((record, field), (dataclasses.dataclass, dataclasses.field)):

        @make(**options)
        class Spring:
            """A spring."""

            stiffness: "float"
            length: "float" = 1.0
            marks: "list" = default(default_factory=list)
            known: "ClassVar[int]" = 3

        kinds.append(Spring)
    return kinds


@record(frozen=True)
class Base:
    """A record of its own, and one that others derive from."""

    a: int
    b: int = 2


OPTIONS = [{}, {"eq": False}, {"frozen": True}, {"frozen": True, "eq": False}]


@pytest.mark.parametrize("options", OPTIONS)
def test_objects_are_made_shown_compared_and_hashed_alike(options):
    ours, theirs = pair(**options)
    found = []
    for kind in (ours, theirs):
        one, same, other = kind(2.0), kind(stiffness=2.0, length=1.0), kind(2.0, length=3.0)
        assert one.marks is not same.marks
        equal, hashable = (one == same, one == other), kind.__hash__ is not None
        found.append((repr(one).split("<locals>.")[1], vars(one), equal, one != same, one == 1, hashable))
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("args", "kwargs"), [((), {}), ((1, 2, [], 4), {}), ((1,), {"stiffness": 2}), ((1,), {"width": 2})]
)
def test_wrong_arguments_are_refused_in_the_same_words(args, kwargs):
    messages = []
    for kind in pair():
        with pytest.raises(TypeError) as error:
            kind(*args, **kwargs)
        messages.append(str(error.value))
    assert messages[0] == messages[1]


def test_frozen_ones_do_not_change_but_what_a_subclass_adds_may():
    class Open(Base):
        """No record itself."""

    for change in (lambda: setattr(Base(1), "a", 2), lambda: delattr(Base(1), "a")):
        with pytest.raises(dataclasses.FrozenInstanceError, match="field 'a'"):
            change()
    with pytest.raises(dataclasses.FrozenInstanceError):
        Open(1).b = 3
    item = Open(1)
    item.c = 3
    del item.c
    with pytest.raises(dataclasses.FrozenInstanceError):
        Base(1).c = 3


def test_the_fields_of_a_base_come_first_and_own_methods_stay():
    @record(frozen=True)
    class More(Base):
        b: int = 5
        c: int = 7

        def __repr__(self):
            return "mine"

    assert (More(1).a, More(1).b, More(1).c, repr(More(1))) == (1, 5, 7, "mine")
    assert names_of(More) == ("a", "b", "c")


def test_checks_run_after_the_fields_are_set():
    @record
    class Checked:
        a: int

        def __post_init__(self):
            self.double = 2 * self.a

    assert Checked(2).double == 4


def test_copies_and_replacement():
    item = Base(1, 3)
    assert replace(item, b=4) == dataclasses.replace(item, b=4) == Base(1, 4)
    assert copy.deepcopy(item) == item == pickle.loads(pickle.dumps(item))


def test_others_see_a_dataclass():
    kind, _ = pair(frozen=True)
    assert str(inspect.signature(kind)).startswith("(stiffness: 'float', length: 'float' = 1.0,")
    kind, _ = pair(frozen=True)
    item = kind(1.0)
    assert dataclasses.asdict(item) == {"stiffness": 1.0, "length": 1.0, "marks": []}
    assert [f.name for f in dataclasses.fields(kind)] == ["stiffness", "length", "marks"]
    assert item == kind(1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        item.length = 2.0


def test_a_dataclass_may_derive_from_a_record():
    @dataclasses.dataclass(frozen=True)
    class More(Base):
        c: int = 7
        known: ClassVar[int] = 3

    assert More(1, c=4) == More(1, 2, 4)
    assert names_of(More) == ("a", "b", "c")
    assert replace(More(1), c=9).c == 9
    match Base(1, 8):
        case Base(1, b):
            assert b == 8
