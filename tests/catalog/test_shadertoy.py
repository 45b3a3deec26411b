"""Programs of Shadertoy as nodes: what they read is that of the frame, and buffers read the frame before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import InputError

RINGS = """void mainImage( out vec4 fragColor, in vec2 fragCoord )
{
    float time = iTime;
    fragColor = vec4(fragCoord / iResolution.xy, fract(time), 0.25);
}
"""
LIFE = """void mainImage(out vec4 c, in vec2 p) {
    ivec2 cell = ivec2(p), size = ivec2(iResolution.xy);
    int around = 0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
            if (x != 0 || y != 0) around += int(texelFetch(iChannel1, (cell + ivec2(x, y) + size) % size, 0).r);
    bool alive = texelFetch(iChannel1, cell, 0).r > 0.5;
    c = vec4(iFrame == 0 ? float((cell.x * 7 + cell.y * 3) % 5 < 2) : float(around == 3 || (alive && around == 2)));
}
"""
RESOLUTION = """void mainImage(out vec4 c, in vec2 p) {
    c = vec4(iChannelResolution[2].xy, iMouse.x, texture(iChannel2, vec2(0.5)).r);
}
"""


def draw(gl: rg.Session, folder: Path, nodes: str, output: str, size: tuple[int, int], frames: int = 1) -> rg.Frame:
    text = f"rendergraph: 1\nnodes:\n{nodes}\noutputs: {{{output}}}\n"
    (folder / "toy.yaml").write_text(text)
    return gl.render(rg.load(folder / "toy.yaml", size=size), frames=range(1, frames + 1))


def test_a_pasted_program_draws_its_picture(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "rings.frag").write_text(RINGS)
    frame = draw(gl, tmp_path, "  a: {type: ./rings.frag}", "image: a.image, values: a.values", (8, 4), 16)
    y, x = np.mgrid[3:-1:-1, 0:8]  # the origin is at the lower left
    expected = np.stack([(x + 0.5) / 8, (y + 0.5) / 4, np.full(x.shape, 0.5), np.full(x.shape, 0.25)], axis=-1)
    np.testing.assert_allclose(frame["values"], expected, atol=1e-5)
    np.testing.assert_allclose(frame["image"][..., :3], expected[..., :3] * 255, atol=0.6)
    assert (frame["image"][..., 3] == 255).all()


def test_a_buffer_reads_its_own_frame_before(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "life.frag").write_text(LIFE)
    nodes = "  a: {type: ./life.frag, inputs: {iChannel1: a.values@previous}}"
    found = draw(gl, tmp_path, nodes, "values: a.values, image: a.image", (12, 9), 6)["values"][::-1, :, 0]
    y, x = np.mgrid[0:9, 0:12]
    cells = (x * 7 + y * 3) % 5 < 2
    for _ in range(5):
        around = sum(np.roll(cells, (i, j), (0, 1)).astype(int) for i in (-1, 0, 1) for j in (-1, 0, 1)) - cells
        cells = (around == 3) | (cells & (around == 2))
    np.testing.assert_array_equal(found, cells)


def test_channels_may_have_another_size_and_the_mouse_is_a_parameter(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "small.frag").write_text(
        "/*---\noutputs: {color: {size: [3, 5], format: r32f}}\n---*/\n"
        "out vec4 color;\nvoid main() { color = vec4(0.75); }\n"
    )
    (tmp_path / "show.frag").write_text(RESOLUTION)
    nodes = "  b: {type: ./small.frag}\n"
    nodes += "  a: {type: ./show.frag, inputs: {iChannel2: b.color}, params: {iMouse: [9, 0, 0, 0]}}"
    frame = draw(gl, tmp_path, nodes, "values: a.values, image: a.image", (4, 4))
    np.testing.assert_array_equal(frame["values"], np.tile([3, 5, 9, 0.75], (4, 4, 1)))


def test_a_mistake_has_its_line_in_the_pasted_text(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "rings.frag").write_text(RINGS.replace("= iTime;", "= iTime + wrong;"))
    with pytest.raises(InputError, match=r"rings\.frag:3:\d+: RG410 .*wrong"):
        draw(gl, tmp_path, "  a: {type: ./rings.frag}", "image: a.image", (8, 4))
