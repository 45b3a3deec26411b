"""A pipeline or a scene in words, for `rendergraph explain`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rendergraph.cli.describe import summary
from rendergraph.cli.output import table, warn
from rendergraph.resources import opening, shipped_pipelines, shipped_scenes

if TYPE_CHECKING:
    from rendergraph.cli.options import Select
    from rendergraph.scene.model import Camera, Light, Scene

_MESHES = (".obj", ".gltf", ".glb")


def kind_of(topic: str) -> Literal["pipeline", "scene"] | None:
    """What a topic names, shipped or as a file; None where it names neither."""
    if topic in shipped_pipelines():
        return "pipeline"
    if topic in shipped_scenes():
        return "scene"
    path = Path(topic)
    if path.suffix.lower() in _MESHES:
        return "scene"
    if path.suffix.lower() not in (".yaml", ".yml") or not path.is_file():
        return None
    from rendergraph.document import load

    version = load(path, keep_going=True).root.get("scene")
    return "scene" if version is not None and isinstance(version.data, int) else "pipeline"


def pipeline(name: str, select: Select) -> dict[str, Any]:
    """What a pipeline is, as plain JSON values.

    Raises:
        InputError: with every mistake in it.
    """
    from rendergraph.session import stages

    linked = stages.link(stages.resolve(select(name)))
    warn(linked.warnings)
    path, graph, spec = linked.spec.path, linked.graph, linked.spec
    assert path is not None  # it was named by a file
    return {
        "pipeline": graph.name,
        "name": name,
        "line": opening(path) or spec.description,
        "file": str(path),
        "text": path.read_text(encoding="utf-8"),
        "scene": spec.scene.stem if spec.scene else None,
        "size": list(graph.size),
        "nodes": [
            {"id": node.id, "type": node.type.name, "line": "" if node.type.missing else summary(node.type)}
            for node in graph.nodes
        ],
        "parameters": {name: one.doc for name, one in spec.parameters.items()},
        "outputs": {name: str(end) for name, end in graph.outputs.items()},
    }


def pipeline_text(found: dict[str, Any]) -> str:
    """The same for a person."""
    width, height = found["size"]
    nodes = [(node["id"], node["type"], node["line"]) for node in found["nodes"]]
    scene = f"Draws {found['scene']}, {width}×{height}" if found["scene"] else f"Draws no scene, {width}×{height}"
    parts = [
        f"{found['pipeline']}  (pipeline)",
        found["line"],
        f"{scene}; outputs {', '.join(f'{name} ({end})' for name, end in found['outputs'].items())}.",
        "Nodes\n" + _indented(table(nodes, ("id", "type", "what it makes"))),
        "The file\n" + _indented(found["text"]),
        f"`rendergraph graph {found['name']}` draws it, `rendergraph config {found['name']}` prints it whole.",
    ]
    if found["parameters"]:
        parts.insert(4, "Parameters\n" + _indented(table(list(found["parameters"].items()))))
    return "\n\n".join(filter(None, parts))


def scene(name: str, select: Select) -> dict[str, Any]:
    """What a scene is, as plain JSON values.

    Raises:
        InputError: with every mistake in it.
    """
    from rendergraph.catalog import Catalog
    from rendergraph.scene.animate import complete
    from rendergraph.scene.load import load

    path = shipped_scenes().get(name) or Path(name)
    found = load(path, extensions=Catalog.discover(select(name).plugins).extensions)
    warn(found.warnings)
    whole = complete(found)
    return {
        "scene": found.name,
        "name": name,
        "line": opening(path) if path.suffix.lower() in (".yaml", ".yml") else "",
        "file": str(path),
        "triangles": sum(found.meshes[one.mesh].indices.size // 3 for one in found.objects),
        "objects": [
            {
                "name": one.name,
                "triangles": found.meshes[one.mesh].indices.size // 3,
                "material": found.materials[one.material].name,
                "casts_shadow": one.casts_shadow,
            }
            for one in found.objects
        ],
        "lights": [{"name": light.name, "line": _light(light)} for light in found.lights],
        "cameras": [{"name": name, "line": _camera(camera)} for name, camera in found.cameras.items()],
        "added": _added(found, whole),
        "moves": bool(found.keyframes or found.orbit),
    }


def scene_text(found: dict[str, Any]) -> str:
    """The same for a person."""
    objects = [
        (one["name"], one["triangles"], one["material"], "" if one["casts_shadow"] else "casts no shadow")
        for one in found["objects"][:_MOST_OBJECTS]
    ]
    more = len(found["objects"]) - len(objects)
    heads = ("name", "triangles", "material", "")
    parts = [
        f"{found['scene']}  (scene, {found['triangles']} triangles{', moves' if found['moves'] else ''})",
        found["line"],
        "Objects\n" + _indented(table(objects, heads, right=(1,))) + (f"\n  and {more} more" if more else ""),
    ]
    for title in ("lights", "cameras"):
        if found[title]:
            rows = [(one["name"], one["line"]) for one in found[title]]
            parts.append(f"{title.capitalize()}\n" + _indented(table(rows)))
    parts += found["added"]
    parts.append(f"`rendergraph run forward --scene {found['name']}` draws it.")
    return "\n\n".join(filter(None, parts))


_MOST_OBJECTS = 40


def _added(found: Scene, whole: Scene) -> list[str]:
    """What is there because the file has none."""
    said = []
    if not found.cameras:
        said.append("It has no camera: it is framed from the front, above and the right.")
    if not found.lights and whole.lights:
        said.append(f"It has no light: {_light(whole.lights[0])} is added.")
    return said


def _light(light: Light) -> str:
    unit = "lx" if light.type == "directional" else "cd"
    text = f"{light.type}, {light.intensity:g} {unit}"
    if tuple(light.color) != (1.0, 1.0, 1.0):
        text += f", colour {_numbers(light.color)}"
    if light.type != "point":
        text += f", towards {_numbers(light.direction)}"
    if light.type != "directional":
        text += f", at {_numbers(light.position)}"
    return text + ("" if light.casts_shadow else ", casts no shadow")


def _camera(camera: Camera) -> str:
    lens = {
        "perspective": f"{math.degrees(camera.fov_y):.3g}° high",
        "orthographic": f"orthographic, {camera.height:g} m high",
        "frustum": "a frustum of its own",
    }[camera.type]
    return f"{lens}, at {_numbers(camera.transform[:3, 3])}, {camera.near:g} to {camera.far:g} m"


def _numbers(values: Any) -> str:
    return "(" + ", ".join(f"{float(value):.3g}" for value in values) + ")"


def _indented(text: str) -> str:
    return "\n".join(f"  {line}".rstrip() for line in text.rstrip().splitlines())
