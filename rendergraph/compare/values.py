"""What comparing yields: one value for each variant, and all of them with what they were compared to."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy.typing as npt

from rendergraph.compare.axes import typed
from rendergraph.compare.timing import Times
from rendergraph.diff import GraphDiff, diff_json
from rendergraph.errors import Place, Problem
from rendergraph.installed import versions
from rendergraph.metrics import Encoding, Metrics, colors, description, rmse
from rendergraph.session.frame import not_finite

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.link import Graph

Pixels = npt.NDArray[Any]
_MOST_PICTURES = 6
"""Variants whose pictures a notebook shows."""


@dataclass(frozen=True, eq=False)
class Reference:
    """What pictures are measured against.

    Attributes:
        name: a variant's, a pipeline's or a file's.
        kind: which of the three.
        pixels: top row first.
        encoding: what its values are.
        output: the output that is compared with it.
    """

    name: str
    kind: Literal["variant", "pipeline", "file"]
    pixels: Pixels
    encoding: Encoding
    output: str

    def __repr__(self) -> str:
        return f"<Reference {self.name} ({self.kind}): {self.output}>"

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

    def __repr__(self) -> str:
        return f"<Difference at {self.node}.{self.port}: {100 * self.share:.3g} % of the texels>"

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
        pixels: the output that was compared, and its encoding; None where the picture was not kept.
        metrics: against the reference.
        radiance_rmse: of linear light against the reference's, None where one of them has none.
        flip_map: (height, width), 0…1; None where it was not kept.
        times: what drawing took.
        graph, plan: structure and memory; None where a result was read back from a file.
        memory: the plan's figures; none of a picture that was there already.
        pass_count: nodes that are drawn.
        difference: what turns the base's graph into this one.
        first: the first pass that draws something else than the base's.
        not_finite: how many pixels of its outputs hold NaN or infinity; such a result wins nothing.
        figures: its outputs that are one texel, as `run --json` has them.
    """

    name: str
    source: str
    pixels: Pixels | None
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
    not_finite: int = 0
    figures: Mapping[str, float | list[float]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Result {self.name}: FLIP {self.metrics.flip:.4f}, {self.times.headline.median:.2f} ms>"

    @property
    def columns(self) -> dict[str, float]:
        """What tables have of it beside the project's own metrics: plugins' and its figures, one a channel."""
        found = dict(self.metrics.plugins)
        for name, value in self.figures.items():
            if isinstance(value, list):
                found |= {f"{name}[{channel}]": one for channel, one in enumerate(value)}
            else:
                found[name] = value
        return found

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What is to be said where pixels are no numbers."""
        if not self.not_finite:
            return ()
        text = f"{self.not_finite} pixels of its outputs are NaN or infinite"
        way = "run … --tap-all FOLDER shows where they begin"
        return (Problem("RG619", f"{text}; {way}", Place(self.name), severity="warning"),)

    def as_json(self) -> dict[str, Any]:
        """Everything but pictures."""
        found: dict[str, Any] = {"name": self.name, "pipeline" if self.memory else "picture": self.source}
        if self.settings:
            found["settings"] = {path: typed(value) for path, value in self.settings.items()}
        found |= self.metrics.as_json()
        found |= {"radiance_rmse": self.radiance_rmse, "not_finite": self.not_finite}
        if self.figures:
            found["figures"] = dict(self.figures)
        if self.memory:
            found |= self.times.as_json()
            found |= {"pass_count": self.pass_count, "memory": dict(self.memory)}
        if self.difference is not None:
            found["diff"] = diff_json(self.difference)
        if self.plan is not None and self.difference is not None:
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
        metric: the port that was measured in place of the picture.
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
    metric: str | None = None
    notes: tuple[str, ...] = ()
    warnings: tuple[Problem, ...] = ()

    def __repr__(self) -> str:
        width, height = self.size
        shown = ", ".join(f"{result.name} {result.metrics.flip:.4f}" for result in self.results[:4])
        more = ", …" if len(self.results) > 4 else ""
        return f"<Comparison on {self.scene}, {width}×{height}, FLIP against {self.reference.name}: {shown}{more}>"

    def _repr_html_(self) -> str:
        from rendergraph.compare.notebook import notebook_html  # for notebooks alone
        from rendergraph.compare.report.parts import eight_bit, number  # see above
        from rendergraph.images import heat_map  # see above

        reference, pictures, rows = self.reference, [], []
        if reference.kind != "variant":
            pictures.append((f"{reference.name}, the reference", eight_bit(reference.pixels, reference.encoding)))
        for result in [result for result in self.results if result.pixels is not None][:_MOST_PICTURES]:
            assert result.pixels is not None
            pictures.append((result.name, eight_bit(result.pixels, result.encoding)))
            if result.flip_map is not None:
                pictures.append((f"FLIP of {result.name}: {number(result.metrics.flip)}", heat_map(result.flip_map)))
        for result in self.results:
            m, ms = result.metrics, number(result.times.headline.median, 2)
            psnr = "∞" if m.psnr is None else number(m.psnr, 2)
            rows.append((result.name, number(m.flip), number(m.rmse), psnr, number(m.ssim), ms))
        times = "GPU ms" if all(result.times.gpu_ms for result in self.results) else "ms"
        software = "; times of a software rasteriser are no measure of a GPU" if self.software else ""
        where = f"{self.scene}, " if self.scene else ""
        about = f"{where}{self.size[0]}×{self.size[1]}, against {reference.name}{software}"
        return notebook_html(pictures, ("", "FLIP", "RMSE", "PSNR dB", "SSIM", times), rows, about)

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
            **({"metric": self.metric} if self.metric else {}),
            "device": dict(self.device),
            "machine": machine(),
            "metrics": description(),
            "variants": [result.as_json() for result in self.results],
            "notes": list(self.notes),
        }


def light_error(light: Pixels | None, reference: Pixels | None) -> float | None:
    """RMSE of scene-linear light, None where either picture has none."""
    if light is None or reference is None:
        return None
    return rmse(colors(light), colors(reference))


def not_finite_pixels(graph: Graph, arrays: Mapping[str, Pixels]) -> int:
    """How many pixels of a graph's outputs hold NaN or infinity."""
    return sum(not_finite(pixels, graph.textures[graph.outputs[name]].semantic.name) for name, pixels in arrays.items())


def machine() -> dict[str, str]:
    """The computer and the versions, in words."""
    names = ("rendergraph", "moderngl", "numpy", "OpenImageIO")
    return {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "processor": _processor(),
        "python": platform.python_version(),
        **{name: version or "" for name, version in versions(names).items()},
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0]}, {len(models)} logical cores" if models else platform.processor()
