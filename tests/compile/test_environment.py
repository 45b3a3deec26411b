"""The environment as an input: the scene's where nothing is linked, and a node that is left out where there is none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.images import write

SEEN = '''
from rendergraph.api import Any, EnvironmentMap, Input, Node, Output

class Seen(Node):
    """The picture as it is, the size that is known beforehand."""

    picture = Input(EnvironmentMap, size="any", filter="nearest", doc="Picture.")
    copied = Output(Any, format="rgba32f", size=lambda node, facts: facts.input("picture").desc.size, doc="Copy.")
    turned = Output(Any, format="rgba32f", size=(1, 1), doc="Turn and intensity.")

    def record(self, steps):
        assert steps.connected(self.picture)
        assert steps.desc(self.picture).size == steps.desc(self.copied).size
        steps.fullscreen("seen.frag", picture=self.picture, out=self.copied)
        steps.fullscreen("turned.frag", picture=self.picture, out=self.turned)
'''
KEPT = '''
from rendergraph.api import Any, EnvironmentMap, Input, Node, Output, param

class Hold(Node):
    """Something kept that is made of the environment."""

    picture = Input(EnvironmentMap, size="any", doc="Picture.")
    made = Output(Any, format="rgba32f", size=(1, 1), kept=True, doc="One texel.")
    gain: float = param(default=1.0, min=0, max=9, doc="Times this.")
'''
SOURCE = '''
from rendergraph.api import EnvironmentMap, Node, Output

class Source(Node):
    """A picture of one's own."""

    made = Output(EnvironmentMap, format="rgba16f", size=(4, 2), doc="Two, everywhere.")
'''


@pytest.fixture
def plugins(tmp_path: Path) -> Path:
    folder = tmp_path / "plugins"
    folder.mkdir()
    for name, text in (("seen", SEEN), ("hold", KEPT), ("source", SOURCE)):
        (folder / f"{name}.py").write_text("from __future__ import annotations\n" + text)
    (folder / "seen.frag").write_text(
        "uniform sampler2D picture; out vec4 copied; void main() { ivec2 texel = ivec2(gl_FragCoord.xy);"
        " copied = texelFetch(picture, ivec2(texel.x, textureSize(picture, 0).y - 1 - texel.y), 0); }"
    )
    (folder / "turned.frag").write_text(
        "#include <environment.glsl>\nout vec4 turned; void main() { turned = environment_transform; }"
    )
    (folder / "hold.frag").write_text(
        "uniform sampler2D picture; uniform float gain; out vec4 made;"
        "void main() { made = gain * textureLod(picture, vec2(0.5), 0.0); }"
    )
    (folder / "source.frag").write_text("out vec4 made; void main() { made = vec4(2.0); }")
    return folder


def environment(file: Path, pixels: npt.ArrayLike) -> Path:
    """An EXR of these pixels, (height, width, 3)."""
    oiio = pytest.importorskip("OpenImageIO")
    values = np.asarray(pixels, np.float32)
    out = oiio.ImageOutput.create(str(file))
    out.open(str(file), oiio.ImageSpec(values.shape[1], values.shape[0], 3, "float"))
    out.write_image(values)
    out.close()
    return file


def pipeline(plugins: Path, nodes: dict[str, Any], outputs: dict[str, str], **options: Any) -> rg.Pipeline:
    file = plugins.parent / "p.yaml"
    file.write_text(json.dumps({"rendergraph": 1, "size": [8, 8], "nodes": nodes, "outputs": outputs}))
    return rg.load(file, plugins=[plugins], **options)


SEEN_NODES = {"seen": {"type": "seen"}}
SEEN_OUTPUTS = {"copied": "seen.copied", "turned": "seen.turned"}


def lit(folder: Path, *lines: str) -> Path:
    """A scene with a light, so that nothing is added, and these lines."""
    scene = "scene: 1\nlights: {sun: {type: directional}}\n"
    (folder / "s.yaml").write_text(scene + "\n".join(lines))
    return folder / "s.yaml"


def test_an_input_that_nothing_is_linked_to_reads_the_scenes(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).uniform(0, 4, (3, 5, 3)).astype(np.float16).astype(np.float32)
    environment(tmp_path / "e.exr", pixels)
    scene = lit(tmp_path, "environment: {file: e.exr, intensity: 2.5, rotate_degrees: 30}")
    frame = gl.render(pipeline(plugins, SEEN_NODES, SEEN_OUTPUTS, scene=scene))
    np.testing.assert_array_equal(frame["copied"][..., :3], pixels)
    np.testing.assert_allclose(frame["turned"][0, 0], [np.cos(np.pi / 6), 0.5, 2.5, 0], rtol=1e-6)
    assert frame.memory["no_reuse_bytes"] == 16 * (15 + 1)  # the picture is the scene's


def test_the_command_lines_takes_the_place_of_the_scenes(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    environment(tmp_path / "e.exr", np.ones((2, 4, 3)))
    other = environment(tmp_path / "other.exr", np.full((1, 1, 3), 3.0))
    scene = lit(tmp_path, "environment: {file: e.exr, intensity: 7}")
    frame = gl.render(pipeline(plugins, SEEN_NODES, SEEN_OUTPUTS, scene=scene, environment=other))
    np.testing.assert_array_equal(frame["copied"], [[[3, 3, 3, 1]]])
    np.testing.assert_array_equal(frame["turned"], [[[1, 0, 1, 0]]])


def test_another_nodes_picture_is_an_input_like_any(gl: rg.Session, plugins: Path) -> None:
    nodes: dict[str, Any] = {
        "source": {"type": "source"},
        "seen": {"type": "seen", "inputs": {"picture": "source.made"}},
    }
    for around in (None, "studio"):
        frame = gl.render(pipeline(plugins, nodes, SEEN_OUTPUTS, environment=around))
        np.testing.assert_array_equal(frame["copied"], np.full((2, 4, 4), 2.0))
    nodes["seen"]["type"] = "hold"
    with pytest.raises(InputError, match=r"RG439 .*samples 'picture', which is not"):
        pipeline(plugins, nodes, {"made": "seen.made"}).check()


def test_what_is_kept_may_be_made_of_it_and_is_made_once(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    environment(tmp_path / "e.exr", np.full((1, 1, 3), 0.5))
    scene = lit(tmp_path, "environment: {file: e.exr}")
    nodes = {"hold": {"type": "hold"}, "seen": {"type": "seen"}}
    frame = gl.render(pipeline(plugins, nodes, {"made": "hold.made", "turned": "seen.turned"}, scene=scene), timed=True)
    np.testing.assert_array_equal(frame["made"][0, 0, :3], 0.5)
    assert [entry["node"] for entry in frame.passes] == ["seen"]  # the frame that was drawn beforehand has paid
    (plugins / "hold.frag").write_text(
        "#include <environment.glsl>\nuniform sampler2D picture; uniform float gain; out vec4 made;"
        "void main() { made = gain * textureLod(picture, vec2(0.5), 0.0) * environment_transform.z; }"
    )
    with pytest.raises(InputError, match=r"RG439 .*the intensity and rotation of the environment"):
        pipeline(plugins, nodes, {"made": "hold.made"}, scene=scene).check()


def test_what_is_kept_of_it_is_made_again_with_another_parameter(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    environment(tmp_path / "e.exr", np.full((1, 1, 3), 0.5))
    scene = lit(tmp_path, "environment: {file: e.exr}")
    held = pipeline(plugins, {"hold": {"type": "hold"}}, {"made": "hold.made"}, scene=scene)
    for gain in (1.0, 3.0):
        np.testing.assert_array_equal(gl.render(held.set("hold.gain", gain))["made"][0, 0, :3], 0.5 * gain)


def test_keyframes_turn_it_without_making_it_anew(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    environment(tmp_path / "e.exr", np.ones((2, 4, 3)))
    scene = lit(tmp_path, "environment: {file: e.exr}", "keyframes: {environment.rotate_degrees: {0: 0, 1: 90}}")
    turning = pipeline(plugins, SEEN_NODES, SEEN_OUTPUTS, scene=scene)
    frames = [frame["turned"][0, 0].copy() for frame in gl.frames(turning, frames=range(1, 32, 30))]
    np.testing.assert_allclose(frames, [[1, 0, 1, 0], [0, 1, 1, 0]], atol=1e-6)


def test_without_one_the_node_is_left_out(plugins: Path, tmp_path: Path) -> None:
    scene = lit(tmp_path)
    nodes = {"hold": {"type": "hold"}}
    with pytest.raises(
        InputError, match=r"RG132 output 'made' shows 'hold.made', but 'hold' is left out: the scene has"
    ):
        pipeline(plugins, nodes, {"made": "hold.made"}, scene=scene).check()
    lighting = rg.load(
        "forward",
        scene=scene,
        plugins=[plugins],
        patches=[{"nodes": {"hold": {"type": "hold"}}}],
    )
    assert "hold" in lighting.link().graph.unlit
    assert lighting.plan().schedule.culled["hold"] == "the scene has no environment"
    with pytest.raises(InputError, match=r"RG206 .*node .hold. is left out: the scene has no environment"):
        lighting.plan(taps=["hold.made"])


@pytest.mark.parametrize(("name", "code"), [("studoi", r"RG015 .*did you mean 'studio'"), ("none.hdr", "RG350|RG011")])
def test_what_is_not_there_is_said(tmp_path: Path, name: str, code: str) -> None:
    with pytest.raises(InputError, match=code):
        rg.load("forward", environment=name).link()
    with pytest.raises(InputError, match=code):
        rg.load("forward", scene=lit(tmp_path, f"environment: {{file: {name}}}")).link()


def test_sun_and_turbidity_go_with_the_sky(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="RG321 'turbidity' requires a sky"):
        rg.load("forward", scene=lit(tmp_path, "environment: {file: studio, turbidity: 4}")).link()


def test_light_that_cannot_be_is_replaced_and_said(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    pixels = np.ones((2, 4, 3))
    pixels[0, 0], pixels[0, 1], pixels[1, 2] = np.nan, -4, 1e9
    environment(tmp_path / "e.exr", pixels)
    frame = gl.render(pipeline(plugins, SEEN_NODES, SEEN_OUTPUTS, scene=lit(tmp_path, "environment: {file: e.exr}")))
    found = frame["copied"][..., 0]
    np.testing.assert_array_equal(found, [[0, 0, 1, 1], [1, 1, 65504, 1]])
    said = " ".join(problem.message for problem in frame.warnings)
    assert "1 pixel is NaN" in said
    assert "1 pixel is negative" in said
    assert "1 pixel is infinite or beyond 65504" in said


def test_a_picture_of_eight_bits_is_light(gl: rg.Session, plugins: Path, tmp_path: Path) -> None:
    write(tmp_path / "e.png", np.full((2, 4, 3), 188, np.uint8))
    frame = gl.render(pipeline(plugins, SEEN_NODES, SEEN_OUTPUTS, scene=lit(tmp_path, "environment: {file: e.png}")))
    np.testing.assert_allclose(frame["copied"][..., :3], ((188 / 255 + 0.055) / 1.055) ** 2.4, rtol=1e-3)
