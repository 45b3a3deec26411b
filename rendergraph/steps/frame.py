"""What a node's `update` may ask and do in each frame."""

from __future__ import annotations

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
    """

    view: npt.NDArray[np.float64]
    projection: npt.NDArray[np.float64]
    size: tuple[int, int]
    near: float
    far: float
    light: int = -1


class FrameScene(Protocol):
    """The scene of one frame, with `scene.model`'s values."""

    @property
    def lights(self) -> Sequence[Any]:
        """The scene's lights, in its order."""
        ...

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Least and greatest corner of what is drawn."""
        ...

    @property
    def objects(self) -> Sequence[Any]:
        """Placed objects with `name`, `mesh`, `material`, `transform`, `casts_shadow`, `hidden`."""
        ...

    @property
    def meshes(self) -> Sequence[Any]:
        """What an object's `mesh` counts through; `box` is a mesh's least and greatest corner."""
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
        camera: the pipeline's camera in this frame.
    """

    index: int
    time: float
    camera: ViewMatrices

    @property
    def scene(self) -> FrameScene:
        """The scene in this frame."""
        ...

    def connected(self, port: Port) -> bool:
        """Whether anything is linked to an input."""
        ...

    def set_views(self, port: Views, views: Sequence[ViewMatrices]) -> None:
        """Set the views of a declared table."""
        ...

    def write(self, port: Port, values: npt.NDArray[Any]) -> None:
        """Upload into a declared buffer; the array's bytes may be fewer than the buffer's."""
        ...
