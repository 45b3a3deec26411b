"""Shipped files with a few random mistakes: every one is checked to an end, and what is wrong is said without a trace."""

from __future__ import annotations

import random
import re
import time
from pathlib import Path

import pytest

from rendergraph.cli.app import main
from rendergraph.resources import folder

PIPELINES = sorted(folder("rendergraph.pipelines").glob("*.yaml"))
SCENES = sorted((folder("rendergraph.pipelines") / "scenes").glob("*.yaml"))
SHADER = """/* ---
about: Darkens the border.
inputs: {radiance: {semantic: radiance, doc: What is darkened.}}
outputs: {shaded: {like: radiance, doc: The same.}}
parameters: {strength: {default: 1.0, min: 0, max: 4, doc: How much.}}
--- */
uniform sampler2D radiance;
uniform float strength = 1.0;
uniform vec3 tint = vec3(1, 0.5, 0);
struct Pair { float a; vec2 b; };
layout(location = 0) out vec4 shaded;
void main() { shaded = texelFetch(radiance, ivec2(gl_FragCoord.xy), 0) * strength * vec4(tint, 1); }
"""
LENS = """extends: forward
nodes:
  lens: {type: ./lens.frag, inputs: {radiance: light.radiance}}
  display: {inputs: {radiance: lens.shaded}}
"""
WORDS = """
    0 -1 2 99999999999 1e308 -1e308 .inf .nan '' null ~ [] {} [1,2] true no $samples a.b a.b.c light.radiance@previous
    '\\0' ../x /dev/zero http://a/b *a << - ? % @ forward shadow_map gbuffer.depth 1e999 16385 1e-45 !!python/name:os
""".split()  # noqa: SIM905 - a list of so many words reads best as text
SIGNS = "{}[]:,&*!|>'\"%@`#-\t\0\x07é\u2028 "


def mutated(text: str, rng: random.Random) -> str:
    """A text with one to four lines taken out, doubled, indented otherwise, or with another word or sign in them."""
    lines = text.split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(lines))
        words = list(re.finditer(r"[\w.$/-]+", lines[at]))
        what = rng.randrange(6)
        if what == 0 and len(lines) > 1:
            del lines[at]
        elif what == 1:
            lines.insert(at, rng.choice(lines))
        elif what == 2:
            lines[at] = " " * rng.randrange(6) + lines[at].lstrip()
        elif what == 3 and lines[at]:
            place = rng.randrange(len(lines[at]))
            lines[at] = lines[at][:place] + rng.choice(SIGNS) + lines[at][place + rng.randrange(2) :]
        elif words:
            word = rng.choice(words)
            other = rng.choice(WORDS if what == 4 else re.findall(r"[\w.$/-]+", text))
            lines[at] = lines[at][: word.start()] + other + lines[at][word.end() :]
    return "\n".join(lines)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pipeline", "scene", "shader"])
def test_a_file_with_mistakes_is_checked_to_an_end(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RENDERGRAPH_TRACEBACK", "1")  # what nobody meant to be seen is raised
    for seed in range(40):
        rng = random.Random(f"{kind} {seed}")
        files = PIPELINES if kind == "pipeline" else SCENES
        text = SHADER if kind == "shader" else rng.choice(files).read_text(encoding="utf-8")
        file = tmp_path / ("lens.frag" if kind == "shader" else "file.yaml")
        file.write_text(mutated(text, rng), encoding="utf-8")
        (tmp_path / "lens.yaml").write_text(LENS)
        words = {"pipeline": [str(file)], "scene": ["forward", "--scene", str(file)], "shader": ["lens.yaml"]}[kind]
        start = time.perf_counter()
        code = main(["check", *words])
        said = capsys.readouterr()
        assert code in (0, 3), (seed, said.err)
        assert (code == 3) == (re.search(r"^(?!.*warning:).*\bRG\d{3} ", said.err, re.MULTILINE) is not None), seed
        assert time.perf_counter() - start < 20, seed
