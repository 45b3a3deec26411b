"""What a node knows of scene and inputs before the schedule."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from msgspec import Struct, field
from msgspec.structs import astuple

from rendergraph.errors import SceneError, suggestion
from rendergraph.formatting import format_bytes
from rendergraph.textures import BufferDesc, EnvironmentMap, Layout, SceneData, Semantic, Signature, TextureDesc

SELECTIONS: Mapping[str, Callable[[bool, bool], bool]] = {
    "all": lambda casts, blended: True,
    "opaque": lambda casts, blended: not blended,
    "transparent": lambda casts, blended: blended,
    "casters": lambda casts, blended: casts and not blended,
}
"""The objects of a geometry step by its word: a test of whether they cast a shadow, and are blended.

Keyframes change neither.
"""


class Extra(dict[str, Any]):
    """Values that an entry of a scene file gives to keys of plugins, by name; read-only. `SceneKey.of` reads one."""

    def __hash__(self) -> int:  # type: ignore[override]  # nobody writes to it
        return hash(frozenset(self.items()))


NO_EXTRA = Extra()


class LightFacts(Struct, frozen=True):
    """A light without the values that keyframes change; `casts_shadow` allows nodes to choose it for shadows.

    Attributes:
        extra: values of plugins' keys, see `SceneKey.of`; keyframes may change them, as with the other facts.
    """

    name: str
    type: Literal["directional", "point", "spot"]
    casts_shadow: bool = True
    extra: Extra = NO_EXTRA


class MaterialFacts(Struct, frozen=True):
    """A material; `extra` has the values of plugins' keys."""

    name: str
    extra: Extra = NO_EXTRA


class CameraFacts(Struct, frozen=True):
    """The camera that the pipeline renders with; `extra` has the values of plugins' keys.

    Attributes:
        shutter: how much of a frame's time it is open, the most of any frame; 0 while `subframes` are averaged.
    """

    name: str = ""
    extra: Extra = NO_EXTRA
    shutter: float = 0.0


def casting_lights(wanted: str | Sequence[str], lights: Sequence[Any]) -> tuple[int, ...]:
    """Return the shadow-casting lights, as indices into the scene's lights, in its order.

    Args:
        wanted: `auto` for the first directional, else the first spot, else the first point light, and `all`, both of
            those that cast shadows; or a light's name, or several.
        lights: the scene's lights, each with `name`, `type` and `casts_shadow`.

    Raises:
        SceneError: no light has that name.
    """
    if wanted == "auto":
        kinds = [light.type if light.casts_shadow else None for light in lights]
        return tuple([kinds.index(kind) for kind in ("directional", "spot", "point") if kind in kinds][:1])
    if wanted == "all":
        return tuple(number for number, light in enumerate(lights) if light.casts_shadow)
    names = [light.name for light in lights]
    found = set()
    for name in [wanted] if isinstance(wanted, str) else wanted:
        if name not in names:
            hint = suggestion(name, names, most=len(names)) or "; there are no lights"
            raise SceneError(f"the scene has no light '{name}'{hint}", name)
        found.add(names.index(name))
    return tuple(sorted(found))


class ObjectFacts(Struct, frozen=True, eq=False):
    """An object without its place, which may move.

    Meshes are not compared: what was worked out for one object holds for another that is equal in all else.

    Attributes:
        triangles, vertices: counts of its mesh.
        blended: what is behind it is seen through its material, by alpha or as it transmits light.
        double_sided: its material is visible from both sides.
        hidden: only steps that name it draw it.
        grain: its material is anisotropic (`anisotropy_strength`) in some frame.
        emissive: its material emits light in some frame.
        reflective: its material reflects other than 4 % at normal incidence where it is not metal, in some frame.
        mesh: the name of its mesh.
        extra: values of plugins' keys, see `SceneKey.of`.
        layers: those of its material in some frame: `clearcoat`, `sheen`, `iridescence`, `transmission`.
    """

    name: str
    triangles: int
    vertices: int
    casts_shadow: bool = True
    blended: bool = False
    double_sided: bool = False
    hidden: bool = False
    grain: bool = False
    emissive: bool = False
    reflective: bool = False
    mesh: str = ""
    _gap: Callable[[], str] = str
    _plane: Callable[[], object] = lambda: None
    _convex: Callable[[], bool] = bool
    extra: Extra = NO_EXTRA
    layers: tuple[str, ...] = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ObjectFacts) and self._compared == other._compared

    def __hash__(self) -> int:
        return hash(self._compared)

    def __repr__(self) -> str:
        names = [
            name
            for name in self.__struct_fields__
            if name[0] != "_" and (name not in ("extra", "layers") or getattr(self, name))
        ]
        known = (f"{name}={getattr(self, name)!r}" for name in names)
        return f"ObjectFacts({', '.join(known)})"

    @property
    def _compared(self) -> tuple[object, ...]:
        return *astuple(self)[:-6], self.extra, self.layers  # all but the mesh and what is asked of it

    @property
    def closed(self) -> bool:
        """Whether its mesh, welded where positions are equal, has two triangles at each edge that run it both ways."""
        return not self._gap()

    @property
    def flat(self) -> bool:
        """Whether all its triangles lie in one plane."""
        return self._plane() is not None

    @property
    def most_layers(self) -> int:
        """A bound of how many of its drawn surfaces a line of sight can meet.

        One for a flat mesh, one for a convex mesh and two if it is double-sided; else its number of triangles.
        """
        if self.flat:
            return 1
        return 1 + self.double_sided if self._convex() else self.triangles

    @property
    def gap(self) -> str:
        """Where its mesh is not closed, as a sentence that names object, mesh and edge; empty where it is closed."""
        gap = self._gap()
        return gap and f"object '{self.name}' is not closed: in its mesh '{self.mesh}' {gap}"


class TextureInfo(Struct, frozen=True, gc=False):
    """What inference found out about an output.

    Attributes:
        desc: what it is allocated from (None for a buffer, view or function).
        semantic: its meaning, after `any` and `like` are followed.
        view: the id of the view table it is drawn with (`camera`, or `node.port`), None if not drawn.
        lights: the scene's light index of each layer or view, empty if they belong to no lights.
        bytes: size of a buffer, or of the scene's data; 0 for textures.
        views: number of views of a table of views, 0 for everything else.
        element: what a buffer holds, if its port declares it.
    """

    desc: TextureDesc | None
    semantic: Semantic
    view: str | None = None
    lights: tuple[int, ...] = ()
    bytes: int = 0
    views: int = 0
    element: Layout | None = None

    @property
    def storage(self) -> TextureDesc | BufferDesc:
        """What a texture or buffer is allocated from."""
        return self.desc if self.desc is not None else BufferDesc(self.bytes, self.element)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a texture."""
        assert self.desc is not None, "only textures have a size"
        return self.desc.size

    @property
    def holds_values(self) -> bool:
        """Whether it is a texture or a buffer, which can be read back; a function or a view is neither."""
        return self.desc is not None or self.bytes > 0


class SceneDataFacts(Struct, frozen=True):
    """What inputs of `SceneData` bring along.

    Attributes:
        bytes: of buffers and texture arrays, without the indices, lights and materials that every scene has.
        triangles: of all objects.
        emitters: triangles that emit light in some frame, of objects that are not hidden.
        textures: the arrays that hold the materials' textures.
        smaller: images that are smaller than the layers of their array, of which they fill a corner.
        trees: a limit of the bytes of the trees for rays, among `bytes`; 0 where no input asks for them.
    """

    bytes: int = 0
    triangles: int = 0
    emitters: int = 0
    textures: tuple[TextureDesc, ...] = ()
    smaller: int = 0
    trees: int = 0

    @property
    def note(self) -> str:
        """What takes the bytes, in one line."""
        in_arrays = sum(desc.bytes for desc in self.textures)
        text = f"{format_bytes(self.bytes - self.trees - in_arrays)} of buffers"
        if self.trees:
            text += f", at most {format_bytes(self.trees)} of trees for rays"
        if self.textures:
            listed = [f"{desc.layers} of {desc.width}×{desc.height} {desc.format}" for desc in self.textures]
            text += f", {format_bytes(in_arrays)} of texture arrays ({'; '.join(listed)})"
        return text + (f", in which {self.smaller} smaller images fill corners of layers" if self.smaller else "")


class Facts(Struct, frozen=True):
    """What a node knows before the schedule; lights and objects are in the scene's order.

    Attributes:
        viewport: width and height of the picture.
        inputs: what each connected input carries; a `many` input has one entry a link.
        environment: the environment map as it is uploaded; None if the scene has none.
        scene_data: what inputs of `SceneData` read; None if no node has one.
        materials: of the scene, in the order of `FrameScene.materials`.
        camera: the camera that renders.
    """

    viewport: tuple[int, int]
    lights: tuple[LightFacts, ...] = ()
    inputs: Mapping[str, tuple[TextureInfo, ...]] = field(default_factory=dict)
    objects: tuple[ObjectFacts, ...] = ()
    environment: TextureDesc | None = None
    scene_data: SceneDataFacts | None = None
    materials: tuple[MaterialFacts, ...] = ()
    camera: CameraFacts = CameraFacts()

    def of_scene(self, semantic: Semantic | Signature) -> tuple[TextureInfo, ...]:
        """What an unconnected input of this meaning reads of the scene; empty if the scene has nothing like it."""
        if semantic == EnvironmentMap and self.environment is not None:
            return (TextureInfo(self.environment, EnvironmentMap),)
        if semantic == SceneData and self.scene_data is not None:
            return (TextureInfo(None, SceneData, bytes=self.scene_data.bytes),)
        return ()

    def casting(self, wanted: str | Sequence[str]) -> tuple[int, ...]:
        """The shadow-casting lights, as indices: `auto`, `all`, a light's name or several; see `casting_lights`."""
        return casting_lights(wanted, self.lights)

    def drawn(self, objects: str | Sequence[str]) -> tuple[ObjectFacts, ...]:
        """The objects that a geometry step of these `objects` draws: `opaque`, …, or names."""
        takes = SELECTIONS.get(objects) if isinstance(objects, str) else None
        if takes is not None:
            return tuple(one for one in self.objects if not one.hidden and takes(one.casts_shadow, one.blended))
        names = [objects] if isinstance(objects, str) else objects
        return tuple(one for one in self.objects if one.name in names)

    def connected(self, name: str) -> bool:
        """Whether the input is connected, or takes something of the scene and there is such a thing."""
        return bool(self.inputs.get(name))

    def input(self, name: str) -> TextureInfo:
        """What a connected input carries; KeyError for others."""
        return self.inputs[name][0]
