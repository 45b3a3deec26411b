"""A pipeline or a scene as plain JSON values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rendergraph.pipelines.formats import MESHES, used_extensions
from rendergraph.reference.node_types import summary
from rendergraph.resources import opening, shipped_pipelines, shipped_scenes

if TYPE_CHECKING:
    from rendergraph.scene.model import Camera, Light, Material, Scene
    from rendergraph.session.values import Linked

_YAML = (".yaml", ".yml")


def kind_of(topic: str) -> Literal["pipeline", "scene"] | None:
    """Return what a shipped name or a path refers to; None if it is neither."""
    if topic in shipped_pipelines():
        return "pipeline"
    path = Path(topic)
    if topic in shipped_scenes() or path.suffix.lower() in MESHES:
        return "scene"
    if path.suffix.lower() not in _YAML or not path.is_file():
        return None
    from rendergraph.document import load  # most topics need no YAML

    version = load(path, keep_going=True).root.get("scene")
    return "scene" if version is not None and isinstance(version.data, int) else "pipeline"


def describe_pipeline(name: str, linked: Linked) -> dict[str, Any]:
    path, graph, spec = linked.spec.path, linked.graph, linked.spec
    assert path is not None  # it was named by a file
    return {
        "pipeline": graph.name,
        "name": name,
        "line": opening(path) or spec.description,
        "file": str(path),
        "text": path.read_text(encoding="utf-8"),
        "scene": spec.scene_name or None,
        "size": list(graph.size),
        "nodes": [
            {"id": node.id, "type": node.type.name, "line": "" if node.type.missing else summary(node.type)}
            for node in graph.nodes
        ],
        "parameters": {name: parameter.doc for name, parameter in spec.parameters.items()},
        "outputs": {name: str(end) for name, end in graph.outputs.items()},
    }


def describe_scene(name: str, path: Path, scene: Scene) -> dict[str, Any]:
    from rendergraph.scene.animate import complete, moves  # other topics need no scene

    triangles = [mesh.indices.size // 3 for mesh in scene.meshes]
    added = [] if scene.cameras else ["It has no camera: one is added in front, above and to the right."]
    whole = complete(scene)
    if not scene.lights and whole.lights:
        added.append(f"It has no light: {_light(whole.lights[0])} is added.")
    if scene.environment is None and whole.environment is not None:
        added.append("It has no environment: the studio is added; `--environment none` leaves it out.")
    return {
        "scene": scene.name,
        "name": name,
        "line": opening(path) if path.suffix.lower() in _YAML else "",
        "file": str(path),
        "triangles": sum(triangles[one.mesh] for one in scene.objects),
        "bounds": [[round(value, 4) + 0.0 for value in corner] for corner in scene.bounds],  # 0, not -0
        "objects": [
            {
                "name": one.name,
                "triangles": triangles[one.mesh],
                "material": scene.materials[one.material].name,
                "casts_shadow": one.casts_shadow,
            }
            for one in scene.objects
        ],
        "clips": [
            {"name": clip.name, "seconds": round(clip.length, 3)} for rig in scene.rigs for clip in rig.clips.values()
        ],
        "variants": list(scene.variants),
        "materials": [{"name": one.name, "line": _material(one)} for one in scene.materials],
        "extensions": used_extensions(path),
        "lights": [{"name": light.name, "line": _light(light)} for light in scene.lights],
        "cameras": [{"name": name, "line": _camera(camera)} for name, camera in scene.cameras.items()],
        "added": added,
        "moves": moves(scene),
    }


def _material(material: Material) -> str:
    facts = [
        f"metallic {material.metallic:g}, roughness {material.roughness:g}",
        "" if material.alpha_mode == "opaque" else f"alpha {material.alpha_mode}",
        "double-sided" if material.double_sided else "",
        "unlit" if material.unlit else "",
        f"textures: {', '.join(material.textures)}" if material.textures else "",
    ]
    return ", ".join(filter(None, facts))


def _light(light: Light) -> str:
    is_directional = light.type == "directional"
    facts = [
        light.type,
        f"{light.intensity:g} {'lx' if is_directional else 'cd'}",
        "" if tuple(light.color) == (1.0, 1.0, 1.0) else f"colour {_numbers(light.color)}",
        "" if light.type == "point" else f"towards {_numbers(light.direction)}",
        "" if is_directional else f"at {_numbers(light.position)}",
        "" if light.casts_shadow else "casts no shadow",
    ]
    return ", ".join(filter(None, facts))


def _camera(camera: Camera) -> str:
    lens = {
        "perspective": f"{math.degrees(camera.fov_y):.3g}° high",
        "orthographic": f"orthographic, {camera.height:g} m high",
        "frustum": "with its own frustum",
    }[camera.type]
    return f"{lens}, at {_numbers(camera.transform[:3, 3])}, {camera.near:g} to {camera.far:g} m"


def _numbers(values: Any) -> str:
    return "(" + ", ".join(f"{float(value):.3g}" for value in values) + ")"
