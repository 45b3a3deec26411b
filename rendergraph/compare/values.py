"""What comparing yields: one value for each variant, and all of them with what they were compared to."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy.typing as npt

from rendergraph.compare.timing import Times
from rendergraph.diff import GraphDiff, diff_json
from rendergraph.errors import Problem
from rendergraph.metrics import Encoding, Metrics, description

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.link import Graph

Pixels = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Reference:
    """What pictures are measured against.

    Attributes:
        name: a variant's, a pipeline's or a file's.
        kind: which of the three.
        pixels: top row first.
        encoding: what its values are; `linear` ones are compared with `radiance`.
    """

    name: str
    kind: Literal["variant", "pipeline", "file"]
    pixels: Pixels
    encoding: Encoding

    @property
    def output(self) -> str:
        """The output that is compared with it."""
        return "image" if self.encoding == "display" else "radiance"

    def as_json(self) -> dict[str, Any]:
        """Its name and kind."""
        return {"name": self.name, "kind": self.kind, "output": self.output}


@dataclass(frozen=True, eq=False)
class Difference:
    """The first pass, in order of execution, whose output differs.

    Attributes:
        node: the pass in the variant.
        base_node: the same pass in what it is compared to; another name where it was renamed.
        port: the first of its outputs that differs.
        most: greatest difference of a channel, None where sizes or formats differ.
        share: part of the texels that differ, 0…1.
        causes: nodes that differ in structure and lead there, the pass itself included.
        added: those of them that the base does not have: they have no counterpart that they could differ from.
        pixels: the output in the base and in the variant.
        semantic: what its texels mean.
    """

    node: str
    base_node: str
    port: str
    most: float | None
    share: float
    causes: tuple[str, ...]
    added: tuple[str, ...]
    pixels: tuple[Pixels, Pixels]
    semantic: str

    @property
    def after(self) -> str:
        """What the base does not have on the way there: `, after added node bloom`."""
        several = "s" if len(self.added) > 1 else ""
        return f", after added node{several} {', '.join(self.added)}" if self.added else ""

    def as_json(self) -> dict[str, Any]:
        """Everything but the texels."""
        return {
            "node": self.node,
            "base_node": self.base_node,
            "port": self.port,
            "most": self.most,
            "share": self.share,
            "causes": list(self.causes),
            "added": list(self.added),
        }


@dataclass(frozen=True, eq=False)
class Result:
    """One variant.

    Attributes:
        name: unique among the variants.
        source: what was typed to name its pipeline.
        settings: what a sweep set, by path.
        pixels: the output that was compared, and its encoding.
        metrics: against the reference.
        radiance_rmse: of linear light against the reference's, None where one of them has none.
        flip_map: (height, width), 0…1; None where it was not kept.
        times: what drawing took.
        graph, plan: structure and memory; None where a result was read back from a file.
        memory: the plan's figures.
        pass_count: nodes that are drawn.
        difference: what turns the base's graph into this one.
        first: the first pass that draws something else than the base's.
    """

    name: str
    source: str
    pixels: Pixels
    encoding: Encoding
    metrics: Metrics
    times: Times
    memory: Mapping[str, object]
    pass_count: int
    settings: Mapping[str, str] = field(default_factory=dict)
    radiance_rmse: float | None = None
    flip_map: Pixels | None = None
    graph: Graph | None = None
    plan: ResourcePlan | None = None
    difference: GraphDiff | None = None
    first: Difference | None = None

    def as_json(self) -> dict[str, Any]:
        """Everything but pictures."""
        found: dict[str, Any] = {"name": self.name, "pipeline": self.source}
        if self.settings:
            found["settings"] = dict(self.settings)
        found |= self.metrics.as_json()
        found["radiance_rmse"] = self.radiance_rmse
        found |= self.times.as_json()
        found |= {"pass_count": self.pass_count, "memory": dict(self.memory)}
        if self.difference is not None:
            found["diff"] = diff_json(self.difference)
            found["first_difference"] = self.first.as_json() if self.first else None
        return found


@dataclass(frozen=True, eq=False)
class Comparison:
    """Variants against a reference, on one scene, at one size, on one machine.

    Attributes:
        results: in the order given.
        reference: what pictures were measured against.
        base: the graph that the variants' graphs were compared to, and its name.
        scene: the scene's name.
        camera: the camera's name where one was chosen.
        size: width and height.
        frame: number of the frame whose pictures were compared.
        device: what drew, as `run --json` has it.
        notes: what was changed to make the variants comparable.
        warnings: what was noticed in files and is no error.
    """

    results: tuple[Result, ...]
    reference: Reference
    base: tuple[str, Graph] | None
    scene: str
    camera: str | None
    size: tuple[int, int]
    frame: int
    device: Mapping[str, object]
    notes: tuple[str, ...] = ()
    warnings: tuple[Problem, ...] = ()

    @property
    def software(self) -> bool:
        """Whether a rasteriser on the CPU drew: times are then no measure of a GPU."""
        return bool(self.device.get("software"))

    def as_json(self) -> dict[str, Any]:
        """The document of `compare --json`."""
        return {
            "reference": self.reference.as_json(),
            "scene": self.scene,
            "camera": self.camera,
            "size": list(self.size),
            "frame": self.frame,
            "device": dict(self.device),
            "machine": machine(),
            "metrics": description(),
            "variants": [result.as_json() for result in self.results],
            "notes": list(self.notes),
        }


def machine() -> dict[str, str]:
    """The computer and the versions, in words."""
    from importlib.metadata import version  # takes longer than a check, and only reports ask

    names = ("rendergraph", "moderngl", "numpy", "OpenImageIO")
    return {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "processor": _processor(),
        "python": platform.python_version(),
        **{name: version(name) for name in names},
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0]}, {len(models)} logical cores" if models else platform.processor()
