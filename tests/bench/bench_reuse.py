"""What is saved where not everything has changed: `python tests/bench/bench_reuse.py`.

Each work is drawn frame after frame with the steps left out whose values are still there, and with all of them run, in
turns; pictures are compared first. In the second table textures share no memory, as in `view`: then more is still there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from measure import check_pictures, compare, keep_memory, options, report

import rendergraph as rg
from rendergraph.resources import folder
from rendergraph.session import stages


@dataclass(frozen=True)
class Work:
    """A pipeline over `shadow_study`, and what changes from frame to frame.

    Attributes:
        pipeline: a shipped one.
        path, values: a parameter that takes turns, empty for none.
        moves: a line of `keyframes`, empty for none.
    """

    pipeline: str
    path: str = ""
    values: tuple[float, float] = (0.0, 0.0)
    moves: str = ""

    @property
    def name(self) -> str:
        """As the table has it."""
        return f"{self.pipeline}, {self.path or self.moves.partition(':')[0] or 'nothing'}"


WORKS = (
    Work("deferred"),
    Work("deferred", "display.exposure", (0.0, 0.5)),
    Work("ssao-hemisphere", "ao.radius", (0.4, 0.5)),
    Work("shadow-vsm", "light.ambient", (0.1, 0.2)),
    Work("ssao-hemisphere", moves="lights.sun.direction: {0: [0.7, -1.2, -0.5], 1: [-0.7, -1.2, -0.5]}"),
    Work("shadow-vsm", moves="lights.sun.intensity: {0: 3, 1: 6}"),
    Work("deferred", moves="objects.crate.at: {0: [2.4, 0.5, -1.6], 1: [2.4, 2, -1.6]}"),
    Work("deferred", moves="cameras.main.eye: {0: [5, 5, 7.5], 1: [7.5, 5, 5]}"),
)


def main() -> None:
    """Compare each work with itself, all of it run."""
    chosen = options(__doc__, frames=10, turns=5, width=640, height=360)
    keep_memory()
    rows = []
    study = (folder("rendergraph.pipelines") / "scenes" / "shadow_study.yaml").read_text()
    with tempfile.TemporaryDirectory() as place, rg.Session() as session:
        for number, work in enumerate(WORKS):
            scene = Path(place) / f"{number}.yaml"
            scene.write_text(study + (f"keyframes:\n  {work.moves}\n" if work.moves else ""))
            base = rg.load(work.pipeline, size=(chosen.width, chosen.height), scene=str(scene))
            shown = [base.set(work.path, value) if work.path else base for value in work.values]
            pictures = [
                loop(session, shown, reuse=reuse, alias=alias)(3) for reuse, alias in ((True, True), (False, True))
            ]
            check_pictures(work.name, *pictures)
            for alias in (True, False):
                less, all_of_it = (loop(session, shown, reuse=reuse, alias=alias) for reuse in (True, False))
                name = work.name if alias else f"{work.name}, roomy"
                rows.append(compare(name, less, all_of_it, frames=chosen.frames, turns=chosen.turns))
    report(rows, chosen.json)


def loop(session: rg.Session, shown: list[rg.Pipeline], *, reuse: bool, alias: bool) -> Callable[[int], Any]:
    """Draws frames of the pipelines in turns, each with the time of its number."""
    expanded = [one.expand(reuse=reuse, alias=alias, warm_up=False) for one in shown]
    frames = count(1)

    def draw(times: int) -> Any:
        for _ in range(times):
            number = next(frames)
            with session.current():
                drawing = stages.compile(expanded[number % 2], session)
                drawing.draw(number % 30 + 1)
                frame = drawing.read()
        return frame["image"]

    return draw


if __name__ == "__main__":
    main()
