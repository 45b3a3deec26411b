"""What a node declares: ports and parameters. The one source for checking, schema, docs, uniforms and diffs."""

from __future__ import annotations

from rendergraph.declare.facts import Facts, LightFacts, TextureInfo
from rendergraph.declare.mistakes import RESERVED_NAMES, declaration_mistakes
from rendergraph.declare.node import Node
from rendergraph.declare.parameters import define, param, structural
from rendergraph.declare.ports import (
    PORT_TYPES,
    Function,
    History,
    InOut,
    Input,
    Internal,
    Made,
    Output,
    Part,
    Port,
    Ruled,
    SizeRule,
    Views,
)  # fmt: skip

__all__ = [
    "PORT_TYPES", "RESERVED_NAMES", "Facts", "Function", "History", "InOut", "Input", "Internal", "LightFacts", "Made",
    "Node", "Output", "Part", "Port", "Ruled", "SizeRule", "TextureInfo", "Views", "declaration_mistakes", "define",
    "param", "structural",
]  # fmt: skip
