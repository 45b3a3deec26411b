"""Changes to the text of files: what is not changed stays byte for byte."""

from rendergraph.edit.pipeline import PipelineText
from rendergraph.edit.shader import upgraded_shader
