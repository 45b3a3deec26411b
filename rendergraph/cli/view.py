"""`rendergraph view` and `gallery`: pipelines as web pages, live or as a static site."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say
from rendergraph.errors import Problem, UsageError
from rendergraph.installed import require

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("view", no_args_is_help=True)
@options.pipeline_options
@click.option("--against", metavar="PIPELINE", help="Pipeline to compare with, using a slider.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port to serve at; any free one by default.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve at.")
@click.option("--allow-remote", is_flag=True, help="Allow a --host that other machines can reach; see below.")
@click.option(
    "--export",
    "target",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.html",
    help="Write the page as one static file instead of serving it.",
)
@click.option("--no-open", is_flag=True, help="Print the address without opening a browser.")
@click.option("--fps", type=options.POSITIVE, default=30.0, show_default=True, help="Frames per second.")
@click.option(
    "--timeout",
    type=options.POSITIVE,
    default=30.0,
    show_default=True,
    help="Seconds that a picture may take before its process is terminated.",
)
@options.json_option
@options.device_option
def view(
    selection: Selection,
    against: str | None,
    port: int,
    host: str,
    allow_remote: bool,
    target: Path | None,
    no_open: bool,
    fps: float,
    timeout: float,
    as_json: bool,
    device: int | None,
) -> None:
    """Show a pipeline in a browser and change its parameters live.

    Prints an address and opens it. Changes made on the page are saved as a variant in the current folder; input files
    are watched. Ctrl-C stops it.

    Anyone who has the address can use the page. With --allow-remote and a --host that other machines can reach, that
    is everyone who can read the network traffic, which is not encrypted: prefer an SSH tunnel.

    \b
    Examples:
      rendergraph view forward
      rendergraph view my.yaml --against deferred
      rendergraph view forward --scene helmet.glb --port 8080 --no-open
      rendergraph view forward --size 320x180 --export page.html
    """
    from rendergraph.viewer import EXTRA

    require(*EXTRA)
    from rendergraph.viewer.render_process import RenderProcess
    from rendergraph.viewer.server import LOOPBACK, Server
    from rendergraph.viewer.view_state import ViewState

    if host not in LOOPBACK and not allow_remote:
        text = (
            f"'{host}' accepts connections from other machines: anyone with the address can use the page, unencrypted; "
        )
        raise UsageError(Problem("RG500", text + "pass --allow-remote to allow this, or use an SSH tunnel"))
    with contextlib.closing(RenderProcess(device, timeout)) as process:
        if target is None:
            process.start()  # while the files are read
        other = None
        if against is not None:
            other = Path(against).stem, replace(selection, source=against, sets=(), patches=())
            options.linked(other[1])
        state = ViewState(selection, Path.cwd(), fps=fps, against=other)
        options.linked(selection)  # reports mistakes before there is a page
        if target is not None:
            from rendergraph.session.gpu import Gpu
            from rendergraph.viewer.export import export

            with Gpu(device) as gpu:
                options.put(export(state, gpu).html, target, as_json=as_json)
            return
        server = Server(state, process, host=host, port=port)
        emit_json({"url": server.url}) if as_json else emit(server.url)
        has_display = sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        if has_display and not no_open:
            import webbrowser

            webbrowser.open(server.url)
        say("serving; Ctrl-C ends")
        try:
            server.run()
        finally:
            if (kept := state.keep()) is not None:
                say(f"changes that were not saved are in {kept.name}")


@click.command("gallery", no_args_is_help=True)
@click.argument("pipelines", nargs=-1, required=True, type=options.PIPELINE)
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
def gallery(
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
