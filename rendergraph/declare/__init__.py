"""What a node declares: ports and parameters. The one source for checking, schema, docs, uniforms and diffs."""

from __future__ import annotations

from rendergraph.declare.extensions import (
    NO_EXTENSIONS,
    READ_IMAGES,
    Added,
    Extension,
    Extensions,
    MeshData,
    Source,
    extension_mistakes,
)
from rendergraph.declare.mistakes import RESERVED_NAMES, declaration_mistakes
from rendergraph.declare.node import DROPPED, Node
from rendergraph.declare.parameters import Parameter, define, param, structural
from rendergraph.facts import Facts, LightFacts, ObjectFacts, TextureInfo, casting_lights
from rendergraph.ports import (
    Function,
    History,
    InOut,
    Input,
    Internal,
    Output,
    Part,
    Port,
    Ruled,
    SizeRule,
    Texel,
    Views,
    WrittenPort,
)

__all__ = [
    "DROPPED",
    "NO_EXTENSIONS",
    "READ_IMAGES",
    "RESERVED_NAMES",
    "Added",
    "Extension",
    "Extensions",
    "Facts",
    "Function",
    "History",
    "InOut",
    "Input",
    "Internal",
    "LightFacts",
    "MeshData",
    "Node",
    "ObjectFacts",
    "Output",
    "Parameter",
    "Part",
    "Port",
    "Ruled",
    "SizeRule",
    "Source",
    "Texel",
    "TextureInfo",
    "Views",
    "WrittenPort",
    "casting_lights",
    "declaration_mistakes",
    "define",
    "extension_mistakes",
    "param",
    "structural",
]
