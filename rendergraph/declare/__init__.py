"""Declarations of nodes: ports and parameters, the only source for checking, schema, docs, uniforms and diffs."""

from __future__ import annotations

from rendergraph.declare.extensions import NO_EXTENSIONS, Added, Extension, Extensions, MeshData, SceneKey, TextureKind
from rendergraph.declare.mistakes import RESERVED_NAMES, declaration_mistakes
from rendergraph.declare.node import DROPPED, FileContent, InputFile, Node, Parameter, define, param, structural
from rendergraph.facts import CameraFacts, Facts, LightFacts, MaterialFacts, ObjectFacts, TextureInfo, casting_lights
from rendergraph.ports import Function, History, InOut, Input, Internal, Output, Part, Port, Views, WrittenPort
