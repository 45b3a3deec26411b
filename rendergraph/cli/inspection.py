"""Verbs that inspect pipelines without a GPU: `check`, `plan`, `graph`, `config`, `diff`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit, emit_json, say, warn
from rendergraph.formatting import format_bytes

if TYPE_CHECKING:
    from rendergraph.session import Selection

_FORMATS = {".txt": "text", ".dot": "dot", ".gv": "dot", ".mmd": "mermaid", ".svg": "svg"}


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
@click.option("-o", "--output", type=options.FILE, help="Write a file.")
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

    sketch = options.link(selection, sketch=True)
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
@click.argument("a", type=options.PIPELINE)
@click.argument("b", type=options.PIPELINE)
@options.selection_options
@click.option("--svg", type=options.FILE, help="Draw both graphs, differences in colour.")
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

    old, new = (options.link(select(name), sketch=True) for name in (a, b))
    difference = diff(old.graph, new.graph)
    missing = [problem.as_json() for problem in (*old.missing, *new.missing)]
    plans = None
    if not missing:
        was, now = (figures(stages.plan(stages.expand(linked)).plan) for linked in (old, new))
        plans = was, now
    if svg is not None:
        options.write(diff_svg(old.graph, new.graph, difference), svg)
    if as_json:
        written = {"svg": str(svg)} if svg is not None else {}
        emit_json(diff_json(difference, plans) | written | {"missing": missing})
    else:
        emit(str(svg) if svg is not None else diff_text(difference, plans).rstrip("\n"))
    options.exit_if_missing(old, new)
