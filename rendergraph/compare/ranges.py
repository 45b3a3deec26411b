"""Ranges of an axis: `8:64:8` and `log:0.1:10:5` are values, `8:64` and `log:0.1:10` are all numbers between two."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal

MOST_VALUES = 10_000
"""Values of a range, and runs of a sweep."""
FORMS = "FIRST:LAST:STEP, log:FIRST:LAST:COUNT, or LOW:HIGH and log:LOW:HIGH for --samples"
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?"
_MOST = Decimal("1e12")
RANGE = re.compile(rf"(log:)?({_NUMBER}):({_NUMBER})(?::({_NUMBER}))?\Z")
_BEGINS = re.compile(rf"(?:log:|{_NUMBER}:)")
"""What begins like a range was meant as one."""
_WHOLE = re.compile(r"[-+]?[0-9]+\Z")


@dataclass(frozen=True)
class Span:
    """All numbers between two, both included: what samples are taken from.

    Attributes:
        low, high: the ends.
        log: equal factors are equally likely, in place of equal differences.
        whole: whole numbers only; so where both ends are written as such.
        text: as it was written.
    """

    low: float
    high: float
    log: bool
    whole: bool
    text: str

    def at(self, place: float) -> float:
        """The number at a place 0…1; of whole numbers each has a part of the same size, or as wide as on a log axis."""
        low, high = (self.low - 0.5, self.high + 0.5) if self.whole else (self.low, self.high)
        found = low * (high / low) ** place if self.log else low + (high - low) * place
        return min(max(float(math.floor(found + 0.5)), self.low), self.high) if self.whole else found

    def text_at(self, place: float, first: float, last: float) -> str:
        """The number at a place, in the fewest digits with which it stays between two places and near to itself."""
        value, low, high = self.at(place), self.at(first), self.at(last)
        if self.whole:
            return str(int(value))
        edge = 1e-6 * (high - low)  # the ends themselves are rounded
        for digits in range(3, 17):
            text = f"{value:.{digits}g}"
            if low + edge < float(text) < high - edge and abs(float(text) - value) <= (high - low) / 50:
                return text
        return repr(value)


def parse_range(text: str) -> tuple[str, ...] | Span | None:
    """The values of a range, or all between two numbers; None where the text is no range.

    Both ends are included, the last one if the steps reach it. Where all that is written is whole, so are the values;
    of a logarithmic range the two ends are asked, and its values are rounded.

    Raises:
        ValueError: it begins like a range and is none, or has no values, in words.
    """
    text = text.strip()
    found = RANGE.match(text)
    if not found:
        if _BEGINS.match(text):
            raise ValueError(f"'{text}' is no range: write {FORMS}; text with a colon stands in quotes")
        return None
    log, *written = found.groups()
    first, last, third = (Decimal(part) if part is not None else None for part in written)
    assert first is not None
    assert last is not None
    if max(abs(first), abs(last)) > _MOST:
        raise ValueError(f"'{text}': numbers end at 1e12")
    if log and min(first, last) < 1 / _MOST:
        raise ValueError(f"'{text}': a logarithmic range lies above 0, from 1e-12 on")
    if third is None:
        if first >= last:
            raise ValueError(f"'{text}': the first number is the lower one")
        whole = all(_WHOLE.match(part) for part in written[:2])
        return Span(float(first), float(last), bool(log), whole, text)
    if log:
        return _factors(text, float(first), float(last), written)
    return _steps(text, first, last, third, all(_WHOLE.match(part) for part in written))


def _steps(text: str, first: Decimal, last: Decimal, step: Decimal, whole: bool) -> tuple[str, ...]:
    """In decimals, as they are written: 0:1:0.1 has 0.3, not 0.30000000000000004."""
    if not step or (last - first) / step < 0:
        raise ValueError(f"'{text}': steps of {step} do not lead from {first} to {last}")
    count = int((last - first) / step) + 1
    _check_count(text, count)
    values = [first + number * step for number in range(count)]
    return tuple(str(int(value)) if whole else repr(float(value)) for value in values)


def _factors(text: str, first: float, last: float, written: list[str]) -> tuple[str, ...]:
    if not _WHOLE.match(written[2]) or int(written[2]) < 2:
        raise ValueError(f"'{text}': the last number is how many values there are, 2 or more")
    count = int(written[2])
    _check_count(text, count)
    values = [first * (last / first) ** (number / (count - 1)) for number in range(count)]
    values[-1] = last
    if all(_WHOLE.match(part) for part in written[:2]):
        whole = [str(math.floor(value + 0.5)) for value in values]
        if len(set(whole)) < count:
            raise ValueError(f"'{text}': there are no {count} whole numbers so; for others write {written[0]}.0")
        return tuple(whole)
    texts = [repr(value) for value in values]
    for digits in range(6, 17):
        short = [f"{value:.{digits}g}" for value in values]
        if len(set(short)) == count:
            texts = short
            break
    return tuple(texts)


def _check_count(text: str, count: int) -> None:
    if count > MOST_VALUES:
        raise ValueError(f"'{text}' makes {count} values, more than {MOST_VALUES}")
