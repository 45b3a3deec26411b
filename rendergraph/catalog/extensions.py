"""Finding what plugins add beside node types: by entry point, or in `extension.py` at the top of a plugin's folder."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from rendergraph.declare import Extension, Extensions, Source, extension_mistakes
from rendergraph.declare.blame import describe_error, source_location
from rendergraph.errors import Place, Problem, is_interruption, shown_file
from rendergraph.installed import EntryPoint
from rendergraph.stamps import record_read

GROUP = "rendergraph.extensions"
"""The entry point group; an entry's value is `package.module:NAME`."""
MODULE = "extension"
NAME = "EXTENSION"
"""The extension of a plugin's folder is `EXTENSION` in `extension.py`."""


def extensions(folders: Iterable[tuple[str, Path]], offered: Iterable[EntryPoint]) -> Extensions:
    """Return what plugins add; nothing is imported before it is asked for."""
    named, entries = tuple(folders), sorted(offered, key=lambda entry: entry.value)
    return Extensions(lambda: _sources(named, entries))


def _sources(folders: Iterable[tuple[str, Path]], offered: Iterable[EntryPoint]) -> Iterator[Source]:
    for entry in offered:
        yield _source(entry.package.name, _file(entry), entry.load, entry.value)
    for package, folder in folders:
        file = folder / f"{MODULE}.py"
        record_read(file)
        if file.is_file():
            yield _source(folder.name, file, _loader(f"{package}.{MODULE}"), f"{MODULE}.py:{NAME}")


def _loader(module: str) -> Callable[[], Any]:
    return lambda: getattr(importlib.import_module(module), NAME)


def _file(entry: EntryPoint) -> Path:
    """The file of an entry's module, found without importing more than its parent; empty if there is none."""
    try:
        spec = importlib.util.find_spec(entry.module)
    except BaseException as error:  # its parent fails to import, which loading will report
        if is_interruption(error):
            raise
        spec = None
    return Path(spec.origin) if spec is not None and spec.origin else Path()


def _source(plugin: str, file: Path, load: Callable[[], Any], value: str) -> Source:
    record_read(file)
    place = Place(shown_file(file)) if file.name else None
    try:
        found = load()
    except BaseException as error:  # whatever third-party code raises is a mistake in that code
        if is_interruption(error):
            raise
        text = f"the extension of plugin '{plugin}' ({value}) cannot be imported: {describe_error(error)}"
        where = (source_location(error, file.parent) if file.name else None) or place
        return Source(plugin, file, None, (Problem("RG494", text, where),))
    if not isinstance(found, Extension):
        text = f"'{value}' of plugin '{plugin}' is {type(found).__name__}, not an Extension"
        return Source(plugin, file, None, (Problem("RG495", text, place),))
    defined = sys.modules.get(value.partition(":")[0])
    file = file if file.name else Path(getattr(defined, "__file__", None) or "")
    mistakes = extension_mistakes(found, file.parent)
    problems = tuple(mistake.relocate(place, code="RG495", context=f"plugin '{plugin}'") for mistake in mistakes)
    return Source(plugin, file, None if mistakes else found, problems)
