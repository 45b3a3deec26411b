"""Shadows projected on a plane."""

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
from ._volumes import light_place

SHADOW_PLANE = "ShadowPlaneNS"
"""The name of the object that receives shadows and is not drawn itself."""

Floats = npt.NDArray[np.float64]


def projection_on(plane: Floats, light: Floats) -> Floats:
    """The matrix that moves points along rays of a light onto a plane, `M = (P·L) I − L ⊗ P` (Blinn 1988).

    Args:
        plane: (A, B, C, D), points on it have A x + B y + C z + D = 0.
        light: homogeneous, (x, y, z, 1) or (x, y, z, 0) towards it.
    """
    return (plane @ light) * np.eye(4) - np.outer(light, plane)


class ShadowPlanar(Casting):
    """Shadows that objects cast on one plane: flattened onto it along the light's rays, and drawn there once more.

    They are exact, whatever the mesh: it may be open or cut out by an alpha mask. On everything but the receiver there
    is no shadow. The receiver's pixels are marked in the stencil first, so that no shadow hangs over its border, and
    each pixel is in shadow or not, however many casters lie over one another.
    """

    depth = Input(Depth, doc="Depth of the opaque surfaces.")
    marks = Internal(Depth, format="depth32f_stencil8", clear=0.0)
    projections = Internal(kind="buffer", bytes=lambda node, facts: 80 * max(1, len(node.lights(facts))))
    visibility = visibility_of_lights()

    receiver: str = structural(
        default="auto",
        doc="The flat object that shadows fall on; `auto` is `ShadowPlaneNS`, else the first flat object of the scene.",
    )

    def lights(self, facts: Facts) -> tuple[int, ...]:
        """The lights that cast, as the scene's indices."""
        return super().lights(facts) if self.plane(facts) else ()

    def plane(self, facts: Facts) -> ObjectFacts | None:
        """The object that receives; None in a scene without objects.

        Raises:
            SceneError: no object has the name, or it is not flat, or none is.
        """
        named = [
            one for one in facts.objects if one.name == (SHADOW_PLANE if self.receiver == "auto" else self.receiver)
        ]
        if self.receiver == "auto":
            named += [one for one in facts.objects if one.flat and not one.hidden]
            if facts.objects and not named:
                raise SceneError("no object of the scene is flat; planar shadows need a plane to fall on")
        elif facts.objects and not named:
            raise SceneError(f"the scene has no object '{self.receiver}' for shadows to fall on", self.receiver)
        if named and not named[0].flat:
            raise SceneError(f"object '{named[0].name}' is not flat, so no planar shadow falls on it", self.receiver)
        return named[0] if named else None

    def record(self, steps: Steps) -> None:
        """The receiver into the stencil, then each light's flattened casters where it is seen."""
        receiver = self.plane(steps.facts)
        assert receiver is not None  # without one there are no layers, and nothing is recorded
        casters = [one.name for one in steps.facts.drawn("casters") if one.name != receiver.name]
        steps.fullscreen("<copy_depth.frag>", out=self.marks, depth=self.depth)
        mark = Stencil(StencilFace(reference=1, depth_pass="replace"))
        # A receiver that is not drawn lies on what is, or a hair beside it.
        nearer = (1.0, 16.0)
        steps.geometry(
            None,
            vertex="<depth.vert>",
            out=self.marks,
            objects=[receiver.name],
            materials="none",
            view=self.depth,
            state=State(depth_write=False, cull="none", polygon_offset=nearer, stencil=mark),
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
        """Planes and matrices of where the lights and the receiver are now."""
        scene = frame.scene
        flat = [one for one in scene.objects if scene.meshes[one.mesh].plane is not None]
        wanted = SHADOW_PLANE if self.receiver == "auto" else self.receiver
        receiver = next(
            (one for one in flat if one.name == wanted), next((one for one in flat if not one.hidden), None)
        )
        if receiver is None:
            return
        plane = np.array(scene.meshes[receiver.mesh].plane) @ np.linalg.inv(receiver.transform)
        plane /= np.linalg.norm(plane[:3])
        records = []
        for index in casting_lights(self.light, scene.lights):
            light = light_place(scene.lights[index])
            towards = plane if plane @ light >= 0 else -plane  # in front of it is the light
            columns = projection_on(towards, light).T
            records.append(np.concatenate([columns.reshape(-1), towards]))
        if records:
            frame.write(self.projections, np.array(records, np.float32))
