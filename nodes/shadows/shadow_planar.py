"""Planar projected shadows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rendergraph.api import (
    Depth,
    Facts,
    Frame,
    Input,
    Internal,
    ObjectFacts,
    SceneError,
    State,
    Stencil,
    StencilFace,
    Steps,
    casting_lights,
    structural,
)

from ._casting import Casting, visibility_of_lights
from ._volumes import homogeneous_position

SHADOW_PLANE = "ShadowPlaneNS"
"""Name of an invisible object that receives shadows."""

Floats = npt.NDArray[np.float64]


def planar_projection(plane: Floats, light: Floats) -> Floats:
    """Return the matrix that projects points along rays of a light onto a plane, `M = (P·L) I − L ⊗ P` (Blinn 1988).

    Args:
        plane: (A, B, C, D) of the plane A x + B y + C z + D = 0.
        light: homogeneous position of the light, (x, y, z, 1), or (x, y, z, 0) towards it.
    """
    return (plane @ light) * np.eye(4) - np.outer(light, plane)


class ShadowPlanar(Casting):
    """Project the casters along the light's rays onto one plane, and draw them there as its shadow.

    The shadows are exact for all meshes, including open ones and those with alpha masks. Only the receiver shows
    shadows. Its pixels are marked in the stencil first, so that shadows end at its border. Overlapping casters do not
    darken twice.
    """

    twin = "traced_shadows"

    depth = Input(Depth, doc="Depth of the opaque surfaces.")
    marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)
    projections = Internal(kind="buffer", bytes=lambda node, facts: 80 * max(1, len(node.lights(facts))))
    visibility = visibility_of_lights()

    receiver: str = structural(
        default="auto",
        doc="Flat object that receives shadows; `auto` is `ShadowPlaneNS`, else the first flat object of the scene.",
    )

    def lights(self, facts: Facts) -> tuple[int, ...]:
        """Return the lights that cast shadows, as the scene's indices."""
        return super().lights(facts) if self.plane(facts) else ()

    def plane(self, facts: Facts) -> ObjectFacts | None:
        """Return the object that receives shadows; None in a scene without objects.

        Raises:
            SceneError: no object has the name, or it is not flat, or no object is flat.
        """
        candidates = [
            one for one in facts.objects if one.name == (SHADOW_PLANE if self.receiver == "auto" else self.receiver)
        ]
        if self.receiver == "auto":
            candidates += [one for one in facts.objects if one.flat and not one.hidden]
            if facts.objects and not candidates:
                raise SceneError("no object of the scene is flat; planar shadows need a plane to fall on")
        elif facts.objects and not candidates:
            raise SceneError(f"the scene has no object '{self.receiver}' for shadows to fall on", self.receiver)
        if candidates and not candidates[0].flat:
            raise SceneError(
                f"object '{candidates[0].name}' is not flat, so no planar shadow falls on it", self.receiver
            )
        return candidates[0] if candidates else None

    def record(self, steps: Steps) -> None:
        """Record the receiver into the stencil, then each light's projected casters where the receiver is visible."""
        receiver = self.plane(steps.facts)
        assert receiver is not None  # without one there are no layers, and nothing is recorded
        casters = [one.name for one in steps.facts.drawn("casters") if one.name != receiver.name]
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        mark = Stencil(StencilFace(reference=1, depth_pass="replace"))
        # An invisible receiver coincides with a drawn surface, or is close to one.
        offset = (1.0, 16.0)
        steps.geometry(
            None,
            vertex="<depth.vert>",
            out=self.marks,
            objects=[receiver.name],
            materials="none",
            view=self.depth,
            state=State(depth_write=False, cull="none", polygon_offset=offset, stencil=mark),
            label="receiver",
        )
        state = State(
            depth_test=False,
            depth_write=False,
            depth_clamp=True,
            cull="none",
            clip_distances=2,
            stencil=Stencil(StencilFace(func="equal", reference=1)),
        )
        for layer, light in enumerate(self.lights(steps.facts)):
            if not casters:
                steps.clear(self.visibility.layer(layer), 1.0)
                continue
            steps.geometry(
                "shadow_planar.frag",
                vertex="shadow_planar.vert",
                out={"visibility": self.visibility.layer(layer), "marks": self.marks},
                objects=casters,
                materials="alpha",
                view=self.depth,
                state=state,
                label=steps.lights[light].name,
                layer=layer,
                projections=self.projections,
            )

    def update(self, frame: Frame) -> None:
        """Upload the receiver's plane and the projection matrices of all lights."""
        scene = frame.scene
        flat = [one for one in scene.objects if scene.meshes[one.mesh].plane is not None]
        name = SHADOW_PLANE if self.receiver == "auto" else self.receiver
        receiver = next((one for one in flat if one.name == name), next((one for one in flat if not one.hidden), None))
        if receiver is None:
            return
        plane = np.array(scene.meshes[receiver.mesh].plane) @ np.linalg.inv(receiver.transform)
        plane /= np.linalg.norm(plane[:3])
        records = []
        for index in casting_lights(self.light, scene.lights):
            light = homogeneous_position(scene.lights[index])
            facing_plane = plane if plane @ light >= 0 else -plane  # the light is in front of it
            columns = planar_projection(facing_plane, light).T
            records.append(np.concatenate([columns.reshape(-1), facing_plane]))
        if records:
            frame.write(self.projections, np.array(records, np.float32))
