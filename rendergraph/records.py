"""`dataclass` as in the standard library, made in a fifth of the time.

The standard decorator writes the source of up to seven methods for every class and compiles them one by one: 0.8 ms a
frozen class in Python 3.11, more than a hundred milliseconds at the start of every command. Here the standard library
still reads the fields, so that `fields`, `replace`, `asdict` and pattern matching do what they always do; only
`__init__` is compiled, and the other methods are functions over the names of the fields. What they answer is the same.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import MISSING, Field, FrozenInstanceError
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, order=False):
        """The standard decorator with the options that are used here."""

        def make(cls):
            explicit_hash = cls.__dict__.get("__hash__", MISSING)
            made = dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
            found = tuple(made.__dataclass_fields__.values())
            methods = {"__init__": _init(made, found, frozen), "__repr__": _repr(found)}
            if eq:
                methods |= _comparisons(found, order)
                keeps_hash = explicit_hash is not MISSING and explicit_hash is not None
                methods["__hash__"] = explicit_hash if keeps_hash else _hash(found) if frozen else None
            for name, method in methods.items():
                if name == "__hash__" or name not in cls.__dict__:
                    setattr(made, name, method)
            if frozen:
                made.__setattr__, made.__delattr__ = _refuse_to_set, _refuse_to_delete
            return made

        return make if cls is None else make(cls)


class _Made:
    def __repr__(self) -> str:
        return "<factory>"  # as signatures in the documentation show it


_MADE = _Made()


def _init(cls: type, found: tuple[Field[Any], ...], frozen: bool) -> Callable[..., None]:
    scope: dict[str, Any] = {"_set": object.__setattr__, "_made": _MADE}
    arguments, lines = [], []
    for entry in found:
        name, default = entry.name, ""
        value = name if entry.init else f"_default_{name}"
        if entry.default is not MISSING:
            scope[f"_default_{name}"] = entry.default
            default = f"=_default_{name}"
        elif entry.default_factory is not MISSING:
            scope[f"_default_{name}"] = entry.default_factory
            default = "=_made"
            value = f"_default_{name}() if {name} is _made else {name}" if entry.init else f"_default_{name}()"
        if entry.init:
            arguments.append(f"{name}{default}")
        if entry.init or default:
            lines.append(f"_set(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    exec(f"def __init__({', '.join(['self', *arguments])}):\n " + "\n ".join(lines or ["pass"]), scope)
    made: Callable[..., None] = scope["__init__"]
    made.__qualname__ = f"{cls.__qualname__}.__init__"
    made.__module__ = cls.__module__
    made.__annotations__ = {entry.name: entry.type for entry in found if entry.init} | {"return": None}
    return made


def _repr(found: tuple[Field[Any], ...]) -> Callable[[Any], str]:
    names = [entry.name for entry in found if entry.repr]

    def __repr__(self: Any) -> str:
        values = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({values})"

    return __repr__


def _values(found: tuple[Field[Any], ...]) -> Callable[[Any], Any]:
    """The values that are compared; the bare one where there is only one."""
    names = [entry.name for entry in found if entry.compare]
    return attrgetter(*names) if names else lambda self: ()


def _comparisons(found: tuple[Field[Any], ...], order: bool) -> dict[str, Callable[[Any, Any], Any]]:
    values = _values(found)

    def __eq__(self: Any, other: Any) -> Any:
        return values(self) == values(other) if type(other) is type(self) else NotImplemented

    def __lt__(self: Any, other: Any) -> Any:
        return values(self) < values(other) if type(other) is type(self) else NotImplemented

    def __le__(self: Any, other: Any) -> Any:
        return values(self) <= values(other) if type(other) is type(self) else NotImplemented

    return {"__eq__": __eq__, "__lt__": __lt__, "__le__": __le__} if order else {"__eq__": __eq__}


def _hash(found: tuple[Field[Any], ...]) -> Callable[[Any], int]:
    values = _values(found)
    return lambda self: hash(values(self))


def _refuse_to_set(self: object, name: str, value: object) -> NoReturn:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: object, name: str) -> NoReturn:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


__all__ = ["dataclass"]
