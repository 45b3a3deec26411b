"""Options that several verbs share, and the kinds of value they take."""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from msgspec import Struct

from rendergraph.cli.output import emit, emit_json, warn
from rendergraph.cli.words import click
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from rendergraph.session import Pipeline, Selection
    from rendergraph.session.values import Linked

F = TypeVar("F", bound=Callable[..., Any])

Select: TypeAlias = "Callable[[str], Selection]"
"""Makes the selection of a pipeline's name, as the options say."""

_NAME = r"[A-Za-z_][A-Za-z0-9_-]*"
_NODE = rf"{_NAME}(?:/{_NAME})*"


class Target(Struct, frozen=True):
    """A file, and the output or port it shows; of an output without a name the extension chooses it.

    What is `on_sheet` is one of all ports, and on their contact sheet.
    """

    name: str
    path: Path
    is_tap: bool = False
    on_sheet: bool = False


class Parsed(click.ParamType):  # type: ignore[type-arg]  # generic in new versions of click only
    """A value that a function reads from text; its ValueError says what is wrong with it."""

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name = name
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value; one that is no text has been read already."""
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]{1,9})[x×]([0-9]{1,9})", text)
    if not found or int(found[1]) < 1 or int(found[2]) < 1:
        raise ValueError(f"'{text}' is not WIDTHxHEIGHT, as in 1280x720")
    return int(found[1]), int(found[2])


def _frames(text: str) -> range:
    found = re.fullmatch(r"([0-9]{1,9})(?:-([0-9]{1,9}))?", text)
    first, last = (int(found[1]), int(found[2] or found[1])) if found else (0, 0)
    if not 1 <= first <= last:
        raise ValueError(f"'{text}' is not FIRST-LAST, as in 1-10; frame 1 is the first")
    return range(first, last + 1)


def _setting(text: str) -> str:
    name, equals, _ = text.partition("=")
    if not equals or not name.strip():
        raise ValueError(f"'{text}' is not PATH=VALUE, as in light.ambient=0")
    return text


def settings(text: str) -> tuple[str, ...]:
    """Several settings in one text, as a shell would split it.

    Raises:
        ValueError: one of them is none, or a quote is not closed.
    """
    import shlex

    return tuple(_setting(word) for word in shlex.split(text))


def _output(text: str) -> Target:
    found = re.fullmatch(rf"(?:({_NAME})=)?(.*)", text, re.DOTALL)
    assert found
    return Target(found[1] or "", _picture(found[2], text))


def _tap(text: str) -> Target:
    from rendergraph.session.selection import TEXTURE_PART

    found = re.fullmatch(rf"(?P<name>{_NODE}\.\w+{TEXTURE_PART})=(?P<file>.*)", text, re.DOTALL)
    if not found:
        example = (
            "sun.shadow_map=depth.exr; of a part 'sun.shadow_map[1]=…', 'bloom.glow[mip=1]=…', 'light.marks:stencil=…'"
        )
        raise ValueError(f"'{text}' is not NODE.PORT=FILE, as in {example}")
    return Target(found["name"], _picture(found["file"], text), is_tap=True)


def _picture(name: str, text: str) -> Path:
    if not name or "\0" in name or name.endswith("/"):
        raise ValueError(f"'{text}' names no file")
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


def _executor(text: str) -> str:
    from rendergraph.farm.executors import check_executor_name

    return check_executor_name(text)


def _devices(text: str) -> tuple[int, ...]:
    if text and not re.fullmatch(r"[0-9]{1,4}(,[0-9]{1,4})*", text):
        raise ValueError(f"'{text}' is not NUMBER,NUMBER, as `doctor` numbers GL devices")
    return tuple(map(int, text.split(","))) if text else ()


SIZE = Parsed("WxH", _size)
FRAMES = Parsed("A-B", _frames)
SETTING = Parsed("PATH=VALUE", _setting)
OUTPUT = Parsed("[NAME=]FILE", _output)
TAP = Parsed("NODE.PORT=FILE", _tap)
LIMIT = Parsed("NAME=N", _limit)
POSITIVE = Parsed("NUMBER", _positive)
EXECUTOR = Parsed("WHO", _executor)
DEVICES = Parsed("N,N", _devices)


class NamedPath(click.Path):
    """A path that was typed, and not left out: an empty one would mean the current folder."""

    def __init__(self, *, file_okay: bool = True, dir_okay: bool = True) -> None:
        super().__init__(file_okay=file_okay, dir_okay=dir_okay, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path."""
        if value == "" or "\0" in str(value):
            self.fail(f"'{value}' names no file" + ("" if self.file_okay else " and no folder"), param, ctx)
        return super().convert(value, param, ctx)


_PATH = NamedPath()
_FIELDS = ("scene", "camera", "environment", "size", "sets", "patches", "asset_roots", "limits", "plugins")
"""Of a `Selection`, all that an option sets."""

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
heap_option = click.option(
    "--heap", is_flag=True, help="Let textures of any size and format share memory, where the device can."
)
plugin_option = click.option(
    "--plugin", "plugins", multiple=True, type=_PATH, metavar="PATH", help="Node modules, or a folder of them: code."
)
device_option = click.option("--device", metavar="NUMBER", type=int, help="GL device, as `doctor` numbers them.")


def executor_options(function: F) -> F:
    """Who does the work: the verb gets `executor`, `devices` and `timeout`."""
    for decorate in reversed(
        [
            click.option(
                "--executor",
                type=EXECUTOR,
                metavar="WHO",
                help="Who draws: serial, processes[:N], dask[:N], dask://HOST:PORT.  [default: as suits the machine]",
            ),
            click.option(
                "--devices", type=DEVICES, default="", metavar="N,N", help="GL devices that processes share out."
            ),
            click.option(
                "--timeout",
                type=POSITIVE,
                metavar="SECONDS",
                help="How long a worker may say nothing before another one gets its work.  [default: 600]",
            ),
        ]
    ):
        function = decorate(function)
    return function


def offered(what: str) -> Callable[[click.Context, click.Parameter, str], list[Any]]:
    """What a shell offers on TAB, a function of `rendergraph.cli.completion`, looked up when one asks."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
        completion = importlib.import_module("rendergraph.cli.completion")  # it knows the verbs
        found: list[Any] = getattr(completion, what)(ctx, param, incomplete)
        return found

    return complete


def pipeline_options(function: F) -> F:
    """The pipeline, and everything that changes it before anything looks at it; the verb gets it as `selection`."""

    @wraps(function)
    def selected(*, pipeline: str, select: Select, **given: Any) -> None:
        function(selection=select(pipeline), **given)

    return click.argument("pipeline", shell_complete=offered("pipelines"))(selection_options(selected))  # type: ignore[return-value]


def selection_options(function: F) -> F:
    """Everything that changes a pipeline before anything looks at it; the verb gets `select`, which takes its name."""

    @wraps(function)
    def selecting(**given: Any) -> None:
        from rendergraph.session import Selection

        fields = {name: given.pop(name) for name in _FIELDS}
        function(select=partial(Selection, **fields), **given)

    decorated: Callable[..., Any] = selecting
    for decorate in reversed(
        [
            click.option(
                "--scene",
                metavar="FILE",
                shell_complete=offered("scenes"),
                help="Draw this: a shipped name, a scene file, .obj, .gltf, .glb.",
            ),
            click.option(
                "--camera",
                metavar="NAME",
                shell_complete=offered("cameras"),
                help="See it through this camera of the scene.",
            ),
            click.option(
                "--environment", type=_PATH, metavar="FILE", help="Light it by this picture of the sky (.hdr, .exr)."
            ),
            click.option("--size", type=SIZE, metavar="WxH", help="Size of the picture in pixels."),
            click.option(
                "-s",
                "--set",
                "sets",
                multiple=True,
                type=SETTING,
                shell_complete=offered("settings"),
                help="Set a parameter, rewire an input, swap a type, take a node out: ao.radius=0.5, "
                "light.lookup=null, sun.type=T, ao.enabled=false.",
            ),
            click.option("-p", "--patch", "patches", multiple=True, type=_PATH, help="Apply a merge patch file."),
            click.option(
                "--asset-root",
                "asset_roots",
                multiple=True,
                type=_PATH,
                metavar="DIR",
                help="A further folder that files may be read from.",
            ),
            click.option(
                "--limit", "limits", multiple=True, type=LIMIT, help="Allow more than usual; messages say when."
            ),
            plugin_option,
        ]
    ):
        decorated = decorate(decorated)
    return decorated  # type: ignore[return-value]


def linked(selection: Selection) -> Pipeline:
    """The pipeline as Python has it, linked; its warnings are said.

    Raises:
        InputError: with every mistake found on the way.
    """
    from rendergraph.session import Pipeline

    pipeline = Pipeline(selection)
    warn(pipeline.link().warnings)
    return pipeline


def sketched(selection: Selection) -> Linked:
    """The graph to look at, where node types may be missing; what is, and its warnings, are said.

    Raises:
        InputError: with every mistake found on the way, where something else is wrong.
    """
    from rendergraph.session import stages

    found = stages.sketch(stages.resolve(selection))
    warn(found.warnings)
    return found


def conclude(*sketches: Linked) -> None:
    """End with the exit code of a wrong file where something was missing, now that the rest has been shown."""
    if any(found.missing for found in sketches):
        click.get_current_context().exit(InputError.exit_code)


def words(selection: Selection) -> list[str]:
    """The options that make a selection, so that a report can say how to get it again."""
    found: list[str] = []
    for name, option in (("scene", "--scene"), ("camera", "--camera"), ("environment", "--environment")):
        if (value := getattr(selection, name)) is not None:
            found += [option, str(value)]
    if size := selection.size:
        found += ["--size", f"{size[0]}x{size[1]}"]
    many = {"sets": "-s", "patches": "-p", "asset_roots": "--asset-root", "plugins": "--plugin"}
    found += [
        word for name, option in many.items() for value in getattr(selection, name) for word in (option, str(value))
    ]
    return [*found, *(word for name, most in selection.limits for word in ("--limit", f"{name}={most}"))]


def command_line() -> str:
    """Return the running command line as it was typed, to repeat it, without options that concern this run alone."""
    import shlex

    typed = click.get_current_context().obj
    return shlex.join(["rendergraph", *(word for word in typed if word not in ("--json", "-q", "--quiet", "--resume"))])


def put(text: str, output: Path | None, *, as_json: bool = False) -> None:
    """Text to stdout; or to a file, whole or not at all, and then the file's path to stdout."""
    if output is None:
        emit(text.rstrip("\n"))
        return
    write(text, output)
    if as_json:
        emit_json({"output": str(output)})
    else:
        emit(str(output))


def write(text: str, output: Path) -> None:
    """Text to a file, whole or not at all.

    Raises:
        InputError: the file cannot be written there.
        RenderError: writing failed.
    """
    from rendergraph.images import check_target
    from rendergraph.images.files import write_file

    check_target(output)
    write_file(output, text.rstrip("\n") + "\n")
