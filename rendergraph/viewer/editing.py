"""The file that pages edit: its text is edited in place, linked without GL, and written.

A change of the graph is an operation of `edit` on the text. Values are settings, as with `-s`, until the next operation
or until the file is saved: then they are also written into the text.
"""

from __future__ import annotations

import contextlib
import difflib
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from msgspec.structs import replace

from rendergraph.catalog import Catalog
from rendergraph.declare import Function, Views
from rendergraph.document import Source, YamlLimits, from_plain, read_text
from rendergraph.edit import PipelineText
from rendergraph.edit import text as yaml_text
from rendergraph.errors import InputError, Place, Problem, RendergraphError, UsageError, shown_file
from rendergraph.resolve import diff, to_yaml
from rendergraph.resolve.patches import settings
from rendergraph.resources import shipped_pipelines, shipped_scenes
from rendergraph.scene.scene_values import keys_of
from rendergraph.session import stages
from rendergraph.session.picture_metadata import ENVIRONMENT_NAMES, is_picture
from rendergraph.session.selection import Selection
from rendergraph.session.values import Linked

_GROUND_KEYS = ("ground", "ground_height")


def own_file(opened: Selection) -> Path | None:
    """Return the file that was opened, if it can be saved: it is not shipped, a picture or YAML text."""
    source = opened.source
    if not isinstance(source, str) or "\n" in source or source in shipped_pipelines() or is_picture(source):
        return None
    return path if (path := Path(source)).is_file() else None


def text_of(opened: Selection) -> str:
    """Return the text that the first operation changes: the file's, or one that extends a shipped pipeline."""
    if (own := own_file(opened)) is not None:
        return read_text(own, YamlLimits(), str(own))
    if opened.source in shipped_pipelines():
        return f"rendergraph: 1\nextends: {opened.source}\n"
    if isinstance(opened.source, Mapping):
        return to_yaml(from_plain(opened.source, Source("pipeline")), origins=False)
    if "\n" in opened.source:
        return opened.source
    text = f"the graph of '{opened.label}' cannot be edited here; write a file of it, as with `rendergraph config`"
    raise UsageError(Problem("RG500", text))


def edited(pipeline: PipelineText, sets: Iterable[str], operations: Sequence[Sequence[Any]]) -> dict[str, str]:
    """Write settings and apply operations; return by path the settings that stay beside the text.

    Those are settings of scenes, parameters of the pipeline and parts of sub-pipelines.
    """
    beside: dict[str, str] = {}
    for text in sets:
        (setting,) = settings([text])
        if setting.scope or setting.node in (None, "scene"):
            path, _, value = text.partition("=")
            beside[path] = value
        elif setting.name == "type":  # drops parameters and inputs that the new type lacks, as with `-s`
            pipeline.retype(setting.node, str(setting.value.plain()))
        else:
            pipeline.set(f"{setting.node}.{setting.name}", setting.value.plain())
    for name, *words in operations:
        getattr(pipeline, name)(*words)
        if name in ("delete", "rename"):
            mine = {path for path in beside if path.startswith(f"{words[0]}/")}
            moved = {f"{words[-1]}{path[len(words[0]) :]}": beside[path] for path in mine if name == "rename"}
            beside = {path: value for path, value in beside.items() if path not in mine} | moved
    return beside


def difference(before: str, after: str, name: str) -> str:
    return "\n".join(difflib.unified_diff(before.splitlines(), after.splitlines(), name, name, n=2, lineterm=""))


def problems_of(selection: Selection) -> list[dict[str, Any]]:
    """Return the problems of a pipeline, as from `check`, each with its node in the edited text."""
    try:
        stages.check(stages.link(stages.resolve(selection)))
    except RendergraphError as error:
        return [problem.as_json() | {"node": node_at(problem, selection)} for problem in error.problems]
    return []


def node_at(problem: Problem, selection: Selection) -> str | None:
    """Return the node that a setting names, or the one at a problem's line in the opened file, or None."""
    place = problem.place
    if place is None:
        return None
    if (setting := place.option("--set")) is not None:
        return setting.path.partition(".")[0]
    if not is_in_opened(place, selection):
        return None
    try:
        text = selection.text or read_text(Path(place.file), YamlLimits(), place.file)
        nodes = (yaml_text.spans(text, ("nodes",))[-1].children or {}).items()
    except (InputError, yaml.YAMLError):  # the text has no readable nodes
        return None
    above = [name for name, span in nodes if text.count("\n", 0, span.first) < place.line]
    return above[-1] if above else None


def is_in_opened(place: Place, selection: Selection) -> bool:
    own = own_file(selection)
    return place.file == selection.source or (own is not None and place.file == shown_file(own))


# --- what is written --------------------------------------------------------------------------------------------------


def in_place(opened: Selection, selection: Selection, file: Path, text: str) -> str:
    """Return a file's text with all changes, so that `run FILE` renders what the page shows, or a UsageError."""
    resolved, scene = _resolved(selection, file.parent)
    wanted = resolved | scene
    pipeline = PipelineText(text, file, Catalog.discover(opened.plugins))
    beside = edited(pipeline, selection.sets, ())
    for setting in settings([f"{path}={value}" for path, value in beside.items()]):
        if setting.node is None and not setting.scope:
            pipeline.set(setting.name, setting.value.plain())
    plain = Selection(str(file), text=pipeline.text, plugins=opened.plugins, asset_roots=opened.asset_roots)
    found = stages.resolve(plain).spec.plain()
    for key in ("size", "scene"):
        if found.get(key) != wanted.get(key):
            pipeline.set(key, wanted.get(key))
    if stages.resolve(replace(plain, text=pipeline.text)).spec.plain() != wanted:
        text = "these changes cannot be written into the file itself, such as those of -p and within sub-pipelines"
        raise UsageError(Problem("RG500", f"{text}; save under another name"))
    return pipeline.text


def variant(opened: Selection, selection: Selection, file: Path) -> str:
    """Return the text of a new file that extends the opened one with all changes, including the camera."""
    if selection.text is None or own_file(opened) is None:
        with contextlib.suppress(UsageError):  # otherwise changes are written as a difference
            return in_place(opened, selection, file, selection.text or f"rendergraph: 1\nextends: {opened.source}\n")
    resolved, scene = _resolved(selection, file.parent)
    before = stages.resolve(replace(opened, sets=(), patches=(), scene=None, size=None)).spec.plain()
    changed = {"extends": opened.source} | diff(before, resolved) | scene
    return to_yaml(from_plain(changed, Source("variant")), origins=False)


def unlinked(opened: Selection, selection: Selection) -> str:
    """Return the text of a file with changes that do not link, as far as possible."""
    pipeline = PipelineText(selection.text or text_of(opened), Path(opened.label), Catalog.discover(opened.plugins))
    for text in selection.sets:
        try:
            edited(pipeline, [text], ())
        except RendergraphError:
            continue  # this one may be why it does not link
    return pipeline.text


def _resolved(selection: Selection, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the resolved file with the scene's own cameras, and what replaces its key `scene` to keep what is shown.

    The latter is empty if a page shows the file's own scene from one of its cameras.
    """
    linked = stages.link(stages.resolve(selection))
    resolved = stages.resolve(replace(selection, camera=None)).spec.plain()
    if not (keys := _view_keys(selection, linked, folder)):
        return resolved, {}
    file, changes = linked.spec.scene, linked.spec.scene_changes
    scene = dict(changes.plain()) if changes is not None else {}
    if file is not None:
        scene["extends"] = file.stem if file in shipped_scenes().values() else os.path.relpath(file, folder)
    return resolved, {"scene": scene | keys}


def _view_keys(chosen: Selection, linked: Linked, folder: Path) -> dict[str, Any]:
    """Return keys of a scene file for a moved camera and for surroundings from the command line."""
    keys: dict[str, Any] = {}
    if chosen.camera is not None and "=" in chosen.camera:
        values = {key: list(v) if isinstance(v, tuple) else v for key, v in keys_of(chosen.camera).items()}
        names = [name for name in linked.scene.cameras if not name.startswith("--")]
        keys["cameras"] = {(names or ["main"])[0]: values}
    name = str(chosen.environment)
    if name == "none":
        keys["environment"] = None
    elif chosen.environment is not None:
        own = linked.scene.recipe.get(("environment", ""), {})  # the scene's keys apply to another file
        file = name if name in ENVIRONMENT_NAMES else os.path.relpath(name, folder)
        keys["environment"] = {"file": file} | {key: None for key in own if key not in ("file", *_GROUND_KEYS)}
    if chosen.ground:
        keys["environment"] = (keys.get("environment") or {}) | {"ground": True}
    return keys | ({"variant": chosen.variant} if chosen.variant else {})


# --- what can be added ------------------------------------------------------------------------------------------------


def node_types(catalog: Catalog) -> list[dict[str, Any]]:
    """Return every node type with its ports, for a list to choose from."""
    found = []
    for name in catalog.names():
        try:
            entry = catalog.get(name)
        except InputError:  # a plugin's that cannot be imported
            continue
        inputs = entry.cls.inputs()
        facts = {
            "name": name,
            "family": entry.family,
            "doc": (entry.cls.__doc__ or "").strip().partition("\n\n")[0].replace("\n", " "),
            "inputs": {key: _port(port, inputs) | {"optional": port.optional} for key, port in inputs.items()},
            "outputs": {key: _port(port, inputs) for key, port in entry.cls.outputs().items()},
        }
        found.append(facts)
    return sorted(found, key=lambda entry: str(entry["family"]))


def _port(port: Any, inputs: Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(port, Function):
        return {"kind": "function", "semantic": port.signature.name}
    if isinstance(port, Views):
        return {"kind": "view", "semantic": "any"}
    meaning = port.semantic or getattr(inputs.get(getattr(port, "like", "") or ""), "semantic", None)
    return {"kind": port.kind, "semantic": getattr(meaning, "name", "any")}
