"""Resolve a document into a PipelineSpec: apply `extends`, patches, `--set`, parameters and sub-pipelines."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rendergraph.catalog import Catalog
from rendergraph.document import Document, Source, Value, YamlLimits, from_plain, is_standard_input
from rendergraph.document import merge_patch as merge_patch
from rendergraph.errors import InputError, Option, Place, Problem, shown_file, suggestion
from rendergraph.keys import Validator, plain
from rendergraph.read import CODES, SIZE, checked, entries, flag, read, word
from rendergraph.resolve.files import Files
from rendergraph.resolve.flatten import Flattener, parameters
from rendergraph.resolve.patches import diff, patch_of, settings
from rendergraph.resolve.spec import DEFAULT_SIZE, NodeSpec, PipelineParameter, PipelineSpec, Scope, to_yaml
from rendergraph.resources import is_name, shipped_pipelines, shipped_scenes
from rendergraph.settings import Roots


def resolve(
    source: str | Path | Document | Mapping[str, Any],
    *,
    catalog: Catalog,
    patches: Sequence[Path | Mapping[str, Any]] = (),
    sets: Sequence[str] | Mapping[str, object] = (),
    scene: str | Path | None = None,
    size: tuple[int, int] | None = None,
    asset_roots: Sequence[Path] = (),
    limits: YamlLimits = YamlLimits(),
) -> PipelineSpec:
    """Return a pipeline with patches, `--set`, sub-pipelines and parameters applied.

    Mistakes that do not prevent resolving are in its `problems`, which `link` raises with its own.

    Args:
        source: a shipped name, a file, YAML text of several lines, or plain data.
        patches: merge patches, files or plain data, applied in order.
        sets: `PATH=VALUE` texts or a mapping of paths to values; applied as one patch, types first.
        asset_roots: further folders from which files may be read.
    """
    wanted = settings(sets)
    files = Files(catalog, asset_roots, limits)
    document = _entry(source, limits)
    is_shipped = document.path is not None and shipped_pipelines().get(document.path.stem) == document.path
    home = Path() if is_shipped or document.path is None else document.path.parent  # folder of the resolved file
    roots = Roots.of_file(home / "x", files.asset_roots)
    files.plugins.home, files.plugins.roots = home.resolve(), roots
    files.own(document, None if is_shipped else roots)
    tree = files.chain(document)
    overrides: dict[str, Value] = {}
    if scene is not None:
        overrides["scene"] = Value(str(scene), Source(Option("--scene", str(scene)), Path.cwd() / "--scene"))
        tree = tree.updated(overrides)
    for patch in patches:
        tree = files.patched(tree, _patch(patch, files, limits))
    if isinstance((value := tree.get("scene") or tree).data, dict) and value is not tree:
        overrides.pop("scene", None)  # a patch changes the chosen scene
    if size is not None:
        overrides["size"] = from_plain(list(size), Source(Option("--size", f"{size[0]}x{size[1]}")))
    tree = tree.updated(overrides)
    settled, problems = patch_of(tree, [s for s in wanted if not s.scope], files.names_of)
    files.problems += problems
    if settled is not None:
        tree = files.patched(tree, settled)
    flat = Flattener(files)
    tree = flat.flatten(tree, "", {}, [s for s in wanted if s.scope])
    _complete(tree, files)
    found, changes, roots = _scene(tree, files, scene)
    tree = _with_plugins(_with_scene(tree, found, document), files)
    return PipelineSpec(
        name=document.path.stem if document.path else Path(str(document.source.origin)).stem,
        path=document.path,
        description=word(tree, "description") or "",
        size=_size(tree, files),
        scene=found,
        scene_changes=changes,
        roots=roots,
        nodes=flat.nodes,
        outputs=entries(tree, "outputs"),
        parameters=parameters(tree),
        scopes=flat.scopes,
        tree=tree,
        notes=(*files.notes, *files.plugins.notes),
        problems=tuple(files.problems),
        dropped=frozenset(files.dropped),
        removed=files.removed,
        catalog=files.catalog,
        missing=tuple(files.plugins.missing),
        unrun=files.plugins.unrun,
        source_roots=files.roots,
    )


def _entry(source: str | Path | Document | Mapping[str, Any], limits: YamlLimits) -> Document:
    if isinstance(source, Mapping):
        given = Source(Option("pipeline"))
        source = Document(from_plain(source, given), given)
    if isinstance(source, Document):
        return checked(source, keep_going=True)
    if isinstance(source, str) and "\n" in source:
        return read(None, source, limits, name="pipeline", keep_going=True)
    if isinstance(source, str) and is_name(source) and not is_standard_input(source):
        shipped = shipped_pipelines()
        if source not in shipped:
            hint = suggestion(source, shipped)
            if (here := next(Path().glob(f"{source}.y*ml"), None)) is not None:
                hint = f"; the file is named '{here}'"
            elif source in shipped_scenes():
                hint = f"; it is a scene, render it with: rendergraph run full --scene {source}"
            raise InputError(Problem("RG015", f"there is no shipped pipeline '{source}'{hint}"))
        return read(shipped[source], None, limits, keep_going=True)
    path = Path(source)
    if path.suffix.lower() not in (".yaml", ".yml") and path.is_file():
        import shlex  # other extensions are rare

        from rendergraph.scene.reading import MESHES  # likewise

        if path.suffix.lower() in MESHES:
            way = f"rendergraph run full --scene {shlex.quote(shown_file(path))}"
            text = f"this file is a scene, not a pipeline; render it with: {way}"
            raise InputError(Problem("RG013", text, Place(str(path))))
    try:
        return read(path, None, limits, keep_going=True)  # records that the file was looked for, even if it is missing
    except InputError:
        if path.exists() or path.stem not in shipped_pipelines():
            raise
        text = f"there is no file '{path}'; did you mean '{path.stem}', which is shipped?"
        raise InputError(Problem("RG011", text)) from None


def _patch(patch: Path | Mapping[str, Any], files: Files, limits: YamlLimits) -> Value:
    if isinstance(patch, Mapping):
        document = Document(from_plain(patch, source := Source(Option("patch"))), source)
        document = checked(document, keep_going=True, patch=True)
    else:
        document = read(Path(patch), None, limits, keep_going=True, patch=True)
    files.own(document)
    files.problems += document.problems
    return document.root


def _complete(tree: Value, files: Files) -> None:
    for part, example in (("nodes", "{display: {type: tonemap, …}}"), ("outputs", "{image: display.color}")):
        if not entries(tree, part) and not files.problems:
            text = f"the pipeline has no {part}; add {part}: {example}"
            empty = tree.get(part)
            files.report(tree.problem("RG125", text) if empty is None else empty.problem("RG125", text, key=True))
    for name, declared in entries(tree, "inputs").items():
        if not flag(declared, "optional"):
            text = f"input '{name}' comes from outside: this file is a sub-pipeline and cannot be run"
            files.report(declared.problem("RG124", text, key=True))


def _size(tree: Value, files: Files) -> tuple[int, int]:
    value = tree.get("size")
    if value is None or value.data is None:
        return DEFAULT_SIZE
    validator = Validator(CODES)  # only for the command line: files are validated when read
    good = validator.value(value, SIZE)
    files.problems += validator.problems
    return plain(good, SIZE.type) if good is not None else DEFAULT_SIZE


def _scene(tree: Value, files: Files, typed: str | Path | None) -> tuple[Path | None, Value | None, Roots]:
    """Return the scene's file, the pipeline's changes to it or replacement for it, and the roots for its files."""
    value, changes = tree.get("scene"), None
    if value is not None and isinstance(value.data, dict):
        changes = value.with_data({key: entry for key, entry in value.items() if key != "extends"})
        value = value.get("extends")
    if value is None or value.data is None:
        return None, changes, files.roots_of(changes or tree)
    if typed is not None and not is_name(str(value.data)):
        # The user named the file, so it may be anywhere; files that it refers to may not.
        path = Path(typed)
        roots = Roots.of_file(path, files.asset_roots)
        found: tuple[Path, Roots] | None = (path, roots)
        resolved = Roots((*roots.folders, path.resolve().parent)).mistake(path, str(typed))
        if resolved:
            files.report(value.problem(*resolved))
            found = None
    else:
        found = files.locate(value, shipped_scenes(), "scene")
    file, roots = found or (None, files.roots_of(value))
    if changes is not None:  # their paths are relative to the file that contains them
        roots = Roots(tuple(dict.fromkeys((*roots.folders, *files.roots_of(changes).folders))))
    return file, changes, roots


def _with_scene(tree: Value, found: Path | None, document: Document) -> Value:
    """Make the paths of the scene, and of files that its changes name, relative to the folder of the resolved file."""
    value = tree.get("scene")
    if value is None:
        return tree
    home = (document.path.parent if document.path else Path()).resolve()

    def spelled(path: Path) -> str:
        text = os.path.relpath(path, home) if path.is_relative_to(home) else str(path)
        return text if not is_name(text) else f"./{text}"

    def moved(value: Value, key: str) -> Value:
        if isinstance(value.data, dict):
            return value.with_data({name: moved(entry, name) for name, entry in value.data.items()})
        is_file = key == "file" or key.endswith("_texture")
        if not is_file or not isinstance(value.data, str) or is_name(value.data) or value.source.path == document.path:
            return value
        return value.with_data(spelled(((value.source.path or Path("x")).parent / value.data).resolve()))

    if isinstance(value.data, dict):
        value, base = moved(value, ""), value.get("extends")
        if base is not None and found is not None and not is_name(str(base.data)):
            value = value.updated({"extends": base.with_data(spelled(found.resolve()))})
        return tree.updated({"scene": value})
    if found is None or is_name(str(value.data)):
        return tree
    return tree.updated({"scene": value.with_data(spelled(found.resolve()))})


def _with_plugins(tree: Value, files: Files) -> Value:
    if not (written := files.plugins.written):
        return tree
    named = tree.get("plugins") or next(iter(written.values()))
    return tree.updated({"plugins": named.with_data([value.with_data(text) for text, value in written.items()])})
