"""Nothing is read that is not watched: every file Python opens in a project is among those that were looked at."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rendergraph import stamps

SCRIPT = """
import json, os, sys
opened = set()
here = os.path.realpath(os.getcwd())
def note(event, arguments):
    if event == "open" and isinstance(arguments[0], str) and isinstance(arguments[1], str) and "r" in arguments[1]:
        opened.add(os.path.realpath(arguments[0]))
sys.addaudithook(note)
import rendergraph as rg
from rendergraph.stamps import track_reads
with track_reads() as looked:
    pipeline = rg.load("top.yaml", environment="sky.hdr", patches=["patch.yaml"], plugins=["tools"])
    pipeline.render(size=(8, 8))
inside = lambda paths: sorted({os.path.relpath(p, here) for p in paths if p.startswith(here + os.sep)})
print(json.dumps([inside(opened), inside(map(os.path.realpath, map(str, looked)))]))
"""
NODE = (
    "from rendergraph.api import Any, Node, Output, param\nfrom ._help import GAIN\n\n\nclass Plain(Node):\n"
    '    """One value."""\n\n    color = Output(Any, format="rgba8", doc="It.")\n'
    '    gain: float = param(default=GAIN, doc="It.")\n'
)
FILES = {
    "rendergraph.toml": 'plugins = ["more"]\n',
    "top.yaml": "extends: ./below.yaml\nplugins: [./effects]\nnodes:\n"
    "  sub: {type: ./sub.yaml, inputs: {x: light.radiance}}\n  plain: {type: plain}\n  soft: {type: soft}\n"
    "  edge: {type: edge}\n"
    "outputs: {image: sub.color, plain: plain.color, soft: soft.color, edge: edge.color}\n",
    "below.yaml": "extends: ./lowest.yaml\n",
    "lowest.yaml": "extends: forward\nscene: scene.yaml\n",
    "patch.yaml": "nodes: {light: {params: {ambient: 0.1}}}\n",
    "sub.yaml": "inputs: {x: {semantic: radiance}}\nnodes: {f: {type: ./flat.frag, inputs: {source: inputs.x}}}\n"
    "outputs: {color: f.color}\n",
    "flat.frag": '#include "outer.glsl"\nuniform sampler2D source;\nout vec4 color;\n'
    "void main() { color = texelFetch(source, ivec2(0), 0) * value(); }\n",
    "outer.glsl": '#include "inner.glsl"\nfloat value() { return VALUE; }\n',
    "inner.glsl": "#define VALUE 0.2\n",
    "effects/edge.frag": "out vec4 color;\nvoid main() { color = vec4(0.5); }\n",
    "more/soft.frag": "out vec4 color;\nvoid main() { color = vec4(0.5); }\n",
    "tools/plain.py": NODE,
    "tools/_help.py": "GAIN = 0.5\n",
    "tools/plain.frag": "uniform float gain; out vec4 color; void main() { color = vec4(gain); }",
    "scene.yaml": "scene: 1\nobjects: {it: {file: it.obj}, wall: {shape: plane, size: [1, 1], material: red}}\n"
    "materials: {red: {base_color_texture: paint.png}}\ncameras: {main: {eye: [0, 0, 3], target: [0, 0, 0]}}\n",
    "it.obj": "mtllib it.mtl\nusemtl m\nv -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n",
    "it.mtl": "newmtl m\nKd 1 0 0\n",
}


@pytest.mark.slow
def test_every_file_that_is_opened_was_looked_at(tmp_path: Path) -> None:
    from rendergraph.images import encode

    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    encode.write(tmp_path / "paint.png", np.full((4, 4, 3), 200, np.uint8))
    encode.write(tmp_path / "sky.hdr", np.ones((4, 8, 3), np.float32))
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=tmp_path, capture_output=True, text=True, check=False, encoding="utf-8"
    )
    assert done.returncode == 0, done.stderr
    opened, looked = map(set, json.loads(done.stdout))
    assert opened >= FILES.keys() - {"rendergraph.toml"}
    assert opened - looked == set()
    assert looked >= {*FILES, "paint.png", "sky.hdr", "tools", "more", "effects"}


def test_a_collection_inside_another_is_part_of_it_and_the_first_look_counts(tmp_path: Path) -> None:
    file, gone = tmp_path / "a", tmp_path / "gone"
    file.write_text("1")
    with stamps.track_reads() as outer:
        stamps.record_read(file)
        file.write_text("22")
        with stamps.track_reads() as inner:
            stamps.record_read(file)
            stamps.record_read(gone)
    assert stamps.modified(outer) == [file]
    assert stamps.modified(inner) == []
    assert outer[str(gone)] is None
    gone.write_text("")
    assert stamps.modified(inner) == [gone]


def test_of_a_folder_only_what_may_be_source_counts(tmp_path: Path) -> None:
    with stamps.track_reads() as looked:
        stamps.record_read(tmp_path)
    for name in ("a.png", ".a.py.swp", "__pycache__", "a.py~", "#a.py#"):
        (tmp_path / name).write_text("")
    assert stamps.modified(looked) == []
    (tmp_path / "b.frag").write_text("")
    assert stamps.modified(looked) == [tmp_path]
