"""`rendergraph gallery`: a static site of pipelines."""

from __future__ import annotations

from pathlib import Path

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json
from rendergraph.errors import Problem, UsageError


@click.command("gallery", no_args_is_help=True)
@click.argument("pipelines", nargs=-1, required=True, shell_complete=options.offered("pipelines"))
@options.selection_options
@click.option(
    "-o",
    "--output",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    required=True,
    help="Folder to write; created if it does not exist.",
)
@click.option("--title", default="Pipelines", show_default=True, help="Heading of the index.")
@options.json_option
@options.device_option
def command(
    pipelines: tuple[str, ...], select: options.Select, folder: Path, title: str, as_json: bool, device: int | None
) -> None:
    """Build a static site of pipelines.

    Each pipeline gets the page that `view --export` writes, with its picture, graph, textures, parameters, memory and
    times. `index.html` shows them all. The site needs no server and no network. Options apply to every pipeline.

    \b
    Examples:
      rendergraph gallery forward deferred -o site --size 320x180
      rendergraph gallery my.yaml -o site --title "My renderers"
    """
    from rendergraph.installed import require
    from rendergraph.viewer import EXTRA

    require(*EXTRA)
    from rendergraph.images.files import write_file
    from rendergraph.session import stages
    from rendergraph.session.gpu import Gpu
    from rendergraph.viewer.export import Exported, export, index
    from rendergraph.viewer.view_state import ViewState

    selections = {Path(pipeline).stem: select(pipeline) for pipeline in pipelines}
    if len(selections) < len(pipelines):
        raise UsageError(Problem("RG500", "two of the pipelines have the same name; their pages would be one file"))
    if "index" in selections:
        raise UsageError(Problem("RG500", "a pipeline called 'index' would overwrite the site's index"))
    # All mistakes are reported before the first picture.
    planned = {name: options.linked(selection).check() for name, selection in selections.items()}
    folder.mkdir(parents=True, exist_ok=True)
    pages: dict[str, Exported] = {}
    times: dict[str, float] = {}
    with Gpu(device) as gpu:
        for name, selection in selections.items():
            pages[name] = page = export(ViewState(selection, Path.cwd()), gpu)
            # The first frame compiles and uploads; the median leaves it out.
            times[name] = stages.draw_last(planned[name].for_frames(range(1, 4), timed=True), gpu).frame_ms["median"]
            write_file(folder / f"{name}.html", page.html)
            write_file(folder / f"{name}.png", page.picture)
    write_file(folder / "index.html", index(title, pages, times))
    files = ("index.html", *(f"{name}.{ending}" for name in pages for ending in ("html", "png")))
    outputs = [str(folder / file) for file in files]
    emit_json({"outputs": outputs}) if as_json else emit(outputs[0])
