"""Verbs that inspect pipelines without a GPU: `check`, `plan`, `graph`, `config`, `diff`, `schema`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rendergraph import reference
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit, emit_json, say, warn
from rendergraph.errors import InputError, Problem, UsageError, suggestion
from rendergraph.formatting import format_bytes

if TYPE_CHECKING:
    from rendergraph.session import Selection
    from rendergraph.typecheck import Schema

_FORMATS = {".txt": "text", ".dot": "dot", ".gv": "dot", ".mmd": "mermaid", ".svg": "svg"}
_KINDS = ("pipeline", "scene", "sweep", "results", "results-csv")


@click.command("check", no_args_is_help=True)
@options.pipeline_options
@options.json_option
@click.option(
    "--profile", type=click.Choice(["guaranteed"]), help="Also require that every OpenGL 4.5 device can render it."
)
def check(selection: Selection, as_json: bool, profile: str | None) -> None:
    """Find every error, without a GPU.

    Checks the pipeline, everything it refers to, its scene and the options; of a sweep file, every run. Exits 0 if
    there are no errors. Otherwise exits 3 and prints each error with its line and how to fix it.

    \b
    Examples:
      rendergraph check forward
      rendergraph check forward --scene spheres -s light.ambient=0.1 --json
      rendergraph check full --profile guaranteed
    """
    from rendergraph.compare.sweepfile import is_sweep
    from rendergraph.schema import outdated
    from rendergraph.session import stages
    from rendergraph.session.picture_metadata import is_picture
    from rendergraph.settings import Roots

    if is_sweep(Path(selection.label)):
        from rendergraph.cli.sweep import check_file

        if profile is not None:
            raise click.UsageError("--profile checks a pipeline, not a sweep file")
        file = selection.label
        runs, warnings = check_file(Path(file), lambda name: replace(selection, source=name))
        warn(warnings)
        say(f"{file}: a sweep of {amount(runs, 'run')}")
        if as_json:
            emit_json({"sweep": file, "runs": runs, "warnings": [problem.as_json() for problem in warnings]})
        return
    linked = options.link(selection)
    planned = stages.check(linked)
    later = list(planned.warnings)
    if profile is not None:
        stages.check_profile(planned)
    graph, path = linked.graph, linked.spec.path
    if path and not is_picture(path):
        stale = outdated(path, Roots.of_file(path, selection.asset_roots), linked.catalog, selection.plugins)
        later += [stale] if stale else []
    warn(later)
    width, height = graph.size
    links = sum(len(ends) for node in graph.nodes for ends in node.inputs.values())
    fits = "; within the limits of every OpenGL 4.5 device" if profile else ""
    say(graph.summary + fits)
    if as_json:
        report = {"pipeline": graph.name, "size": [width, height], "nodes": len(graph.nodes), "links": links}
        outputs = {name: str(end) for name, end in graph.outputs.items()}
        emit_json(report | {"outputs": outputs, "warnings": [one.as_json() for one in (*linked.warnings, *later)]})


@click.command("plan", no_args_is_help=True)
@options.pipeline_options
@options.json_option
@options.alias_option
@options.heap_option
@click.option("--shuffle", type=int, metavar="SEED", help="Use another legal order.")
@click.option("--every-step", is_flag=True, help="List each step that computes a kept value in a row of its own.")
def plan(selection: Selection, as_json: bool, every_step: bool, **modes: Any) -> None:
    """Show order, lifetimes and memory, with reasons.

    Lists the order of the steps, the lifetime of each texture, which textures share memory, and the bytes. Steps that
    compute values kept from frame to frame, such as tables and environment maps, share a row.

    \b
    Examples:
      rendergraph plan forward
      rendergraph plan forward-prepass --size 1920x1080 --json
    """
    from rendergraph import diagrams
    from rendergraph.scene.scene_data import posing_figures
    from rendergraph.session import RenderOptions, stages

    linked = options.link(selection)
    plan, posing = stages.plan(stages.expand(linked, RenderOptions(**modes))).plan, posing_figures(linked.scene)
    if as_json:
        emit_json(diagrams.plan_json(plan) | ({"posing": posing} if posing["meshes"] else {}))
        return
    if posing["meshes"]:
        what = f"{amount(posing['meshes'], 'animated mesh', 'animated meshes')}, {posing['vertices']} vertices"
        when = "in a compute shader before step 1, when a pose has changed"
        emit(f"posing\n  {what}, {format_bytes(posing['bytes'])}; {when}\n")
    emit(diagrams.plan_text(plan, every_step=every_step).rstrip("\n"))


@click.command("graph", no_args_is_help=True)
@options.pipeline_options
@click.option(
    "-f",
    "--format",
    "format_name",
    type=click.Choice(["text", "dot", "mermaid", "svg"]),
    help="Format; by default that of the file's extension, or text.",
)
@click.option("-o", "--output", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Write a file.")
@options.json_option
def graph(selection: Selection, format_name: str | None, output: Path | None, as_json: bool) -> None:
    """Draw the graph as text, DOT, Mermaid or SVG.

    Nodes of unknown types are marked as such; the exit code is then 3.

    \b
    Examples:
      rendergraph graph forward
      rendergraph graph forward --format mermaid
      rendergraph graph forward-prepass -o graph.svg
    """
    from rendergraph import diagrams

    sketch = options.sketch(selection)
    if as_json and not output:
        missing = [problem.as_json() for problem in sketch.missing]
        emit_json(diagrams.graph_json(sketch.graph) | {"missing": missing})
    else:
        default = _FORMATS.get(output.suffix.lower(), "text") if output else "text"
        text: str = getattr(diagrams, format_name or default)(sketch.graph)
        options.put(text, output, as_json=as_json)
    options.exit_if_missing(sketch)


@click.command("config", no_args_is_help=True)
@options.pipeline_options
@options.json_option
def config(selection: Selection, as_json: bool) -> None:
    """Print the resolved pipeline, with origins.

    Prints the file with `extends`, patches and settings applied, and next to each value the line that it comes from.
    For a picture that `rendergraph run` wrote (EXR or PNG), prints the pipeline that rendered it.

    \b
    Examples:
      rendergraph config forward-prepass
      rendergraph config forward -s light.ambient=0.1 --json
      rendergraph config forward.png
    """
    from rendergraph.session import Selection, stages
    from rendergraph.session.picture_metadata import is_picture

    if is_picture(selection.label) and selection == Selection(selection.label):
        _of_picture(Path(selection.label), as_json)
        return
    spec = stages.resolve(selection).spec
    spec.check()
    warn(spec.notes)
    if as_json:
        emit_json({"pipeline": spec.name, "resolved": spec.plain(), "yaml": spec.to_yaml(origins=True)})
    else:
        emit(spec.to_yaml(origins=True).rstrip("\n"))


def _of_picture(path: Path, as_json: bool) -> None:
    from rendergraph.session.picture_metadata import metadata

    found = metadata(path)
    if as_json:
        emit_json({"picture": str(path), "yaml": found["pipeline"], "metadata": found})
        return
    for name, text in found.items():
        if name != "pipeline":
            emit(f"# {name}: " + " ".join(text.split()))
    emit(found["pipeline"].rstrip("\n"))


@click.command("diff", no_args_is_help=True)
@click.argument("a", shell_complete=options.offered("pipelines"))
@click.argument("b", shell_complete=options.offered("pipelines"))
@options.selection_options
@click.option(
    "--svg", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Draw both graphs, differences in colour."
)
@options.json_option
def diff(a: str, b: str, select: options.Select, svg: Path | None, as_json: bool) -> None:
    """Show the differences between two pipelines.

    Compares nodes, links and parameters after everything is resolved, and the plan: passes, bytes, peak. Nodes that
    differ only in their names are recognised. Needs no GPU. With unknown node types there is no plan, and the exit code
    is 3.

    \b
    Examples:
      rendergraph diff forward forward-prepass
      rendergraph diff forward my.yaml --svg difference.svg
      rendergraph diff forward forward-prepass --json
    """
    from rendergraph.diff import diff, diff_json, diff_svg, diff_text, figures
    from rendergraph.session import stages

    old, new = (options.sketch(select(name)) for name in (a, b))
    difference = diff(old.graph, new.graph)
    missing = [problem.as_json() for problem in (*old.missing, *new.missing)]
    plans = None
    if not missing:
        was, now = (figures(stages.plan(stages.expand(linked)).plan) for linked in (old, new))
        plans = was, now
    written: dict[str, Any] = {}
    if svg is not None:
        options.write(diff_svg(old.graph, new.graph, difference), svg)
        written["svg"] = str(svg)
    if as_json:
        emit_json(diff_json(difference, plans) | written | {"missing": missing})
    else:
        emit(written["svg"] if written else diff_text(difference, plans).rstrip("\n"))
    options.exit_if_missing(old, new)


@click.command("schema")
@click.argument("what", default="pipeline", metavar="[pipeline|scene|sweep|results|results-csv|FILE|NODE]")
@click.option("--glsl", is_flag=True, help="Print a shader of NODE as a complete file, for a GLSL checker.")
@click.option("--shader", metavar="NAME", help="Shader to print, if the node has several; requires --glsl.")
@click.option(
    "--pipeline",
    metavar="PIPELINE",
    shell_complete=options.offered("pipelines"),
    help="Pipeline that contains the node NODE; requires --glsl.",
)
@options.plugin_option
@click.option("-o", "--output", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Write a file.")
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
    if (shader or pipeline) and not glsl:
        raise UsageError(Problem("RG500", "--shader and --pipeline require --glsl"))
    if glsl:
        options.put(_shader(what, shader, pipeline, plugins), output, as_json=as_json)
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


def _shader(what: str, shader: str | None, pipeline: str | None, plugins: tuple[Path, ...]) -> str:
    from rendergraph.catalog import SHADERS, Catalog
    from rendergraph.session import Selection

    if pipeline is not None:
        return reference.complete_shader(options.link(Selection(pipeline, plugins=plugins)), what, shader)
    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    if what.endswith(SHADERS):
        catalog = catalog.with_file(what, Path(what))
    if what not in catalog:
        hint = suggestion(what, catalog.names(), most=0) or "; a node's id needs --pipeline"
        raise InputError(Problem("RG511", f"there is no node type '{what}'{hint}"))

    def select(name: str) -> Selection:
        return Selection(name, plugins=plugins)

    linked, node = reference.find_node_of_type(catalog.get(what), catalog, select)
    return reference.complete_shader(linked, node, shader)


def _of_pipelines(what: str, plugins: tuple[Path, ...]) -> Schema:
    from rendergraph.catalog import Catalog
    from rendergraph.schema import Links, base_of, schema, shipped_bases
    from rendergraph.session import Selection, stages

    if what != "pipeline" and not Path(what).suffix:
        text = f"unknown schema '{what}'{suggestion(what, _KINDS)}"
        raise InputError(Problem("RG511", text))
    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
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
