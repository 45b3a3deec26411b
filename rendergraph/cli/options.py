"""Options that several verbs share, and the types of their values."""

from __future__ import annotations

import importlib
import math
import os
import re
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from msgspec import Struct

from rendergraph.activity import DRAW_TIMEOUT
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, warn
from rendergraph.errors import InputError
from rendergraph.system import STDIN

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from rendergraph.catalog import Catalog
    from rendergraph.declare import Extensions
    from rendergraph.session import Pipeline, Selection
    from rendergraph.session.values import Linked

F = TypeVar("F", bound=Callable[..., Any])

Select: TypeAlias = "Callable[[str], Selection]"
"""Returns the selection for a pipeline's name, with all options applied."""

_NAME = r"[A-Za-z_][A-Za-z0-9_-]*"
_NODE = rf"{_NAME}(?:/{_NAME})*"


class Target(Struct, frozen=True):
    """A file, and the output or port that goes into it; without a `name` the extension chooses the output."""

    name: str
    path: Path
    is_tap: bool = False
    on_sheet: bool = False  # also shown on the contact sheet


class Parsed(click.ParamType):  # type: ignore[type-arg]  # generic in new versions of click only
    """A value that a function parses from text; its ValueError becomes the message.

    A function given as `module:function` is imported when there is a value. The shell `offers` words of a kind.
    """

    def __init__(self, name: str, parse: Callable[[str], Any] | str = str, offers: str = "") -> None:
        self.name, self._parse, self._offers = name, parse, offers

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):  # a default, or converted before
            return value
        parse = self._parse
        if isinstance(parse, str):
            module, _, function = parse.partition(":")
            parse = getattr(importlib.import_module(module), function)
        try:
            return parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        return _complete(self._offers, ctx, incomplete) if self._offers else []


class NamedPath(click.Path):
    """A path that is not empty: an empty one would mean the current folder."""

    def __init__(self, metavar: str = "PATH", offers: str = "", *, file_okay: bool = True, dir_okay: bool = True):
        super().__init__(file_okay=file_okay, dir_okay=dir_okay, path_type=Path)
        self._metavar, self._offers = metavar, offers

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        return None if isinstance(param, click.Argument) else self._metavar

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "" or "\0" in str(value):
            self.fail(f"'{value}' is not the name of a file" + ("" if self.file_okay else " or folder"), param, ctx)
        return super().convert(value, param, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        if self._offers:
            return _complete(self._offers, ctx, incomplete)
        return super().shell_complete(ctx, param, incomplete)


def _complete(kind: str, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    from rendergraph.cli import completion  # only when a shell asks

    return completion.complete(kind, ctx, incomplete)


# --- types of values -------------------------------------------------------------------------------------------------


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,9})[x×]([0-9]{1,9})", text)
    if not match or int(match[1]) < 1 or int(match[2]) < 1:
        raise ValueError(f"'{text}' is not WIDTHxHEIGHT, as in 1280x720")
    return int(match[1]), int(match[2])


def _frames(text: str) -> range:
    match = re.fullmatch(r"([0-9]{1,9})(?:-([0-9]{1,9}))?", text)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
    if not 1 <= first <= last:
        raise ValueError(f"'{text}' is not FIRST-LAST, as in 1-10; frame 1 is the first")
    return range(first, last + 1)


def _setting(text: str) -> str:
    name, equals, _ = text.partition("=")
    if not equals or not name.strip():
        raise ValueError(f"'{text}' is not PATH=VALUE, as in light.ambient=0")
    return text


def settings(text: str) -> tuple[str, ...]:
    """Split several settings in one text as a shell would."""
    import shlex

    return tuple(_setting(word) for word in shlex.split(text))


def _output(text: str) -> Target:
    match = re.fullmatch(rf"(?:({_NAME})=)?(.*)", text, re.DOTALL)
    assert match
    return Target(match[1] or "", _picture(match[2], text))


def _tap(text: str) -> Target:
    from rendergraph.session.selection import TEXTURE_PART

    match = re.fullmatch(rf"(?P<name>{_NODE}\.\w+{TEXTURE_PART})=(?P<file>.*)", text, re.DOTALL)
    if not match:
        parts = "'sun.shadow_map[1]=…', 'bloom.glow[mip=1]=…', 'light.marks:stencil=…'"
        raise ValueError(f"'{text}' is not NODE.PORT=FILE, as in sun.shadow_map=depth.exr; for a part: {parts}")
    return Target(match["name"], _picture(match["file"], text), is_tap=True)


def _picture(name: str, text: str) -> Path:
    if not name or "\0" in name or name.endswith("/"):
        raise ValueError(f"'{text}' has no file name")
    return Path(name)


def _limit(text: str) -> tuple[str, int]:
    name, _, number = text.partition("=")
    if not name or not re.fullmatch(r"[0-9]{1,18}", number):
        raise ValueError(f"'{text}' is not NAME=N, as in yaml-depth=100")
    return name, int(number)


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0):
        raise ValueError(f"'{text}' is not a number above 0")
    return number


def _share(text: str) -> float:
    if not re.fullmatch(r"0?\.\d{1,9}|[01](\.0*)?", text):
        raise ValueError(f"'{text}' is not a number from 0 to 1, as in 0.5")
    return float(text)


def _devices(text: str) -> tuple[int, ...]:
    if text and not re.fullmatch(r"[0-9]{1,4}(,[0-9]{1,4})*", text):
        raise ValueError(f"'{text}' is not NUMBER,NUMBER, as `doctor` numbers GL devices")
    return tuple(map(int, text.split(","))) if text else ()


SIZE = Parsed("WxH", _size)
FRAMES = Parsed("A-B", _frames)
FRAMES_OR_CLIP = Parsed("A-B|clip", lambda text: text if text == "clip" else _frames(text))
SETTING = Parsed("PATH=VALUE", _setting, "settings")
OUTPUT = Parsed("[NAME=]FILE", _output)
TAP = Parsed("NODE.PORT=FILE", _tap, "taps")
LIMIT = Parsed("NAME=N", _limit)
POSITIVE = Parsed("NUMBER", _positive)
SECONDS = Parsed("SECONDS", _positive)
EXECUTOR = Parsed("NAME", "rendergraph.farm.executors:check_executor_name")
DEVICES = Parsed("N,N", _devices)
PIPELINE = Parsed("PIPELINE", offers="pipelines")
TOPIC = Parsed("TOPIC", offers="topics")
PATH = NamedPath()
FILE = NamedPath("FILE", dir_okay=False)
FOLDER = NamedPath("DIR", file_okay=False)


# --- options ---------------------------------------------------------------------------------------------------------


def together(*decorators: Callable[[Any], Any]) -> Callable[[F], F]:
    """Return one decorator for several, in the order of `--help`."""

    def decorate(function: F) -> F:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return decorate


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
alias_option = click.option(
    "--no-alias", "alias", is_flag=True, flag_value=False, default=True, help="Give every texture its own memory."
)
heap_option = click.option(
    "--heap", is_flag=True, help="Let textures of any size and format share memory, where the device supports it."
)
plugin_option = click.option(
    "--plugin", "plugins", multiple=True, type=PATH, help="Node module or a folder of them; runs code."
)

device_option = click.option("--device", metavar="NUMBER", type=int, help="GL device number, as listed by `doctor`.")


def _limit_draws(ctx: click.Context, param: click.Parameter, value: float | None) -> None:
    os.environ.pop(DRAW_TIMEOUT, None)
    if value is not None:
        os.environ[DRAW_TIMEOUT] = str(value)


draw_timeout_option = click.option(
    "--draw-timeout",
    type=SECONDS,
    expose_value=False,
    callback=_limit_draws,
    help="Exit with code 1 and name the step if rendering a frame takes longer.",
)
executor_options = together(
    click.option(
        "--executor",
        type=EXECUTOR,
        help="Where to render: serial, processes[:N], dask[:N], dask://HOST:PORT.  [default: depends on the machine]",
    ),
    click.option("--devices", type=DEVICES, default="", help="GL devices to distribute over workers."),
    click.option(
        "--timeout", type=SECONDS, help="Seconds without progress before a worker is replaced.  [default: 600]"
    ),
    draw_timeout_option,
)
"""The verb gets `executor`, `devices` and `timeout`."""
SELECTION_OPTIONS = {
    "scene": click.option(
        "--scene",
        type=Parsed("FILE", offers="scenes"),
        help="Scene to render: a shipped name, a scene file, .obj, .gltf, .glb.",
    ),
    "camera": click.option(
        "--camera",
        type=Parsed("NAME", offers="cameras"),
        help="Name of one of the scene's cameras, or a new camera: 'eye=0,1,5 target=0,1,0 fov=40'.",
    ),
    "view": click.option(
        "--view", metavar="NAME", help="View from the file's `views`: sets camera, frame and environment unless given."
    ),
    "shutter": click.option(
        "--shutter",
        type=Parsed("SHARE", _share),
        help="Fraction of a frame's time for which the shutter is open, 0 to 1, for motion blur.",
    ),
    "environment": click.option(
        "--environment",
        type=NamedPath("FILE", "environments"),
        help="Environment map: a shipped name, .hdr or .exr, or `none` to use only the file's own lights.",
    ),
    "variant": click.option(
        "--variant", metavar="NAME", help="Material variant of a glTF file; `explain FILE` lists them."
    ),
    "ground": click.option(
        "--ground", is_flag=True, help="Add a ground below the scene that shows the environment and receives shadows."
    ),
    "transparent": click.option(
        "--transparent",
        is_flag=True,
        help="Leave out the background and write alpha, straight in PNG and premultiplied in EXR.",
    ),
    "size": click.option("--size", type=SIZE, metavar="WxH", help="Size of the picture in pixels."),
    "sets": click.option(
        "-s",
        "--set",
        "sets",
        multiple=True,
        type=SETTING,
        help="Set a parameter, connect an input, change a type, or disable a node: ao.radius=0.5, light.lookup=null, "
        "sun.type=T, ao.enabled=false, scene.lights.sun.intensity=2.",
    ),
    "patches": click.option("-p", "--patch", "patches", multiple=True, type=PATH, help="Apply a merge patch file."),
    "asset_roots": click.option(
        "--asset-root",
        "asset_roots",
        multiple=True,
        type=PATH,
        metavar="DIR",
        help="Another folder from which files may be read.",
    ),
    "limits": click.option(
        "--limit", "limits", multiple=True, type=LIMIT, help="Raise a safety limit, named as in error messages."
    ),
    "plugins": plugin_option,
}
"""By the field of `Selection` that each sets."""


def pipeline_options(function: F) -> F:
    """Add the argument PIPELINE and all options that change a pipeline; the verb gets them as `selection`."""

    @wraps(function)
    def selected(*, pipeline: str, select: Select, **given: Any) -> None:
        function(selection=select(pipeline), **given)

    return click.argument("pipeline", type=PIPELINE)(selection_options(selected))  # type: ignore[return-value]


def selection_options(function: F) -> F:
    """Add all options that change a pipeline; the verb gets `select`, which takes the pipeline's name."""

    @wraps(function)
    def selecting(**given: Any) -> None:
        from rendergraph.session import Selection

        fields = {name: given.pop(name) for name in SELECTION_OPTIONS}
        function(select=lambda name: Selection(STDIN if name == "-" else name, **fields), **given)

    return together(*SELECTION_OPTIONS.values())(selecting)  # type: ignore[return-value]


# --- what verbs do with them -----------------------------------------------------------------------------------------


def linked(selection: Selection) -> Pipeline:
    from rendergraph.session import Pipeline

    pipeline = Pipeline(selection)
    warn(pipeline.link().warnings)
    return pipeline


def link(selection: Selection, *, sketch: bool = False) -> Linked:
    """Resolve and link a pipeline, and print its warnings; node types may be missing in a `sketch`."""
    from rendergraph.session import stages

    linked = (stages.sketch if sketch else stages.link)(stages.resolve(selection))
    warn(linked.warnings)
    return linked


def find_catalog(plugins: tuple[Path, ...], topic: str = "") -> Catalog:
    """Return the available node types, with that of the shader file that a topic may name; print notes about them."""
    from rendergraph.catalog import SHADERS, Catalog

    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    return catalog.with_file(topic, Path(topic)) if topic.endswith(SHADERS) else catalog


def extensions(plugins: tuple[Path, ...]) -> Extensions:
    """Return what plugins add besides node types; print mistakes in it as warnings."""
    from rendergraph.catalog import Catalog

    found = Catalog.discover(plugins).extensions
    warn(found.warnings)
    return found


def exit_if_missing(*sketches: Linked) -> None:
    """Exit with code 3 if node types are missing; call this when everything else is printed."""
    if any(linked.missing for linked in sketches):
        click.get_current_context().exit(InputError.exit_code)


def command_line() -> str:
    """Return the running command line as it was typed, to repeat it, without options that concern this run alone."""
    import shlex

    typed = click.get_current_context().obj
    return shlex.join(["rendergraph", *(word for word in typed if word not in ("--json", "-q", "--quiet", "--resume"))])


def put(text: str, output: Path | None, *, as_json: bool = False) -> None:
    """Print text, or write it to a file and print the file's path."""
    if output is None:
        emit(text.rstrip("\n"))
        return
    write(text, output)
    emit_json({"output": str(output)}) if as_json else emit(str(output))


def write(text: str, output: Path) -> None:
    from rendergraph.images import check_target
    from rendergraph.images.files import write_file

    check_target(output)
    write_file(output, text.rstrip("\n") + "\n")
