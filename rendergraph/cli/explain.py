"""`rendergraph explain`: the reference, offline."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli import options
from rendergraph.cli.describe import describe, in_a_file, input_facts, meaning, output_facts
from rendergraph.cli.output import emit, emit_json, table, warn
from rendergraph.cli.program_text import as_text, program, shown_at_work
from rendergraph.cli.words import click
from rendergraph.errors import InputError, Problem, UsageError, suggestion

if TYPE_CHECKING:
    from rendergraph.cli.options import Select
    from rendergraph.keys import Table
    from rendergraph.session.values import Linked

FILES = ("pipeline", "scene", "sweep", "settings", "header")
"""Kinds of file whose keys can be explained."""


@click.command("explain", no_args_is_help=True)
@click.argument("topic", shell_complete=options.offered("topics"))
@click.option("--glsl", is_flag=True, help="Print the program of the node: what is in scope, and its final text.")
@click.option(
    "--pipeline",
    metavar="PIPELINE",
    shell_complete=options.offered("pipelines"),
    help="The program that node TOPIC of this pipeline has.",
)
@click.option("--step", type=click.IntRange(min=0), metavar="N", help="Which of the node's steps, as `plan` counts.")
@options.selection_options
@options.json_option
def command(topic: str, glsl: bool, pipeline: str | None, step: int | None, select: Select, as_json: bool) -> None:
    """Explain a node, pipeline, scene, error code or file.

    `pipeline`, `scene`, `sweep`, `settings` and `header` list every key of such a file; the path of a file explains the
    pipeline, the scene or the node that it is. With --glsl a type is shown in a small pipeline, or TOPIC is a node of
    --pipeline; either is changed by the options that `run` has.

    \b
    Examples:
      rendergraph explain tonemap
      rendergraph explain forward
      rendergraph explain cornell_box
      rendergraph explain RG103
      rendergraph explain scene
      rendergraph explain tonemap --glsl
      rendergraph explain ao --glsl --step 2 --pipeline ssao-hemisphere -s ao.samples=16
    """
    from rendergraph.session import Selection, stages

    plugins = select(topic).plugins
    if not glsl and (pipeline or step is not None or select(topic) != Selection(topic, plugins=plugins)):
        raise UsageError(Problem("RG500", "--pipeline, --step and what changes a pipeline go with --glsl"))
    if pipeline is not None:
        linked = stages.link(stages.resolve(select(pipeline)))
        warn(linked.warnings)
        _program(linked, topic, step, as_json)
        return
    if re.fullmatch(r"[Rr][Gg]\d+", topic):
        page = error_page(topic.upper())
        emit_json(page) if as_json else emit(_error_text(page))
        return
    if topic in FILES:
        keys = file_keys(topic)
        emit_json({"file": topic, "keys": keys}) if as_json else emit(_keys_text(topic, keys))
        return
    from rendergraph.catalog import SHADERS, Catalog
    from rendergraph.resources import shipped_pipelines, shipped_scenes

    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    if topic.endswith(SHADERS):
        catalog = catalog.with_file(topic, Path(topic))
    shown = None if glsl else _file(topic, select)
    if topic not in catalog and shown is not None:
        emit_json(shown[0]) if as_json else emit(shown[1])
        return
    if topic not in catalog:
        known = [*catalog.names(), *FILES, *shipped_pipelines(), *shipped_scenes()]
        beside = next((f"{topic}{end}" for end in SHADERS if Path(f"{topic}{end}").is_file()), None)
        if beside is not None:
            raise InputError(Problem("RG511", f"nothing is called '{topic}'; did you mean './{beside}'?"))
        hint = suggestion(topic, known)
        text = f"nothing is called '{topic}'{hint}; `nodes`, `pipelines` and `scenes` list what there is"
        raise InputError(Problem("RG511", text))
    found = catalog.get(topic)
    if glsl:
        _program(*shown_at_work(found, catalog, select), step, as_json)
        return
    described = describe(found, catalog.extensions) | {"example": in_a_file(found, catalog)}
    if any("added" in parameter for parameter in described["parameters"]):
        warn(catalog.extensions.warnings)
    warn(found.warnings)
    if as_json:
        emit_json((shown[0] if shown else {}) | described)
    else:
        emit(_node_text(described) + (f"\n\n{shown[1]}" if shown else ""))


def _file(topic: str, select: Select) -> tuple[dict[str, Any], str] | None:
    """The pipeline or the scene that a topic names, as values and as text."""
    from rendergraph.cli import about

    kind = about.kind_of(topic)
    if kind == "pipeline":
        found = about.pipeline(topic, select)
        return found, about.pipeline_text(found)
    if kind == "scene":
        found = about.scene(topic, select)
        return found, about.scene_text(found)
    return None


def _program(linked: Linked, node: str, step: int | None, as_json: bool) -> None:
    found = program(linked, node, step)
    emit_json(found) if as_json else emit(as_text(found))


# --- error codes -----------------------------------------------------------------------------------------------------


def error_page(code: str) -> dict[str, Any]:
    """The page of a code.

    Raises:
        InputError: there is no such code.
    """
    import yaml

    from rendergraph.resources import folder

    pages = {path.name.partition("-")[0]: path for path in sorted(folder("rendergraph.errors").glob("RG*.yaml"))}
    if code not in pages:
        raise InputError(Problem("RG511", f"there is no error code '{code}'{suggestion(code, pages)}"))
    page: dict[str, Any] = yaml.safe_load(pages[code].read_text(encoding="utf-8"))
    return page


def _error_text(page: dict[str, Any]) -> str:
    about = "\n\n".join(textwrap.fill(" ".join(part.split()), 98) for part in str(page["about"]).split("\n\n"))
    parts = [f"{page['code']}  {page['title']}", _indented(about)]
    for key, title in (("wrong", "Wrong"), ("message", "Message"), ("right", "Right")):
        if page.get(key):
            parts.append(f"{title}\n{_indented(page[key])}")
    return "\n\n".join(parts)


def _indented(text: object) -> str:
    return "\n".join(f"  {line}".rstrip() for line in str(text).rstrip().splitlines())


# --- files -----------------------------------------------------------------------------------------------------------


def table_of(kind: str) -> Table:
    """The keys of a kind of file."""
    if kind == "pipeline":
        from rendergraph.read import PIPELINE as found
    elif kind == "scene":
        from rendergraph.scene.scene_keys import SCENE as found
    elif kind == "sweep":
        from rendergraph.compare.sweepfile import SWEEP as found
    elif kind == "settings":
        from rendergraph.settings import SETTINGS as found
    else:
        from rendergraph.catalog.header import HEADER as found
    return found


def file_keys(kind: str) -> list[dict[str, Any]]:
    """Every key of a kind of file, section by section."""
    from rendergraph.keys import briefly

    return [
        {
            "section": section,
            "key": key.name,
            "value": briefly(key.takes),
            "default": list(key.default) if isinstance(key.default, tuple) else key.default,
            "unit": key.unit,
            "required": key.required,
            "doc": key.doc,
        }
        for section, keys in table_of(kind).sections()
        for key in keys
    ]


_KINDS = {
    "pipeline": "a pipeline file",
    "scene": "a scene file",
    "sweep": "a sweep's file",
    "settings": "`rendergraph.toml`",
    "header": "a shader file's header",
}


def _keys_text(kind: str, keys: list[dict[str, Any]]) -> str:
    parts = [f"Every key of {_KINDS[kind]}. All are optional unless it is said."]
    for section in dict.fromkeys(row["section"] for row in keys):
        rows = [
            (row["key"], row["value"], row["unit"], _default(row), row["doc"])
            for row in keys
            if row["section"] == section
        ]
        parts.append((f"{section}\n" if section else "") + _block(rows))
    parts.append("`rendergraph config forward` prints a pipeline." if kind == "pipeline" else "")
    return "\n\n".join(filter(None, parts))


def _default(row: dict[str, Any]) -> str:
    if row["required"]:
        return "required"
    return "" if row["default"] is None else _value(row["default"])


# --- nodes -----------------------------------------------------------------------------------------------------------


def _node_text(node: dict[str, Any]) -> str:
    family = f"  ({node['family']})" if node["family"] else ""
    parts = [f"{node['name']}{family}", node["doc"]]
    if node["inputs"]:
        rows = [(p["name"], meaning(p), ", ".join(input_facts(p)), p["doc"]) for p in node["inputs"]]
        parts.append("Inputs\n" + _block(rows))
    for title, ports in (("Outputs", node["outputs"]), ("Textures of its own", node["internal"])):
        rows = [(p["name"], meaning(p), ", ".join(output_facts(p)), p["doc"]) for p in ports]
        parts.append(f"{title}\n{_block(rows)}" if rows else "")
    if node["parameters"]:
        knobs = [
            (p["name"], p["type"], f"{_value(p['default'])} {p['unit']}".strip(), _range(p), p["doc"])
            for p in node["parameters"]
        ]
        parts.append("Parameters\n" + _block(knobs, ("name", "value", "default", "range", "")))
    added = [
        (f"{p['name']}: {c['name']}", c["plugin"], c["doc"]) for p in node["parameters"] for c in p.get("added", ())
    ]
    if added:
        parts.append("Choices of plugins\n" + _block(added))
    if node["extends"]:
        parts.append("To extend it, or what it stands on\n" + _indented("\n".join(node["extends"])))
    parts.append("In a file\n" + _indented(node["example"]))
    return "\n\n".join(filter(None, parts))


def _block(rows: Sequence[tuple[Any, ...]], heads: tuple[str, ...] = ()) -> str:
    return _indented(table(rows, heads))


def _range(parameter: dict[str, Any]) -> str:
    low, high = parameter.get("min"), parameter.get("max")
    if low is None and high is None:
        return ""
    return f"{_value(low) if low is not None else '-∞'} … {_value(high) if high is not None else '∞'}"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value)
