"""3D textures: stored to, drawn to slice by slice, filtered along all three axes, read back; and borders."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Input, Internal, Node, Output, Radiance, Steps
from rendergraph.errors import InputError
from rendergraph.textures import TextureDesc

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]


class Volume(Node):
    """x, y and z of each texel, but for slice 2, which is drawn; and mips."""

    volume = Output(AnyTexel, kind="texture3d", format="rgba32f", size=(8, 4), layers=8, mips=0, doc="Positions.")

    def record(self, steps: Steps) -> None:
        steps.compute("volume.comp", out=self.volume)
        steps.fullscreen("slice.frag", out={"value": self.volume.layer(2)})
        steps.mipmaps(self.volume)


class Probe(Node):
    """The volume half way between slices 3 and 4, sampled with trilinear filtering, and its mip 1."""

    volume = Input(AnyTexel, kind="texture3d", size="any", filter="trilinear", wrap="clamp", doc="The volume.")
    color = Output(Radiance, format="rgba32f", size=(8, 4), doc="A slice.")


class Slice(Node):
    """Samples one slice alone, which OpenGL has no view for."""

    volume = Input(AnyTexel, kind="texture3d", size="any", doc="The volume.")
    color = Output(Radiance, doc="A slice.")
    copy = Internal(kind="texture3d", size=(4, 4), layers=2)

    def record(self, steps: Steps) -> None:
        steps.clear(self.copy, 0.5)
        steps.fullscreen("read.frag", out=self.color, volume=self.copy.layer(1))


SHADERS = {
    "volume.comp": """layout(local_size_x = 4, local_size_y = 4, local_size_z = 2) in;
        uniform writeonly image3D volume;
        void main() {
            ivec3 texel = ivec3(gl_GlobalInvocationID);
            imageStore(volume, texel, vec4(texel, 1.0));
        }""",
    "slice.frag": "out vec4 value; void main() { value = vec4(gl_FragCoord.xy, 20.0, 1.0); }",
    "probe.frag": """uniform sampler3D volume;
        in vec2 v_uv;
        out vec4 color;
        void main() { color = textureLod(volume, vec3(v_uv, 0.5), gl_FragCoord.y < 2.0 ? 0.0 : 1.0); }""",
    "read.frag": "uniform sampler2D volume; out vec4 color; void main() { color = texelFetch(volume, ivec2(0), 0); }",
}
TEXT = "nodes: {v: {type: volume}, p: {type: probe, inputs: {volume: v.volume}}}\noutputs: {image: p.color}"


def test_a_volume_is_stored_drawn_filtered_and_read_back(draw: Draw) -> None:
    taps = ["v.volume", "v.volume[2]", "v.volume[mip=2]"]
    frame = draw(TEXT, Volume, Probe, shaders=SHADERS, taps=taps)
    z, y, x = np.meshgrid(np.arange(8), np.arange(4), np.arange(8), indexing="ij")
    expected = np.stack([x, y, z, np.ones_like(x)], axis=-1).astype(np.float64)
    expected[2, ..., :2] += 0.5
    expected[2, ..., 2] = 20.0
    np.testing.assert_array_equal(frame["v.volume"][:, ::-1], expected)
    np.testing.assert_array_equal(frame["v.volume[2]"][::-1], expected[2])
    mips = [expected]
    for _ in range(2):
        before = mips[-1]
        depth, height, width = (max(1, side // 2) for side in before.shape[:3])
        pairs = before.reshape(depth, -1, height, before.shape[1] // height, width, 2, 4)
        mips.append(pairs.mean(axis=(1, 3, 5)))
    assert frame["v.volume[mip=2]"].shape == (2, 1, 2, 4)
    np.testing.assert_allclose(frame["v.volume[mip=2]"], mips[2])
    sampled = frame["image"][::-1]
    np.testing.assert_allclose(sampled[:2], (expected[3] + expected[4])[:2] / 2, atol=1e-4)
    np.testing.assert_allclose(sampled[2:, 1:-1, 2], 0.5 * (mips[1][1] + mips[1][2])[1, 0, 2], atol=1e-4)


@pytest.mark.parametrize("mode", [{"alias": False}, {"poison": True, "shuffle": 3}])
def test_memory_and_order_change_nothing(draw: Draw, mode: dict[str, Any]) -> None:
    plain, other = (draw(TEXT, Volume, Probe, shaders=SHADERS, **options)["image"] for options in ({}, mode))
    np.testing.assert_array_equal(plain, other)


def test_bytes_count_the_depth_of_each_mip() -> None:
    desc = TextureDesc("texture3d", "r8", 8, 4, layers=6, mips=4)
    assert desc.bytes == 8 * 4 * 6 + 4 * 2 * 3 + 2 * 1 * 1 + 1


def test_a_slice_cannot_be_sampled_alone(bench: Any) -> None:
    text = "nodes: {v: {type: volume}, s: {type: slice, inputs: {volume: v.volume}}}\noutputs: {image: s.color}"
    with pytest.raises(
        InputError, match=r"samples a slice of the 3D texture 's.copy'; sample all of it as a sampler3D"
    ):
        bench.draw(text, Volume, Slice, shaders=SHADERS)


class Edge(Node):
    """Beyond its edges, a texture is its border."""

    source = Input(AnyTexel, filter="nearest", wrap="border", border=(0.25, 0.5, 0.75, 0.0), doc="Anything.")
    color = Output(Radiance, format="rgba32f", doc="What is beyond.")


class Ids(Node):
    """Integers of 16 bits."""

    ids = Output(AnyTexel, format="rgba16ui", doc="Numbers.")


def test_a_border_has_the_declared_value(draw: Draw) -> None:
    shaders = {
        "edge.frag": "uniform sampler2D source; out vec4 color; void main() { color = texture(source, vec2(-0.5)); }",
        "ids.frag": "out uvec4 ids; void main() { ids = uvec4(1u, 2u, 65535u, uint(gl_FragCoord.x)); }",
    }
    text = "nodes: {i: {type: other}, e: {type: edge, inputs: {source: i.value}}}\noutputs: {image: e.color}"
    shaders["other.frag"] = "out vec4 value; void main() { value = vec4(1.0); }"

    class Other(Node):
        """Ones."""

        value = Output(AnyTexel, doc="Ones.")

    np.testing.assert_array_equal(draw(text, Other, Edge, shaders=shaders)["image"][0, 0], [0.25, 0.5, 0.75, 0.0])
    ids = draw("nodes: {i: {type: ids}}\noutputs: {ids: i.ids}", Ids, shaders=shaders)["ids"]
    np.testing.assert_array_equal(ids[0, 3], [1, 2, 65535, 3])
    text = "nodes: {i: {type: ids}, e: {type: edge, inputs: {source: i.ids}}}\noutputs: {image: e.color}"
    with pytest.raises(
        InputError, match=r"RG215 'e.source' has a border, which excludes integers, but 'i.ids' .* rgba16ui"
    ):
        draw(text, Ids, Edge, shaders=shaders)
