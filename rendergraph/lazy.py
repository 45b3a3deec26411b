"""Lazily imported names of packages (PEP 562)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import ModuleType
from typing import Any


def lazy_exports(
    package: str, names: Mapping[str, Iterable[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` for a package; `names` lists the exports of each of its modules."""
    module_of = {name: module for module, members in names.items() for name in members}

    def load(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        import importlib  # `rendergraph --help` needs no exports

        return getattr(importlib.import_module(f".{module_of[name]}", package), name)

    return load, lambda: list(module_of)


class CallableModule(ModuleType):
    """A package that can be called like the function of the same name: `rendergraph.compare(…)`."""

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        return getattr(self, self.__name__.rpartition(".")[2])(*arguments, **keywords)
