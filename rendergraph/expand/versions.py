"""Second pass: replace the ports that nodes recorded by resources and versions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.declare import Function, History, InOut, Input, Internal, Node, Part, Port, Views, WrittenPort
from rendergraph.errors import InputError
from rendergraph.expand.recording import OF_SCENE, SCENE_DATA, Recording, is_kept, part_of
from rendergraph.expand.targets import overlap, parts_written, refusals, target_size
from rendergraph.link import Endpoint, Graph
from rendergraph.link.infer import CAMERA
from rendergraph.steps import BUFFER_OPTIONS, StepRequest
from rendergraph.steps.model import FunctionBinding, Read, Resource, Role, Step, Use, Where, Write
from rendergraph.textures import FORMATS, BufferDesc, Sampler, TextureDesc

_COPIED_OPTIONS = frozenset(
    """
    label state region objects materials order in_place per_light topology command commands invocations
    """.split()  # noqa: SIM905 - a list of so many words reads best as text
)
"""Options of a request that are copied to the step."""
_PLAIN = Sampler()


class ViewTable(Struct, frozen=True):
    """A table of views: their count, and each view's light index in the scene (empty unless they are lights' views)."""

    count: int = 1
    lights: tuple[int, ...] = ()


class VersionAssignment:
    """Turns recordings into steps with resources and versions in place of ports.

    Attributes:
        version: resource id to its newest version.
        written: resource id to its written parts: mip, and layer or None for all.
        final: port to its resource and the resource's version after its node.
        forwarded: port of an idle node to the port that it would continue: without the node, the texture is unchanged.
        firsts: resource id to the first frame's value, if a node that continues it declares one.
    """

    def __init__(self, graph: Graph, recordings: Mapping[str, Recording], idle: Mapping[str, str]) -> None:
        self.graph = graph
        self.recordings = recordings
        self.idle = dict(idle)
        self.version: dict[str, int] = {}
        self.final: dict[Endpoint, tuple[str, int]] = {}
        self.written: dict[str, set[tuple[int, int | None]]] = {}
        self.resources: dict[str, Resource] = {}
        for semantic, end in OF_SCENE.items():
            data = graph.facts.scene_data
            for info in graph.facts.of_scene(semantic):
                note = data.note if end == SCENE_DATA and data is not None else ""
                self.resources[end.port] = Resource(end.port, info.storage, "scene", note=note)
                self.final[end] = end.port, 0
        self.views: dict[str, ViewTable] = {CAMERA: ViewTable()}
        self.steps: list[Step] = []
        self.forwarded = {
            Endpoint(node.id, name): node.inputs[name][0].now
            for node in graph.nodes
            for name, port in (node.node.ports().items() if node.id not in recordings else ())
            if isinstance(port, InOut) and node.inputs.get(name)
        }
        self.firsts: dict[str, float] = {}

    def follow(self, end: Endpoint) -> Endpoint:
        """Return the port of this frame that a link leads to: idle nodes forward the input they would continue."""
        end = end.now
        while end in self.forwarded:
            end = self.forwarded[end]
        return end

    def run(self) -> None:
        if self.graph.cyclic:
            self._by_step()
        else:
            self._by_node()
        for recording in self.recordings.values():
            outputs = [port for port in recording.node.node.outputs().values() if port.name in recording.used_ports]
            if not recording.requests and not any(isinstance(port, Function | Views) for port in outputs):
                self.idle[recording.node.id] = "it recorded no step"
        self._check_buffers()

    def _check_buffers(self) -> None:
        """Refuse reads of buffers that nothing writes, neither a step nor `update`."""
        unwritten = {id for id, version in self.version.items() if version == 0 and self._is_unfilled(id)}
        for step in self.steps if unwritten else ():
            for read in step.all_reads:
                if read.resource in unwritten and not read.previous:
                    text = f"it reads the buffer '{read.resource}', but no step writes it, and its node has no `update`"
                    raise InputError(step.problem("RG601", text))

    def _is_unfilled(self, id: str) -> bool:
        node = self.graph[id.rpartition(".")[0]].node
        return isinstance(self.resources[id].desc, BufferDesc) and type(node).update is Node.update

    def _by_node(self) -> None:
        for recording in self.recordings.values():
            self._declare(recording)
            for number in range(len(recording.requests)):
                self.steps.append(self._step(recording, number))
            for end in recording.own.values():
                if end in self.final:
                    resource, _ = self.final[end]
                    self.final[end] = resource, self.version[resource]

    def _by_step(self) -> None:
        """Assign versions if nodes form a cycle: steps of one node run before and after those of others."""
        from rendergraph.expand.order import step_order  # few pipelines have one

        for recording in self.recordings.values():
            self._declare(recording)
        for name, number in step_order(self.graph, self.recordings, self.follow):
            self.steps.append(self._step(self.recordings[name], number))
        for recording in self.recordings.values():
            for end in recording.own.values():
                self._final(end)

    def _final(self, end: Endpoint) -> tuple[str, int] | None:
        """Return the resource of a port and its current version."""
        found = self.final.get(end)
        if found is None and self.graph.cyclic and end.node in self.recordings:
            links = self.recordings[end.node].links.get(end.port)
            if links and end in self.recordings[end.node].own.values():
                found = self._final(self.follow(links[0]))
                if found is not None:
                    self.final[end] = found
        return found

    def _declare(self, recording: Recording) -> None:
        """Create a resource for every texture that the node may write; an `InOut` continues an existing one."""
        node = recording.node
        for name in node.type.views:
            end = Endpoint(node.id, name)
            info = self.graph.textures[end]
            self.views[str(end)] = ViewTable(info.views, info.lights)
        for name, made in node.type.written.items():
            end = recording.own[name]
            if end in self.graph.empty:
                continue
            if recording.continues(made):
                before = self.follow(recording.links[name][0])
                if self.graph.cyclic:
                    continue  # deferred until a step needs it: its source is not written yet
                if before in self.final:  # otherwise no step that runs touches it
                    self.final[end] = self.final[before]
                continue
            info = self.graph.textures[end]
            id = str(end)
            self.resources[id] = Resource(id, info.storage, _role(made), made.first or 0.0, info.view, info.lights)
            self.version[id] = 0
            self.written[id] = set()
            self.final[end] = id, 0

    def _maker(self, end: Endpoint) -> Endpoint:
        """Return the port that first created a texture, however many nodes continue it."""
        node = self.graph[end.node]
        while isinstance(node.node.ports()[end.port], InOut) and (links := node.inputs.get(end.port)):
            end, node = links[0], self.graph[links[0].node]
        return end.now

    def _step(self, recording: Recording, index: int) -> Step:
        node, request = recording.node, recording.requests[index]
        options = request.options
        reads: list[Read] = []
        functions: list[FunctionBinding] = []
        called: set[str] = set()
        for name, target in request.bindings.items():
            part = part_of(target)
            port = part.port
            if isinstance(port, Function):
                functions.append(self._binding(recording, port.name))
            elif not isinstance(port, Input) or port.kind not in ("function", "view"):
                reads += self._reads(recording, name, part)
            elif port.kind == "function":
                # A node that has nothing to read is not recorded, and the function here is neutral.
                ends = [end for end in recording.links.get(port.name, ()) if end.node in self.recordings]
                functions += [self._binding(self.recordings[end.node], end.port) for end in ends]
                called |= {name} if ends else set()
        writes: list[Write] = []
        for name, part in request.out:
            read, write = self._write(recording, request, name, part)
            reads += read
            writes.append(write)
        all_reads = [*reads, *[read for f in functions for read in f.reads]]
        for code, text in refusals(request, self.resources, writes, all_reads):
            raise self._refused(recording, request, code, text)  # while the author's call is known
        view, view_index = self._view(recording, request)
        for write in writes if view is not None and request.kind == "geometry" else ():
            resource = self.resources[write.resource]
            if resource.view is None:
                self.resources[write.resource] = replace(resource, view=view)
        size, samples = target_size(self.resources, writes, reads)
        counts = {name: options[name] for name in BUFFER_OPTIONS if options.get(name) is not None}
        for name, port in counts.items():
            if isinstance(port, Port):
                reads += self._reads(recording, port.name, port.whole)
                counts[name] = reads[-1].resource
        held: list[tuple[str, str]] = []
        for layout, port in options.get("attributes", {}).items():
            reads += self._reads(recording, port.name, port.whole)
            held.append((layout, reads[-1].resource))
        return Step(
            node=node.id,
            index=index,
            kind=request.kind,
            shaders=request.shaders,
            reads=tuple(reads),
            writes=tuple(writes),
            functions=tuple(functions),
            includes=recording.includes,
            defines=(*_use_macros(recording, request, reads, called), *recording.defines, *request.defines.items()),
            uniforms=(*recording.uniforms, *request.uniforms.items()),
            size=size,
            samples=samples,
            view=view,
            view_index=view_index,
            attributes=tuple(held),
            type=node.type.name,
            where=Where(node.place, request.caller),
            if_drawn=_condition_step(recording, options.get("if_drawn", ""), index),
            **counts,
            **{key: value for key, value in options.items() if key in _COPIED_OPTIONS},
        )

    def _reads(self, recording: Recording, name: str, part: Part) -> list[Read]:
        port = part.port
        if isinstance(port, Input):
            ends = recording.links.get(port.name, ())
            sampler = part.sampler or recording.node.samplers.get(port.name, _PLAIN)
            use, several = part.use or port.use, port.many and part.link is None
            return [
                self._read(f"{name}_{number}" if several else name, end, part, sampler, use)
                for number, end in enumerate(ends)
                if part.link in (None, number)
            ]
        own = Endpoint(recording.node.id, port.name, part.previous)
        found = self._final(own.now)
        assert found is not None  # its node declares it
        return [self._read(name, own, part, part.sampler or _PLAIN, part.use or "sample", found[1])]

    def _read(
        self, name: str, end: Endpoint, part: Part, sampler: Sampler, use: Use, version: int | None = None
    ) -> Read:
        resource, final = self._final(self.follow(end)) or (str(self._maker(end)), 0)
        port = self.graph[end.node].node.ports()[end.port] if end.previous else None
        if isinstance(port, InOut) and port.first is not None:
            self.firsts[resource] = port.first  # declared by the node that continues the texture
        # If `known` is None, this is last frame's value of a later node.
        known = self.resources.get(resource)
        desc = known.desc if known is not None else self.graph.textures[end.now].storage
        if isinstance(desc, BufferDesc):
            use = "scene" if end in OF_SCENE.values() else "buffer"
        version = final if version is None else version
        kind = desc.kind if isinstance(desc, TextureDesc) and part.layer is None else "texture2d"
        return Read(name, resource, version, use, sampler, part.mip, part.layer, end.previous, kind)

    def _write(self, recording: Recording, request: StepRequest, name: str, part: Part) -> tuple[list[Read], Write]:
        port = part.port
        assert isinstance(port, WrittenPort)  # checked by `steps`
        end = recording.own[port.name]
        found = self._final(end)
        if found is None:
            raise self._refused(recording, request, "RG421", f"it writes '{port.name}', which has no layers")
        resource, _ = found
        desc = self.resources[resource].desc
        old = self.version[resource]
        self.version[resource] = old + 1
        self.final[end] = resource, old + 1
        continued = recording.continues(port)
        parts, touched = self.written[resource], parts_written(request, part, desc)
        fresh = not continued and not any(overlap(one, other) for one in parts for other in touched)
        parts |= touched
        clear = recording.node.clears[port.name]
        if request.kind == "clear":
            load, clear = "clear", request.options.get("value")
        elif request.kind == "mipmaps" or not fresh:
            load = "load"
        else:
            load = "discard" if clear is None else "clear"
        use = "color"
        if isinstance(desc, BufferDesc):
            use = "buffer"
        elif request.kind == "compute" or part.use == "image":
            use = "image"
        elif isinstance(desc, TextureDesc) and FORMATS[desc.format].is_depth:
            use = "depth"
        read = []
        if load == "load" and (continued or old > 0):
            read = [Read(name, resource, old, "attach", mip=part.mip, layer=part.layer)]
        updates = type(recording.node.node).update is not Node.update and not isinstance(port, History)
        if use == "buffer" and old == 0 and updates:
            read = [Read(name, resource, 0, "attach")]  # what `update` wrote before the frame must still be there
        if request.kind == "mipmaps":
            read = [Read(name, resource, old, "attach")]
        value = 0.0 if clear is None else clear
        write = Write(name, resource, old + 1, use, load, value, part.mip, part.layer)  # type: ignore[arg-type]
        return read, write

    def _refused(self, recording: Recording, request: StepRequest, code: str, text: str) -> InputError:
        node = recording.node
        step = Step(node.id, 0, request.kind, type=node.type.name, where=Where(node.place, request.caller))
        return InputError(step.problem(code, text))

    def _view(self, recording: Recording, request: StepRequest) -> tuple[str | None, int | None]:
        if request.kind not in ("geometry", "draw"):
            return None, None
        port, index = request.options.get("view"), request.options.get("view_index", 0)
        if isinstance(port, Views):
            table = str(Endpoint(recording.node.id, port.name))
            count = self.views[table].count
            if index is not None and index >= max(1, count):
                text = f"view_index is {index}, but '{port.name}' has {count} views, counted from 0"
                raise self._refused(recording, request, "RG423", text)
            if type(recording.node.node).update is Node.update and port.compute is None:
                text = f"it draws with the views of '{port.name}', which nothing sets; set them in `update`"
                raise self._refused(recording, request, "RG433", text)
            return table, index
        name = port.name if isinstance(port, Input | InOut) else "view"
        ends = recording.links.get(name, ())
        if isinstance(port, InOut) or (isinstance(port, Input) and port.kind != "view"):
            return (self.graph.textures[ends[0].now].view if ends else None) or CAMERA, index
        return (str(ends[0]) if ends else CAMERA), index

    def _binding(self, recording: Recording, function: str) -> FunctionBinding:
        node, reads = recording.node, []
        ports = node.node.ports()
        port = ports[function]
        assert isinstance(port, Function)
        for name, read in zip(port.read_names, port.reads, strict=True):
            source = ports[name]
            if isinstance(source, Input) and not recording.links.get(name):
                continue
            if name in recording.own and recording.own[name] in self.graph.empty:
                continue
            updates = type(node.node).update is not Node.update  # `update` may fill a buffer
            filled = isinstance(source, Internal) and source.kind == "buffer" and updates
            if isinstance(source, Internal) and not filled and not self.written[self.final[recording.own[name]][0]]:
                continue
            reads += self._reads(recording, name, read if isinstance(read, Part) else source.whole)
        defines = (*[(f"HAS_{read.name.upper()}", "1") for read in reads], *recording.defines)
        return FunctionBinding(
            port.signature.name, node.id, port.shader, tuple(reads), defines, recording.uniforms, recording.includes
        )


def _role(port: WrittenPort) -> Role:
    if is_kept(port):
        return "kept"
    if isinstance(port, Internal):
        return "internal"
    return "history" if isinstance(port, History) else "transient"


def _use_macros(
    recording: Recording, request: StepRequest, reads: Iterable[Read], called: set[str]
) -> list[tuple[str, str]]:
    names = called.union([read.name for read in reads])
    inputs = recording.node.node.inputs().items()
    read = [name for name, port in inputs if name in names or (getattr(port, "many", False) and f"{name}_0" in names)]
    return [(f"HAS_{name.upper()}", "1") for name in read] + [
        (f"WRITES_{name.upper()}", "1") for name, _ in request.out
    ]


def _condition_step(recording: Recording, label: str, index: int) -> int | None:
    """Return the number of the last earlier step with a label; None without a label."""
    earlier = reversed(range(index)) if label else ()
    return next((number for number in earlier if recording.requests[number].options.get("label") == label), None)
