"""What the comparisons share: two programs in turn, CPU and wall time, medians with their spread, a table.

CPU time is the process's, driver threads included: on a software rasteriser that is where a frame happens. The two
programs take turns and change who begins, so that whatever else the machine does falls on both; the ratio is the median
over the turns' own ratios.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Draw = Callable[[int], None]
"""Draws that many frames and waits until the device is done."""


@dataclass(frozen=True)
class Row:
    """One comparison; milliseconds a frame, ratios ours over theirs.

    Attributes:
        name: what was compared.
        goal: the ratio to stay under, None where there is none.
        ours_cpu, hand_cpu, ours_wall, hand_wall: medians over the turns.
        ratio: median over the turns of CPU time's ratio, with its quartiles `low` and `high`.
        wall_ratio: the same of wall time.
        turns, frames: how often each was measured, and frames a turn.
    """

    name: str
    goal: float | None
    ours_cpu: float
    hand_cpu: float
    ratio: float
    low: float
    high: float
    ours_wall: float
    hand_wall: float
    wall_ratio: float
    turns: int
    frames: int


def keep_memory() -> None:
    """Have the C library keep what is freed.

    A software rasteriser frees and asks again for some twenty megabytes a frame. Whether the kernel gets them back in
    between depends on what else the process holds, and costs either program up to a fifth of a frame.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):  # not the GNU C library
        return
    for option, value in ((-1, 1 << 30), (-2, 1 << 26), (-4, 0)):  # TRIM_THRESHOLD, TOP_PAD, MMAP_MAX
        mallopt(option, value)


def compare(name: str, ours: Draw, by_hand: Draw, *, frames: int, turns: int, goal: float | None = None) -> Row:
    """Run two programs in turn; the first turn of each is not counted."""
    ours(frames)
    by_hand(frames)
    taken: list[tuple[float, float, float, float]] = []
    for turn in range(turns):
        if turn % 2:
            b = cpu_and_wall(by_hand, frames)
            a = cpu_and_wall(ours, frames)
        else:
            a = cpu_and_wall(ours, frames)
            b = cpu_and_wall(by_hand, frames)
        taken.append((*a, *b))
    cpu = [a_cpu / b_cpu for a_cpu, _, b_cpu, _ in taken]
    wall = [a_wall / b_wall for _, a_wall, _, b_wall in taken]
    low, _, high = statistics.quantiles(cpu, n=4) if turns > 1 else (cpu[0],) * 3
    medians = [statistics.median(column) for column in zip(*taken, strict=True)]
    return Row(
        name,
        goal,
        medians[0],
        medians[2],
        statistics.median(cpu),
        low,
        high,
        medians[1],
        medians[3],
        statistics.median(wall),
        turns,
        frames,
    )


def cpu_and_wall(draw: Draw, frames: int) -> tuple[float, float]:
    """Milliseconds of CPU and of wall time a frame."""
    wall, cpu = time.perf_counter(), time.process_time()
    draw(frames)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    return cpu * 1e3 / frames, wall * 1e3 / frames


def check_pictures(
    name: str, ours: npt.NDArray[Any], by_hand: npt.NDArray[Any], *, bound: float = 0.0, share: float = 0.0
) -> None:
    """A time counts only with its picture: not black, and the same.

    Args:
        name: for the message.
        ours, by_hand: arrays of equal shape.
        bound: how far two values may lie apart.
        share: how large a part of the pixels may be farther apart.
    """
    a, b = np.asarray(ours, np.float64), np.asarray(by_hand, np.float64)
    if a.shape != b.shape:
        raise SystemExit(f"{name}: pictures of {a.shape} and {b.shape}")
    for who, picture in (("framework", a), ("hand-written", b)):
        if not np.isfinite(picture).all() or np.ptp(picture[..., :3]) == 0:
            raise SystemExit(f"{name}: the {who} picture is empty")
    off = (np.abs(a - b).max(axis=-1) > bound).mean()
    if off > share:
        raise SystemExit(f"{name}: {off:.2%} of the pixels differ by more than {bound}")


def frame_loop(session: Any, pipeline: Any) -> Draw:
    """The framework's bare frame loop over a pipeline that is compiled once; every step of every frame is run."""
    from rendergraph.scene.cameras import view_matrices

    with session.device.ctx:
        drawing = session.compile(pipeline, reuse=False)
    linked, runner = drawing.expanded.linked, drawing.runner
    scene = linked.scene
    camera = view_matrices(next(iter(scene.cameras.values())), linked.graph.size)
    number = 0

    def draw(frames: int) -> None:
        nonlocal number
        with session.device.current():
            for _ in range(frames):
                number += 1
                runner.run(number, number / 30, 1 / 30, scene, camera)
            session.device.ctx.finish()

    draw.executable = runner.executable  # type: ignore[attr-defined]
    return draw


def options(doc: str | None, **numbers: int) -> argparse.Namespace:
    """The command line: `--json`, `--save FOLDER`, and a few numbers with defaults."""
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--save", metavar="FOLDER", help="write both pictures there, to look at")
    for name, default in numbers.items():
        parser.add_argument(f"--{name}", type=int, default=default, help=f"{default} by default")
    return parser.parse_args()


def report(rows: Sequence[Row], as_json: bool, **more: Any) -> None:
    """Print a table, or everything as JSON."""
    if as_json:
        json.dump({"rows": [asdict(row) for row in rows], **more}, sys.stdout, indent=1)
        print()
        return
    width = max([10, *(len(row.name) for row in rows)])
    print(f"{'':{width}}  framework    by hand   CPU ratio (quartiles)       goal     wall ratio")
    for row in rows:
        goal = "" if row.goal is None else f"<= {row.goal:.2f}"
        print(
            f"{row.name:{width}}  {row.ours_cpu:7.3f} ms {row.hand_cpu:7.3f} ms   {row.ratio:5.3f} "
            f"({row.low:.3f} to {row.high:.3f})   {goal:8} {row.wall_ratio:8.3f}"
        )
    for name, value in more.items():
        print(f"{name.replace('_', ' ')}: {value}")


def markdown(device: str, size: tuple[int, int], heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with its first column to the left, beneath what drew it."""
    lines = [
        f"On {device}, {size[0]}×{size[1]}.",
        "",
        *(f"| {' | '.join(cells)} |" for cells in (heads, ["---", *["---:"] * (len(heads) - 1)], *rows)),
    ]
    return "\n".join(lines)


def figures(
    chosen: argparse.Namespace,
    name: str,
    device: str,
    cells: Sequence[Any],
    table: str,
    plot: Callable[[list[dict[str, Any]], str], str],
) -> None:
    """Print measured cells as a table or JSON; with `--save` the table and a plot are written too."""
    rows = [asdict(cell) for cell in cells]
    if chosen.save:
        (Path(chosen.save) / f"{name}.svg").write_text(plot(rows, device))
        (Path(chosen.save) / f"{name}.txt").write_text(table + "\n")
    if chosen.json:
        json.dump({"device": device, "rows": rows}, sys.stdout, indent=1)
    else:
        print(table)


def save(folder: str | None, **pictures: npt.NDArray[Any]) -> None:
    """Write pictures as PNG, values 0 to 1 or bytes, top row first."""
    if folder is None:
        return
    from png import write_png

    Path(folder).mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.items():
        data = picture if picture.dtype == np.uint8 else (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
        write_png(Path(folder) / f"{name}.png", np.ascontiguousarray(data[..., :3]))
