"""Options that several verbs share, and the kinds of value they take."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rendergraph.cli.output import emit, emit_json, warn
from rendergraph.cli.words import click
from rendergraph.errors import InputError

if TYPE_CHECKING:
    import rendergraph as rg
    from rendergraph.link import Graph

F = TypeVar("F", bound=Callable[..., Any])

_NAME = r"[A-Za-z_][A-Za-z0-9_-]*"
_NODE = rf"{_NAME}(?:/{_NAME})*"


@dataclass(frozen=True)
class Target:
    """A file, and the output or port it shows; None lets the extension choose."""

    name: str | None
    path: Path


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
    found = re.fullmatch(r"(\d{1,9})[x×](\d{1,9})", text)
    if not found or int(found[1]) < 1 or int(found[2]) < 1:
        raise ValueError(f"'{text}' is not WIDTHxHEIGHT, as in 1280x720")
    return int(found[1]), int(found[2])


def _frames(text: str) -> range:
    found = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9}))?", text)
    first, last = (int(found[1]), int(found[2] or found[1])) if found else (0, 0)
    if not 1 <= first <= last:
        raise ValueError(f"'{text}' is not FIRST-LAST, as in 1-10; frame 1 is the first")
    return range(first, last + 1)


def _setting(text: str) -> str:
    name, equals, _ = text.partition("=")
    if not equals or not name.strip():
        raise ValueError(f"'{text}' is not PATH=VALUE, as in light.ambient=0")
    return text


def _output(text: str) -> Target:
    found = re.fullmatch(rf"(?:({_NAME})=)?(.*)", text, re.DOTALL)
    assert found
    return Target(found[1], _picture(found[2], text))


def _tap(text: str) -> Target:
    found = re.fullmatch(rf"({_NODE}\.\w+)=(.*)", text, re.DOTALL)
    if not found:
        raise ValueError(f"'{text}' is not NODE.PORT=FILE, as in sun.shadow_map=depth.exr")
    return Target(found[1], _picture(found[2], text))


def _picture(name: str, text: str) -> Path:
    if not name or "\0" in name or name.endswith("/"):
        raise ValueError(f"'{text}' names no file")
    return Path(name)


def _limit(text: str) -> tuple[str, int]:
    name, _, number = text.partition("=")
    if not name or not re.fullmatch(r"\d{1,18}", number):
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


SIZE = Parsed("WxH", _size)
FRAMES = Parsed("A-B", _frames)
SETTING = Parsed("PATH=VALUE", _setting)
OUTPUT = Parsed("[NAME=]FILE", _output)
TAP = Parsed("NODE.PORT=FILE", _tap)
LIMIT = Parsed("NAME=N", _limit)
POSITIVE = Parsed("NUMBER", _positive)
_PATH = click.Path(path_type=Path)

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
plugin_option = click.option(
    "--plugin", "plugins", multiple=True, type=_PATH, metavar="PATH", help="Node modules, or a folder of them: code."
)
device_option = click.option("--device", metavar="NUMBER", type=int, help="GL device, as `doctor` numbers them.")


def pipeline_options(function: F) -> F:
    """The pipeline, and everything that changes it before anything looks at it."""
    return click.argument("pipeline")(selection_options(function))


def selection_options(function: F) -> F:
    """Everything that changes a pipeline before anything looks at it."""
    for decorate in reversed(
        [
            click.option("--scene", metavar="FILE", help="Draw this: a shipped name, a scene file, .obj, .gltf, .glb."),
            click.option("--camera", metavar="NAME", help="See it through this camera of the scene."),
            click.option("--environment", metavar="FILE", help="Light it by this picture of the sky (.hdr, .exr)."),
            click.option("--size", type=SIZE, metavar="WxH", help="Size of the picture in pixels."),
            click.option(
                "-s",
                "--set",
                "sets",
                multiple=True,
                type=SETTING,
                help="Set a parameter, rewire an input, swap a type: ao.radius=0.5, light.lookup=null, sun.type=T.",
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
        function = decorate(function)
    return function


def load(**selection: Any) -> rg.Pipeline:
    """The pipeline that `pipeline_options` describe, linked; its warnings are said.

    Raises:
        InputError: with every mistake found on the way.
    """
    pipeline = make(**selection)
    warn(pipeline.warnings)
    return pipeline


def sketched(**selection: Any) -> tuple[rg.Pipeline, Graph]:
    """The pipeline and its graph to look at, where node types may be missing; what is, and its warnings, are said.

    Raises:
        InputError: with every mistake found on the way, where something else is wrong.
    """
    pipeline = make(**selection)
    graph, missing = pipeline.sketch
    scene = () if missing else pipeline.scene.warnings  # it may be what cannot be read
    warn((*pipeline.spec.notes, *graph.warnings, *scene, *missing))
    return pipeline, graph


def conclude(*pipelines: rg.Pipeline) -> None:
    """End with the exit code of a wrong file where something was missing, now that the rest has been shown."""
    if any(pipeline.sketch[1] for pipeline in pipelines):
        click.get_current_context().exit(InputError.exit_code)


def make(
    pipeline: str,
    *,
    scene: str | None = None,
    camera: str | None = None,
    environment: str | None = None,
    size: tuple[int, int] | None = None,
    sets: tuple[str, ...] = (),
    patches: tuple[Path, ...] = (),
    asset_roots: tuple[Path, ...] = (),
    limits: tuple[tuple[str, int], ...] = (),
    plugins: tuple[Path, ...] = (),
) -> rg.Pipeline:
    """The pipeline that `pipeline_options` describe; nothing is read yet."""
    import rendergraph as rg

    return rg.load(
        pipeline,
        scene=scene,
        camera=camera,
        environment=environment,
        size=size,
        sets=list(sets),
        patches=list(patches),
        asset_roots=list(asset_roots),
        limits=dict(limits),
        plugins=list(plugins),
    )


def words(**selection: Any) -> list[str]:
    """What was typed for `selection_options`, so that a report can say how to get it again."""
    found = [
        w for key in ("scene", "camera", "environment") if selection.get(key) for w in (f"--{key}", selection[key])
    ]
    if size := selection.get("size"):
        found += ["--size", f"{size[0]}x{size[1]}"]
    many = {"sets": "-s", "patches": "-p", "asset_roots": "--asset-root", "plugins": "--plugin"}
    found += [word for key, option in many.items() for value in selection.get(key, ()) for word in (option, str(value))]
    return [*found, *(word for name, most in selection.get("limits", ()) for word in ("--limit", f"{name}={most}"))]


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
    from rendergraph.images.files import failed, staged

    check_target(output)
    with staged([output]) as (part,):
        try:
            part.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
        except OSError as error:
            raise failed(output, error.strerror or str(error)) from error
