"""What a node knows about the scene and its inputs before scheduling."""

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
"""The objects of a geometry step by keyword: a test on whether they cast a shadow, and whether they are blended.

Keyframes change neither.
"""


class Extra(dict[str, Any]):
    """Values of plugins' keys in an entry of a scene file, by name; read-only. `SceneKey.of` reads one."""

    def __hash__(self) -> int:  # type: ignore[override]  # read-only
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
        shutter: fraction of a frame's time for which it is open, the maximum over frames; 0 with `subframes`.
    """

    name: str = ""
    extra: Extra = NO_EXTRA
    shutter: float = 0.0


def casting_lights(wanted: str | Sequence[str], lights: Sequence[Any]) -> tuple[int, ...]:
    """Return the shadow-casting lights, as indices into the scene's lights, in its order.

    Args:
        wanted: `auto` for the first directional, else the first spot, else the first point light, or `all`, both
            among lights that cast shadows; or the names of one or several lights.
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
    """An object without its transform, which may change.

    Equality ignores meshes: results for one object hold for another that is equal in everything else.

    Attributes:
        triangles, vertices: counts of its mesh.
        blended: its material lets surfaces behind it show, by alpha or transmission.
        double_sided: its material is visible from both sides.
        hidden: only steps that name it draw it.
        grain: its material is anisotropic (`anisotropy_strength`) in any frame.
        emissive: its material emits light in any frame.
        reflective: its material has a dielectric reflectance other than 4 % at normal incidence in any frame.
        mesh: the name of its mesh.
        extra: values of plugins' keys, see `SceneKey.of`.
        layers: layers of its material in any frame: `clearcoat`, `sheen`, `iridescence`, `transmission`.
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
        facts = {name: getattr(self, name) for name in self.__struct_fields__ if name[0] != "_"}
        known = (f"{name}={value!r}" for name, value in facts.items() if value or name not in ("extra", "layers"))
        return f"ObjectFacts({', '.join(known)})"

    @property
    def _compared(self) -> tuple[object, ...]:
        return *astuple(self)[:-6], self.extra, self.layers  # everything except the mesh and its properties

    @property
    def closed(self) -> bool:
        """Whether its mesh, with equal positions welded, has two triangles at each edge, in opposite directions."""
        return not self._gap()

    @property
    def flat(self) -> bool:
        """Whether all its triangles lie in one plane."""
        return self._plane() is not None

    @property
    def most_layers(self) -> int:
        """An upper bound on how many of its drawn surfaces a view ray can hit.

        One for a flat mesh, one for a convex mesh and two if it is double-sided; else its number of triangles.
        """
        if self.flat:
            return 1
        return 1 + self.double_sided if self._convex() else self.triangles

    @property
    def gap(self) -> str:
        """Where its mesh is not closed, as a sentence that names object, mesh and edge; empty if it is closed."""
        gap = self._gap()
        return gap and f"object '{self.name}' is not closed: in its mesh '{self.mesh}' {gap}"


class TextureInfo(Struct, frozen=True, gc=False):
    """The inferred properties of an output.

    Attributes:
        desc: its texture's description (None for a buffer, view or function).
        semantic: its semantic, with `any` and `like` resolved.
        view: the id of the view table it is drawn with (`camera`, or `node.port`), None if not drawn.
        lights: index of the scene's light for each layer or view, empty if they do not belong to lights.
        bytes: size of a buffer, or of the scene's data; 0 for textures.
        views: number of views in a view table, 0 for everything else.
        element: the elements of a buffer, if its port declares them.
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
        """The description of a texture or buffer."""
        return self.desc if self.desc is not None else BufferDesc(self.bytes, self.element)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a texture."""
        assert self.desc is not None, "only textures have a size"
        return self.desc.size

    @property
    def holds_values(self) -> bool:
        """Whether it is a texture or a buffer, which can be read back, unlike a function or a view."""
        return self.desc is not None or self.bytes > 0


class SceneDataFacts(Struct, frozen=True):
    """The data behind inputs of `SceneData`.

    Attributes:
        bytes: bytes of buffers and texture arrays, without the indices, lights and materials that every scene has.
        triangles: number of triangles of all objects.
        emitters: number of triangles that emit light in any frame, of objects that are not hidden.
        textures: the arrays of the materials' textures.
        smaller: number of images that are smaller than the layers of their array and fill a corner.
        trees: an upper bound on the bytes of the BVHs, included in `bytes`; 0 if no input needs them.
    """

    bytes: int = 0
    triangles: int = 0
    emitters: int = 0
    textures: tuple[TextureDesc, ...] = ()
    smaller: int = 0
    trees: int = 0

    @property
    def note(self) -> str:
        """A summary of the bytes, in one line."""
        in_arrays = sum(desc.bytes for desc in self.textures)
        text = f"{format_bytes(self.bytes - self.trees - in_arrays)} of buffers"
        if self.trees:
            text += f", at most {format_bytes(self.trees)} of trees for rays"
        if self.textures:
            listed = [f"{desc.layers} of {desc.width}×{desc.height} {desc.format}" for desc in self.textures]
            text += f", {format_bytes(in_arrays)} of texture arrays ({'; '.join(listed)})"
        return text + (f", in which {self.smaller} smaller images fill corners of layers" if self.smaller else "")


class Facts(Struct, frozen=True):
    """What a node knows before scheduling; lights and objects are in the scene's order.

    Attributes:
        viewport: width and height of the picture.
        inputs: the properties of each connected input's texture; a `many` input has one entry per link.
        environment: the environment map as uploaded; None if the scene has none.
        scene_data: the data behind inputs of `SceneData`; None if no node has one.
        materials: materials of the scene, in the order of `FrameScene.materials`.
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
        """Return what an unconnected input with this semantic reads from the scene; empty if the scene lacks it."""
        if semantic == EnvironmentMap and self.environment is not None:
            return (TextureInfo(self.environment, EnvironmentMap),)
        if semantic == SceneData and self.scene_data is not None:
            return (TextureInfo(None, SceneData, bytes=self.scene_data.bytes),)
        return ()

    def casting(self, wanted: str | Sequence[str]) -> tuple[int, ...]:
        """Return the indices of shadow-casting lights: `auto`, `all`, or names; see `casting_lights`."""
        return casting_lights(wanted, self.lights)

    def drawn(self, objects: str | Sequence[str]) -> tuple[ObjectFacts, ...]:
        """Return the objects that a geometry step with these `objects` draws: `opaque`, …, or names."""
        takes = SELECTIONS.get(objects) if isinstance(objects, str) else None
        if takes is not None:
            return tuple(one for one in self.objects if not one.hidden and takes(one.casts_shadow, one.blended))
        names = [objects] if isinstance(objects, str) else objects
        return tuple(one for one in self.objects if one.name in names)

    def connected(self, name: str) -> bool:
        """Return whether the input is connected, or reads something that the scene has."""
        return bool(self.inputs.get(name))

    def input(self, name: str) -> TextureInfo:
        """Return the properties of a connected input's texture; KeyError for other inputs."""
        return self.inputs[name][0]
