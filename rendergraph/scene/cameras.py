"""Cameras as matrices, in float64, and what is known of lights and environment before the schedule."""

from __future__ import annotations

from rendergraph import projection
from rendergraph.declare import LightFacts
from rendergraph.scene.model import Camera, Matrix, Scene
from rendergraph.steps import ViewMatrices
from rendergraph.textures import TextureDesc, full_mip_count


def view_matrices(camera: Camera, size: tuple[int, int]) -> ViewMatrices:
    """The view of a camera drawn at a size in texels; the aspect is the size's.

    An off-centre `frustum` keeps its own left, right, bottom and top.
    """
    width, height = size
    view = projection.inverse_rigid(camera.transform)
    return ViewMatrices(view, projection_matrix(camera, width / height), size, camera.near, camera.far)


def projection_matrix(camera: Camera, aspect: float) -> Matrix:
    """View space to OpenGL clip space (z in -w…w) as (4, 4).

    Args:
        camera: what is projected.
        aspect: width over height of the picture.
    """
    near, far = camera.near, camera.far
    if camera.type == "orthographic":
        top = camera.height / 2
        return projection.orthographic(-top * aspect, top * aspect, -top, top, near, far)
    if camera.type == "frustum" and camera.frustum is not None:
        return projection.frustum(*camera.frustum, near, far)
    return projection.perspective(camera.fov_y, aspect, near, far)


def light_facts(scene: Scene) -> tuple[LightFacts, ...]:
    """What is known of every light before the schedule, in the scene's order."""
    return tuple(LightFacts(light.name, light.type, light.casts_shadow) for light in scene.lights)


def environment_facts(scene: Scene) -> TextureDesc | None:
    """The texture that a scene's environment becomes; None where it has none."""
    if scene.environment is None:
        return None
    size = scene.environment.size
    assert size is not None  # whoever reads a scene has seen to that
    return TextureDesc("texture2d", "rgba16f", *size, mips=full_mip_count(*size))
