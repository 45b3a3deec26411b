"""`rendergraph explain`: the reference manual in the terminal."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph import reference
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit, emit_json, section, sections, warn
from rendergraph.errors import InputError, Problem, UsageError, node_named, suggestion
from rendergraph.formatting import format_value
from rendergraph.resources import shipped_pipelines, shipped_scenes

if TYPE_CHECKING:
    from rendergraph.cli.options import Select

Entry = dict[str, Any]
"""Facts about a topic, as `--json` prints them."""


@click.command("explain", no_args_is_help=True)
@click.argument("topic", shell_complete=options.offered("topics"))
@click.option("--glsl", is_flag=True, help="Print the node's program: the names in scope, and the final text.")
@click.option(
    "--pipeline",
    metavar="PIPELINE",
    shell_complete=options.offered("pipelines"),
    help="Pipeline that contains the node TOPIC; requires --glsl.",
)
@click.option("--step", type=click.IntRange(min=0), metavar="N", help="Step of the node, numbered as by `plan`.")
@options.selection_options
@options.json_option
def command(topic: str, glsl: bool, pipeline: str | None, step: int | None, select: Select, as_json: bool) -> None:
    """Explain a node, pipeline, scene, error or file format.

    TOPIC may also be an environment. `pipeline`, `scene`, `sweep`, `settings` and `header` list every key of that kind
    of file. `Steps` or `Pipeline` explains a Python class or function; `api` lists the names that nodes import, and
    `glsl` those that shaders include. A file's path explains the pipeline, scene or node in it. With --glsl, TOPIC is a
    node type, shown in a small pipeline, or a node of --pipeline; the options of `run` change either pipeline.

    \b
    Examples:
      rendergraph explain tonemap
      rendergraph explain forward
      rendergraph explain cornell_box
      rendergraph explain studio
      rendergraph explain RG103
      rendergraph explain scene
      rendergraph explain Steps
      rendergraph explain tonemap --glsl
      rendergraph explain ao --glsl --step 2 --pipeline ssao-hemisphere -s ao.samples=16
    """
    from rendergraph.session import Selection

    plugins = select(topic).plugins
    if not glsl and (pipeline or step is not None or select(topic) != Selection(topic, plugins=plugins)):
        raise UsageError(Problem("RG500", "--pipeline, --step and options that change a pipeline require --glsl"))
    if pipeline is not None:
        entry = reference.describe_program(options.link(select(pipeline)), topic, step)
        _print(entry, _program_text, as_json)
    elif re.fullmatch(r"[Rr][Gg]\d+", topic):
        _print(reference.error_page(topic.upper()), _error_text, as_json)
    elif topic in reference.FILE_KINDS:
        extensions = options.extensions(plugins) if topic == "scene" else None
        _print({"file": topic, "keys": reference.file_keys(topic, extensions)}, _keys_text, as_json)
    else:
        _node_or_file(topic, plugins, select, glsl=glsl, step=step, as_json=as_json)


def _node_or_file(
    topic: str, plugins: tuple[Path, ...], select: Select, *, glsl: bool, step: int | None, as_json: bool
) -> None:
    """Explain a node type, a pipeline or a scene; a name that is both a node type and a file is explained as both."""
    from rendergraph.catalog import SHADERS, Catalog

    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    if topic.endswith(SHADERS):
        catalog = catalog.with_file(topic, Path(topic))
    file, file_text = ({}, "") if glsl else _file(topic, select, catalog)
    if topic not in catalog:
        if not file and not glsl:
            file, file_text = _environment(topic)
        if not file and not glsl and (file := reference.describe_python(topic)):
            file_text = _python_text(file)
        if not file:
            raise InputError(Problem("RG511", _unknown(topic, catalog.names(), SHADERS)))
        emit_json(file) if as_json else emit(file_text)
        return
    node_type = catalog.get(topic)
    if glsl:
        linked, node = reference.find_node_of_type(node_type, catalog, select)
        _print(reference.describe_program(linked, node, step), _program_text, as_json)
        return
    described = reference.describe_node(node_type, catalog.extensions)
    described["example"] = reference.example_text(node_type, catalog)
    if any("added" in parameter for parameter in described["parameters"]):
        warn(catalog.extensions.warnings)
    warn(node_type.warnings)
    _print(file | described, lambda entry: sections(_node_text(entry), file_text), as_json)


def _print(entry: Entry, text_of: Callable[[Entry], str], as_json: bool) -> None:
    emit_json(entry) if as_json else emit(text_of(entry))


def _unknown(topic: str, types: Any, shader_suffixes: tuple[str, ...]) -> str:
    shader = next((f"./{topic}{suffix}" for suffix in shader_suffixes if Path(f"{topic}{suffix}").is_file()), None)
    from rendergraph.scene.environments import SHIPPED

    names = [*types, *reference.FILE_KINDS, *shipped_pipelines(), *shipped_scenes(), *SHIPPED]
    if topic in names:
        return f"'{topic}' has no program; --glsl takes a node type, or a node of --pipeline"
    names += [*reference.public_names(), "api", "glsl"]
    hint = f"; did you mean '{shader}'?" if shader else suggestion(topic, names)
    return f"unknown name '{topic}'{hint}" + (
        "" if shader else "; `nodes`, `pipelines`, `scenes` and `environments` list names"
    )


def _python_text(entry: Entry) -> str:
    """Return a public name of Python, or a list of names, as text."""
    if entry.get("topic") == "api":
        names = "\n".join(f"{name}  {line}" for name, line in entry["names"].items())
        return sections("rendergraph.api  (what a node imports)", section("Names", names))
    if entry.get("topic") == "glsl":
        parts = [section(f"#include <{name}>", "\n".join(lines)) for name, lines in entry["includes"].items() if lines]
        return sections("GLSL  (functions of the shared includes)", *parts)
    members = [section(one["signature"], one["doc"]) for one in entry["members"]]
    return sections(f"{entry['name']}  (Python)", entry["signature"], entry["doc"], *members)


def _environment(topic: str) -> tuple[Entry, str]:
    """Describe a shipped environment, also as text; empty if the topic is not one."""
    from rendergraph.scene.environments import SHIPPED  # slower to import than what most topics need

    if topic not in SHIPPED:
        return {}, ""
    use = f"rendergraph run forward --environment {topic}\nenvironment: {{file: {topic}}}  # in a scene file"
    shown = sections(f"{topic}  (environment)", SHIPPED[topic], section("Use it", use))
    return {"environment": topic, "line": SHIPPED[topic]}, shown


def _file(topic: str, select: Select, catalog: Any) -> tuple[Entry, str]:
    """Describe the pipeline or scene that a topic names, also as text; empty if it names neither."""
    kind = reference.kind_of(topic)
    if kind == "pipeline":
        entry = reference.describe_pipeline(topic, options.link(select(topic)))
        return entry, _pipeline_text(entry)
    if kind == "scene":
        from rendergraph.scene.load import load

        path = shipped_scenes().get(topic) or Path(topic)
        scene = load(path, extensions=catalog.extensions)
        warn(scene.warnings)
        entry = reference.describe_scene(topic, path, scene)
        return entry, _scene_text(entry)
    return {}, ""


# --- text ------------------------------------------------------------------------------------------------------------


def _pipeline_text(entry: Entry) -> str:
    width, height = entry["size"]
    scene = f"Renders {entry['scene']}" if entry["scene"] else "Renders no scene"
    outputs = ", ".join(f"{name} ({end})" for name, end in entry["outputs"].items())
    nodes = [(node["id"], node["type"], node["line"]) for node in entry["nodes"]]
    return sections(
        f"{entry['pipeline']}  (pipeline)",
        entry["line"],
        f"{scene}, {width}×{height}; outputs {outputs}.",
        section("Nodes", nodes, ("id", "type", "result")),
        section("Parameters", list(entry["parameters"].items())),
        section("File", entry["text"]),
        f"`rendergraph graph {entry['name']}` draws its graph, "
        f"`rendergraph config {entry['name']}` prints it with everything that it extends.",
    )


_MOST_ENTRIES = 40


def _scene_text(entry: Entry) -> str:
    def listed(title: str, rows: list[tuple[Any, ...]], *columns: Any, **options: Any) -> str:
        """Return a section with the first rows, and the number of the others."""
        more = len(rows) - _MOST_ENTRIES
        return section(title, rows[:_MOST_ENTRIES], *columns, **options) + (f"\n  and {more} more" if more > 0 else "")

    objects: list[tuple[Any, ...]] = [
        (one["name"], one["triangles"], one["material"], "" if one["casts_shadow"] else "casts no shadow")
        for one in entry["objects"]
    ]
    return sections(
        f"{entry['scene']}  (scene, {entry['triangles']} triangles{', animated' if entry['moves'] else ''})",
        entry["line"],
        listed("Objects", objects, ("name", "triangles", "material", ""), right=(1,)),
        listed("Clips", [(one["name"], f"{one['seconds']:g} s") for one in entry["clips"]]),
        listed("Variants", [(name, "") for name in entry["variants"]]),
        listed("Materials", [(one["name"], one["line"]) for one in entry["materials"]]),
        listed("Lights", [(one["name"], one["line"]) for one in entry["lights"]]),
        section("Cameras", [(one["name"], one["line"]) for one in entry["cameras"]]),
        f"It uses the extensions {', '.join(entry['extensions'])}." if entry["extensions"] else "",
        *entry["added"],
        f"`rendergraph run full --scene {entry['name']}` renders it.",
    )


def _error_text(page: Entry) -> str:
    paragraphs = str(page["about"]).split("\n\n")
    about = "\n\n".join(textwrap.fill(" ".join(paragraph.split()), 98) for paragraph in paragraphs)
    return sections(
        section(f"{page['code']}  {page['title']}", about),
        *(section(key.capitalize(), str(page.get(key) or "")) for key in ("wrong", "message", "right")),
    )


def _keys_text(entry: Entry) -> str:
    kind = entry["file"]
    tables = []
    for title, keys in groupby(entry["keys"], key=lambda row: row["section"]):
        rows = [(row["key"], row["value"], row["unit"], _default(row), row["doc"]) for row in keys]
        tables.append(section(title, rows))
    return sections(
        f"Every key of {reference.FILE_KINDS[kind]}. All are optional unless marked as required.",
        *tables,
        "`rendergraph config forward` prints a pipeline." if kind == "pipeline" else "",
    )


def _default(row: Entry) -> str:
    if row["required"]:
        return "required"
    return "" if row["default"] is None else format_value(row["default"])


def _node_text(node: Entry) -> str:
    inputs = [(p["name"], reference.meaning(p), ", ".join(reference.input_facts(p)), p["doc"]) for p in node["inputs"]]
    outputs, internal = (
        [(p["name"], reference.meaning(p), ", ".join(reference.output_facts(p)), p["doc"]) for p in node[key]]
        for key in ("outputs", "internal")
    )
    parameters = [
        (p["name"], p["type"], f"{format_value(p['default'])} {p['unit']}".strip(), _range(p), p["doc"])
        for p in node["parameters"]
    ]
    added = [
        (f"{p['name']}: {choice['name']}", choice["plugin"], choice["doc"])
        for p in node["parameters"]
        for choice in p.get("added", ())
    ]
    return sections(
        f"{node['name']}  ({node['family']})" if node["family"] else node["name"],
        node["doc"],
        f"Its exact twin, with the same outputs, is {node['twin']}." if node["twin"] else "",
        section("Inputs", inputs),
        section("Outputs", outputs),
        section("Internal textures", internal),
        section("Parameters", parameters, ("name", "value", "default", "range", "")) if parameters else "",
        section("Choices added by plugins", added),
        section("To extend it or one of its bases", "\n".join(node["extends"])),
        section("Example", node["example"]),
    )


def _range(parameter: Entry) -> str:
    low, high = parameter.get("min"), parameter.get("max")
    if low is None and high is None:
        return ""
    return f"{'-∞' if low is None else format_value(low)} … {'∞' if high is None else format_value(high)}"


_SCOPE_TITLES = {
    "textures": "textures",
    "uniforms": "uniforms",
    "blocks": "blocks, views and tables",
    "macros": "macros",
    "functions": "functions of other nodes, and their providers",
    "includes": "included files, and what they declare",
    "attributes": "attributes",
    "varyings": "varyings",
    "outputs": "outputs",
}
_WIDE = 64


def _program_text(entry: Entry) -> str:
    """Return the program as GLSL, with everything else in comments."""
    lines = [f"step {entry['step']} of {node_named(entry['node'], entry['type'])} in pipeline '{entry['pipeline']}'"]
    if len(entry["steps"]) > 1:
        lines.append("steps with a program; --step N selects one:")
        for one in entry["steps"]:
            shaders = ", ".join(one["shaders"].values())
            lines.append(f"  {one['step']}  {one['kind']}  {shaders}  {one['label']}".rstrip())
    if entry["variants"] == 0:
        lines.append("it draws nothing in this scene")
    elif entry["variants"] > 1:
        differing = ", ".join(entry["differ"])
        lines.append(f"the first of {amount(entry['variants'], 'variant')}, which differ in {differing}")
    for title, members in groupby(entry["scope"], key=lambda one: one["section"]):
        rows = [(one["name"], one["source"]) for one in members]
        width = max((len(name) for name, _ in rows if len(name) < _WIDE), default=0)
        lines += ["", _SCOPE_TITLES[title]]
        for name, source in rows:
            if len(name) < _WIDE and width + len(source) < 2 * _WIDE:
                lines.append(f"  {name.ljust(width)}  {source}")
            else:
                lines += [f"  {name}", *textwrap.wrap(source, 100, initial_indent=" " * 6, subsequent_indent=" " * 6)]
    head = "\n".join(f"// {line}".rstrip() for line in lines)
    stages = [f"// {'=' * 20} {stage} shader\n\n{one['annotated']}" for stage, one in entry["stages"].items()]
    return sections(head, *stages).rstrip()
