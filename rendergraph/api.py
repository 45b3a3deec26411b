"""The one module a node author imports."""

from __future__ import annotations

from rendergraph.declare import (
    Choice,
    Extension,
    Facts,
    Function,
    History,
    InOut,
    Input,
    Internal,
    LightFacts,
    MeshData,
    Node,
    Output,
    Part,
    Port,
    TextureInfo,
    Views,
    define,
    param,
    structural,
)  # fmt: skip
from rendergraph.steps import (
    ADD,
    ALPHA,
    MULTIPLY,
    PREMULTIPLIED,
    Blend,
    Frame,
    State,
    Stencil,
    StencilFace,
    Steps,
    ViewMatrices,
)  # fmt: skip
from rendergraph.textures import (
    Albedo,
    Any,
    Depth,
    DisplayColor,
    Emissive,
    IrradianceSH,
    LinearDepth,
    Luminance,
    Material,
    Normal,
    Occlusion,
    Radiance,
    SceneRef,
    Semantic,
    ShadowLookup,
    ShadowMap,
    Signature,
    TextureDesc,
    View,
    Visibility,
    full_mip_count,
)  # fmt: skip

__all__ = [
    "ADD", "ALPHA", "MULTIPLY", "PREMULTIPLIED", "Albedo", "Any", "Blend", "Choice", "Depth", "DisplayColor", "Emissive", "Extension", "Facts",
    "Frame", "Function", "History", "InOut", "Input", "Internal", "IrradianceSH", "LightFacts", "LinearDepth",
    "Luminance", "Material", "MeshData", "Node", "Normal", "Occlusion", "Output", "Part", "Port", "Radiance", "SceneRef",
    "Semantic", "ShadowLookup", "ShadowMap", "Signature", "State", "Stencil", "StencilFace", "Steps", "TextureDesc",
    "TextureInfo", "View", "ViewMatrices", "Views", "Visibility", "define", "full_mip_count", "param", "structural",
]  # fmt: skip
