"""`rendergraph explain` and `schema`: the reference manual in the terminal, and the schemas of files."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Callable, Iterable
from functools import partial
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
    from rendergraph.catalog import Catalog
    from rendergraph.cli.options import Select
    from rendergraph.session.values import Linked
    from rendergraph.typecheck import Schema

_SCHEMAS = ("pipeline", "scene", "sweep", "results", "results-csv")
_ERROR = re.compile(r"[Rr][Gg]\d+")
Entry = dict[str, Any]
"""Facts about a topic, as `--json` prints them."""


@click.command("explain", no_args_is_help=True)
@click.argument("topic", type=options.TOPIC)
@click.option("--glsl", is_flag=True, help="Print the node's program: the names in scope, and the final text.")
@click.option("--pipeline", type=options.PIPELINE, help="Pipeline that contains the node TOPIC; requires --glsl.")
@click.option("--step", type=click.IntRange(min=0), metavar="N", help="Step of the node, numbered as by `plan`.")
@options.selection_options
@options.json_option
def explain(topic: str, glsl: bool, pipeline: str | None, step: int | None, select: Select, as_json: bool) -> None:
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
    if glsl:
        linked, node = _node(topic, pipeline, select, partial(_unknown, topic))
        _print(reference.describe_program(linked, node, step), _program_text, as_json)
    elif _ERROR.fullmatch(topic):
        _print(reference.error_page(topic.upper()), _error_text, as_json)
    elif topic in reference.FILE_KINDS:
        extensions = options.extensions(plugins) if topic == "scene" else None
        _print({"file": topic, "keys": reference.file_keys(topic, extensions)}, _keys_text, as_json)
    else:
        _node_or_file(topic, select, as_json)


def _node(
    name: str, pipeline: str | None, select: Select, unknown: Callable[[Iterable[str]], str]
) -> tuple[Linked, str]:
    """Return a pipeline and the id of a node in it: a node of `--pipeline`, or that of a type in its example."""
    if pipeline is not None:
        return options.link(select(pipeline)), name
    catalog = options.find_catalog(select(name).plugins, name)
    if name not in catalog:
        raise InputError(Problem("RG511", unknown(catalog.names())))
    return reference.find_node_of_type(catalog.get(name), catalog, select)


def _node_or_file(topic: str, select: Select, as_json: bool) -> None:
    """Explain what a name refers to; one that is both a node type and a file is explained as both."""
    catalog = options.find_catalog(select(topic).plugins, topic)
    entry, text = _other(topic, select, catalog)
    if topic in catalog:
        node_type = catalog.get(topic)
        entry |= reference.describe_node(node_type, catalog.extensions)
        entry["example"] = reference.example_text(node_type, catalog)
        if any("added" in parameter for parameter in entry["parameters"]):
            warn(catalog.extensions.warnings)
        warn(node_type.warnings)
        text = sections(_node_text(entry), text)
    elif not entry:
        raise InputError(Problem("RG511", _unknown(topic, catalog.names())))
    emit_json(entry) if as_json else emit(text)


def _other(topic: str, select: Select, catalog: Catalog) -> tuple[Entry, str]:
    """Describe what is no node type, also as text; empty if there is nothing of the name."""
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
    if topic in catalog:
        return {}, ""
    from rendergraph.pipelines.environments import SHIPPED  # slower to import than what most topics need

    if topic in SHIPPED:
        use = f"rendergraph run forward --environment {topic}\nenvironment: {{file: {topic}}}  # in a scene file"
        text = sections(f"{topic}  (environment)", SHIPPED[topic], section("Use it", use))
        return {"environment": topic, "line": SHIPPED[topic]}, text
    entry = reference.describe_python(topic)
    return entry, _python_text(entry) if entry else ""


def _print(entry: Entry, text_of: Callable[[Entry], str], as_json: bool) -> None:
    emit_json(entry) if as_json else emit(text_of(entry))


def _unknown(topic: str, types: Iterable[str]) -> str:
    from rendergraph.catalog import SHADERS
    from rendergraph.pipelines.environments import SHIPPED

    names = [*types, *reference.FILE_KINDS, *shipped_pipelines(), *shipped_scenes(), *SHIPPED]
    if topic in names or _ERROR.fullmatch(topic):
        return f"'{topic}' has no program; --glsl takes a node type, or a node of --pipeline"
    if shader := next((f"./{topic}{suffix}" for suffix in SHADERS if Path(f"{topic}{suffix}").is_file()), None):
        return f"unknown name '{topic}'; did you mean '{shader}'?"
    hint = suggestion(topic, [*names, *reference.public_names(), "api", "glsl"])
    return f"unknown name '{topic}'{hint}; `nodes`, `pipelines`, `scenes` and `environments` list names"


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


@click.command("schema")
@click.argument("what", default="pipeline", metavar="[pipeline|scene|sweep|results|results-csv|FILE|NODE]")
@click.option("--glsl", is_flag=True, help="Print a shader of NODE as a complete file, for a GLSL checker.")
@click.option("--shader", metavar="NAME", help="Shader to print, if the node has several; requires --glsl.")
@click.option("--pipeline", type=options.PIPELINE, help="Pipeline that contains the node NODE; requires --glsl.")
@options.plugin_option
@click.option("-o", "--output", type=options.FILE, help="Write a file.")
@options.json_option
def schema(
    what: str,
    glsl: bool,
    shader: str | None,
    pipeline: str | None,
    plugins: tuple[Path, ...],
    output: Path | None,
    as_json: bool,
) -> None:
    """Print the JSON Schema of a kind of file, or a whole shader.

    The schema of pipelines contains all installed nodes, and the contents of shipped pipelines for files that extend
    them. If FILE is a pipeline, its schema also contains what it extends, its shader files, and the links that fit each
    input of its nodes. A node type with errors is included by name only, with a warning. `results` describes the lines
    of a sweep's results.jsonl; `results-csv` is a Table Schema of its results.csv.

    With --glsl, NODE is a node type, shown in a small pipeline, a shader file, or a node of --pipeline. The file
    contains everything that rendergraph adds and all includes. Every line keeps its number, so messages of another
    compiler name the lines that you wrote.

    \b
    Examples:
      rendergraph schema -o rendergraph.schema.json
      rendergraph schema scene -o scene.schema.json
      rendergraph schema results
      rendergraph schema my.yaml -o rendergraph.schema.json
      rendergraph schema --glsl tonemap
      rendergraph schema --glsl ao --pipeline ssao-gtao --shader gtao.frag
    """
    from rendergraph.session import Selection

    def unknown(types: Iterable[str]) -> str:
        return f"there is no node type '{what}'" + (suggestion(what, types, most=0) or "; a node's id needs --pipeline")

    if (shader or pipeline) and not glsl:
        raise UsageError(Problem("RG500", "--shader and --pipeline require --glsl"))
    if glsl:
        linked, node = _node(what, pipeline, partial(Selection, plugins=plugins), unknown)
        options.put(reference.complete_shader(linked, node, shader), output, as_json=as_json)
        return
    if what in ("results", "results-csv"):
        from rendergraph.compare.export.table import csv_schema  # slower to import than the rest
        from rendergraph.compare.store import line_schema

        document = line_schema() if what == "results" else csv_schema()
    elif what in ("scene", "sweep"):
        from rendergraph.keys import as_markdown, file_schema

        extensions = options.extensions(plugins) if what == "scene" else None
        document = as_markdown(file_schema(reference.table_of(what, extensions)))
    else:
        document = _of_pipelines(what, plugins)
    options.put(json.dumps(document, indent=2, ensure_ascii=False), output, as_json=as_json)


def _of_pipelines(what: str, plugins: tuple[Path, ...]) -> Schema:
    from rendergraph.schema import Links, base_of, schema, shipped_bases
    from rendergraph.session import Selection, stages

    if what != "pipeline" and not Path(what).suffix:
        raise InputError(Problem("RG511", f"unknown schema '{what}'{suggestion(what, _SCHEMAS)}"))
    catalog = options.find_catalog(plugins)
    bases = shipped_bases(catalog)
    links: Links = {}
    if what != "pipeline":
        resolved = stages.resolve(Selection(what, plugins=plugins), catalog)
        spec = resolved.spec
        bases |= base_of(Path(what), spec)
        catalog = spec.catalog or catalog  # with the shader files it names
        links = stages.fitting_links(resolved)
    document = schema(catalog, bases, links)
    warn([problem.as_warning() for problem in catalog.usable()[1]])
    warn(catalog.extensions.warnings)
    return document


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
    low, high = (", ".join(f"{value:.4g}" for value in corner) for corner in entry["bounds"])
    return sections(
        f"{entry['scene']}  (scene, {entry['triangles']} triangles{', animated' if entry['moves'] else ''})",
        entry["line"],
        listed("Objects", objects, ("name", "triangles", "material", ""), right=(1,)),
        f"From ({low}) to ({high}), in metres." if objects else "",
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
    def ports(key: str, facts: Callable[[Entry], list[str]]) -> list[tuple[str, ...]]:
        return [(p["name"], reference.meaning(p), ", ".join(facts(p)), p["doc"]) for p in node[key]]

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
        section("Inputs", ports("inputs", reference.input_facts)),
        section("Outputs", ports("outputs", reference.output_facts)),
        section("Internal textures", ports("internal", reference.output_facts)),
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
    "blocks": "blocks, views and tables",
    "functions": "functions of other nodes, and their providers",
    "includes": "included files, and what they declare",
}
"""Of sections that are not called as their key."""
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
        lines += ["", _SCOPE_TITLES.get(title, title)]
        for name, source in rows:
            if len(name) < _WIDE and width + len(source) < 2 * _WIDE:
                lines.append(f"  {name.ljust(width)}  {source}")
            else:
                lines += [f"  {name}", *textwrap.wrap(source, 100, initial_indent=" " * 6, subsequent_indent=" " * 6)]
    head = "\n".join(f"// {line}".rstrip() for line in lines)
    stages = [f"// {'=' * 20} {stage} shader\n\n{one['annotated']}" for stage, one in entry["stages"].items()]
    return sections(head, *stages).rstrip()
