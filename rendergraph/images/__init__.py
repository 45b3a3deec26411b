"""Pictures on disk. OpenImageIO is imported on first use.

`decode` prepares a scene's image for the GPU, `write` and `read` are the plain functions, `viewable` turns any texture
into a picture that an eye can read, and `save_outputs` chooses what of a frame goes into which kind of file.
"""

from rendergraph.images.decode import decode as decode
from rendergraph.images.decode import decode_light as decode_light
from rendergraph.images.decode import read as read
from rendergraph.images.decode import read_metadata as read_metadata
from rendergraph.images.encode import EXTENSIONS as EXTENSIONS
from rendergraph.images.encode import picture_bytes as picture_bytes
from rendergraph.images.encode import write as write
from rendergraph.images.saving import PictureInfo as PictureInfo
from rendergraph.images.saving import Saved as Saved
from rendergraph.images.saving import channel_names as channel_names
from rendergraph.images.saving import check_target as check_target
from rendergraph.images.saving import encoded as encoded
from rendergraph.images.saving import is_numbered as is_numbered
from rendergraph.images.saving import numbered as numbered
from rendergraph.images.saving import output_for as output_for
from rendergraph.images.saving import save_output as save_output
from rendergraph.images.saving import save_outputs as save_outputs
from rendergraph.images.saving import stands_for as stands_for
from rendergraph.images.saving import viewable_as as viewable_as
from rendergraph.images.viewable import from_srgb as from_srgb
from rendergraph.images.viewable import heat_map as heat_map
from rendergraph.images.viewable import signed_map as signed_map
from rendergraph.images.viewable import to_srgb as to_srgb
from rendergraph.images.viewable import viewable as viewable
