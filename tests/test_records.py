"""Our `dataclass` answers what the standard library's does."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from dataclasses import FrozenInstanceError, field
from typing import Any

import pytest

from rendergraph.records import dataclass

KINDS: list[dict[str, bool]] = [
    {}, {"frozen": True}, {"eq": False}, {"frozen": True, "eq": False}, {"frozen": True, "order": True},
]  # fmt: skip


def pair(**kind: bool) -> tuple[Any, Any]:
    """The same class made by the standard decorator and by ours."""
    made = []
    decorators: list[Any] = [dataclasses.dataclass, dataclass]
    for decorate in decorators:

        class Base:
            """Something."""

            number: int
            word: str = "w"
            many: list[int] = field(default_factory=list)
            hidden: int = field(default=3, compare=False, repr=False)
            computed: int = field(init=False, default=4)

            def __post_init__(self) -> None:
                object.__setattr__(self, "computed", self.number + 1)

        made.append(decorate(**kind)(Base))
    return made[0], made[1]


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_instances_answer_alike(kind: dict[str, bool]) -> None:
    theirs, ours = pair(**kind)
    one, other = theirs(1, many=[2], hidden=9), ours(1, many=[2], hidden=9)
    assert vars(one) == vars(other)
    assert repr(one) == repr(other)
    for change in ({}, {"hidden": 1}, {"number": 2}, {"word": "v"}):
        assert (one == dataclasses.replace(one, **change)) == (other == dataclasses.replace(other, **change))
    assert other != one
    assert dataclasses.asdict(one) == dataclasses.asdict(other)
    assert [entry.name for entry in dataclasses.fields(one)] == [entry.name for entry in dataclasses.fields(other)]
    assert copy.deepcopy(other).many == [2]
    assert str(inspect.signature(theirs)) == str(inspect.signature(ours))
    assert theirs.__match_args__ == ours.__match_args__
    assert ours(1).many is not ours(1).many
    for wrong in ({}, {"number": 1, "computed": 2}):
        for cls in (theirs, ours):
            with pytest.raises(TypeError, match=r"__init__\(\) (missing|got an unexpected)"):
                cls(**wrong)


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_hashes_and_changes_are_allowed_alike(kind: dict[str, bool]) -> None:
    for cls in pair(**kind):
        item = cls(1, many=())
        if kind.get("frozen"):
            changes: list[Any] = [lambda item: setattr(item, "number", 2), lambda item: delattr(item, "number")]
            for change in changes:
                with pytest.raises(FrozenInstanceError, match="field 'number'"):
                    change(item)
        else:
            item.number = 2
        if kind.get("eq", True) and not kind.get("frozen"):
            with pytest.raises(TypeError, match="unhashable"):
                hash(item)
        else:
            assert (hash(item) == hash(cls(1, many=()))) == kind.get("eq", True)


def test_order_is_that_of_the_fields() -> None:
    for cls in pair(frozen=True, order=True):
        items = [cls(2, "a"), cls(1, "b"), cls(1, "a")]
        assert sorted(items) == [items[2], items[1], items[0]]
        assert max(items) is items[0]
        assert cls(1) <= cls(1)
        assert cls(1) >= cls(1)
        with pytest.raises(TypeError, match="not supported"):
            _ = items[0] < 1


@dataclass(frozen=True)
class Parent:
    first: int = 1


@dataclass(frozen=True)
class Child(Parent):
    second: int = 2

    def __repr__(self) -> str:
        return "mine"

    def __hash__(self) -> int:
        return 7


def test_inheritance_own_methods_and_pickles() -> None:
    assert Child(5) == Child(5, 2)
    assert Child() != Parent()
    assert (repr(Child()), hash(Child())) == ("mine", 7)
    assert pickle.loads(pickle.dumps(Child(3))) == Child(3)
