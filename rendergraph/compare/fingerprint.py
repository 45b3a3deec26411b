"""Fingerprints of everything that a picture depends on besides its pipeline file: shaders, node code, scene files."""

from __future__ import annotations

import ast
import hashlib
import inspect
import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import partial
from importlib.machinery import ModuleSpec
from importlib.util import resolve_name
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.catalog.catalog import NOTEBOOK
from rendergraph.errors import InputError
from rendergraph.farm.bundle import file_sha256
from rendergraph.installed import module_spec
from rendergraph.program import TextSources, stage_texts, text_key
from rendergraph.stamps import FileCache, record_read
from rendergraph.steps import Step
from rendergraph.version import __version__

if TYPE_CHECKING:
    from rendergraph.link import Graph
    from rendergraph.session.values import Expanded, Planned

_BUILTIN = "rendergraph.nodes"
_TEXTS: FileCache[str] = FileCache()
_DIGESTS: FileCache[str] = FileCache(4096)
_IMPORTS: FileCache[list[str]] = FileCache(4096)


def run_key(planned: Planned, frame: int, reference: str) -> str:
    """Return the SHA-256 of everything that decides a run's picture and figures, `reference` being its reference's."""
    linked = planned.linked
    files = [str(linked.spec.scene), sources_digest(planned)]
    spec = linked.spec.to_yaml(origins=False)
    size = linked.graph.size
    parts = [__version__, spec, files, linked.selection.view_fields, size, frame, reference, *_metrics(planned)]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def worker_digest(planned: Planned) -> str:
    """Return what must be the same on a worker, besides the resolved file."""
    return f"{sources_digest(planned)} {' '.join(_metrics(planned))}"


def _metrics(planned: Planned) -> list[str]:
    return sorted(metric.name for metric in planned.linked.catalog.extensions.metrics())


def sources_digest(expanded: Expanded) -> str:
    """Return the SHA-256 of everything that a pipeline depends on and its resolved file does not contain.

    Shaders count as they reach the driver, without comments; of Python code, the nodes' modules and what they import
    from their own package; of the scene, every file that was read. The version stands for the framework's own code.
    """
    files = (file_digest(path) for path in sorted(map(Path, expanded.linked.scene.files)))
    return _texts_digest((*_shader_texts(expanded), *_code(expanded.linked.graph), *files))


def _texts_digest(texts: Iterable[str]) -> str:
    """Return the SHA-256 of the digests of texts, so that their boundaries count."""
    return hashlib.sha256(b"".join(hashlib.sha256(text.encode()).digest() for text in texts)).hexdigest()


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content, empty if it cannot be read."""
    return _DIGESTS.get(path, partial(_read_digest, path))


def _read_digest(path: Path) -> str:
    record_read(path)
    try:
        return file_sha256(path)
    except OSError:
        return ""


def _shader_texts(expanded: Expanded) -> Iterator[str]:
    expansion = expanded.expansion
    types = {node.id: node.type for node in expanded.linked.graph.nodes}
    sources = TextSources(types, expansion.resources, expansion.views)
    for step in expansion.steps:
        try:
            yield _TEXTS.get(text_key(step, sources), partial(_stages_digest, step, sources))
        except InputError as error:  # reported at its place when the run is rendered
            yield str(error)


def _stages_digest(step: Step, sources: TextSources) -> str:
    return _texts_digest(text.text for text in stage_texts(step, sources).values())


def _code(graph: Graph) -> Iterator[str]:
    seen: set[str] = set()
    for node in graph.nodes:
        if node.type.is_shader:
            yield file_digest(node.type.file)  # its header's declarations
        else:
            yield from _module_digests(type(node.node).__module__, seen)
            if node.type.plugin == NOTEBOOK:  # a module without a file
                with suppress(OSError, TypeError):
                    yield inspect.getsource(type(node.node))


def _module_digests(name: str, seen: set[str]) -> Iterator[str]:
    package = _BUILTIN if name.startswith(f"{_BUILTIN}.") else name.partition(".")[0]
    waiting = [name]
    while waiting:
        spec = _spec(waiting.pop())
        if spec is None or not spec.origin or spec.name in seen:
            continue
        seen.add(spec.name)
        file = Path(spec.origin)
        yield file_digest(file)
        imports = _IMPORTS.get(file, partial(_imported_names, file, spec.parent or ""))
        waiting += [other for other in imports if other == package or other.startswith(f"{package}.")]


def _spec(name: str) -> ModuleSpec | None:
    """Return where a module comes from, whether or not it has been imported: another process may have done so."""
    module = sys.modules.get(name)  # the name may also be that of something within a module, which has no spec
    return module_spec(name) if module is None else module.__spec__


def _imported_names(file: Path, package: str) -> list[str]:
    """Return the absolute names that a module's imports may mean."""
    record_read(file)
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return []
    names: list[str] = []
    for statement in ast.walk(tree):
        if isinstance(statement, ast.Import):
            names += [alias.name for alias in statement.names]
        elif isinstance(statement, ast.ImportFrom):
            base = resolve_name("." * statement.level + (statement.module or ""), package)
            names += [base, *(f"{base}.{alias.name}" for alias in statement.names)]
    return names
