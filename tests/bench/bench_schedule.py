"""How long scheduling takes and how good it is: `python tests/bench/bench_schedule.py`.

Prints a table; nothing is asserted. Sizes are in MiB at 1920×1080. `optimum` is the least peak of live bytes over all
orders (with `?` where it is not proven: the least that was found), `file` the peak of the file's order, `pool` what is
allocated, `heap` what blocks of memory for textures of any description would be.
"""

from __future__ import annotations

import argparse
import random
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence

import networkx  # noqa: F401  # its import is no part of what is measured

from rendergraph.allocate import allocate
from rendergraph.expand import Expansion
from rendergraph.schedule import schedule
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import Kind, TextureDesc

MIB = 1 << 20
FORMATS = ("rgba8", "r11f_g11f_b10f", "rgba16f", "r8", "r32f", "depth32f", "rgba32f")


def texture(format: str, scale: float = 1.0, layers: int = 1, size: tuple[int, int] = (1920, 1080)) -> TextureDesc:
    """A texture at a factor of the picture's size."""
    kind: Kind = "texture2d_array" if layers > 1 else "texture2d"
    return TextureDesc(kind, format, max(1, round(size[0] * scale)), max(1, round(size[1] * scale)), layers)


def graph(passes: Mapping[str, tuple[Sequence[str], Mapping[str, TextureDesc]]], image: str) -> Expansion:
    """Passes as `node: (reads, {port: texture})`, in the file's order."""
    resources = {
        f"{node}.{port}": Resource(f"{node}.{port}", desc)
        for node, (_, made) in passes.items()
        for port, desc in made.items()
    }
    steps = [
        Step(
            node,
            0,
            "fullscreen",
            reads=tuple(Read(f"input{number}", id, 1) for number, id in enumerate(reads)),
            writes=tuple(Write(port, f"{node}.{port}", 1) for port in made),
        )
        for node, (reads, made) in passes.items()
    ]
    return Expansion(tuple(steps), resources, {"image": image})


def random_graph(count: int, seed: int, reach: int = 8) -> Expansion:
    """Passes that each read one to three of the eight, or more, before; what nobody reads is merged by the last."""
    chooser = random.Random(seed)
    passes: dict[str, tuple[list[str], dict[str, TextureDesc]]] = {}
    unread: dict[str, None] = {}
    for number in range(count - 1):
        most = min(number, chooser.choice((1, 1, 2, 2, 3)))
        recent = [f"n{i:03}.out" for i in range(max(0, number - reach), number)]
        reads = sorted(chooser.sample(recent, most))
        for id in reads:
            unread.pop(id, None)
        passes[f"n{number:03}"] = (reads, {"out": texture(chooser.choice(FORMATS), chooser.choice((1, 1, 0.5, 0.25)))})
        unread[f"n{number:03}.out"] = None
    passes["end"] = (list(unread), {"out": texture("rgba8")})
    return graph(passes, "end.out")


def fan_out(branches: int) -> Expansion:
    """Branches of three passes each, listed breadth first, merged by one."""
    passes: dict[str, tuple[list[str], dict[str, TextureDesc]]] = {}
    for branch in range(branches):
        passes[f"draw{branch}"] = ([], {"color": texture("rgba16f"), "depth": texture("depth32f")})
    for branch in range(branches):
        passes[f"light{branch}"] = ([f"draw{branch}.color", f"draw{branch}.depth"], {"color": texture("rgba16f")})
    for branch in range(branches):
        passes[f"show{branch}"] = ([f"light{branch}.color"], {"color": texture("rgba8", 0.5)})
    passes["merge"] = ([f"show{branch}.color" for branch in range(branches)], {"color": texture("rgba8")})
    return graph(passes, "merge.color")


def deferred() -> Expansion:
    """A deferred pipeline of 40 passes: cascades, G-buffer, occlusion, reflections, bloom, tone mapping."""
    half, full = 0.5, 1.0
    passes: dict[str, tuple[list[str], dict[str, TextureDesc]]] = {
        "gbuffer": (
            [],
            {
                "albedo": texture("rgba8"),
                "normal": texture("rgb10_a2"),
                "material": texture("rgba8"),
                "motion": texture("rg16f"),
                "depth": texture("depth32f"),
            },
        ),
        "sun": ([], {"shadow_map": texture("depth16", 1, 4, (2048, 2048))}),
        "linear": (["gbuffer.depth"], {"depth": texture("r32f")}),
        "hiz1": (["linear.depth"], {"depth": texture("r32f", half)}),
        "hiz2": (["hiz1.depth"], {"depth": texture("r32f", half / 2)}),
        "hiz3": (["hiz2.depth"], {"depth": texture("r32f", half / 4)}),
        "shadows": (["sun.shadow_map", "gbuffer.depth", "gbuffer.normal"], {"visibility": texture("r8")}),
        "ao": (["hiz1.depth", "gbuffer.normal"], {"raw": texture("r8", half)}),
        "ao_blur_x": (["ao.raw", "hiz1.depth"], {"out": texture("r8", half)}),
        "ao_blur_y": (["ao_blur_x.out", "hiz1.depth"], {"out": texture("r8", half)}),
        "ao_up": (["ao_blur_y.out", "linear.depth"], {"occlusion": texture("r8", full)}),
        "light": (
            [
                "gbuffer.albedo",
                "gbuffer.normal",
                "gbuffer.material",
                "gbuffer.depth",
                "shadows.visibility",
                "ao_up.occlusion",
            ],
            {"radiance": texture("rgba16f")},
        ),
        "trace": (["hiz1.depth", "hiz2.depth", "hiz3.depth", "gbuffer.normal"], {"hits": texture("rgba16f", half)}),
        "reflect": (["trace.hits", "light.radiance"], {"color": texture("rgba16f", half)}),
        "reflect_blur": (["reflect.color"], {"color": texture("rgba16f", half)}),
        "sky": (["light.radiance", "gbuffer.depth"], {"radiance": texture("rgba16f")}),
        "compose": (["sky.radiance", "reflect_blur.color", "gbuffer.material"], {"radiance": texture("rgba16f")}),
        "smooth": (["compose.radiance", "gbuffer.motion", "gbuffer.depth"], {"radiance": texture("rgba16f")}),
        "tiles": (["gbuffer.motion"], {"most": texture("rg16f", 0.05)}),
        "spread": (["tiles.most"], {"most": texture("rg16f", 0.05)}),
        "blur": (["smooth.radiance", "spread.most", "linear.depth"], {"radiance": texture("rgba16f")}),
        "focus": (["linear.depth"], {"coc": texture("r16f")}),
        "near": (["blur.radiance", "focus.coc"], {"color": texture("rgba16f", half)}),
        "far": (["blur.radiance", "focus.coc"], {"color": texture("rgba16f", half)}),
        "lens": (["near.color", "far.color", "blur.radiance", "focus.coc"], {"radiance": texture("rgba16f")}),
    }
    source = "lens.radiance"
    for level in range(1, 7):
        passes[f"down{level}"] = ([source], {"color": texture("r11f_g11f_b10f", half**level)})
        source = f"down{level}.color"
    for level in range(5, 0, -1):
        passes[f"up{level}"] = ([source, f"down{level}.color"], {"color": texture("r11f_g11f_b10f", half**level)})
        source = f"up{level}.color"
    passes["display"] = (["lens.radiance", source], {"color": texture("rgba8")})
    passes["edges"] = (["display.color"], {"color": texture("rgba8")})
    passes["text"] = ([], {"overlay": texture("rgba8")})
    passes["final"] = (["edges.color", "text.overlay"], {"color": texture("rgba8")})
    return graph(passes, "final.color")


def rows(samples: int, budget_s: float) -> Iterator[tuple[str, list[Expansion]]]:
    """Workloads by name."""
    yield "deferred, 40 passes", [deferred()]
    for branches in (6, 12, 16, 24):
        yield f"fan-out of {branches}", [fan_out(branches)]
    for count in (24, 48, 64, 100):
        yield f"random, {count} passes", [random_graph(count, seed) for seed in range(samples)]
    for count in (64, 96):
        yield f"far links, {count} passes", [random_graph(count, seed, 24) for seed in range(samples)]
    yield "random, 10,000 passes", [random_graph(10_000, 0)]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=10, help="random graphs of each size")
    parser.add_argument("--budget", type=float, default=1.0, help="budget_s of the schedule")
    arguments = parser.parse_args()
    head = f"{'graph':22} {'schedule ms':>18} {'allocate ms':>11} {'proven':>7} {'no reuse':>9} {'file':>8} "
    print(head + f"{'optimum':>9} {'pool':>8} {'heap':>8}   ratios to optimum: file pool heap")
    for name, graphs in rows(arguments.samples, arguments.budget):
        times, allocations, figures = [], [], []
        for expansion in graphs:
            start = time.perf_counter()
            found = schedule(expansion, budget_s=arguments.budget)
            middle = time.perf_counter()
            plan = allocate(found)
            times.append(1000 * (middle - start))
            allocations.append(1000 * (time.perf_counter() - middle))
            memory = plan.memory
            assert found.model is not None  # it was not written by hand
            rank = {step.key: number for number, step in enumerate(expansion.steps)}
            in_file = [rank[step.key] for step in found.model.steps]
            kept, _ = found.model.peak(sorted(range(len(in_file)), key=in_file.__getitem__))
            heap = memory.next_tier_bytes if memory.next_tier == "heap" else memory.allocated_bytes
            figures.append(
                (
                    memory.no_reuse_bytes,
                    kept,
                    memory.least_peak_bytes,
                    memory.allocated_bytes,
                    heap or 0,
                    memory.proven,
                )
            )
        proven = sum(figure[5] for figure in figures)
        mean = [statistics.mean(figure[i] for figure in figures) / MIB for i in range(5)]
        ratio = [statistics.mean(figure[i] / figure[2] for figure in figures) for i in (1, 3, 4)]
        print(
            f"{name:22} {statistics.median(times):8.1f} ≤{max(times):8.1f} {statistics.median(allocations):11.1f} "
            f"{proven:3}/{len(graphs):<3} {mean[0]:9.1f} {mean[1]:8.1f} {mean[2]:8.1f}{' ?'[proven < len(graphs)]} "
            f"{mean[3]:8.1f} {mean[4]:8.1f}   {ratio[0]:.3f} {ratio[1]:.3f} {ratio[2]:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
