"""Declarations of nodes: ports and parameters, the only source for checking, schema, docs, uniforms and diffs."""

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
from rendergraph.declare.node import (
    DROPPED,
    FileContent,
    InputFile,
    Node,
    Parameter,
    define,
    param,
    structural,
    type_name,
)
from rendergraph.declare.scene_keys import Image, SceneKey, Section, TextureKind
from rendergraph.facts import CameraFacts, Facts, LightFacts, MaterialFacts, ObjectFacts, TextureInfo, casting_lights
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
