"""`rendergraph view`: the graph alive in a browser."""

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
    from rendergraph.viewer.desk import Desk


@click.command("view", no_args_is_help=True)
@options.pipeline_options
@click.option("--against", metavar="PIPELINE", help="Compare with this one, under a slider.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of the address; any that is free by default.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve at.")
@click.option("--allow-remote", is_flag=True, help="Let --host name more than this machine; see below.")
@click.option(
    "--export",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.html",
    help="Write the page as one still file instead of serving it.",
)
@click.option("--no-open", is_flag=True, help="Open no browser, print the address only.")
@click.option("--fps", type=options.POSITIVE, default=30.0, show_default=True, help="Frames a second.")
@click.option(
    "--timeout",
    type=options.POSITIVE,
    default=30.0,
    show_default=True,
    help="Seconds that a picture may take before its process is ended.",
)
@options.json_option
@options.device_option
def command(
    selection: Selection,
    against: str | None,
    port: int,
    host: str,
    allow_remote: bool,
    export: Path | None,
    no_open: bool,
    fps: float,
    timeout: float,
    as_json: bool,
    device: int | None,
) -> None:
    """Serve a pipeline to a browser, its parameters live.

    Prints an address and opens it. Changes are made on the page and saved as a variant beside where this was started;
    the files themselves are watched. Ctrl-C ends it.

    Whoever has the address may use the page. With --host beyond this machine, and --allow-remote, that is everybody who
    can read what goes over the network, for it is not encrypted: use an SSH tunnel instead where you can.

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
    from rendergraph.viewer.child import Child
    from rendergraph.viewer.desk import Desk
    from rendergraph.viewer.serve import LOOPBACK, serving

    if host not in LOOPBACK and not allow_remote:
        text = f"'{host}' is more than this machine: everybody who learns the address could use the page unencrypted; "
        raise UsageError(Problem("RG500", text + "say --allow-remote if that is meant, or use an SSH tunnel"))
    with contextlib.closing(Child(device, timeout)) as child:
        if export is None:
            child.start()  # meanwhile the files are looked at
        desk = Desk(selection, Path.cwd(), fps=fps, against=_compared(selection, against))
        options.linked(selection)  # what is wrong with a file is said here, before there is a page
        if export is not None:
            _export(desk, export, device, as_json=as_json)
            return
        made = serving(desk, child, host=host, port=port)
        emit_json({"url": made.url}) if as_json else emit(made.url)
        if not no_open:
            _open(made.url)
        say("serving; Ctrl-C ends")
        made.run()


def _compared(selection: Selection, against: str | None) -> tuple[str, Selection] | None:
    """The other pipeline, of the same scene, and what it is called."""
    if against is None:
        return None
    other = replace(selection, source=against, sets=(), patches=())
    options.linked(other)
    return Path(against).stem, other


def _export(desk: Desk, path: Path, device: int | None, *, as_json: bool) -> None:
    """The page as one file."""
    from rendergraph.session.gpu import Gpu
    from rendergraph.viewer.export import exported

    with Gpu(device) as gpu:
        options.put(exported(desk, gpu), path, as_json=as_json)


def _open(url: str) -> None:
    """A browser, where there is a display to show it on."""
    import os
    import sys
    import webbrowser

    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)
