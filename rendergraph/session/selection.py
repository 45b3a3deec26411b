"""What is asked for, before anything is read: which pipeline with what said about it, and how it is to be drawn.

Both are plain frozen values without GL, files or modules in them, so that a run can be sent to another process.
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
"""What may stand behind `node.port` in a tap: `[2]`, `[mip=3]`, `[2,mip=3]` and `:stencil`."""

MOST_FRAMES = 100_000
"""Of one run: an hour at 30 frames a second."""


class Selection(Struct, frozen=True):
    """A pipeline's name with everything that changes it, as the options of every verb say it.

    Attributes:
        source: a shipped name (`forward`) or a path.
        scene, size: override the file's; `size` is width and height in pixels.
        environment: an equirectangular image that replaces the scene's.
        camera: name of the scene's camera; its first by default.
        sets: what `-s` takes, such as `ao.radius=0.8`.
        patches: merge patches, as files or mappings.
        asset_roots: more folders that the file may reach.
        limits: what files may ask for, by the names that messages give: `yaml-depth`, `scene-vertices`, …;
            `plan-memory`, in MiB, is what textures may take.
        plugins: Python files or folders with node types.

    Raises:
        UsageError: a limit of an unknown name, or a size that is no pair of whole numbers.
    """

    source: str
    scene: str | None = None
    camera: str | None = None
    environment: Path | None = None
    size: tuple[int, int] | None = None
    sets: tuple[str, ...] = ()
    patches: tuple[Path | Mapping[str, Any], ...] = ()
    asset_roots: tuple[Path, ...] = ()
    limits: tuple[tuple[str, int], ...] = ()
    plugins: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        if self.size is not None:
            force_setattr(self, "size", _pair(self.size))
        if not self.limits:
            return
        known = {name for names in _limit_names().values() for name in names}
        for name, _ in self.limits:
            if name not in known:
                raise UsageError(Problem("RG500", f"there is no limit '{name}'{suggestion(name, known)}"))

    def allowed(self, kind: str) -> dict[str, int]:
        """The limits set for `yaml` or `scene` files, or for the `plan`, by field."""
        names = _limit_names()[kind] if self.limits else {}
        return {names[name]: most for name, most in self.limits if name in names}


def _pair(size: Any) -> tuple[int, int]:
    """Width and height; whether pictures can be so large is asked when the file is read."""
    if isinstance(size, tuple | list) and len(size) == 2 and all(isinstance(each, Integral) for each in size):
        return int(size[0]), int(size[1])
    numbers = re.findall(r"\d+", size) if isinstance(size, str) else ()
    example = f"({', '.join(numbers)})" if len(numbers) == 2 else "(1280, 720)"
    text = f"size is {size!r}; it is a pair, width and height in pixels, as in size={example}"
    raise UsageError(Problem("RG500", text))


def _limit_names() -> dict[str, dict[str, str]]:
    """What each kind of file has limits of: the name on the command line to the field."""
    from rendergraph.document import YamlLimits
    from rendergraph.scene.model import SceneLimits

    names = {
        kind: {f"{kind}-{name.replace('_', '-')}": name for name in limits.__struct_fields__ if name != "yaml"}
        for kind, limits in (("yaml", YamlLimits), ("scene", SceneLimits))
    }
    return {**names, "plan": {"plan-memory": "memory"}}


class RenderKeywords(TypedDict, total=False):
    """The fields of `RenderOptions` as keywords; names may be any sequence there, or the text of a single one."""

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


class RenderOptions(Struct, frozen=True):
    """What is drawn of a pipeline, and how; keywords of `render`, `frames` and `plan`.

    Attributes:
        frames: frame numbers from 1; frame 1 is time 0.
        fps: frames a second.
        outputs: names of the outputs to compute, all of the file's by default.
        taps: further ports to read: `node.port`, of it `[layer]`, `[mip=1]` or `[layer,mip=1]`, and `:stencil`.
        alias, poison, shuffle: test modes: no sharing of memory, poisoned released textures, the seed of a random legal
            order instead of the best one.
        heap: let textures of any size and format share blocks of memory; the device must have memory objects.
        warm_up: draw the first frame once more beforehand, unmeasured, and start history afresh after it. By default
            that is done where steps are timed.
        timed: measure each step, which takes longer than many small ones do.
        reuse: leave out the steps whose values are still there from the frame before and would be the same; no bit of a
            picture depends on it. By default that is done unless steps are timed, as those left out take no time.
        cull: leave out objects that lie outside of the view that they would be drawn with; no bit of a picture depends
            on it.

    Raises:
        UsageError: frames or frames a second that there cannot be.
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

    def __post_init__(self) -> None:
        if not isinstance(self.frames, range) or not self.frames or min(self.frames[0], self.frames[-1]) < 1:
            text = f"frames is {self.frames!r}; it is a range of numbers from 1, as in range(1, 31) for the first 30"
            raise UsageError(Problem("RG500", text))
        if len(self.frames) > MOST_FRAMES:
            text = f"{len(self.frames)} frames are more than {MOST_FRAMES} at a time; draw them in parts"
            raise UsageError(Problem("RG500", text))
        if not self.fps > 0:
            raise UsageError(Problem("RG500", f"fps is {self.fps}; it is a number above 0"))

    @property
    def warms_up(self) -> bool:
        """Whether a frame is drawn before the first, so that what a driver does once is not measured."""
        return self.timed if self.warm_up is None else self.warm_up

    @property
    def reuses(self) -> bool:
        """Whether steps are left out; what poison overwrites is never there."""
        return not self.poison and (not self.timed if self.reuse is None else self.reuse)

    @property
    def shares(self) -> bool:
        """Whether kept values are taken over from other pipelines; the modes that check one make all of it."""
        return self.alias and not self.poison and self.shuffle is None

    @classmethod
    def of(cls, keywords: RenderKeywords) -> RenderOptions:
        """The options that keywords spell; None is the default."""
        given: dict[str, Any] = {name: value for name, value in keywords.items() if value is not None}
        for name in {"outputs", "taps"} & given.keys():
            given[name] = each_of(given[name])
        return cls(**given)


def each_of(names: Iterable[str]) -> tuple[str, ...]:
    """Several names, or a text that is one: its letters are never meant."""
    return (names,) if isinstance(names, str) else tuple(names)
