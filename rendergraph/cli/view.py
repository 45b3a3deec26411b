"""`rendergraph view`: the graph live in a browser."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say
from rendergraph.errors import Problem, UsageError

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
def command(
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
    from rendergraph.installed import require
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
        if not no_open:
            _open(server.url)
        say("serving; Ctrl-C ends")
        try:
            server.run()
        finally:
            if (kept := state.keep()) is not None:
                say(f"changes that were not saved are in {kept.name}")


def _open(url: str) -> None:
    """Open a browser if there is a display."""
    import os
    import sys
    import webbrowser

    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)
