"""The arguments of a render before anything is read: a pipeline with the changes to it, and how to render it.

Both are frozen values without GL, files or modules in them, so that a run can be sent to another process.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any, TypedDict

from msgspec import Struct
from msgspec.structs import force_setattr

from rendergraph.errors import Problem, UsageError, suggestion

TEXTURE_PART = (
    r"(?:\[(?!\])(?:(?P<layer>\d{1,9})(?:,(?=mip)|(?=\])))?(?:mip=(?P<mip>\d{1,9}))?\])?(?P<stencil>:stencil)?"
)
"""The suffixes of `node.port` in a tap: `[2]`, `[mip=3]`, `[2,mip=3]` and `:stencil`."""

MOST_FRAMES = 100_000
"""Per run: an hour at 30 frames per second."""
MOST_SUBFRAMES = 4096


VIEW = ("scene", "camera", "environment")
"""What `-s` and axes set without a node: `-s scene=spheres` is `--scene spheres`."""


class Selection(Struct, frozen=True):
    """A pipeline's name with everything that changes it, as the options of every verb have it.

    Attributes:
        source: a shipped name (`forward`), a path, YAML text of several lines, or a mapping with the keys of a file.
        text: what the file `source` holds, where it has been edited and is not written yet.
        scene, size: override the file's; `size` is width and height in pixels.
        environment: an equirectangular image that replaces the scene's.
        variant: name of a variant of the scene's file, which has other materials.
        ground: whether a ground is put below the scene's objects, also where its file asks for none.
        transparent: whether to set the parameter `transparent` of every node that has one: pictures get alpha.
        camera: name of the scene's camera; its first by default.
        view: name of a view of the file, which gives the camera, environment and frame that are not chosen otherwise.
        shutter: overrides the cameras': how much of a frame's time it is open, 0 to 1.
        sets: values of `-s`, such as `ao.radius=0.8`.
        patches: merge patches, as files or mappings.
        asset_roots: more folders from which files may be read.
        limits: limits of files, named as in messages: `yaml-depth`, `scene-vertices`, …; `plan-memory`, in MiB, limits
            all textures.
        plugins: Python files or folders with node types.
    """

    source: str | Mapping[str, Any]
    scene: str | None = None
    camera: str | None = None
    shutter: float | None = None
    environment: Path | None = None
    variant: str | None = None
    ground: bool = False
    transparent: bool = False
    size: tuple[int, int] | None = None
    sets: tuple[str, ...] = ()
    patches: tuple[Path | Mapping[str, Any], ...] = ()
    asset_roots: tuple[Path, ...] = ()
    limits: tuple[tuple[str, int], ...] = ()
    plugins: tuple[Path, ...] = ()
    view: str | None = None
    text: str | None = None

    def __post_init__(self) -> None:
        if self.size is not None:
            force_setattr(self, "size", _pair(self.size))
        if self.shutter is not None and not 0 <= self.shutter <= 1:
            raise UsageError(Problem("RG500", f"shutter: expected a fraction of a frame, 0 to 1, got {self.shutter}"))
        for text in self.sets:
            path, _, value = text.partition("=")
            if path.strip() in VIEW and value:
                force_setattr(self, path.strip(), Path(value) if path.strip() == "environment" else value)
                force_setattr(self, "sets", tuple(each for each in self.sets if each is not text))
        if not self.limits:
            return
        known = {name for names in _limit_names().values() for name in names}
        for name, _ in self.limits:
            if name not in known:
                raise UsageError(Problem("RG500", f"unknown limit '{name}'{suggestion(name, known)}"))

    @property
    def view_fields(self) -> dict[str, str]:
        """What is chosen beside the pipeline's file and changes its pictures, as texts by field."""
        names = ("camera", "environment", "variant", "ground", "shutter")
        values = {name: getattr(self, name) for name in names}
        return {name: str(value) for name, value in values.items() if value is not None and value is not False}

    @property
    def label(self) -> str:
        """The source in one line."""
        is_name = isinstance(self.source, str) and "\n" not in self.source
        return str(self.source) if is_name else "pipeline"

    def allowed(self, kind: str) -> dict[str, int]:
        """Return the limits set for `yaml` or `scene` files, or for the `plan`, by field."""
        names = _limit_names()[kind] if self.limits else {}
        return {names[name]: most for name, most in self.limits if name in names}


def _pair(size: Any) -> tuple[int, int]:
    """Return width and height; the limit of pictures is checked when the file is read."""
    if isinstance(size, tuple | list) and len(size) == 2 and all(isinstance(each, Integral) for each in size):
        return int(size[0]), int(size[1])
    numbers = re.findall(r"\d+", size) if isinstance(size, str) else ()
    example = f"({', '.join(numbers)})" if len(numbers) == 2 else "(1280, 720)"
    text = f"size: expected width and height in pixels, as in size={example}, got {size!r}"
    raise UsageError(Problem("RG500", text))


def _limit_names() -> dict[str, dict[str, str]]:
    """Return, for each kind of limits, the name on the command line to the field."""
    from rendergraph.document import YamlLimits
    from rendergraph.scene.model import SceneLimits

    names = {
        kind: {f"{kind}-{name.replace('_', '-')}": name for name in limits.__struct_fields__ if name != "yaml"}
        for kind, limits in (("yaml", YamlLimits), ("scene", SceneLimits))
    }
    return {**names, "plan": {"plan-memory": "memory"}}


class RenderKeywords(TypedDict, total=False):
    """The fields of `RenderOptions` as keywords; names may be any sequence, or the text of a single one."""

    frames: range
    fps: float
    outputs: Sequence[str] | None
    taps: Sequence[str]
    alias: bool
    heap: bool
    poison: bool
    shuffle: int | None
    warm_up: bool | None
    timed: bool
    reuse: bool | None
    cull: bool
    still: int | None
    subframes: int
    turntable: range | None
    share: bool | None


class RenderOptions(Struct, frozen=True):
    """The outputs of a pipeline to render, and how; keywords of `render`, `frames` and `plan`.

    Attributes:
        frames: frame numbers from 1; frame 1 is time 0.
        fps: frames per second.
        outputs: names of the outputs to compute; all of the file's by default.
        taps: further ports to read: `node.port`, followed by `[layer]`, `[mip=1]`, `[layer,mip=1]` or `:stencil`.
        alias, poison, shuffle: test modes: no sharing of memory, poisoned released textures, the seed of a random legal
            order.
        heap: let textures of any size and format share blocks of memory; the device must have memory objects.
        warm_up: render the first frame once more beforehand, unmeasured, and clear the history after it; by default if
            steps are timed.
        timed: measure each step, which takes longer if there are many small ones.
        reuse: skip steps whose results are unchanged since the previous frame; by default unless steps are timed, as
            skipped steps take no time. No bit of a picture depends on it.
        cull: skip objects outside the view that they would be rendered with. No bit of a picture depends on it.
        still: a frame after which the scene, the camera and the time stay as they are, so that pictures accumulate.
        subframes: number of moments of the open shutter, centred on the frame's time, whose light is averaged. History
            advances once per frame; random numbers differ between moments.
        turntable: the frames in which the camera goes around its target once.
        share: use kept values that other pipelines have made; by default in no test mode.
    """

    frames: range = range(1, 2)
    fps: float = 30.0
    outputs: tuple[str, ...] | None = None
    taps: tuple[str, ...] = ()
    alias: bool = True
    heap: bool = False
    poison: bool = False
    shuffle: int | None = None
    warm_up: bool | None = None
    timed: bool = False
    reuse: bool | None = None
    cull: bool = True
    still: int | None = None
    subframes: int = 1
    turntable: range | None = None
    share: bool | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.frames, range) or not self.frames or min(self.frames[0], self.frames[-1]) < 1:
            text = (
                f"frames: expected a range of numbers from 1, as in range(1, 31) for the first 30, got {self.frames!r}"
            )
            raise UsageError(Problem("RG500", text))
        if len(self.frames) > MOST_FRAMES:
            text = f"{len(self.frames)} frames exceed the limit of {MOST_FRAMES} per run; render them in several runs"
            raise UsageError(Problem("RG500", text))
        if not isinstance(self.subframes, int) or not 1 <= self.subframes <= MOST_SUBFRAMES:
            text = f"subframes: expected a number from 1 to {MOST_SUBFRAMES}, got {self.subframes!r}"
            raise UsageError(Problem("RG500", text))
        if not self.fps > 0:
            raise UsageError(Problem("RG500", f"fps: expected a number above 0, got {self.fps}"))

    @property
    def warms_up(self) -> bool:
        """Whether a frame is rendered before the first, so that one-time work of a driver is not measured."""
        return self.timed if self.warm_up is None else self.warm_up

    @property
    def reuses(self) -> bool:
        """Whether steps are skipped; poison overwrites the results that this needs."""
        return not self.poison and (not self.timed if self.reuse is None else self.reuse)

    @property
    def shares(self) -> bool:
        """Whether kept values of other pipelines are used; the test modes compute all of them."""
        is_test = not self.alias or self.poison or self.shuffle is not None
        return not is_test if self.share is None else self.share

    @classmethod
    def of(cls, keywords: RenderKeywords) -> RenderOptions:
        """Return the options of these keywords; None is the default."""
        given: dict[str, Any] = {name: value for name, value in keywords.items() if value is not None}
        for name in {"outputs", "taps"} & given.keys():
            given[name] = each_of(given[name])
        return cls(**given)


def each_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return several names as a tuple; a text is a single name, not its letters."""
    return (names,) if isinstance(names, str) else tuple(names)
