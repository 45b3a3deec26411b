"""The three works of `bench_works` as one would write them in plain moderngl, on top of `forward_by_hand`.

Camera and light move, a ground lies under the spheres, and every frame is read back. `Deferred` has a G-buffer of two
targets beside depth, plain ambient occlusion of 32 samples in a hemisphere turned by 4×4 random vectors, a 4×4 box blur
of it, and light in image space.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from forward_by_hand import SCREEN_VERTEX, VERTEX, Forward, light_matrix

SAMPLES = 32
DEEP = 40.0  # metres before and behind the spheres' middle that the light's map holds

GBUFFER_FRAGMENT = """
#version 450 core
in vec3 v_position;
in vec3 v_normal;
flat in vec3 v_color;
flat in vec2 v_surface;
layout(location = 0) out vec4 albedo;  // and metallic
layout(location = 1) out vec4 normal;  // and roughness
void main() {
    albedo = vec4(v_color, v_surface.x);
    normal = vec4(normalize(v_normal), v_surface.y);
}
"""

OCCLUSION_FRAGMENT = """
#version 450 core
uniform sampler2D depth;
uniform sampler2D normal;
uniform sampler2D noise;
uniform mat4 projection;
uniform mat4 inverse_projection;
uniform mat3 to_view;
uniform vec3 kernel[32];
uniform float radius;
out float occlusion;

vec3 place(vec2 uv) {
    vec4 p = inverse_projection * vec4(vec3(uv, textureLod(depth, uv, 0.0).r) * 2.0 - 1.0, 1.0);
    return p.xyz / p.w;
}

void main() {
    vec2 uv = gl_FragCoord.xy / vec2(textureSize(depth, 0));
    occlusion = 1.0;
    if (texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r == 1.0) return;
    vec3 p = place(uv);
    vec3 n = to_view * texelFetch(normal, ivec2(gl_FragCoord.xy), 0).xyz;
    vec3 turn = texelFetch(noise, ivec2(gl_FragCoord.xy) & 3, 0).xyz;
    vec3 t = normalize(turn - n * dot(turn, n));
    mat3 basis = mat3(t, cross(n, t), n);
    float blocked = 0.0;
    for (int i = 0; i < 32; ++i) {
        vec3 q = p + radius * (basis * kernel[i]);
        vec4 clip = projection * vec4(q, 1.0);
        float z = place(clip.xy / clip.w * 0.5 + 0.5).z;
        blocked += z >= q.z + 0.02 ? smoothstep(0.0, 1.0, radius / abs(p.z - z)) : 0.0;
    }
    occlusion = 1.0 - blocked / 32.0;
}
"""

BLUR_FRAGMENT = """
#version 450 core
uniform sampler2D unfiltered;
out float occlusion;
void main() {
    float sum = 0.0;
    for (int y = -2; y < 2; ++y)
        for (int x = -2; x < 2; ++x) sum += texelFetch(unfiltered, ivec2(gl_FragCoord.xy) + ivec2(x, y), 0).r;
    occlusion = sum / 16.0;
}
"""


def light_fragment(forward: str) -> str:
    """The forward program's light, over a G-buffer."""
    head, body = forward.replace("core\n", "core\n#define SHADOWS\n", 1).split("void main() {")
    for line in ("in vec3 v_position;", "in vec3 v_normal;", "flat in vec3 v_color;", "flat in vec2 v_surface;"):
        head = head.replace(line + "\n", "")
    head += """
uniform sampler2D albedo;
uniform sampler2D normal;
uniform sampler2D depth;
uniform sampler2D occlusion;
uniform mat4 inverse_camera;
"""
    body = body.replace("cross(dFdx(v_position), dFdy(v_position))", "v_normal").replace(
        "ambient * v_color", "ambient * v_color * texelFetch(occlusion, t, 0).r"
    )
    read = """void main() {
    ivec2 t = ivec2(gl_FragCoord.xy);
    float z = texelFetch(depth, t, 0).r;
    if (z == 1.0) {
        radiance = vec4(0.0);
        return;
    }
    vec4 place = inverse_camera * vec4(vec3(gl_FragCoord.xy / vec2(textureSize(depth, 0)), z) * 2.0 - 1.0, 1.0);
    vec4 a = texelFetch(albedo, t, 0), b = texelFetch(normal, t, 0);
    vec3 v_position = place.xyz / place.w, v_normal = b.xyz, v_color = a.rgb;
    vec2 v_surface = vec2(a.a, b.a);"""
    return head + read + body


def ground(y: float, half: float) -> tuple[Any, Any, Any]:
    """A square that faces up: positions, normals, indices."""
    corners = np.array([(-half, y, -half), (-half, y, half), (half, y, half), (half, y, -half)], "f4")
    return corners, np.tile(np.array([0, 1, 0], "f4"), (4, 1)), np.array([0, 1, 2, 0, 2, 3], "u4")


class Moving(Forward):
    """`Forward` with a ground, whose camera and light are set before each frame, and read back after it."""

    def __init__(self, *arguments: Any, under: tuple[Any, Any, Any] | None = None, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.ball = named.get("ball")
        self.lit: Any = self.spheres.program
        self.more = self._ground(self.lit, under) if under is not None else None

    def _ground(self, program: Any, mesh: tuple[Any, Any, Any]) -> Any:
        buffer = self.ctx.buffer
        positions, normals, indices = (buffer(array.tobytes()) for array in mesh)
        content = [
            (positions, "3f", "in_position"),
            (normals, "3f", "in_normal"),
            (buffer(np.eye(4, dtype="f4").tobytes()), "16f/i", "in_model"),
            (buffer(np.array([0.6, 0.6, 0.6, 0.0, 0.9], "f4").tobytes()), "3f 2f/i", "in_color", "in_surface"),
        ]
        return self.ctx.vertex_array(program, content, indices)

    def look(self, view: Any, projection: Any, eye: Any, to_light: Any) -> None:
        """Set camera and light."""
        self.lit["camera_matrix"].write((projection @ view).T.astype("f4").tobytes())
        self._light(self.lit, eye, to_light)

    def _light(self, program: Any, eye: Any, to_light: Any) -> None:
        program["eye"].value = tuple(eye)
        program["to_light"].value = tuple(to_light)
        if self.shadow is not None:
            assert self.ball is not None
            deeper = np.diag([1, 1, self.ball[1] / DEEP, 1])  # the ground lies below the ball
            matrix = (deeper @ light_matrix(to_light, *self.ball)).T.astype("f4").tobytes()
            casters: Any = self.casters.program
            casters["light_matrix"].write(matrix)
            program["light_matrix"].write(matrix)

    def draw_map(self) -> None:
        """The shadow map, where there is one, of the spheres: the ground casts on nothing."""
        if self.shadow is not None:
            self.light.use()
            self.light.clear(depth=1.0)
            self.casters.render(instances=self.count)
            self.map.use(0)

    def draw_objects(self) -> None:
        """Spheres, and the ground."""
        self.spheres.render(instances=self.count)
        if self.more is not None:
            self.more.render(instances=1)

    def draw(self) -> None:
        """One frame."""
        ctx = self.ctx
        ctx.enable(moderngl.DEPTH_TEST)
        self.draw_map()
        self.target.use()
        self.target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        self.draw_objects()
        ctx.disable(moderngl.DEPTH_TEST)
        self.screen.use()
        self.radiance.use(0)
        self.tonemap.render(moderngl.TRIANGLES, vertices=3)


class Deferred(Moving):
    """The same in image space, with ambient occlusion."""

    def __init__(self, size: tuple[int, int], *arguments: Any, radius: float = 0.5, **named: Any) -> None:
        super().__init__(size, *arguments, **named)
        ctx: Any = self.ctx
        self.albedo, self.normal = ctx.texture(size, 4), ctx.texture(size, 4, dtype="f2")
        self.depth = self._depth(size)
        self.depth.compare_func = ""
        self.surfaces = ctx.framebuffer([self.albedo, self.normal], self.depth)
        self.raw, self.open = (ctx.texture(size, 1) for _ in range(2))
        self.raw_target, self.open_target = ctx.framebuffer(self.raw), ctx.framebuffer(self.open)
        for texture in (self.albedo, self.normal, self.depth, self.raw, self.open):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        random = np.random.default_rng(1)
        kernel = random.normal(size=(SAMPLES, 3))
        kernel[:, 2] = np.abs(kernel[:, 2])
        kernel *= (random.uniform(0.1, 1, SAMPLES) ** 2 / np.linalg.norm(kernel, axis=1))[:, None]
        turns = np.zeros((16, 4), "f4")
        turns[:, :2] = random.normal(size=(16, 2))
        self.noise = ctx.texture((4, 4), 4, turns.tobytes(), dtype="f4")
        self.noise.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.gbuffer: Any = ctx.program(VERTEX, GBUFFER_FRAGMENT)
        models, looks = self.models_buffer, self.looks_buffer
        self.spheres = ctx.vertex_array(
            self.gbuffer,
            [
                (self.position_buffer, "3f", "in_position"),
                (self.normal_buffer, "3f", "in_normal"),
                (models, "16f/i", "in_model"),
                (looks, "3f 2f/i", "in_color", "in_surface"),
            ],
            self.index_buffer,
        )
        self.more = self._ground(self.gbuffer, named["under"])
        self.occlusion: Any = ctx.program(SCREEN_VERTEX, OCCLUSION_FRAGMENT)
        self.occlusion["kernel"].write(kernel.astype("f4").tobytes())
        self.occlusion["radius"].value = radius
        self.blur: Any = ctx.program(SCREEN_VERTEX, BLUR_FRAGMENT)
        from forward_by_hand import FRAGMENT

        self.shade: Any = ctx.program(SCREEN_VERTEX, light_fragment(FRAGMENT))
        for name in ("light_color", "ambient", "texel"):
            self.shade[name].value = self.lit[name].value
        for number, name in enumerate(("shadow_map", "albedo", "normal", "depth", "occlusion")):
            self.shade[name].value = number
        for name, number in (("depth", 3), ("normal", 2), ("noise", 5)):
            self.occlusion[name].value = number
        self.blur["unfiltered"].value = 4
        self.passes = [ctx.vertex_array(program, []) for program in (self.occlusion, self.blur, self.shade)]

    def look(self, view: Any, projection: Any, eye: Any, to_light: Any) -> None:
        """Set camera and light."""
        camera = projection @ view
        self.gbuffer["camera_matrix"].write(camera.T.astype("f4").tobytes())
        self.occlusion["projection"].write(projection.T.astype("f4").tobytes())
        self.occlusion["inverse_projection"].write(np.linalg.inv(projection).T.astype("f4").tobytes())
        self.occlusion["to_view"].write(view[:3, :3].T.astype("f4").tobytes())
        self.shade["inverse_camera"].write(np.linalg.inv(camera).T.astype("f4").tobytes())
        self._light(self.shade, eye, to_light)

    def draw(self) -> None:
        """One frame."""
        ctx = self.ctx
        ctx.enable(moderngl.DEPTH_TEST)
        self.draw_map()
        self.surfaces.use()
        self.surfaces.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        self.draw_objects()
        ctx.disable(moderngl.DEPTH_TEST)
        for number, texture in enumerate((self.albedo, self.normal, self.depth), 1):
            texture.use(number)
        self.noise.use(5)
        occlusion, blur, shade = self.passes
        self.raw_target.use()
        occlusion.render(moderngl.TRIANGLES, vertices=3)
        self.raw.use(4)
        self.open_target.use()
        blur.render(moderngl.TRIANGLES, vertices=3)
        self.open.use(4)
        self.target.use()
        shade.render(moderngl.TRIANGLES, vertices=3)
        self.screen.use()
        self.radiance.use(0)
        self.tonemap.render(moderngl.TRIANGLES, vertices=3)
