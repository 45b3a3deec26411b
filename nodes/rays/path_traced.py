"""Path tracing."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import (
    Albedo,
    Depth,
    EnvironmentLight,
    Facts,
    History,
    Input,
    Internal,
    Luminance,
    Node,
    Normal,
    Output,
    Part,
    Port,
    Radiance,
    SceneData,
    Steps,
    View,
    define,
    param,
    structural,
)
from rendergraph.api import Any as AnyTexel

from ..lighting._lighting import has_layer

Color = float | tuple[float, float, float]
_TABLE = 512, 256  # directions of the environment to choose from
_BATCH = 4  # paths whose random numbers depend on each other, so that they cover a pixel evenly
_MOST_RAYS = 80  # per pixel and step: drivers limit the duration of a step, and llvmpipe the iterations of its loops


def _emitters(facts: Facts) -> int:
    return 0 if facts.scene_data is None else facts.scene_data.emitters


def _table_side(node: Any, facts: Facts) -> int:
    """Return the side of a square with a texel for each emitting triangle, a power of two."""
    side = 1
    while side * side < _emitters(facts):
        side *= 2
    return side


def _tree_size(width: int, height: int) -> tuple[int, int]:
    """Return the size of the tree over a table: its first level, and the others beside it."""
    return max(width // 2, 1) + max(width // 4, 1), max(height // 2, 1)


class PathTraced(Node):
    """Light the scene by path tracing: the reference that other techniques approximate.

    It replaces a lighting node, and needs no shadow, occlusion or interreflection nodes, because rays account for all
    of these. Its shading models, materials and lights are those of the other nodes. Each frame adds `samples` paths to
    every pixel, as long as the camera, the scene and all parameters stay the same, and `radiance` is the mean of all
    paths. Its noise falls with the square root of their number; `variance` estimates it.

    Emissive surfaces and the environment are light sources like any other. Without an environment, light of the
    constant radiance `ambient` comes from all sides. As in other nodes, the camera does not see back faces of one-sided
    materials; to all other rays they look like front faces, but emit no light. A shading model that does not sample
    directions itself is sampled by the cosine, which is slow to converge for narrow highlights.

    References: Kajiya 1986; Veach 1997 (multiple importance sampling); Heitz 2018 (visible normals); Burley 2020 (Owen
    scrambling by hashes).
    """

    scene = Input(SceneData, rays=True, doc="The scene and its trees.")
    view = Input(View, kind="view", optional=True, doc="The view; the pipeline's camera by default.")
    environment = Input(
        EnvironmentLight, kind="function", optional=True, doc="Light of the environment, which replaces `ambient`."
    )
    radiance = Output(
        Radiance, format="rgba32f", doc="Mean of the scene-linear radiance of all paths; alpha is coverage."
    )
    variance = Output(Radiance, format="rgba32f", doc="Variance of this mean, of each channel.")
    samples_taken = Output(Luminance, format="r32f", doc="Number of paths in the mean.")
    albedo = Output(Albedo, format="rgba16f", clear=0.0, doc="Base colour of the first surface at the pixel's centre.")
    normal = Output(
        Normal, format="rgba16_snorm", clear=0.0, doc="Shading normal of that surface; 0 on the background."
    )
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Window depth of that surface, 0 on the background.")
    instance = Output(
        AnyTexel,
        format="r32f",
        clear=0.0,
        doc="Number of that surface's object in the scene, from 1; 0 on the background.",
    )
    mean = History(format="rgba32f")
    spread = History(format="rgba32f")
    mean_between = Internal(format="rgba32f", doc="The mean between two steps of a frame.")
    spread_between = Internal(format="rgba32f", doc="The spread between two steps.")
    mean_before = Internal(format="rgba32f", doc="The mean before that.")
    spread_before = Internal(format="rgba32f", doc="The spread before that.")
    environment_table = Internal(
        AnyTexel, format="r32f", size=_TABLE, mips=0, doc="Luminance of directions times their solid angle."
    )
    environment_tree = Internal(
        AnyTexel, format="rgba32f", size=lambda node, facts: _tree_size(*_TABLE), doc="Tree for choosing directions."
    )
    emitter_tree = Internal(
        AnyTexel,
        format="rgba32f",
        size=lambda node, facts: _tree_size(*(_table_side(node, facts),) * 2),
        doc="Tree for choosing emitting triangles.",
    )
    emitter_table = Internal(
        AnyTexel,
        format="rgba32f",
        size=lambda node, facts: (_table_side(node, facts), _table_side(node, facts)),
        mips=0,
        doc="Power of each emitting triangle.",
    )
    brdf_table = Internal(
        AnyTexel,
        format=lambda node, facts: "rgba16" if has_layer(facts, "sheen") else "rg16",
        size=(64, 64),
        kept=True,
        doc="Split-sum BRDF factors, for a shared diffuse lobe and for sheen.",
    )
    first_depth = Internal(Depth, format="depth32f", clear=0.0, doc="The depth target if `depth` is not used.")

    shading: Literal["unlit", "phong", "blinn_phong", "anisotropic", "pbr"] | str = define(
        default="pbr",
        doc="Shading model: Cook-Torrance (`pbr`), its anisotropic form for all surfaces, or an empirical model.",
        choices="shading",
        needs=("nothing", "phong", "grain", "grain_where_any"),
    )
    smith: Literal["exact", "fast"] = define(
        default="exact", doc="Visibility term of `pbr`: Smith, or a fit without square roots."
    )
    diffuse_lobe: Literal["lambert", "shared"] = define(
        default="lambert",
        doc="Diffuse lobe of `pbr`: reflects all light, or only the share that the specular lobe does not reflect.",
    )
    terms: Literal["all", "diffuse", "specular"] = define(
        default="all", doc="Reflect light by all lobes of the materials, or by one kind alone."
    )
    ambient: Color = param(
        default=0.03,
        min=0,
        glsl="vec3",
        unless="environment",
        doc="Constant radiance from all sides, a number or RGB; an environment replaces it.",
    )
    background: Color = param(default=0.0, min=0, glsl="vec3", doc="Radiance of the background, a number or RGB.")
    backdrop: bool = structural(
        default=True, doc="Show the environment behind all surfaces; otherwise there is the `background`."
    )
    transparent: bool = structural(
        default=False, doc="Leave out the background, and write the coverage of surfaces to alpha."
    )
    samples: int = structural(default=16, min=1, max=65536, unit="paths", doc="Paths per pixel in each frame.")
    max_bounces: int = define(
        default=4,
        min=0,
        max=64,
        doc="Maximum number of reflections between the first and the last surface of a path; 0: direct light.",
    )
    light_part: Literal["all", "direct", "one_bounce", "indirect"] = define(
        default="all",
        doc="Show a part: `direct` is emitted or reflected once, `one_bounce` arrives by way of one other surface, "
        "`indirect` is all light that is not direct.",
    )
    sources: Literal["all", "lights", "environment", "emissive"] = define(
        default="all", doc="Sources of light: punctual lights, the environment or `ambient`, emissive surfaces."
    )
    antialiasing: bool = define(
        default=True, doc="Spread paths over the pixel; otherwise all begin at its centre, as in other nodes."
    )
    seed: int = param(
        default=0, min=0, doc="Seed of the random numbers. Pictures with different seeds have independent noise."
    )

    def record(self, steps: Steps) -> None:
        """Record the tables for choosing light, the paths in several steps, and the outputs that follow from them."""
        used: dict[str, Port] = {name: port for name, port in self.outputs().items() if steps.used(port)}
        means = {name: port for name, port in used.items() if name in ("radiance", "variance", "samples_taken")}
        if means:
            self._trace_paths(steps, means)
        first = {name: port for name, port in used.items() if name in ("albedo", "normal", "depth", "instance")}
        if first:
            first.setdefault("depth", self.first_depth)
            steps.draw(
                "first_hit.frag", vertex="<fullscreen.vert>", vertices=3, out=first, scene=self.scene, label="first hit"
            )

    def _trace_paths(self, steps: Steps, out: dict[str, Port]) -> None:
        """Record the steps that add paths to the mean."""
        reads: dict[str, Any] = {"scene": self.scene}
        batch = _BATCH if self.samples % _BATCH == 0 else 1
        defines: dict[str, Any] = {"BATCH": batch, "SAMPLES_DIRECTIONS": 1}
        if steps.connected(self.environment):
            reads |= {"environment": self.environment, "environment_table": self.environment_table}
            reads["environment_tree"] = self.environment_tree
            if self.backdrop and not self.transparent and self.sources in ("all", "environment"):
                defines["SHOWS_ENVIRONMENT"] = 1
            steps.fullscreen(
                "environment_table.frag",
                environment=self.environment,
                out=self.environment_table.mip(0),
                defines={"ENVIRONMENT_TABLE_SIZE": "vec2({}, {})".format(*_TABLE)},
                label="environment",
            )
            self._add_tree(steps, self.environment_table, self.environment_tree, 0)
        needs = steps.needs("shading")
        has_sheen = has_layer(steps.facts, "sheen")
        if (self.diffuse_lobe == "shared" or has_sheen) and "phong" not in needs and "nothing" not in needs:
            reads["brdf_table"] = self.brdf_table.sampled("linear")
            defines["MULTIPLE_SCATTERING"] = 0
            table = {"TABLE_SAMPLES": 512, **({"SHEEN_TABLE": 1} if has_sheen else {})}
            steps.fullscreen("../lighting/brdf_table.frag", out=self.brdf_table, defines=table, label="table")
        emits = _emitters(steps.facts) > 0 and self.sources in ("all", "emissive")
        if emits:
            side = _table_side(self, steps.facts)
            defines |= {"USES_EMITTERS": 1, "EMITTER_TABLE_SIDE": side}
            reads |= {"emitter_table": self.emitter_table, "emitter_tree": self.emitter_tree}
            steps.fullscreen(
                "emitter_table.frag",
                scene=self.scene,
                out=self.emitter_table.mip(0),
                defines={"EMITTER_TABLE_SIDE": side},
                label="emitters",
            )
            self._add_tree(steps, self.emitter_table, self.emitter_tree, 3)
        if emits or self.sources in ("all", "environment"):
            defines["FOLLOWS_LAST"] = 1  # a ray from the last surface may hit light sources
        at_once = max(batch, _MOST_RAYS // (self.max_bounces + 1) // batch * batch)
        before: tuple[Port | Part, Port | Part] = self.mean.previous, self.spread.previous
        between = [(self.mean_between, self.spread_between), (self.mean_before, self.spread_before)]
        for number, first in enumerate(range(0, self.samples, at_once)):
            paths = min(at_once, self.samples - first)
            after = (self.mean, self.spread) if first + paths == self.samples else between[number % 2]
            steps.draw(
                "path_traced.frag",
                vertex="<fullscreen.vert>",
                vertices=3,
                out={"mean": after[0], "spread": after[1]},
                defines={**defines, "PATHS": paths},
                label=f"paths {first + 1} to {first + paths}",
                previous_mean=before[0],
                previous_spread=before[1],
                first_path=first,
                **reads,
            )
            before = after
        steps.fullscreen(
            "path_outputs.frag", mean=self.mean, spread=self.spread, out=out, defines={"BATCH": batch}, label="mean"
        )

    def _add_tree(self, steps: Steps, table: Internal, tree: Internal, channel: int) -> None:
        """Record the mips of a table, and the tree by which texels are chosen."""
        if steps.desc(table).mips > 1:
            steps.mipmaps(table)
        steps.fullscreen(
            "density_tree.frag", table=table, out={"tree": tree}, channel=channel, label=f"tree of {table.name}"
        )
