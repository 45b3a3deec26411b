"""Edit the text of files: everything else stays byte for byte."""

from rendergraph.edit.pipeline import PipelineText
from rendergraph.edit.shader import upgraded_shader
