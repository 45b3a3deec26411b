"""Pictures on disk. OpenImageIO is imported on first use.

`decode` prepares a scene's image for the GPU, `write` and `read` are the plain functions, `viewable` turns any texture
into a viewable picture, and `save_outputs` converts a frame's outputs to the formats of files.
"""

from rendergraph.images.decode import decode, decode_light, read, read_metadata
from rendergraph.images.encode import EXTENSIONS, picture_bytes, write
from rendergraph.images.saving import (
    PictureInfo,
    Saved,
    Shown,
    channel_names,
    check_target,
    encoded,
    is_numbered,
    numbered,
    output_for,
    save_output,
    save_outputs,
    shown,
    stands_for,
    viewable_as,
)
from rendergraph.images.viewable import from_srgb, heat_map, mapped, signed_map, to_srgb, viewable
