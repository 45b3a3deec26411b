"""What all plugins add, looked up by name; plugins are imported when the first name is asked for."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, TypeVar

from msgspec import Struct

from rendergraph.declare.blame import raised_at, told
from rendergraph.declare.extension import Extension, ImageLoader, MeshLoader, Metric
from rendergraph.errors import InputError, Place, Problem, is_interruption, shown_file
from rendergraph.glsl import about
from rendergraph.stamps import Stamps, replay_reads, track_reads
from rendergraph.textures import SEMANTICS, Semantic

T = TypeVar("T")
R = TypeVar("R")


class Added(Struct, Generic[T], frozen=True):
    """One thing that a plugin adds.

    Attributes:
        name: what it is asked for by.
        value: what it is.
        plugin: whose it is: a distribution, or a folder.
        file: the module of the extension.
    """

    name: str
    value: T
    plugin: str
    file: Path

    def run(self: Added[Callable[..., R]], code: str, doing: str, *arguments: Any) -> R:
        """Call what was added; whatever it raises is an error at the author's line.

        Args:
            code: of the error.
            doing: what could not be done, as a sentence without its end.
            arguments: what it is called with.

        Raises:
            InputError: it raised.
        """
        try:
            return self.value(*arguments)
        except BaseException as error:
            if is_interruption(error):
                raise
            place = raised_at(error, self.file.parent) or Place(shown_file(self.file))
            raise InputError(Problem(code, f"{doing}: {told(error)} (plugin '{self.plugin}')", place)) from error


class Source(Struct, frozen=True):
    """One extension, or what is wrong with it.

    Attributes:
        plugin: a distribution, or a folder.
        file: its module.
        extension: None where it cannot be used.
        problems: why.
    """

    plugin: str
    file: Path
    extension: Extension | None
    problems: tuple[Problem, ...] = ()


class Extensions:
    """What all plugins add. Asking for a name imports every extension, so it is done for names nobody else knows."""

    def __init__(self, find: Callable[[], Iterable[Source]] = tuple) -> None:
        self._find = find

    @property
    def sources(self) -> tuple[Source, ...]:
        """Every extension there is."""
        found, stamps = self._found
        replay_reads(stamps)
        return found

    @cached_property
    def _found(self) -> tuple[tuple[Source, ...], Stamps]:
        with track_reads() as stamps:
            return tuple(self._find()), stamps

    @property
    def problems(self) -> tuple[Problem, ...]:
        """What is wrong with extensions: it may be why a name is unknown, so it is said beside that."""
        return tuple(problem for source in self.sources for problem in source.problems)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """The same for whoever lists everything: what is broken is left out."""
        return tuple(problem.as_warning() for problem in self.problems)

    # By name; two plugins that bring one name are an error for whoever asks for it ------------------------------------

    def semantic(self, name: str) -> Semantic | None:
        """A meaning by name, the framework's or a plugin's.

        Raises:
            InputError: two plugins give it different meanings.
        """
        own = next((known for known in SEMANTICS if known.name == name), None)
        if own is not None:
            return own
        found = self._one(name, self.semantics(), "semantic")
        return found.value if found is not None else None

    def choice(self, parameter: str, name: str) -> Added[Path] | None:
        """The include of a plugin's choice of a parameter.

        Raises:
            InputError: two plugins have it.
        """
        return self._one(name, self.choices(parameter), f"choice of '{parameter}'")

    def mesh_loader(self, ending: str) -> Added[MeshLoader] | None:
        """What reads mesh files of an ending.

        Raises:
            InputError: two plugins do.
        """
        return self._one(ending.lower(), self.meshes(), "mesh loader")

    def image_loader(self, ending: str) -> Added[ImageLoader] | None:
        """What decodes image files of an ending.

        Raises:
            InputError: two plugins do.
        """
        return self._one(ending.lower(), self.images(), "image loader")

    # All of a kind, each with whose it is -----------------------------------------------------------------------------

    def semantic_names(self) -> list[str]:
        """The names of plugins' meanings."""
        return [added.name for added in self.semantics()]

    def semantics(self) -> list[Added[Semantic]]:
        """Plugins' meanings; what several plugins declare alike is there once."""
        found: list[Added[Semantic]] = []
        for source, extension in self._usable():
            for value in extension.semantics:
                if all(value != other.value for other in found):
                    found.append(Added(value.name, value, source.plugin, source.file))
        return found

    def choices(self, parameter: str) -> list[Added[Path]]:
        """The includes of plugins' choices of a parameter, absolute."""
        return [added for name, added in self.all_choices() if name == parameter]

    def all_choices(self) -> list[tuple[str, Added[Path]]]:
        """Parameter and choice, of all parameters."""
        return [
            (str(parameter), Added(name, source.file.parent / include, source.plugin, source.file))
            for source, extension in self._usable()
            for parameter, choices in extension.choices.items()
            for name, include in choices.items()
        ]

    def meshes(self) -> list[Added[MeshLoader]]:
        """Loaders of mesh files, by ending."""
        return [Added(*row) for row in self._table("meshes")]

    def images(self) -> list[Added[ImageLoader]]:
        """Loaders of image files, by ending."""
        return [Added(*row) for row in self._table("images")]

    def metrics(self) -> list[Added[Metric]]:
        """Metrics of pictures.

        Raises:
            InputError: two plugins have one of the same name.
        """
        found: list[Added[Metric]] = [Added(*row) for row in self._table("metrics")]
        for metric in found:
            self._one(metric.name, found, "metric")
        return found

    def listed(self) -> list[dict[str, str]]:
        """Everything that plugins add, as plain values: `kind`, `name`, `plugin`, `doc`."""
        kinds: list[tuple[str, Sequence[Added[Any]]]] = [("semantic", self.semantics())]
        kinds += [(parameter, [added]) for parameter, added in self.all_choices()]
        tables = (("meshes", "mesh loader"), ("images", "image loader"), ("metrics", "metric"))
        kinds += [(word, [Added(*row) for row in self._table(kind)]) for kind, word in tables]
        return [
            {"kind": kind, "name": added.name, "plugin": added.plugin, "doc": _doc(added.value)}
            for kind, found in kinds
            for added in found
        ]

    def _usable(self) -> Iterator[tuple[Source, Extension]]:
        for source in self.sources:
            if source.extension is not None:
                yield source, source.extension

    def _table(self, kind: str) -> Iterator[tuple[str, Any, str, Path]]:
        for source, extension in self._usable():
            for name, value in getattr(extension, kind).items():
                yield name, value, source.plugin, source.file

    def _one(self, name: str, known: Sequence[Added[T]], what: str) -> Added[T] | None:
        found = [added for added in known if added.name == name]
        if len(found) > 1:
            plugins = " and ".join(f"'{added.plugin}' ({shown_file(added.file)})" for added in found)
            text = f"{what} '{name}' comes from {plugins}; rename one, or uninstall one plugin"
            raise InputError(Problem("RG496", text, Place(shown_file(found[0].file))))
        return found[0] if found else None


def _doc(value: object) -> str:
    """The first line of what a thing says about itself."""
    if isinstance(value, Path):
        return about(value)
    doc = value.doc if isinstance(value, Semantic) else inspect.getdoc(value) or ""
    return doc.partition("\n")[0]


NO_EXTENSIONS = Extensions()
"""What the framework has without plugins."""
