"""What a node's `update` can read and do in each frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

from rendergraph.ports import Port, Views
from rendergraph.steps.model import SceneSource, UniformValue

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


Change: TypeAlias = Literal["camera", "parameters", "size"] | SceneSource


@dataclass(frozen=True, eq=False)
class ViewMatrices:
    """One view: column-vector matrices as float64 arrays of shape (4, 4), and the size in texels.

    Attributes:
        view: world to view space.
        projection: view space to clip space, z in -w…w.
        size: width and height in texels.
        near, far: distances in metres; far may be infinite.
        light: index of the scene's light that it belongs to, -1 for none.
        span: distances along the camera's axis between which the view is used, by default everywhere; several views of
            one light (cascades) are blended where they overlap. `range.zw` in GLSL.
        jitter: the subpixel offset in `projection`, as fractions of the picture's width and height, if frames are
            accumulated (`Node.camera_jitter`). `jitter.xy` in GLSL.
    """

    view: npt.NDArray[np.float64]
    projection: npt.NDArray[np.float64]
    size: tuple[int, int]
    near: float
    far: float
    light: int = -1
    span: tuple[float, float] = (0.0, math.inf)
    jitter: tuple[float, float] = (0.0, 0.0)


# Methods of protocols have no bodies.
# pyright: reportReturnType=false
class FrameScene(Protocol):
    """The scene in one frame: `Frame.scene`. `SceneKey.of` reads plugins' keys of its objects, materials and lights."""

    @property
    def lights(self) -> Sequence[Any]:
        """The scene's lights, in its order."""

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Minimum and maximum corner of all visible objects except shadow catchers."""

    @property
    def catchers(self) -> npt.NDArray[np.int64]:
        """Indices of the visible shadow catchers, (n,)."""

    @property
    def corners(self) -> npt.NDArray[np.float64]:
        """World-space corners of the box of each object, (n, 8, 3); read-only."""

    @property
    def casting(self) -> npt.NDArray[np.bool_]:
        """Mask of objects that are visible and cast a shadow, (n,)."""

    @property
    def shown(self) -> npt.NDArray[np.bool_]:
        """Mask of objects that are not hidden, (n,)."""

    @property
    def objects(self) -> Sequence[Any]:
        """Placed objects with `name`, `mesh`, `material`, `transform`, `casts_shadow`, `hidden`, `pose`.

        `pose` is None, or has the `box` of an animated mesh and `vertices()`, its current `positions` and `normals`.
        """

    @property
    def camera(self) -> Any:
        """The scene's camera with `name`, `transform` and other values; `Frame.camera` has the matrices."""

    def pixels(self, image: Any) -> npt.NDArray[np.float32]:
        """Decode an image that is the value of a `SceneKey`: (height, width, 4), top row first.

        Integers are scaled to 0…1 without a transfer function; HDR and EXR files give linear light.
        """

    @property
    def meshes(self) -> Sequence[Any]:
        """The meshes that an object's `mesh` indexes.

        `box` is a mesh's minimum and maximum corner, `edges` its edge adjacency, `plane` the plane that contains it, or
        None; each is computed once.
        """

    @property
    def materials(self) -> Sequence[Any]:
        """The materials that an object's `material` indexes."""


class Frame(Protocol):
    """The interface of `update`.

    Attributes:
        index: frame number, from 1.
        time: seconds since frame 1.
        camera: the pipeline's camera in this frame, as it renders.
    """

    index: int
    time: float
    camera: ViewMatrices

    @property
    def scene(self) -> FrameScene:
        """The scene in this frame, a `FrameScene`."""

    def connected(self, port: Port) -> bool:
        """Whether an input is connected."""

    def views(self, port: Port) -> Sequence[ViewMatrices]:
        """Return the views that the texture at an input was rendered with, in order; none if it is not connected."""

    def set_views(self, port: Views, views: Sequence[ViewMatrices]) -> None:
        """Set the views of a declared table."""

    def set_region(
        self,
        number: int,
        scissor: tuple[int, int, int, int] | None = None,
        depth_bounds: tuple[float, float] | None = None,
    ) -> None:
        """Restrict the steps of a `region` to a part of the picture from now on.

        Args:
            number: number of the region.
            scissor: x, y, width and height in texels from the bottom left; None for the whole target. With a width or
                height of 0 nothing is drawn.
            depth_bounds: minimum and maximum value in the depth texture for which fragments pass, 0 to 1. Drivers
                without depth bounds ignore it, so it may save work but must not change the picture.
        """

    def set_uniform(self, name: str, value: UniformValue) -> None:
        """Set a uniform of the node's steps from now on.

        It must have an initial value: a parameter, or a keyword of a step (`steps.fullscreen(…, wind=(0, 0))`). Steps
        that compute kept values keep the initial value.
        """

    def changed(self, *what: Change) -> bool:
        """Return whether anything has changed since the previous frame; true in the first frame.

        Args:
            what: `camera` (position and lens, without jitter), `transforms`, `lights`, `materials`, `environment`,
                `parameters`, `size`; by default all of them. After a change of parameters or size, the next frame is
                a first frame.
        """

    def write(self, port: Port, values: npt.NDArray[Any]) -> None:
        """Upload an array into a declared buffer; it may have fewer bytes than the buffer."""
