"""What a node's `update` may ask and do in each frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from rendergraph.ports import Port, Views

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class ViewMatrices:
    """One view: column-vector matrices as float64 arrays of shape (4, 4), and the size drawn at.

    Attributes:
        view: world to view space.
        projection: view space to clip space, z in -w…w.
        size: width and height in texels.
        near, far: distances in metres; far may be infinite.
        light: the scene's light index it belongs to, -1 for none.
        span: distances from the camera, along its axis, between which the view is looked at; several of one light share
            the picture by them, and are blended where they overlap. Everywhere by default. `range.zw` in GLSL.
        jitter: how far `projection` moves the picture, in widths and heights of it, where pictures of many frames are
            put together (`Node.camera_jitter`). `jitter.xy` in GLSL.
    """

    view: npt.NDArray[np.float64]
    projection: npt.NDArray[np.float64]
    size: tuple[int, int]
    near: float
    far: float
    light: int = -1
    span: tuple[float, float] = (0.0, math.inf)
    jitter: tuple[float, float] = (0.0, 0.0)


class FrameScene(Protocol):
    """The scene where a frame finds it: `Frame.scene`."""

    @property
    def lights(self) -> Sequence[Any]:
        """The scene's lights, in its order."""
        ...

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Least and greatest corner of what is drawn."""
        ...

    @property
    def corners(self) -> npt.NDArray[np.float64]:
        """World-space corners of the box of each object, (n, 8, 3); do not write into it."""
        ...

    @property
    def casting(self) -> npt.NDArray[np.bool_]:
        """Which objects are drawn and cast a shadow, (n,)."""
        ...

    @property
    def shown(self) -> npt.NDArray[np.bool_]:
        """Which objects are not hidden, (n,)."""
        ...

    @property
    def objects(self) -> Sequence[Any]:
        """Placed objects with `name`, `mesh`, `material`, `transform`, `casts_shadow`, `hidden`."""
        ...

    @property
    def meshes(self) -> Sequence[Any]:
        """What an object's `mesh` counts through.

        `box` is a mesh's least and greatest corner, `edges` which of its triangles meet at each edge, `plane`
        the one that they lie in, or None; found once.
        """
        ...

    @property
    def materials(self) -> Sequence[Any]:
        """What an object's `material` counts through."""
        ...


class Frame(Protocol):
    """What `update` may ask and do.

    Attributes:
        index: frame number, from 1.
        time: seconds since frame 1.
        camera: the pipeline's camera in this frame, as it is drawn with.
    """

    index: int
    time: float
    camera: ViewMatrices

    @property
    def scene(self) -> FrameScene:
        """The scene in this frame, a `FrameScene`."""
        ...

    def connected(self, port: Port) -> bool:
        """Whether anything is linked to an input."""
        ...

    def views(self, port: Port) -> Sequence[ViewMatrices]:
        """The views that what is linked to an input was drawn with, one after another; none where nothing is linked."""
        ...

    def set_views(self, port: Views, views: Sequence[ViewMatrices]) -> None:
        """Set the views of a declared table."""
        ...

    def set_region(
        self,
        number: int,
        scissor: tuple[int, int, int, int] | None = None,
        depth_bounds: tuple[float, float] | None = None,
    ) -> None:
        """Draw the steps of a `region` in a part of the picture from now on.

        Args:
            number: the region's.
            scissor: x, y, width and height in texels from the bottom left; None for the whole target. With a width or
                height of 0 nothing is drawn.
            depth_bounds: least and greatest depth that what the depth texture holds may have there, 0 to 1. Where the
                driver has no depth bounds this is passed over: it saves work, and must not change the picture.
        """
        ...

    def write(self, port: Port, values: npt.NDArray[Any]) -> None:
        """Upload into a declared buffer; the array's bytes may be fewer than the buffer's."""
        ...
