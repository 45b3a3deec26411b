"""Node types for tests of the stages before any GPU: like the standard ones, but standing still while those change."""

from __future__ import annotations

from typing import Literal

from rendergraph import api
from rendergraph.api import (
    Albedo,
    Depth,
    DisplayColor,
    Facts,
    Function,
    History,
    InOut,
    Input,
    Internal,
    Luminance,
    Node,
    Normal,
    Occlusion,
    Output,
    Radiance,
    SceneError,
    Semantic,
    ShadowLookup,
    ShadowMap,
    Signature,
    Steps,
    TextureInfo,
    View,
    Views,
    Visibility,
    define,
    param,
    structural,
)
from rendergraph.catalog import Catalog

ViewNormal = Semantic("normal", "Unit normal in view space.", space="view")
Ids = Semantic("ids", "Number of the object.")
EncodedAlbedo = Semantic("albedo", "Base colour, sRGB encoded.", encoding="display")
Wind = Signature("wind", "vec3 wind(vec3 position)", ("position",), "+", "vec3(0.0)", "Wind at a place.")


def _cast(node: LightDepth, facts: Facts) -> tuple[int, ...]:
    names = [light.name for light in facts.lights]
    if node.light == "auto":
        return (0,) if names else ()
    if node.light not in names:
        raise SceneError(f"the scene has no light '{node.light}'; available: {', '.join(names)}", node.light)
    return (names.index(node.light),)


class LightDepth(Node):
    """Depth from lights."""

    views = Views(count=lambda node, facts: len(_cast(node, facts)), lights=_cast, doc="The lights' views.")
    shadow_map = Output(
        ShadowMap,
        kind="texture2d_array",
        format="depth32f",
        layers=lambda node, facts: len(_cast(node, facts)),
        size=lambda node, facts: (node.resolution, node.resolution),
        view="views",
        lights="views",
        doc="Depth.",
    )
    light: str = structural(default="auto", doc="Which light.")
    resolution: int = structural(default=1024, unit="texels", min=16, max=32768, doc="Side.")


class ShadowPcf(Node):
    """Shadows by percentage-closer filtering."""

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", compare=True, doc="Depth from lights.")
    depth = Input(Depth, optional=True, doc="Depth of the picture.")
    visibility = Output(
        Visibility,
        kind="texture2d_array",
        format="r8",
        size="depth",
        lights="shadow_map",
        needs=("depth",),
        layers=lambda node, facts: len(facts.input("shadow_map").lights),
        doc="1 lit, 0 shadowed.",
    )
    lookup = Function(ShadowLookup, "shadow_pcf.glsl", reads=("shadow_map",), doc="To call.")
    taps: int = define(default=4, min=1, max=8, doc="Taps along a side.")
    bias: float = param(default=1.0, unit="texels", min=0, max=10, doc="Offset.")


class ShadowVsm(Node):
    """Variance shadows."""

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Depth from lights.")
    depth = Input(Depth, optional=True, doc="Depth of the picture.")
    visibility = Output(
        Visibility, kind="texture2d_array", size="depth", lights="shadow_map", needs=("depth",), doc="Lit or not."
    )
    lookup = Function(ShadowLookup, "shadow_vsm.glsl", reads=("shadow_map",), doc="To call.")
    radius: int = define(default=4, min=1, max=8, doc="Blur.")
    bias: float = param(default=1.0, unit="texels", min=0, max=10, doc="Offset.")


class DepthPrepass(Node):
    """Depth before everything else."""

    view = Input(View, kind="view", optional=True, doc="Seen from.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")


class ForwardLighting(Node):
    """Light in one pass over the geometry."""

    view = Input(View, kind="view", optional=True, doc="Seen from.")
    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows to look up.")
    visibility = Input(Visibility, kind="texture2d_array", many=True, optional=True, doc="Shadows as pictures.")
    depth = Input(Depth, use="depth_test", optional=True, doc="Depth to test.")
    radiance = Output(Radiance, clear=0.0, doc="Radiance.")
    scratch = Internal(Depth, format="depth32f")
    shading: Literal["unlit", "phong", "blinn_phong", "pbr"] = define(default="pbr", doc="How surfaces reflect.")
    ambient: float | tuple[float, float, float] = param(default=0.03, min=0, glsl="vec3", doc="From all sides.")


class Gbuffer(Node):
    """Surfaces as textures."""

    view = Input(View, kind="view", optional=True, doc="Seen from.")
    albedo = Output(Albedo, format="rgba8", doc="Base colour.")
    normal = Output(Normal, doc="Normal.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")


class MsaaGbuffer(Node):
    """Surfaces as multisampled textures."""

    albedo = Output(Albedo, format="rgba8", samples=4, doc="Base colour.")
    normal = Output(Normal, samples=4, doc="Normal.")
    depth = Output(Depth, format="depth32f", samples=4, doc="Depth.")


class Resolve(Node):
    """One sample of many."""

    source = Input(api.Any, samples="multi", doc="Multisampled.")
    resolved = Output(like="source", samples=1, doc="The mean.")


class DeferredLighting(Node):
    """Light from textures."""

    albedo = Input(Albedo, group="gbuffer", doc="Base colour.")
    normal = Input(Normal, group="gbuffer", doc="Normal.")
    depth = Input(Depth, group="gbuffer", doc="Depth.")
    occlusion = Input(Occlusion, optional=True, doc="Scales ambient light.")
    visibility = Input(Visibility, kind="texture2d_array", many=True, optional=True, doc="Shadows.")
    radiance = Output(Radiance, doc="Radiance.")


class Ssao(Node):
    """Occlusion in screen space."""

    depth = Input(Depth, doc="Depth.")
    normal = Input(Normal, optional=True, doc="Normal.")
    occlusion = Output(Occlusion, format="r8", size="depth", doc="1 open.")
    samples: int = define(default=16, min=1, max=64, doc="Directions.")
    radius: float = param(default=0.5, unit="m", min=0, max=10, doc="Reach.")
    offset: tuple[float, float] = param(default=(0.0, 0.0), doc="Shift.")
    quality: Literal["low", "high"] = define(default="low", doc="How fine.")
    blurred: bool = define(default=True, doc="Whether to blur.")


class Tonemap(Node):
    """Radiance to display values."""

    radiance = Input(Radiance, doc="Radiance.")
    color = Output(DisplayColor, format="rgba8", doc="Colour.")
    exposure: float = param(default=0.0, unit="EV", min=-16, max=16, doc="Stops.")
    curve: Literal["neutral", "aces", "none"] = define(default="neutral", doc="Shoulder.")


class Blur(Node):
    """A blur of anything."""

    source = Input(api.Any, size="any", filter="linear", doc="What.")
    blurred = Output(like="source", doc="The same, blurred.")
    across = Internal(like="source")
    radius: int = param(default=4, unit="texels", min=1, max=32, doc="Reach.")


class Half(Node):
    """Radiance at half size."""

    source = Input(Radiance, size="any", doc="What.")
    radiance = Output(Radiance, size=("source", 0.5), doc="Half.")


class Upsample(Node):
    """Radiance at full size."""

    source = Input(Radiance, size="any", filter="linear", doc="What.")
    radiance = Output(Radiance, doc="Full.")


class Sky(Node):
    """Sky behind everything."""

    depth = Input(Depth, use="depth_test", optional=True, doc="Depth.")
    radiance = InOut(Radiance, optional=True, doc="What it is added to.")


class Fog(Node):
    """Fog over everything."""

    radiance = InOut(Radiance, doc="What it covers.")
    before = Input(Radiance, optional=True, doc="Without fog.")


class Temporal(Node):
    """Mean over time."""

    radiance = Input(Radiance, doc="Now.")
    last = Input(Radiance, optional=True, doc="Then.")
    stable = Output(Radiance, doc="Mean.")
    kept = History(Radiance)


class Histogram(Node):
    """Counts of luminance."""

    radiance = Input(Radiance, doc="What is counted.")
    counts = Output(Luminance, kind="buffer", bytes=1024, doc="256 counts.")

    def record(self, steps: Steps) -> None:
        """One dispatch."""
        steps.compute("histogram.comp", groups=(1, 1, 1))


class Exposure(Node):
    """Exposure from counts."""

    counts = Input(Luminance, kind="buffer", doc="256 counts.")
    radiance = Input(Radiance, doc="What is exposed.")
    exposed = Output(Radiance, doc="Exposed.")


class NormalsInView(Node):
    """Normals in view space."""

    normal = Output(ViewNormal, doc="Normal.")


class NormalsToWorld(Node):
    """View space to world space."""

    source = Input(ViewNormal, doc="Normal in view space.")
    normal = Output(Normal, doc="Normal in world space.")


class Painting(Node):
    """Base colour as an image file has it."""

    albedo = Output(EncodedAlbedo, format="rgba8", doc="Encoded colour.")


class Cube(Node):
    """Six faces."""

    radiance = Output(Radiance, kind="texture_cube", size=(64, 64), mips=0, doc="All around.")


class ObjectIds(Node):
    """Numbers of objects."""

    ids = Output(Ids, format="r32ui", doc="Numbers.")


class WindField(Node):
    """Wind to call."""

    lookup = Function(Wind, "wind.glsl", doc="To call.")


class Colored(Node):
    """A colour that is tested as depth."""

    depth = Output(Depth, format="r32f", doc="Depth in a colour format.")


class TwoSizes(Node):
    """Two targets that do not fit."""

    small = Output(Radiance, size=0.5, doc="Half.")
    large = Output(Radiance, doc="Full.")


class TooManyMips(Node):
    """A chain that is too long."""

    mips: int = structural(default=1, min=0, max=99, doc="Levels.")
    radiance = Output(Radiance, mips=lambda node, facts: node.mips, size=(16, 16), doc="Mips.")


class FailingRule(Node):
    """A rule with a mistake in it."""

    radiance = Output(Radiance, format=lambda node, facts: dict[str, str]()["nonsense"], doc="Never.")


def _size(found: TextureInfo) -> tuple[int, int]:
    assert found.desc is not None
    return found.desc.size


class Growing(Node):
    """As large as what it reads."""

    source = Input(Radiance, size="any", optional=True, doc="What.")
    radiance = Output(Radiance, size="source", doc="The same.")
    halved = Output(Radiance, size=lambda node, facts: _size(facts.input("source")), doc="Needs it.")

    def record(self, steps: Steps) -> None:
        """Nothing."""


class UnknownFormat(Node):
    """A format that is none."""

    radiance = Output(Radiance, format=lambda node, facts: "rgb565", doc="Never.")


CATALOG = Catalog.of(
    ShadowPcf,
    ShadowVsm,
    DepthPrepass,
    ForwardLighting,
    Gbuffer,
    MsaaGbuffer,
    Resolve,
    DeferredLighting,
    Ssao,
    Tonemap,
    Blur,
    Half,
    Upsample,
    Sky,
    Fog,
    Temporal,
    Histogram,
    Exposure,
    NormalsInView,
    NormalsToWorld,
    Painting,
    Cube,
    ObjectIds,
    WindField,
    Colored,
    TwoSizes,
    TooManyMips,
    FailingRule,
    Growing,
    UnknownFormat,
    shadow_map=LightDepth,
)
