"""Results of comparisons: one for each variant, the reference, and the Pareto front."""

from __future__ import annotations

import math
import platform
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from msgspec import to_builtins

from rendergraph import metrics
from rendergraph.compare.space import typed
from rendergraph.compare.timing import NO_TIMES, Times
from rendergraph.declare import Added
from rendergraph.declare.extensions import Metric
from rendergraph.diff import GraphDiff, diff_json
from rendergraph.errors import Place, Problem, suggestion
from rendergraph.installed import require, versions
from rendergraph.metrics import Encoding, Metrics, Pixels
from rendergraph.system import processor

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.link import Graph
    from rendergraph.session.values import Planned

K = TypeVar("K", bound=Hashable)


@dataclass(frozen=True, eq=False)
class Reference:
    """The picture that variants are measured against, of a variant, a pipeline or a file; its top row is first.

    Attributes:
        output: the name of the compared output.
        light: its scene-linear light, if any.
        noise: of ground truth, the relative mean square error that its noise adds to that of each variant.
        flip_noise: the FLIP between its picture and one with as much noise again.
        samples: of ground truth, the samples per pixel.
    """

    name: str
    kind: Literal["variant", "pipeline", "file"]
    pixels: Pixels
    encoding: Encoding
    output: str
    light: Pixels | None = None
    noise: float | None = None
    flip_noise: float | None = None
    samples: int | None = None

    def __repr__(self) -> str:
        return f"<Reference {self.name} ({self.kind}): {self.output}>"

    def as_json(self) -> dict[str, Any]:
        document = {"name": self.name, "kind": self.kind, "output": self.output}
        return document | ({} if self.noise is None else {"samples": self.samples, "flip_noise": self.flip_noise})


@dataclass(frozen=True)
class TwinError:
    """One technique of a variant, and the error that remains when its twin replaces it.

    Attributes:
        node, type: the technique.
        twin: the type that computes the same without approximation.
        relative_mse: of the variant's light with the twin; None if the twin does not fit or cannot be rendered.
        reduction: 1 − that error / the variant's own.
    """

    node: str
    type: str
    twin: str
    relative_mse: float | None = None
    reduction: float | None = None

    def as_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("type", "twin", "relative_mse", "reduction")}


@dataclass(frozen=True, eq=False)
class Difference:
    """The first pass, in order of execution, whose output differs.

    Attributes:
        node, base_node: the pass in the variant, and in the base, where it may have another name.
        port: the first output that differs.
        most: the greatest difference of a channel; None if sizes or formats differ.
        share: fraction of the texels that differ, 0…1.
        causes: nodes on the way there that differ in structure, possibly the pass itself.
        added: the causes that the base does not have.
        pixels: the output in the base and in the variant.
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
        """The added nodes on the way there, in words: `, after added node bloom`."""
        several = "s" if len(self.added) > 1 else ""
        return f", after added node{several} {', '.join(self.added)}" if self.added else ""

    @property
    def amount(self) -> str:
        if self.most is None:
            return "in size"
        return f"in {100 * self.share:.3g} % of its texels, by up to {self.most:.4g}"

    def as_json(self) -> dict[str, Any]:
        fields = ("node", "base_node", "port", "most", "share", "causes", "added")
        return {name: getattr(self, name) for name in fields}


@dataclass(frozen=True, eq=False)
class Result:
    """One variant.

    Attributes:
        name: unique among the variants.
        source: the pipeline as it was typed.
        settings: path to value, as a sweep set them.
        pixels: the compared output; None where the picture was not kept, likewise `flip_map`, (height, width), 0…1.
        radiance_rmse, relative_mse: of linear light against the reference's; None where one of them has none.
        signed_map: how much too bright the light is at each pixel, against a truth: see `metrics.signed_difference`.
        error_by: the error that remains with the twin of each technique, the greatest reduction first.
        graph, plan, memory: None and empty for pictures that were read from files.
        difference: of the graph to the base's.
        first: the first pass whose output differs from the base's.
        not_finite: number of pixels with NaN or infinity; if any, the result is excluded from the Pareto front.
        figures: outputs of one texel, as in `run --json`.
    """

    name: str
    source: str
    pixels: Pixels | None
    encoding: Encoding
    metrics: Metrics
    times: Times = NO_TIMES
    memory: Mapping[str, object] = field(default_factory=dict)
    pass_count: int = 0
    settings: Mapping[str, str] = field(default_factory=dict)
    radiance_rmse: float | None = None
    relative_mse: float | None = None
    signed_map: Pixels | None = None
    error_by: tuple[TwinError, ...] = ()
    flip_map: Pixels | None = None
    graph: Graph | None = None
    plan: ResourcePlan | None = None
    difference: GraphDiff | None = None
    first: Difference | None = None
    not_finite: int = 0
    figures: Mapping[str, float | list[float]] = field(default_factory=dict)

    @classmethod
    def of(cls, name: str, planned: Planned, **measured: Any) -> Result:
        """Return the result of a pipeline, whose structure and memory are known from its plan."""
        linked, plan = planned.linked, planned.plan
        return cls(
            name=name,
            source=linked.selection.label,
            memory=plan.memory.as_json(),
            pass_count=len(passes(plan)),
            graph=linked.graph,
            plan=plan,
            **measured,
        )

    def __repr__(self) -> str:
        return f"<Result {self.name}: FLIP {self.metrics.flip:.4f}, {self.times.headline.median:.2f} ms>"

    @property
    def allocated_bytes(self) -> int:
        return int(str(self.memory["allocated_bytes"]))

    @property
    def columns(self) -> dict[str, float]:
        """Further columns of tables: plugin metrics, and figures by channel."""
        columns = dict(self.metrics.plugins)
        for name, value in self.figures.items():
            if isinstance(value, list):
                columns |= {f"{name}[{channel}]": one for channel, one in enumerate(value)}
            else:
                columns[name] = value
        return columns

    @property
    def cause(self) -> str:
        """The technique whose twin reduces the error most, as a sentence; empty without twins."""
        known = [(one, one.reduction) for one in self.error_by if one.reduction is not None]
        if not known:
            return ""
        one, reduction = known[0]
        if reduction <= 0:
            return f"no twin reduces its error, which has other causes than {', '.join(e.node for e, _ in known)}"
        part = "most" if reduction > 0.5 else "the largest known part"
        return (
            f"{part} of its error comes from {one.node} ({one.type}): with {one.twin} the relative MSE is "
            f"{one.relative_mse:.4g}, {100 * reduction:.3g} % smaller"
        )

    @property
    def warnings(self) -> tuple[Problem, ...]:
        if not self.not_finite:
            return ()
        text = f"{self.not_finite} pixels of its outputs are NaN or infinite"
        text += "; run … --tap-all FOLDER shows where they begin"
        return (Problem("RG619", text, Place(self.name), severity="warning"),)

    def as_json(self) -> dict[str, Any]:
        document: dict[str, Any] = {"name": self.name, "pipeline" if self.memory else "picture": self.source}
        if self.settings:
            document["settings"] = typed_settings(self.settings)
        document |= self.metrics.as_json()
        document |= {name: getattr(self, name) for name in ("radiance_rmse", "relative_mse", "not_finite")}
        if self.error_by:
            document["error_by"] = {one.node: one.as_json() for one in self.error_by}
        if self.figures:
            document["figures"] = dict(self.figures)
        if self.memory:
            document |= to_builtins(self.times)
            document |= {"pass_count": self.pass_count, "memory": dict(self.memory)}
        if self.difference is not None:
            document["diff"] = diff_json(self.difference)
        if self.plan is not None and self.difference is not None:
            document["first_difference"] = self.first.as_json() if self.first else None
        return document


class Results(ABC):
    """Results in order: iterate them, take one by its name or number, or take all as a table.

    The table has the columns of a sweep's `results.csv`.
    """

    results: tuple[Result, ...]
    failures: tuple[Any, ...] = ()

    def __len__(self) -> int:
        return len(self.results)

    def __iter__(self) -> Iterator[Result]:
        return iter(self.results)

    def __getitem__(self, name: str | int) -> Result:
        if isinstance(name, int):
            return self.results[name]
        by_name = {result.name: result for result in self.results}
        if name not in by_name:
            raise KeyError(f"there is no result '{name}'{suggestion(name, by_name)}")
        return by_name[name]

    def to_dict(self) -> dict[str, list[Any]]:
        """Return the table as lists by column; None is an unknown value."""
        # By its name: tables are made of results, and nothing else here knows of them.
        rows = import_module("rendergraph.compare.export.table").rows_of(self.results, self.failures)
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name) for row in rows] for name in names}

    def to_pandas(self) -> Any:
        """Return the table as a DataFrame of pandas, which must be installed; the index has the names of the runs."""
        require("to_pandas()", "figures", "pandas")
        return import_module("pandas").DataFrame(self.to_dict()).set_index("run")

    def figure(self, crops: Any = (), *, caption: str = "", errors: bool = False, width: float = 7.0) -> Any:
        """Return a figure of Matplotlib with the pictures, magnified crops and errors; see `report.figure.figure`.

        Args:
            crops: parts of the picture: left, top, width and height in pixels, also by name.
            caption: text beneath.
            errors: whether a row of FLIP maps follows the pictures.
            width: of the figure, in inches.
        """
        make = import_module("rendergraph.compare.report.figure").figure
        return make(self.whole, crops, caption=caption, errors=errors, width=width)

    @property
    @abstractmethod
    def whole(self) -> Comparison:
        """The comparison that the results belong to."""


@dataclass(frozen=True, eq=False)
class Comparison(Results):
    """Variants against a reference, with one scene, at one size, on one machine.

    Attributes:
        base: name and graph of what the variants' graphs are compared with.
        camera: its name, where one was chosen.
        frame: number of the compared frame.
        device: the GL device, as in `run --json`.
        metric: the port that was measured instead of the picture.
        notes: changes that made the variants comparable.
        warnings: about files and results.
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
        errors = ", ".join(f"{result.name} {result.metrics.flip:.4f}" for result in self.results[:4])
        more = ", …" if len(self.results) > 4 else ""
        return f"<Comparison on {self.scene}, {width}×{height}, FLIP against {self.reference.name}: {errors}{more}>"

    def _repr_html_(self) -> str:
        # By its name, for notebooks alone: reports are made from results, and nothing else here knows of them.
        html: str = import_module("rendergraph.compare.report").notebook_html(self)
        return html

    @property
    def whole(self) -> Comparison:
        """Itself."""
        return self

    @property
    def software(self) -> bool:
        """Whether a CPU rasteriser rendered: its times say nothing about GPUs."""
        return bool(self.device.get("software"))

    @property
    def noise_share(self) -> float | None:
        """The noise of a truth as a part of the smallest error; None without one."""
        smallest = smallest_error(self.results)
        return self.reference.noise / smallest if self.reference.noise is not None and smallest else None

    def as_json(self) -> dict[str, Any]:
        return {
            "reference": self.reference.as_json(),
            **({} if self.reference.noise is None else {"reference_noise": self.reference.noise}),
            "scene": self.scene,
            "camera": self.camera,
            "size": list(self.size),
            "frame": self.frame,
            **({"metric": self.metric} if self.metric else {}),
            "device": dict(self.device),
            "machine": machine(),
            "metrics": metrics.description(),
            "variants": [result.as_json() for result in self.results],
            "notes": list(self.notes),
        }


def passes(plan: ResourcePlan) -> list[str]:
    """Return the executed nodes in order of their first step."""
    return list(dict.fromkeys(step.node for step in plan.schedule.steps))


def typed_settings(settings: Mapping[str, str]) -> dict[str, Any]:
    return {path: typed(value) for path, value in settings.items()}


def measure_against(
    pixels: Pixels, reference: Reference | None, name: str, plugins: Sequence[Added[Metric]]
) -> tuple[Metrics, Pixels | None]:
    """Return a picture's metrics and FLIP map; without a reference, or against itself, there is no map."""
    if reference is None or reference.pixels is pixels:
        return metrics.same(pixels, plugins), None
    names = (name, reference.name)
    return metrics.measure(pixels, reference.pixels, encoding=reference.encoding, names=names, plugins=plugins)


def light_errors(light: Pixels | None, reference: Reference) -> dict[str, Any]:
    """Return the errors of light, as fields of a `Result`."""
    if light is None or reference.light is None:
        return {}
    own, other = metrics.colors(light), metrics.colors(reference.light)
    errors = {"radiance_rmse": metrics.rmse(own, other), "relative_mse": metrics.relative_mse(own, other)}
    if reference.noise is None:
        return errors
    return {**errors, "signed_map": metrics.signed_difference(own, other).astype(np.float16)}


def smallest_error(results: Sequence[Result]) -> float | None:
    """Return the smallest relative mean square error of light, None if none is known."""
    return min((r.relative_mse for r in results if r.relative_mse is not None), default=None)


# --- the best --------------------------------------------------------------------------------------------------------

OBJECTIVES: Mapping[str, Callable[[Result], float | None]] = {
    "flip": lambda result: result.metrics.flip,
    "rmse": lambda result: result.metrics.rmse,
    "radiance_rmse": lambda result: result.radiance_rmse,
    "relative_mse": lambda result: result.relative_mse,
    "ms": lambda result: result.times.headline.median,
    "bytes": lambda result: result.allocated_bytes,
}
"""What can be minimised, besides plugin metrics and a pipeline's figures."""


def objective_values(result: Result | None, objectives: Sequence[str]) -> list[float] | None:
    """Return a result's values of the objectives; None where one of them or the picture is not finite."""
    if result is None or result.not_finite:
        return None
    values = [OBJECTIVES[name](result) if name in OBJECTIVES else result.columns.get(name) for name in objectives]
    numbers = [float(value) for value in values if value is not None and math.isfinite(value)]
    return numbers if len(numbers) == len(values) else None


def pareto_front(values: Mapping[K, Sequence[float] | None]) -> tuple[K, ...]:
    """Return the Pareto front, sorted by the first value: no other key is as good in every value and better in one.

    Keys without values are not on it.
    """
    known = {key: tuple(own) for key, own in values.items() if own is not None}

    def beats(one: Sequence[float], other: Sequence[float]) -> bool:
        return one != other and all(a <= b for a, b in zip(one, other, strict=True))

    front: list[K] = []
    for key in sorted(known, key=known.__getitem__):  # one that beats another is sorted before it
        if not any(beats(known[other], known[key]) for other in front):
            front.append(key)
    return tuple(front)


def pareto(results: Sequence[Result]) -> list[Result]:
    """Return the results of which no other one is both faster and more accurate (FLIP), fastest first."""
    front = pareto_front({number: objective_values(result, ("ms", "flip")) for number, result in enumerate(results)})
    return [results[number] for number in front]


@dataclass(frozen=True)
class Search:
    """The objectives of an optimiser, its budget, and what it found.

    Attributes:
        order: names of the runs in the order in which the optimiser asked for them; None for a failed one.
        values: name to values of the objectives.
        front: names of the runs on the Pareto front.
    """

    minimise: tuple[str, ...]
    budget: int
    order: tuple[str | None, ...]
    values: Mapping[str, Sequence[float]]
    front: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        asked = [{"name": name, "values": self.values.get(name or "")} for name in self.order]
        return {"minimise": list(self.minimise), "budget": self.budget, "asked": asked, "front": list(self.front)}

    def improvements(self) -> list[tuple[int, float]]:
        steps: list[tuple[int, float]] = []
        for number, name in enumerate(self.order, 1):
            values = self.values.get(name or "")
            if values is not None and (not steps or values[0] < steps[-1][1]):
                steps.append((number, values[0]))
        return steps


# --- the machine -----------------------------------------------------------------------------------------------------


def machine() -> dict[str, str]:
    names = ("rendergraph", "moderngl", "numpy", "OpenImageIO")
    return {
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "processor": processor(),
        "python": platform.python_version(),
        **{name: version or "" for name, version in versions(names).items()},
    }
