"""Forward shading as one would write it in plain moderngl: the other half of `bench_forward` and `bench_first_picture`.

Spheres drawn instanced, back faces culled, the mesh in the order it was made; Cook-Torrance with one directional
light, optionally with a shadow map and 3×3 filtered taps; then tone mapping. It knows nothing of rendergraph, and uses
the same formats: rgba16f, depth32f, rgba8.
"""

from __future__ import annotations

import ctypes
from typing import Any

import glcontext  # type: ignore[import-untyped]
import moderngl
import numpy as np

DEPTH_VERTEX = """
#version 450 core
in vec3 in_position;
in mat4 in_model;
uniform mat4 light_matrix;
void main() { gl_Position = light_matrix * in_model * vec4(in_position, 1.0); }
"""

DEPTH_FRAGMENT = """
#version 450 core
void main() {}
"""

VERTEX = """
#version 450 core
in vec3 in_position;
in vec3 in_normal;
in mat4 in_model;
in vec3 in_color;
in vec2 in_surface;
uniform mat4 camera_matrix;
out vec3 v_position;
out vec3 v_normal;
flat out vec3 v_color;
flat out vec2 v_surface;
void main() {
    vec4 world = in_model * vec4(in_position, 1.0);
    v_position = world.xyz;
    v_normal = mat3(in_model) * in_normal;
    v_color = in_color;
    v_surface = in_surface;
    gl_Position = camera_matrix * world;
}
"""

FRAGMENT = """
#version 450 core
const float PI = 3.14159265358979;
in vec3 v_position;
in vec3 v_normal;
flat in vec3 v_color;
flat in vec2 v_surface;
uniform vec3 eye;
uniform vec3 to_light;
uniform vec3 light_color;
uniform vec3 ambient;
out vec4 radiance;
#ifdef SHADOWS
uniform mat4 light_matrix;
uniform float texel;  // metres
uniform sampler2DShadow shadow_map;

float lit(vec3 position, vec3 normal) {
    float cosine = dot(normal, to_light);
    if (cosine <= 0.0) return 0.0;
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    vec3 place = (light_matrix * vec4(position + texel * (2.0 * sine * normal + 0.5 * to_light), 1.0)).xyz * 0.5 + 0.5;
    vec2 step = 1.0 / vec2(textureSize(shadow_map, 0));
    float sum = 0.0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
            sum += texture(shadow_map, vec3(place.xy + vec2(x, y) * step, place.z));
    return sum / 9.0;
}
#endif

void main() {
    vec3 n = normalize(v_normal);
    vec3 v = normalize(eye - v_position);
    vec3 h = normalize(to_light + v);
    float n_l = max(dot(n, to_light), 0.0);
    float n_v = max(dot(n, v), 1e-4);
    float n_h = max(dot(n, h), 0.0);
    float v_h = max(dot(v, h), 0.0);
    float metallic = v_surface.x;
    float alpha = max(v_surface.y * v_surface.y, 0.001);
    float a2 = alpha * alpha;
    float d = n_h * n_h * (a2 - 1.0) + 1.0;
    float distribution = a2 / (PI * d * d);
    float visible = 0.5 / (n_l * sqrt(n_v * n_v * (1.0 - a2) + a2) + n_v * sqrt(n_l * n_l * (1.0 - a2) + a2));
    vec3 f0 = mix(vec3(0.04), v_color, metallic);
    vec3 fresnel = f0 + (1.0 - f0) * pow(1.0 - v_h, 5.0);
    vec3 diffuse = v_color * (1.0 - metallic) / PI;
    vec3 light = light_color * n_l;
#ifdef SHADOWS
    light *= lit(v_position, normalize(cross(dFdx(v_position), dFdy(v_position))));
#endif
    radiance = vec4((diffuse + fresnel * distribution * visible) * light + ambient * v_color, 1.0);
}
"""

SCREEN_VERTEX = """
#version 450 core
void main() { gl_Position = vec4(vec2(ivec2(gl_VertexID << 1, gl_VertexID) & 2) * 2.0 - 1.0, 0.0, 1.0); }
"""

TONEMAP_FRAGMENT = """
#version 450 core
uniform sampler2D radiance;
out vec4 color;

vec3 neutral(vec3 c) {  // Khronos PBR Neutral, 2024
    float x = min(c.r, min(c.g, c.b));
    c -= x < 0.08 ? x - 6.25 * x * x : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < 0.76) return c;
    float compressed = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
    c *= compressed / peak;
    return mix(vec3(compressed), c, 1.0 / (0.15 * (peak - compressed) + 1.0));
}

void main() {
    vec3 c = clamp(neutral(texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb), 0.0, 1.0);
    color = vec4(mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308))), 1.0);
}
"""


def sphere(segments: int, rings: int, radius: float = 1.0) -> tuple[Any, Any, Any]:
    """A sphere row by row: positions, normals, indices of 2 segments (rings - 1) triangles."""
    u = np.linspace(0, 2 * np.pi, segments + 1)
    v = np.linspace(0, np.pi, rings + 1)
    v, u = np.meshgrid(v, u, indexing="ij")
    normals = np.stack([np.sin(v) * np.cos(u), np.cos(v), -np.sin(v) * np.sin(u)], -1).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(rings), np.arange(segments), indexing="ij")
    a = (row * (segments + 1) + column).ravel()
    b, c, d = a + segments + 1, a + 1, a + segments + 2
    upper, lower = np.stack([a, b, c], 1), np.stack([c, b, d], 1)
    keep_upper, keep_lower = row.ravel() > 0, row.ravel() < rings - 1  # at the poles one of the two is empty
    triangles = np.stack([upper, lower], 1)
    kept = np.stack([keep_upper, keep_lower], 1)
    return (normals * radius).astype("f4"), normals.astype("f4"), triangles[kept].astype("u4")


def look_at(eye: Any, target: Any, up: tuple[float, float, float] = (0, 1, 0)) -> Any:
    """World to view."""
    back = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    side = np.cross(up, back)
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3, :3] = side, np.cross(back, side), back
    matrix[:3, 3] = -matrix[:3, :3] @ eye
    return matrix


def perspective(fov_y: float, aspect: float, near: float, far: float) -> Any:
    """View to clip space."""
    f = 1 / np.tan(fov_y / 2)
    z, w = (near + far) / (near - far), 2 * near * far / (near - far)
    return np.array([[f / aspect, 0, 0, 0], [0, f, 0, 0], [0, 0, z, w], [0, 0, -1, 0]])


def light_matrix(to_light: Any, center: Any, radius: float) -> Any:
    """World to the clip space of a directional light that sees a ball."""
    view = look_at(np.asarray(center) + np.asarray(to_light), center, (0, 1, 0.01))
    return (
        np.array([[1 / radius, 0, 0, 0], [0, 1 / radius, 0, 0], [0, 0, -1 / radius, -1 / radius], [0, 0, 0, 1]]) @ view
    )


class Forward:
    """The program: everything made in the constructor, `draw` is a frame."""

    def __init__(
        self,
        size: tuple[int, int],
        mesh: tuple[Any, Any, Any],
        models: Any,
        colors: Any,
        surfaces: Any,
        camera: Any,
        eye: Any,
        to_light: Any,
        intensity: float,
        shadow: int | None = None,
        ball: tuple[Any, float] | None = None,
    ) -> None:
        context = glcontext.get_backend_by_name("egl")(mode="standalone", glversion=450, device_index=0)
        self.ctx = ctx = moderngl.create_context(context=context)
        self._load = context.load
        positions, normals, indices = mesh
        self.count = len(models)
        self.shadow = shadow
        vertices, normals = ctx.buffer(positions.tobytes()), ctx.buffer(normals.tobytes())
        index = ctx.buffer(indices.tobytes())
        models = ctx.buffer(np.ascontiguousarray(np.swapaxes(models, 1, 2), "f4").tobytes())
        looks = ctx.buffer(np.hstack([colors, surfaces]).astype("f4").tobytes())
        self.position_buffer, self.normal_buffer, self.index_buffer = vertices, normals, index
        self.models_buffer, self.looks_buffer = models, looks
        program: Any = ctx.program(
            VERTEX, FRAGMENT.replace("core\n", "core\n#define SHADOWS\n" if shadow else "core\n", 1)
        )
        program["camera_matrix"].write(camera.T.astype("f4").tobytes())
        program["eye"].value = tuple(eye)
        program["to_light"].value = tuple(to_light)
        program["light_color"].value = (intensity,) * 3
        program["ambient"].value = (0.03,) * 3
        self.spheres = ctx.vertex_array(
            program,
            [
                (vertices, "3f", "in_position"),
                (normals, "3f", "in_normal"),
                (models, "16f/i", "in_model"),
                (looks, "3f 2f/i", "in_color", "in_surface"),
            ],
            index,
        )
        self.radiance = ctx.texture(size, 4, dtype="f2")
        self.radiance.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.target = ctx.framebuffer(self.radiance, self._depth(size))
        self.color = ctx.texture(size, 4)
        self.screen = ctx.framebuffer(self.color)
        tonemap = ctx.program(SCREEN_VERTEX, TONEMAP_FRAGMENT)
        self.tonemap = ctx.vertex_array(tonemap, [])
        if shadow is not None:
            assert ball is not None
            matrix = light_matrix(to_light, *ball).T.astype("f4").tobytes()
            depth: Any = ctx.program(DEPTH_VERTEX, DEPTH_FRAGMENT)
            depth["light_matrix"].write(matrix)
            program["light_matrix"].write(matrix)
            program["texel"].value = 2 * ball[1] / shadow
            self.casters = ctx.vertex_array(
                depth, [(vertices, "3f", "in_position"), (models, "16f/i", "in_model")], index
            )
            self.map = self._depth((shadow, shadow))
            self.map.compare_func = "<="
            self.map.repeat_x = self.map.repeat_y = False
            self.light = ctx.framebuffer(depth_attachment=self.map)
        ctx.enable(moderngl.CULL_FACE)

    def _depth(self, size: tuple[int, int]) -> Any:
        """A 32-bit depth texture: moderngl's own are 24-bit, so the storage is stated again."""
        texture = self.ctx.depth_texture(size)
        texture.use(0)
        image = ctypes.CFUNCTYPE(None, *[ctypes.c_uint] * 8, ctypes.c_void_p)(self._load("glTexImage2D"))
        image(0x0DE1, 0, 0x8CAC, size[0], size[1], 0, 0x1902, 0x1406, None)
        return texture

    def draw(self) -> None:
        """One frame."""
        ctx = self.ctx
        ctx.enable(moderngl.DEPTH_TEST)
        if self.shadow is not None:
            self.light.use()
            self.light.clear(depth=1.0)
            self.casters.render(instances=self.count)
            self.map.use(0)
        self.target.use()
        self.target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        self.spheres.render(instances=self.count)
        ctx.disable(moderngl.DEPTH_TEST)
        self.screen.use()
        self.radiance.use(0)
        self.tonemap.render(moderngl.TRIANGLES, vertices=3)

    def frames(self, count: int) -> None:
        """Some frames, and wait until they are done."""
        with self.ctx:
            for _ in range(count):
                self.draw()
            self.ctx.finish()

    def picture(self) -> Any:
        """The last frame as (height, width, 4) bytes, top row first."""
        width, height = self.color.size
        with self.ctx:
            return np.frombuffer(self.screen.read(components=4), "u1").reshape(height, width, 4)[::-1]
