"""Dependencies of steps, derived from versions: which steps run, and in which partial order."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from typing import TypeAlias

from msgspec import Struct

from rendergraph.errors import InputError, Problem
from rendergraph.link.graph import depth_first, upstream_first
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import TextureDesc

MOST_TURNS = 4
"""Number of histories up to which every subset is tried as those read before they are written: 16 subsets."""

StepKey: TypeAlias = tuple[str, int]
"""A step's `key`: node id and number."""

Waits: TypeAlias = Mapping[StepKey, Mapping[StepKey, tuple[str, str]]]
"""Step to the steps that it waits for, with the resource as reason and `reads`, `continues` or `overwrites`."""

Turns: TypeAlias = Mapping[str, tuple[StepKey, Sequence[StepKey]]]
"""History to the step that first writes its next value, and the steps that must read the last value before."""


def touched_ids(step: Step) -> dict[str, None]:
    """Return the ids of the resources that a step reads or writes, each once, in its own order."""
    touched: tuple[Read | Write, ...] = (*step.all_reads, *step.writes)
    return dict.fromkeys([one.resource for one in touched])


class Versions(Struct, frozen=True):
    """Writers and readers of each version of each resource.

    Attributes:
        writers: resource id to version to the step that writes it, in rising order of versions.
        readers: resource id to (version, step) pairs, without reads of the last frame.
    """

    writers: Mapping[str, dict[int, Step]]
    readers: Mapping[str, Sequence[tuple[int, Step]]]

    @classmethod
    def of(cls, steps: Iterable[Step]) -> Versions:
        """Collect the versions of steps; two steps that write the same version of a resource are an error (RG605)."""
        writers: dict[str, dict[int, Step]] = defaultdict(dict)
        readers: dict[str, list[tuple[int, Step]]] = defaultdict(list)
        problems: list[Problem] = []
        for step in steps:
            for write in step.writes:
                other = writers[write.resource].setdefault(write.version, step)
                if other is not step:
                    text = f"'{other.node}' and '{step.node}' both continue '{write.resource}' from the same state; "
                    problems.append(Problem("RG605", text + "let one of them take the other's output"))
            for read in step.all_reads:
                if not read.previous:
                    readers[read.resource].append((read.version, step))
        if problems:
            raise InputError(problems)
        return cls({id: dict(sorted(found.items())) for id, found in writers.items()}, dict(readers))

    def final(self, resource: str) -> Step | None:
        """Return the step that writes the last version; None if no step does."""
        found = self.writers.get(resource)
        return found[next(reversed(found))] if found else None


def continues(step: Step, write: Write, resource: Resource) -> bool:
    """Return whether some of the previous version remains after a step.

    True for everything except a clear or discard of the whole texture: writes of a part, a mip level, an image or a
    buffer preserve the rest.
    """
    whole = write.mip is None and write.layer is None and getattr(resource.desc, "mips", 1) == 1
    return not whole or write.load == "load" or write.use in ("image", "buffer") or step.kind == "mipmaps"


def is_filled_by_update(id: str, resource: Resource, versions: Versions) -> bool:
    """Return whether the CPU fills a buffer before the first step: a step reads it before any step writes it."""
    return not isinstance(resource.desc, TextureDesc) and (
        id not in versions.writers or any(version == 0 for version, _ in versions.readers.get(id, ()))
    )


def contributing(
    steps: Sequence[Step],
    resources: Mapping[str, Resource],
    outputs: Mapping[str, str],
    versions: Versions,
    idle: Mapping[str, str],
) -> list[Step]:
    """Return the steps on which any output depends, in the given order.

    If such a step reads history, the writers of the history are needed as well.
    """
    kept: set[StepKey] = set()
    problems: list[Problem] = []
    stack: list[Step] = []
    for name, id in outputs.items():
        final = versions.final(id)
        if final is not None:
            stack.append(final)
        elif id not in resources or isinstance(resources[id].desc, TextureDesc):
            text = f"output '{name}' shows '{id}', but no step writes it; write it in the node's `record`"
            maker = next((step for step in steps if step.node == id.rpartition(".")[0]), None)
            place = maker.where.place if maker is not None else None
            problems.append(Problem("RG604", text, place, subject=id))
    while stack:
        step = stack.pop()
        if step.key in kept:
            continue
        kept.add(step.key)
        for read in step.all_reads:
            if read.previous:
                writer = versions.final(read.resource)
            else:
                writer = versions.writers.get(read.resource, {}).get(read.version)
                made = resources.get(read.resource)
                texture = made is None or (isinstance(made.desc, TextureDesc) and made.role != "scene")
                if writer is None and texture and read.use != "attach":  # the attached write reports it better
                    problems.append(_unwritten(step, read.resource, versions, idle))
            if writer is not None:
                stack.append(writer)
        for write in step.writes:
            resource = resources[write.resource]
            if not continues(step, write, resource):
                continue
            before = versions.writers[write.resource].get(write.version - 1)
            if before is not None:
                stack.append(before)
            elif isinstance(resource.desc, TextureDesc) and (write.load == "load" or step.kind == "mipmaps"):
                text = f"the first step that writes '{write.resource}' loads its content, but it has none yet; "
                text += "give the port a `clear` value or fill it in an earlier step"
                problems.append(step.problem("RG603", text))
    if problems:
        raise InputError(sorted(set(problems), key=lambda problem: (problem.code, problem.message)))
    return [step for step in steps if step.key in kept]


def dependencies(
    kept: Sequence[Step], versions: Versions, overwritten: Mapping[tuple[str, str], Problem] = {}
) -> Waits:
    """Return the steps that each needed step waits for.

    A reader follows the writer of its version; a writer follows the previous writer and all readers of the version that
    it overwrites. A step's dependencies are in the order of its reads, then its writes, not of nodes. `versions` are
    those of the needed steps only. A cycle of steps is an error: the one in `overwritten` for the nodes that read and
    overwrite a texture, else RG602.
    """
    # Readers by the version that they see, because writers in between may have been culled.
    readers: dict[tuple[str, int], list[StepKey]] = defaultdict(list)
    for id, seen in versions.readers.items():
        known = [0, *versions.writers.get(id, ())]
        for version, step in seen:
            readers[id, known[bisect_right(known, version) - 1]].append(step.key)
    before = {id: {v: earlier for earlier, (v, _) in pairwise(made.items())} for id, made in versions.writers.items()}
    waits: dict[StepKey, dict[StepKey, tuple[str, str]]] = {}
    for step in kept:
        mine = waits[step.key] = {}
        for read in step.all_reads:
            writer = None if read.previous else versions.writers.get(read.resource, {}).get(read.version)
            if writer is not None:
                mine.setdefault(writer.key, (read.resource, "reads"))
        for write in step.writes:
            version, earlier = before[write.resource].get(write.version, (0, None))
            if earlier is not None:
                mine.setdefault(earlier.key, (write.resource, "continues"))
            for reader in sorted(readers.get((write.resource, version), ())):
                mine.setdefault(reader, (write.resource, "overwrites"))
        mine.pop(step.key, None)
    if len(upstream_first(waits)) < len(waits):
        raise InputError(list(dict.fromkeys(_cycles(waits, overwritten, {step.key: step for step in kept}))))
    return waits


def _cycles(
    waits: dict[StepKey, dict[StepKey, tuple[str, str]]],
    overwritten: Mapping[tuple[str, str], Problem],
    steps: Mapping[StepKey, Step],
) -> Iterator[Problem]:
    """Yield the problem of a cycle, then those of cycles that remain without its edges."""
    from graphlib import CycleError, TopologicalSorter  # only to name a cycle

    while True:
        try:
            TopologicalSorter(waits).prepare()
        except CycleError as error:
            edges = list(pairwise(error.args[1]))
        else:
            return
        known = [edge for edge in edges if (edge[0][0], edge[1][0]) in overwritten and _overwrites(waits, edge)]
        if not known:
            yield _cycle(waits, edges, steps)
            return
        yield overwritten[known[0][0][0], known[0][1][0]]
        del waits[known[0][1]][known[0][0]]


def _overwrites(waits: Waits, edge: tuple[StepKey, StepKey]) -> bool:
    return waits[edge[1]][edge[0]][1] == "overwrites"


def history_copies(steps: Iterable[Step], resources: Mapping[str, Resource]) -> dict[str, int]:
    """Return the number of textures of each history in an order of steps, by id.

    Usually two alternate; one suffices if last frame's value is last read before this frame's is written.
    """
    copies = {id: 1 for id, resource in resources.items() if resource.role == "history"}
    written: set[str] = set()
    for step in steps if copies else ():
        written |= {write.resource for write in step.writes}
        copies |= {read.resource: 2 for read in step.all_reads if read.previous and read.resource in written}
    return copies


class ReadFirst(Struct, frozen=True):
    """Histories whose last value can be read before the next is written, unless every order does so.

    Attributes:
        choices: sets that can be read first together; the largest first, the empty set last.
        exhaustive: whether these are all such sets.
    """

    turns: Turns
    choices: Sequence[Sequence[str]]
    exhaustive: bool


def read_first_choices(
    waits: Waits, kept: Sequence[Step], versions: Versions, resources: Mapping[str, Resource]
) -> ReadFirst:
    """Return which histories can be read before they are written; if there are many, only one large set."""
    readers: dict[str, set[StepKey]] = defaultdict(set)
    for step in kept:
        for read in step.all_reads:
            if read.previous and versions.writers.get(read.resource):
                readers[read.resource].add(step.key)
    turns: dict[str, tuple[StepKey, Sequence[StepKey]]] = {}
    for id in sorted(readers):
        writer = next(iter(versions.writers[id].values())).key
        earlier = {*depth_first(waits, [writer])}
        later = {key for key in readers[id] if writer in depth_first(waits, [key])}
        loose = sorted(readers[id] - earlier)
        if loose and not later:
            turns[id] = writer, loose

    def together(ids: Iterable[str]) -> list[str]:
        more, early = waits, []
        for id in ids:
            writer, loose = turns[id]
            if all(writer not in depth_first(more, [reader]) for reader in loose):
                more = read_first(more, {id: turns[id]})
                early.append(id)
        return early

    if len(turns) > MOST_TURNS:
        greedy = together(sorted(turns, key=lambda id: (-resources[id].desc.bytes, id)))
        return ReadFirst(turns, [greedy, []], exhaustive=False)
    sets = [ids for count in range(len(turns), -1, -1) for ids in combinations(turns, count)]
    return ReadFirst(turns, [ids for ids in sets if len(together(ids)) == len(ids)], exhaustive=True)


def read_first(waits: Waits, turns: Turns) -> Waits:
    """Return the dependencies with the readers of some histories before the steps that write them."""
    more = dict(waits)
    for id, (writer, readers) in turns.items():
        more[writer] = {**more[writer], **dict.fromkeys(readers, (id, "overwrites"))}
    return more


def _unwritten(step: Step, resource: str, versions: Versions, idle: Mapping[str, str]) -> Problem:
    """Explain why a resource is not written: its node is idle or never writes it, or the step comes too early."""
    maker = resource.rpartition(".")[0]
    if maker in idle:
        text = f"node '{step.node}' reads '{resource}', but '{maker}' does nothing: {idle[maker]}"
        return Problem("RG607", text, step.where.place)
    if maker != step.node and not versions.writers.get(resource):
        text = f"node '{step.node}' reads '{resource}', but no step of '{maker}' writes it; write it in its `record`"
        return Problem("RG604", text, step.where.place, subject=resource)
    text = f"it reads '{resource}', but no step has written it by then; write it in an earlier step, or declare it "
    return step.problem("RG601", text + "`History` to read last frame's value")


def _cycle(waits: Waits, edges: Sequence[tuple[StepKey, StepKey]], steps: Mapping[StepKey, Step]) -> Problem:
    # Users can change an edge that only keeps a reader before an overwriter, so start the cycle there.
    start = next((i for i, edge in enumerate(edges) if _overwrites(waits, edge)), 0)
    one, other = edges[start]
    reader, writer = one[0], other[0]
    if reader == writer:
        reader, writer = (f"{key[0]}[{f'{key[1]} {steps[key].label}'.rstrip()}]" for key in (one, other))
    resource, _ = waits[edges[start][1]][edges[start][0]]
    back = edges[(start + 1) % len(edges)]
    needed, _ = waits[back[1]][back[0]]
    text = f"'{reader}' must run before '{writer}', which overwrites '{resource}', but also after it, as it depends on "
    text += f"'{needed}'; let '{reader}' take '{resource}' from '{writer}' or the rest from before it"
    return Problem("RG602", text, steps[one].where.place)
