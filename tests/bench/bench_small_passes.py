"""What the framework adds to a frame: `python tests/bench/bench_small_passes.py`.

40 full-screen passes into rgba16f, each reading the one before, so that next to nothing is drawn; against the same in
plain moderngl. Goal: 1.05 of its CPU time, and no GL object made in a frame.
"""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt
from gl_calls import available, counting, made
from measure import Row, check_pictures, compare, frame_loop, keep_memory, options, report

from rendergraph.api import Any as AnyTexture
from rendergraph.api import Input, Node, Output, Radiance, param

COUNT = 40
GOAL = 1.05
FIRST = "color = vec4(gl_FragCoord.xy / vec2(textureSizeHint), 0.5, 1.0);"
MIDDLE = "color = texelFetch(source, ivec2(gl_FragCoord.xy), 0) * 0.98 + 0.01;"
SCALED = "color = texelFetch(source, ivec2(gl_FragCoord.xy), 0) * amount + 0.01;"


class Start(Node):
    """Something to begin with."""

    color = Output(Radiance, format="rgba16f", doc="A ramp.")


class Change(Node):
    """A pass that looks at one texel."""

    source = Input(AnyTexture, doc="The pass before.")
    color = Output(Radiance, format="rgba16f", doc="The same, a little different.")


class Scale(Node):
    """The same with a parameter."""

    source = Input(AnyTexture, doc="The pass before.")
    color = Output(Radiance, format="rgba16f", doc="The same, a little different.")
    amount: float = param(default=0.98, doc="Factor.")


def _start(size: int) -> str:
    return f"out vec4 color;\nvoid main() {{ {FIRST.replace('vec2(textureSizeHint)', f'{size}.0')} }}\n"


CHANGE = f"uniform sampler2D source;\nout vec4 color;\nvoid main() {{ {MIDDLE} }}\n"
SCALE = f"uniform sampler2D source;\nuniform float amount;\nout vec4 color;\nvoid main() {{ {SCALED} }}\n"
VERTEX = """#version 450 core
void main() { gl_Position = vec4(vec2(ivec2(gl_VertexID << 1, gl_VertexID) & 2) * 2.0 - 1.0, 0.0, 1.0); }
"""


def amount(number: int) -> float:
    """The parameter of a pass, different for each."""
    return 0.9 + 0.002 * number


class ByHand:
    """The passes in plain moderngl: framebuffer, texture, uniform where there is one, draw."""

    def __init__(self, size: int, scaled: bool) -> None:
        self.ctx = ctx = moderngl.create_context(require=450, standalone=True, backend="egl")  # type: ignore[arg-type]
        start = ctx.program(VERTEX, "#version 450 core\n" + _start(size))
        self.change: Any = ctx.program(VERTEX, "#version 450 core\n" + (SCALE if scaled else CHANGE))
        self.first, self.next = ctx.vertex_array(start, []), ctx.vertex_array(self.change, [])
        self.scaled = scaled
        self.textures = [ctx.texture((size, size), 4, dtype="f2") for _ in range(2)]
        self.targets = [ctx.framebuffer(texture) for texture in self.textures]

    def frames(self, count: int) -> None:
        """Some frames, and wait until they are done."""
        textures, targets, following = self.textures, self.targets, self.next
        with self.ctx:
            factor = self.change["amount"] if self.scaled else None
            for _ in range(count):
                targets[0].use()
                self.first.render(moderngl.TRIANGLES, 3)
                for number in range(1, COUNT):
                    targets[number % 2].use()
                    textures[1 - number % 2].use(0)
                    if factor is not None:
                        factor.value = amount(number)
                    following.render(moderngl.TRIANGLES, 3)
            self.ctx.finish()

    def picture(self) -> npt.NDArray[Any]:
        """The last frame, top row first."""
        size = self.textures[0].size
        with self.ctx:
            data = self.targets[(COUNT - 1) % 2].read(components=4, dtype="f2")
        return np.frombuffer(data, np.float16).reshape(*size, 4)[::-1].astype(np.float32)


def pipeline(folder: Path, size: int, scaled: bool) -> Any:
    """The same as a pipeline file with nodes of its own."""
    import rendergraph as rg
    from rendergraph.catalog import Catalog

    for name, text in (("start", _start(size)), ("change", CHANGE), ("scale", SCALE)):
        (folder / f"{name}.frag").write_text(text)
    lines = ["rendergraph: 1", f"size: [{size}, {size}]", "nodes:", "  p0: {type: start}"]
    for number in range(1, COUNT):
        kind = f"type: scale, params: {{amount: {amount(number)}}}" if scaled else "type: change"
        lines.append(f"  p{number}: {{{kind}, inputs: {{source: p{number - 1}.color}}}}")
    lines.append(f"outputs: {{radiance: p{COUNT - 1}.color}}")
    (folder / "passes.yaml").write_text("\n".join(lines) + "\n")
    catalog = Catalog.of(Start, Change, Scale, shaders=folder)
    return dataclasses.replace(rg.load(folder / "passes.yaml"), catalog=catalog)


def bench(size: int, scaled: bool, *, frames: int, turns: int) -> Row:
    """One comparison."""
    import rendergraph as rg

    name = f"{COUNT} passes of {size}×{size}{', a parameter each' if scaled else ''}"
    program = ByHand(size, scaled)
    program.frames(1)
    with tempfile.TemporaryDirectory() as folder, rg.Session() as session:
        made_of = pipeline(Path(folder), size, scaled)
        with session.device.ctx:
            picture = session.render(made_of)["radiance"]
            ours = frame_loop(session, made_of)
        check_pictures(name, picture, program.picture())
        return compare(name, ours, program.frames, frames=frames, turns=turns, goal=GOAL)


def objects_made(frames: int = 10) -> dict[str, float] | None:
    """GL calls a frame, and how many of them create something; None where calls cannot be counted."""
    if not available:
        return None
    import rendergraph as rg

    with tempfile.TemporaryDirectory() as folder, counting() as calls, rg.Session() as session:
        draw = frame_loop(session, pipeline(Path(folder), 4, False))
        draw(2)
        before = calls.taken()
        draw(frames)
        counts = calls.taken() - before
    return {"calls": counts.total() / frames, "objects": made(counts) / frames}


def main() -> None:
    chosen = options(__doc__, frames=5, turns=100)
    keep_memory()
    rows = [
        bench(size, scaled, frames=chosen.frames, turns=chosen.turns) for scaled in (False, True) for size in (64, 4)
    ]
    report(rows, chosen.json, gl_calls_a_frame=objects_made())


if __name__ == "__main__":
    main()
