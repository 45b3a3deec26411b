"""Pictures on disk. OpenImageIO is imported on first use.

`decode` prepares a scene's image for the GPU, `write` and `read` are the plain functions, `viewable` turns any texture
into a picture that an eye can read, and `save_outputs` chooses what of a frame goes into which kind of file.
"""

from rendergraph.images.decode import decode, decode_light, read, read_metadata
from rendergraph.images.encode import EXTENSIONS, write
from rendergraph.images.saving import (
    PictureInfo,
    Saved,
    channel_names,
    check_target,
    encoded,
    is_numbered,
    numbered,
    output_for,
    save_output,
    save_outputs,
    stands_for,
    viewable_as,
)
from rendergraph.images.viewable import from_srgb, heat_map, to_srgb, viewable

__all__ = [
    "EXTENSIONS",
    "PictureInfo",
    "Saved",
    "channel_names",
    "check_target",
    "decode",
    "decode_light",
    "encoded",
    "from_srgb",
    "heat_map",
    "is_numbered",
    "numbered",
    "output_for",
    "read",
    "read_metadata",
    "save_output",
    "save_outputs",
    "stands_for",
    "to_srgb",
    "viewable",
    "viewable_as",
    "write",
]
