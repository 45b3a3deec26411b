"""How long `check` and `plan` take: `python tests/bench/bench_check.py`.

A generated pipeline of 40 nodes, read, resolved, linked, expanded, scheduled and allocated with everything made afresh;
in a new process after its imports, which is what a command pays, and again and again in this one. Goal: 10 ms again and again.
"""

from __future__ import annotations

import dataclasses
import gc
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from measure import options

from rendergraph.api import Any as AnyTexture
from rendergraph.api import Depth, Input, Node, Normal, Output, Radiance, define, param

GOAL_MS = 10.0


class Surfaces(Node):
    """Several targets at once."""

    albedo = Output(Radiance, format="rgba8", doc="Colour.")
    normal = Output(Normal, format="rgba16f", doc="Normal.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")


class Occlude(Node):
    """Reads depth and normal, at half the size."""

    depth = Input(Depth, size="any", doc="Depth.")
    normal = Input(Normal, size="any", doc="Normal.")
    occlusion = Output(AnyTexture, format="r8", size=0.5, doc="Occlusion.")

    radius: float = param(default=0.5, unit="m", min=0, max=10, doc="Reach.")
    samples: int = define(default=16, min=1, max=64, doc="Number.")


class Filter(Node):
    """One in, one out, at a size of its own."""

    source = Input(AnyTexture, size="any", filter="linear", doc="What is filtered.")
    filtered = Output(Radiance, format="rgba16f", size=lambda node, facts: node.scaled(facts), doc="The result.")

    radius: int = param(default=4, unit="texels", min=1, max=32, doc="Three standard deviations.")
    shrink: int = define(default=1, min=1, max=64, doc="Divisor of the size.")

    def scaled(self, facts: Any) -> tuple[int, int]:
        """The viewport, divided."""
        return tuple(max(1, side // self.shrink) for side in facts.viewport)


class Join(Node):
    """Two in, one out."""

    first = Input(AnyTexture, size="any", doc="One.")
    second = Input(AnyTexture, size="any", doc="Another.")
    joined = Output(Radiance, format="rgba16f", doc="Both.")

    weight: float = param(default=0.5, min=0, max=1, doc="Of the second.")


def text() -> str:
    """A file of 40 nodes in the shape of a real one: a G-buffer, occlusion, light, two pyramids of blurs, a grade."""
    lines = [
        "# Forty nodes.",
        "rendergraph: 1",
        "description: Generated",
        "size: [1920, 1080]",
        "nodes:",
        "  surfaces: {type: surfaces}",
        "  ao: {type: occlude, inputs: {depth: surfaces.depth, normal: surfaces.normal}, params: {radius: 0.8}}",
        "  ao_wide: {type: occlude, inputs: {depth: surfaces.depth, normal: surfaces.normal}, params: {samples: 8}}",
        "  occlusion: {type: join, inputs: {first: ao.occlusion, second: ao_wide.occlusion}}",
        "  light: {type: join, inputs: {first: surfaces.albedo, second: occlusion.joined}, params: {weight: 0.25}}",
    ]
    count, last = 5, "light.joined"
    for pyramid in ("bloom", "flare"):
        levels: list[str] = []
        for level in range(1, 6):
            source = levels[-1] if levels else "light.joined"
            for axis in ("across", "down"):
                lines.append(
                    f"  {pyramid}_{axis}{level}: {{type: filter, inputs: {{source: {source}}}, "
                    f"params: {{shrink: {2**level}, radius: {level + 2}}}}}"
                )
                source = f"{pyramid}_{axis}{level}.filtered"
                count += 1
            levels.append(source)
        for level in range(4, 0, -1):
            lines.append(
                f"  {pyramid}_up{level}: {{type: join, inputs: {{first: {levels[level - 1]}, second: {source}}}}}"
            )
            source = f"{pyramid}_up{level}.joined"
            count += 1
        lines.append(f"  {pyramid}: {{type: join, inputs: {{first: {last}, second: {source}}}}}")
        last = f"{pyramid}.joined"
        count += 1
    while count < 40:
        lines.append(f"  grade{count}: {{type: filter, inputs: {{source: {last}}}}}")
        last = f"grade{count}.filtered"
        count += 1
    return "\n".join([*lines, f"outputs: {{radiance: {last}, light: light.joined}}", ""])


def once(path: Path) -> dict[str, Any]:
    """Check and plan with everything made afresh; CPU milliseconds of each stage and what the plan says."""
    import rendergraph as rg
    from rendergraph.allocate import allocate
    from rendergraph.catalog import Catalog
    from rendergraph.schedule import schedule
    from rendergraph.session.scenes import scene_of

    stages: dict[str, float] = {}

    def timed(name: str, do: Callable[[], Any]) -> Any:
        start = time.process_time()
        value = do()
        stages[name] = (time.process_time() - start) * 1e3
        return value

    def made() -> Any:
        catalog = Catalog.of(Surfaces, Occlude, Filter, Join, shaders=path.parent)
        return dataclasses.replace(rg.load(path), catalog=catalog)

    pipeline = timed("load", made)
    resolved = timed("resolve", pipeline.resolve)
    scene = timed("scene", lambda: scene_of(resolved))  # held, so that linking finds it
    timed("link", pipeline.link)
    expansion = timed("expand", pipeline.expand).expansion
    ordered = timed("schedule", lambda: schedule(expansion))
    plan = timed("allocate", lambda: allocate(ordered))
    assert scene is pipeline.link().scene
    assert len(plan.schedule.steps) == 40, len(plan.schedule.steps)
    return {"ms": sum(stages.values()), "stages": stages, "proven": plan.memory.as_json()["proven"]}


def cold(path: Path) -> dict[str, Any]:
    """The same in a new process, after the imports and before anything else."""
    command = [sys.executable, str(Path(__file__)), "--child", str(path)]
    return dict(json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout))


def child(path: Path) -> None:
    """What `cold` runs: import everything the stages import, then once; looking for cycles as seldom as a command does."""
    gc.set_threshold(100_000)
    import networkx  # noqa: F401
    import numpy  # noqa: F401
    import yaml  # noqa: F401

    import rendergraph.allocate
    import rendergraph.expand
    import rendergraph.link
    import rendergraph.resolve
    import rendergraph.scene.animate
    import rendergraph.scene.cameras
    import rendergraph.scene.load
    import rendergraph.schedule
    import rendergraph.session.pipeline
    import rendergraph.session.stages  # noqa: F401

    print(json.dumps(once(path)))


def main() -> None:
    if sys.argv[1:2] == ["--child"]:
        child(Path(sys.argv[2]))
        return
    gc.set_threshold(100_000)  # as a command does
    chosen = options(__doc__, processes=7, repeats=40)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "forty.yaml"
        path.write_text(text())
        first = [cold(path) for _ in range(chosen.processes)]
        again = [once(path) for _ in range(chosen.repeats)]
    result = {
        "goal_ms": GOAL_MS,
        "cold_ms": statistics.median(run["ms"] for run in first),
        "cold_range_ms": [min(run["ms"] for run in first), max(run["ms"] for run in first)],
        "again_ms": statistics.median(run["ms"] for run in again),
        "proven": first[0]["proven"],
        "cold_stages_ms": {
            name: statistics.median(run["stages"][name] for run in first) for name in first[0]["stages"]
        },
        "again_stages_ms": {
            name: statistics.median(run["stages"][name] for run in again) for name in again[0]["stages"]
        },
    }
    if chosen.json:
        print(json.dumps(result, indent=1))
        return
    low, high = result["cold_range_ms"]
    print(
        f"new process: {result['cold_ms']:.1f} ms ({low:.1f} to {high:.1f}); "
        f"again: {result['again_ms']:.1f} ms, goal <= {GOAL_MS:.0f} ms; proven: {result['proven']}"
    )
    for name in result["cold_stages_ms"]:
        print(f"  {name:10} {result['cold_stages_ms'][name]:6.2f} ms   {result['again_stages_ms'][name]:6.2f} ms")


if __name__ == "__main__":
    main()
