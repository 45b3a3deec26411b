"""`check-node`: what is right passes, and whatever a node does wrong ends in one message that names its file."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
import yaml

from rendergraph.authoring import KINDS, CheckLimits, Report, check_node, new_node
from rendergraph.authoring.examine import examine_file
from rendergraph.cli.app import main
from rendergraph.errors import InputError, RendergraphError
from rendergraph.resources import folder

pytestmark = pytest.mark.slow

HEAD = "from rendergraph.api import Any, Frame, Input, Internal, Node, Output, Radiance, Steps, Views, define, param\n"
GOOD = (
    HEAD
    + '''

class Glow(Node):
    """Everything a little brighter."""

    radiance = Input(Radiance, doc="What is there.")
    brighter = Output(like="radiance", doc="More of it.")

    gain: float = param(default=2.0, min=0, max=8, doc="Factor.")
'''
)
SHADER = """uniform sampler2D radiance;
uniform float gain;
out vec4 brighter;
void main() { brighter = gain * texelFetch(radiance, ivec2(gl_FragCoord.xy), 0); }
"""
ENOUGH = CheckLimits(import_seconds=10, pass_seconds=10, memory=500 << 20)
QUICK = CheckLimits(import_seconds=2, pass_seconds=3, memory=500 << 20)
"""For those that would never end."""
PATIENCE = 20
"""Seconds for a check, its 2 or 3 s and starting Python on a busy machine; what waits for a hostile node takes 30 or more."""


@dataclass(frozen=True)
class Answer:
    """How a check ended."""

    code: int
    messages: list[str]
    seconds: float


Check = Callable[..., Answer]


def examine(file: Path, scene: str | None = None) -> Report:
    """The report of a harmless node, in this process."""
    return examine_file(file.resolve(), [], scene, lambda stage, what: None)


@pytest.fixture
def check_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    monkeypatch.chdir(tmp_path)

    def run(examine: Callable[[Path], Report], python: str | None = GOOD, shader: str = SHADER) -> Answer:
        if python is not None:
            (tmp_path / "glow.py").write_text(python)
        (tmp_path / "glow.frag").write_text(shader)
        start = time.monotonic()
        try:
            report = examine(Path("glow.frag" if python is None else "glow.py"))
        except RendergraphError as error:
            code, problems = error.exit_code, error.problems
        else:
            code, problems = 3 if report.mistakes else 0, report.problems
        messages = [str(problem).splitlines()[0].replace(f"{tmp_path}/", "") for problem in problems]
        return Answer(code, messages, time.monotonic() - start)

    return run


@pytest.fixture
def check(check_in: Callable[..., Answer]) -> Check:
    """`check(python, shader)`: `glow.py` and `glow.frag` of these texts, checked in this process."""
    return partial(check_in, examine)


@pytest.fixture
def check_hostile(check_in: Callable[..., Answer]) -> Check:
    """The same in a process of its own, under tight limits."""
    return lambda python, limits: check_in(partial(check_node, limits=limits), python)


def body(*lines: str) -> str:
    """The good node with more in its class."""
    return GOOD + "\n" + textwrap.indent("\n".join(lines), "    ") + "\n"


def test_a_good_node_passes_without_a_word(check: Check) -> None:
    assert check().messages == []
    assert check().code == 0


@pytest.mark.parametrize("kind", KINDS)
def test_every_template_passes_without_a_word(kind: str, tmp_path: Path) -> None:
    made = new_node("lens_falloff", kind, where=tmp_path)  # type: ignore[arg-type]  # a word of KINDS
    report = examine(tmp_path / made.commands[1].split()[-1])
    assert report.problems == ()
    assert report.variants[0] == "default"


# --- hostile ---------------------------------------------------------------------------------------------------------

HOSTILE = {
    "raises": ("x = 1\nraise RuntimeError('not today')\n", r"glow.py:2:1: RG491 .* RuntimeError: not today"),
    "leaves": ("import sys\nsys.exit(7)\n", r"glow.py:2:1: RG4\d\d .*(sys.exit\(7\)|SystemExit: 7)"),
    "exits": (
        "import os\n\nos._exit(0)\n",
        r"glow.py:3:1: RG450 it ends the process with status 0 while it is imported",
    ),
    "crashes": ("import ctypes\nctypes.string_at(0)\n", r"glow.py:2:1: RG451 it crashes the process \(SIGSEGV\) while"),
    "aborts": (
        "import os\nos.abort()\n",
        r"glow.py:2:1: RG451 it crashes the process \(SIGABRT\) while it is imported",
    ),
    "sleeps": ("import time\ntime.sleep(60)\n", r"glow.py:2:1: RG452 it takes longer than 2 s while it is imported"),
    "spins": (
        "while True:\n    pass\n",
        r"glow.py:[12]:1: RG452 it takes longer than 2 s while it is imported; --limit",
    ),
    "ignores": (
        "import signal\nfor n in (1, 2, 10, 15): signal.signal(n, signal.SIG_IGN)\nwhile True:\n    pass\n",
        r"glow.py.* RG452 it takes longer than 2 s",
    ),
    "prints": ("while True:\n    print('x' * 1000)\n", r"glow.py:2:1: RG452 it takes longer than 2 s"),
    "eats": ("x = []\nwhile True:\n    x.append(bytearray(1 << 24))\n", r"glow.py:3:1: RG453 .* limit of 500 MiB"),
    "gulps": ("x = bytearray(1 << 40)\n", r"glow.py:1:1: RG453 it needs more memory than the limit of 500 MiB"),
    "nothing": ("x = 1\n", r"glow.py: RG492 the module of node type 'glow' must define one Node class; it has none"),
    "children": (
        "import os, time\nif os.fork() == 0:\n    time.sleep(30)\nos._exit(4)\n",
        r"glow.py:4:1: RG450 .* status 4",
    ),
    "garbles": (
        "import os, stat\nfor fd in range(3, 99):\n    try:\n"
        "        if stat.S_ISFIFO(os.fstat(fd).st_mode):\n"
        '            os.write(fd, b\'{"report": 5}\\n{"failed": [1], "exit_code": 3}\\n[\' + b\'[\' * 9999 + b\'\\n\\xff{"sta\')\n'
        "    except OSError:\n        pass\nraise BaseException('over')\n",
        r"glow.py:8:1: RG491 .* BaseException: over",
    ),
    "closes": ("import os\nos.closerange(3, 100)\nos._exit(0)\n", r"glow.py.* RG450 it ends the process"),
    "closes and sleeps": (
        "import os, time\nos.closerange(3, 100)\ntime.sleep(60)\n",
        r"glow.py.* RG452 it takes longer",
    ),
    "chats": (
        "import os\nfor n in range(3, 20):\n    try: os.write(n, b'{}\\nx\\n[1]\\n')\n    except OSError: pass\n1 / 0\n",
        r"glow.py:5:1: RG491 .* ZeroDivisionError",
    ),
    "interrupts": ("raise KeyboardInterrupt\n", r"glow.py:1:1: RG4\d\d .*KeyboardInterrupt"),
}


FAST = ("garbles", "children")
"""Others that run in `make check` are those of the error pages, below."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * (name not in FAST)) for name in HOSTILE]
)
def test_a_hostile_import_is_one_message(check_hostile: Check, name: str) -> None:
    python, message = HOSTILE[name]
    answer = check_hostile(python, limits=QUICK if "RG452" in message else ENOUGH)
    assert answer.code == 3
    assert len(answer.messages) == 1, answer.messages
    assert re.match(message, answer.messages[0]), answer.messages
    assert answer.seconds < PATIENCE


RUNNING = {
    "raises in record": (
        body("def record(self, steps: Steps) -> None:", "    raise KeyError('gone')"),
        r"glow.py:13:1: RG420 .*KeyError: 'gone'",
    ),
    "raises in update": (
        body("def update(self, frame: Frame) -> None:", "    frame.nothing"),
        r"glow.py:13:1: RG433 .*AttributeError",
    ),
    "writes its input": (
        body(
            "def record(self, steps: Steps) -> None:",
            "    steps.fullscreen('glow.frag', out=self.radiance, radiance=self.radiance)",
        ),
        r"glow.py:13:1: RG421 ",
    ),
    "writes what it made up": (
        body(
            "def record(self, steps: Steps) -> None:",
            "    steps.fullscreen('glow.frag', out=Output(Radiance, doc='Not mine.'))",
        ),
        r"glow.py:13:1: RG42\d ",
    ),
    "fills too much": (
        body(
            "words = Internal(kind='buffer', bytes=16)",
            "def record(self, steps: Steps) -> None:",
            "    steps.fullscreen('glow.frag', radiance=self.radiance, words=self.words)",
            "def update(self, frame: Frame) -> None:",
            "    import numpy; frame.write(self.words, numpy.zeros(100))",
        ),
        r"glow.py:16:1: RG432 .*writes 800 bytes into 'words', which holds 16",
    ),
    "fills another's": (
        body(
            "def update(self, frame: Frame) -> None:",
            "    import numpy",
            "    frame.write(Internal(kind='buffer', bytes=16), numpy.zeros(1))",
        ),
        r"glow.py:14:1: RG433 ",
    ),
    "changes state": (
        body(
            "def update(self, frame: Frame) -> None:", "    import ctypes; ctypes.CDLL('libGL.so.1').glEnable(0x0B90)"
        ),
        r"glow.py:12:5: RG456 'update' changes OpenGL state: enabled capabilities",
    ),
    "leaks": (
        body(
            "def update(self, frame: Frame) -> None:",
            "    import ctypes; ctypes.CDLL('libGL.so.1').glCreateBuffers(3, (ctypes.c_uint * 3)())",
        ),
        r"glow.py: RG456 the node leaves GL objects behind: \d+ buffers",
    ),
}


@pytest.mark.parametrize("name", RUNNING)
def test_a_wrong_pass_is_one_message(check: Check, name: str) -> None:
    python, message = RUNNING[name]
    answer = check(python)
    assert answer.code == 3
    assert len(answer.messages) == 1, answer.messages
    assert re.match(message, answer.messages[0]), answer.messages


HOSTILE_PASSES = {
    "exits in record": (
        body("def record(self, steps: Steps) -> None:", "    import os; os._exit(1)"),
        r"glow.py:13:1: RG450 it ends the process with status 1 in variant 'default'",
    ),
    "spins in update": (
        body("def update(self, frame: Frame) -> None:", "    while True: pass"),
        r"glow.py:13:1: RG452 it takes longer than 3 s in variant 'default'; --limit pass-seconds=N",
    ),
    "crashes in update": (
        body("def update(self, frame: Frame) -> None:", "    import ctypes; ctypes.string_at(0)"),
        r"glow.py:13:1: RG451 it crashes the process \(SIGSEGV\) in variant 'default'",
    ),
    "eats in record": (
        body("def record(self, steps: Steps) -> None:", "    bytearray(1 << 40)"),
        r"glow.py:13:1: RG453 it needs more memory than the limit of 500 MiB",
    ),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * (name != "crashes in update")) for name in HOSTILE_PASSES]
)
def test_a_hostile_pass_is_one_message(check_hostile: Check, name: str) -> None:
    python, message = HOSTILE_PASSES[name]
    answer = check_hostile(python, limits=QUICK if "RG452" in message else ENOUGH)
    assert answer.code == 3
    assert len(answer.messages) == 1, answer.messages
    assert re.match(message, answer.messages[0]), answer.messages
    assert answer.seconds < PATIENCE


BOMB = "\n".join(["#define B0 1.0", *(f"#define B{n + 1} B{n}+B{n}" for n in range(30))])
SHADERS = {
    "does not compile": (SHADER.replace("gain *", "gain * *"), r"glow.frag:4:\d+: RG410 "),
    "leaves an output unwritten": (
        SHADER.replace("brighter =", "vec4 lost ="),
        r"glow.frag:3:1: RG454 the shader never writes 'brighter', a target of its step",
    ),
    "leaves one of two unwritten": (SHADER.replace("void", "out vec4 more;\nvoid"), r"glow.*: RG4(37|54) .*'more'"),
    "writes half": (
        SHADER.replace("{ ", "{ if (gl_FragCoord.x < 10.0) discard; "),
        r"glow.py:8:5: RG454 230 of 851 texels of 'brighter' are not written; write them all, or declare",
    ),
    "never looks at a parameter": (SHADER.replace("= gain *", "="), r"glow.py:10:5: RG455 'gain' is declared, but no"),
    "never looks at an input": (
        SHADER.replace("gain * texelFetch(radiance, ivec2(gl_FragCoord.xy), 0)", "vec4(gain)"),
        r"glow.py:7:5: RG455 'radiance' is declared",
    ),
    "looks at what nobody sets": (
        SHADER.replace("gain *", "gain * other *").replace("out", "uniform float other;\nout"),
        r"glow.frag:3:15: RG434 .*'other', which nothing sets",
    ),
    "looks at another's buffer": (
        SHADER.replace("out", "layout(std430) buffer loot { vec4 all_of_it[]; };\nout").replace(
            "gain *", "all_of_it[3] + gain *"
        ),
        r"glow.frag.*RG4\d\d .*loot",
    ),
    "macros that double": (
        BOMB + SHADER.replace("gain *", "(B30) * gain *"),
        r"glow.(py|frag).* RG409 macros may expand this line",
    ),
}


def test_a_keyword_that_no_shader_uses_is_a_warning(check: Check) -> None:
    record = "def record(self, steps: Steps) -> None:", '    steps.fullscreen("glow.frag", gain=2.0, gian=3.0)'
    answer = check(body(*record))
    assert answer.code == 0
    (said,) = answer.messages
    line = 1 + body(*record).splitlines().index(f"        {record[1].strip()}")
    assert said.startswith(
        f"glow.py:{line}:1: warning: RG455 the step is given gian=…, but no program of it uses 'gian'"
    )


@pytest.mark.parametrize("name", SHADERS)
def test_a_wrong_shader_is_one_message(check: Check, name: str) -> None:
    shader, message = SHADERS[name]
    more = '    more = Output(like="radiance", doc="More.")\n' if "more" in shader else ""
    answer = check(GOOD + more, shader)
    assert answer.code == 3
    assert len(answer.messages) == 1, answer.messages
    assert re.match(message, answer.messages[0]), answer.messages


def test_docs_and_ranges(check: Check) -> None:
    answer = check(GOOD.replace('doc="Factor."', 'doc=""').replace("More of it.", "more"))
    assert answer.code == 3
    assert any("RG490" in message and "gain" in message for message in answer.messages)
    answer = check(GOOD.replace("More of it.", "more"))
    assert answer.messages == [
        "glow.py:8:5: RG490 node type 'glow': the doc of 'brighter' must be a sentence that ends in '.'"
    ]
    answer = check(GOOD.replace("min=0, max=8, ", ""))
    assert (answer.code, len(answer.messages)) == (0, 1)
    assert re.match(r"glow.py:10:5: warning: RG460 parameter 'gain' has no range", answer.messages[0])
    answer = check(GOOD.replace("default=2.0", "default=20.0"))
    assert answer.code == 3
    assert re.match(r"glow.py:10:5: RG490 .*the default of 'gain', 20.0, is wrong", answer.messages[0])


def test_a_mistake_in_one_choice_is_found_and_named(check: Check) -> None:
    python = GOOD.replace("from rendergraph", "from typing import Literal\nfrom rendergraph") + (
        '    mode: Literal["plain", "odd", "even"] = define(default="plain", doc="Kind.")\n'
    )
    shader = SHADER.replace("void main() {", "void main() {\n#if MODE == MODE_ODD\n    wrong;\n#endif\n")
    answer = check(python, shader)
    assert answer.code == 3
    assert re.match(r"glow.frag:6:\d+: RG410 .*wrong.* \(with mode=odd\)", answer.messages[0]), answer.messages


def test_an_input_that_is_left_out_is_tried(check: Check) -> None:
    answer = check(GOOD.replace("Input(Radiance, doc", "Input(Radiance, optional=True, doc"))
    assert answer.code == 3
    assert any("without radiance" in message for message in answer.messages), answer.messages


def test_an_input_that_is_written_is_found(check: Check, tmp_path: Path) -> None:
    python = GOOD.replace("Input(Radiance", 'Input(Radiance, use="image"').replace(
        "    gain", '    shader = "glow.comp"\n    gain'
    )
    shader = """layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba16f) uniform image2D radiance;
layout(rgba16f) uniform writeonly image2D brighter;
uniform float gain;
void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    imageStore(brighter, texel, gain * imageLoad(radiance, texel));
    imageStore(radiance, texel, vec4(0.0));
}
"""
    (tmp_path / "glow.comp").write_text(shader)
    answer = check(python)
    assert answer.code == 3
    assert re.match(r"glow.comp:2:33: RG457 .* image 'radiance' is only read", answer.messages[-1]), answer.messages
    shader = shader.replace("uniform image2D radiance", "uniform readonly image2D radiance")
    (tmp_path / "glow.comp").write_text("".join(shader.splitlines(keepends=True)[:7] + ["}\n"]))
    assert check(python).messages == []


RECORDS = {
    "raises": ("raise KeyError('lamp')", r"glow.py:15:1: RG420 node 'glow' failed while recording: KeyError: 'lamp'$"),
    "samples its target": (
        "steps.fullscreen('glow.frag', radiance=self.brighter, out=self.brighter)",
        r"glow.py:15:1: RG422 node 'glow': it samples 'glow.brighter'",
    ),
}


@pytest.mark.parametrize("name", RECORDS)
def test_a_place_in_the_nodes_file_is_said_once(check: Check, name: str) -> None:
    line, message = RECORDS[name]
    (said,) = check(body("", "def record(self, steps: object) -> None:", '    """Draw."""', f"    {line}")).messages
    assert re.match(message, said), said


def test_a_target_that_is_not_written_is_named_where_it_is_declared(check: Check) -> None:
    (said,) = check(body("extra = Output(Radiance, doc='Never written.')")).messages
    assert re.match(r"glow.py:\d+:5: RG437 node 'glow': glow.frag writes no output 'extra'", said), said


def test_every_kind_of_port_is_fed_and_read() -> None:
    report = examine(Path(__file__).parent / "zoo" / "zoo.py")
    assert report.problems == ()
    assert {"without many", "without weights", "without marks", "numbers alone", "seen alone"} <= set(report.variants)


def test_values_that_are_not_finite_are_a_warning(check: Check) -> None:
    answer = check(shader=SHADER.replace("gain *", "log(-gain) *"))
    assert answer.code == 0
    assert re.match(r"glow.py:8:5: warning: RG458 851 of 851 texels of 'brighter' are not finite", answer.messages[0])


def test_what_a_shader_file_lacks_is_a_warning(
    check: Check, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SHADER.replace("out vec4", "uniform float spare;\nout vec4").replace(
        "{ ", "{ if (gl_FragCoord.x < 10.0) discard; "
    )
    answer = check(None, text)
    assert answer.code == 0
    assert {re.search("RG4..", message)[0] for message in answer.messages} == {"RG445", "RG446", "RG455"}  # type: ignore[index]
    assert all("warning" in message for message in answer.messages)
    capsys.readouterr()
    assert main(["check-node", str(tmp_path / "glow.frag")]) == 0
    assert capsys.readouterr().err.splitlines()[-1] == "glow: 3 warnings, no mistakes in 1 variant"
    assert check(None, text.replace("brighter = gain", "brighter = gian")).code == 3


def test_the_verb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    new_node("lens_falloff")
    assert main(["check-node", "lens_falloff.py", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == "lens_falloff: no problems in 1 variant\n"
    assert json.loads(out) == {
        "node": "lens_falloff",
        "file": "lens_falloff.py",
        "variants": ["default"],
        "warnings": [],
    }
    Path("slow.py").write_text("import time\ntime.sleep(60)\n")
    assert main(["check-node", "slow.py", "--limit", "import-seconds=1", "--json"]) == 3
    problem = json.loads(capsys.readouterr().out)["error"]["problems"][0]
    assert (problem["code"], problem["file"], problem["line"]) == ("RG452", "slow.py", 2)
    assert main(["check-node", "missing.py"]) == 3
    assert main(["check-node", "slow.py", "--limit", "patience=3"]) == 2


def test_a_module_may_use_helpers_beside_it_and_lie_in_a_package(tmp_path: Path) -> None:
    for place in ("nodes/light", "shaders/light"):
        (tmp_path / place).mkdir(parents=True)
    helper = GOOD.replace("class Glow", "class _Glow")
    (tmp_path / "nodes" / "light" / "_shared.py").write_text(helper)
    python = 'from ._shared import _Glow\n\n\nclass Glow(_Glow):\n    """Everything brighter."""\n'
    (tmp_path / "nodes" / "light" / "glow.py").write_text(python)
    (tmp_path / "shaders" / "light" / "glow.frag").write_text(SHADER)
    assert examine(tmp_path / "nodes" / "light" / "glow.py").problems == ()
    (tmp_path / "nodes" / "light" / "_shared.py").write_text(helper.replace("More of it.", "more"))
    (problem,) = examine(tmp_path / "nodes" / "light" / "glow.py").problems
    assert problem.place is not None
    assert (Path(problem.place.file).name, problem.place.line) == ("_shared.py", 8)


def test_what_is_not_there() -> None:
    with pytest.raises(InputError, match=r"RG011 there is no file 'nowhere.py'"):
        check_node(Path("nowhere.py"))
    page = yaml.safe_load((folder("rendergraph.errors") / "RG461-check-not-a-node.yaml").read_text(encoding="utf-8"))
    with pytest.raises(InputError) as caught:
        check_node(Path("vignette.yaml"))
    assert str(caught.value) == page["message"]
    with pytest.raises(InputError, match="RG461"):
        check_node(Path())


def test_a_scene_of_ones_own(tmp_path: Path) -> None:
    new_node("edges", "geometry", where=tmp_path)
    assert examine(tmp_path / "edges.py", scene="shadow_study").problems == ()
    with pytest.raises(InputError, match=r"\ARG015 there is no shipped scene 'nowhere'; available: [\w, ]+\Z"):
        examine(tmp_path / "edges.py", scene="nowhere")


def test_pages_of_what_ends_a_check_tell_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for file in sorted(folder("rendergraph.errors").glob("RG45[0-3]-*.yaml")):
        page = yaml.safe_load(file.read_text(encoding="utf-8"))
        Path("blur.py").write_text(page["wrong"])
        limits = CheckLimits(import_seconds=1) if page["code"] == "RG452" else CheckLimits()
        with pytest.raises(InputError) as caught:
            check_node(Path("blur.py"), limits=limits)
        said = str(caught.value.problems[0]).replace("longer than 1 s", "longer than 10 s")
        assert said == page["message"]


ENDS = '''"""Goes wrong at both ends."""

from __future__ import annotations

from rendergraph.api import Any, Input, Node, Output, Steps, structural


class Glow(Node):
    """Blurs some times."""

    radiance = Input(Any, size="any", doc="What is blurred.")
    color = Output(like="radiance", size=lambda node, facts: (node.side, node.side), doc="The same, blurred.")

    times: int = structural(default=3, min=1, max=16, doc="How often.")
    side: int = structural(default=4, min=1, max=16384, doc="Texels along a side.")

    def record(self, steps: Steps) -> None:
        """Forgets its output at 1, and divides by 0 at 16."""
        if self.times > 1:
            steps.fullscreen("glow.frag")
        1 / (16 - self.times)
'''


def test_numbers_that_shape_the_plan_are_tried_at_their_ends(check: Check) -> None:
    shader = (
        "uniform sampler2D radiance;\nout vec4 color;\nvoid main() { color = texelFetch(radiance, ivec2(0), 0); }\n"
    )
    answer = check(ENDS, shader)
    missing, failing = answer.messages
    assert re.match(r"glow.py:12:5: RG204 output 'color' .* never rendered: .*no step \(with times=1\)", missing), (
        missing
    )
    assert re.match(r"glow.py:21:1: RG420 .*ZeroDivisionError: .* \(with times=16\)", failing), failing
    mended = ENDS.replace("if self.times > 1:", "if self.times > 0:").replace("        1 / (16 - self.times)\n", "")
    assert check(mended, shader).messages == []  # nothing waits for a picture of 16384 × 16384


COUNTS = '''"""Counts into a buffer that nobody clears."""

from __future__ import annotations

from rendergraph.api import Any, Input, Node, Output, Steps


class Glow(Node):
    """Counts dark and bright texels."""

    radiance = Input(Any, doc="What is counted.")
    counts = Output(Any, kind="buffer", bytes=256, doc="Texels of each value.")

    def record(self, steps: Steps) -> None:
        """One dispatch."""
        steps.compute("glow.comp", over=self.radiance)
'''


def test_a_buffer_that_is_added_to_and_not_cleared_is_counted_in_bytes(check: Check, tmp_path: Path) -> None:
    (tmp_path / "glow.comp").write_text("""layout(local_size_x = 8, local_size_y = 8) in;
uniform sampler2D radiance;
layout(std430) buffer counts { uint bins[64]; };
void main() { atomicAdd(bins[texelFetch(radiance, ivec2(0), 0).r > 0.5 ? 63 : 62], 1u); }
""")
    (said,) = check(COUNTS).messages
    assert re.match(r"glow.py:12:5: RG454 256 of 256 bytes of 'counts' .* without being cleared; .*`clear=0`$", said), (
        said
    )
    assert check(COUNTS.replace("bytes=256", "bytes=256, clear=0")).messages == []


IMPORTS = "from rendergraph.api import Any, Depth, Function, Input, Internal, Node, Output, Radiance, ShadowLookup, Signature\n"
IMPORTS += "from rendergraph.api import Steps, structural\nimport rendergraph.nodes.display.gaussian_blur as base\n"
RIGHT = {
    "a geometry shader before a step of the whole picture": '''
class Glow(Node):
    """Triangles, then a picture of them."""

    drawn = Internal(Radiance, clear=0.0)
    color = Output(Radiance, doc="Triangles.")

    def record(self, steps: Steps) -> None:
        steps.geometry("white.frag", geometry="same.geom", out={"white": self.drawn}, materials="none")
        steps.fullscreen("glow.frag", drawn=self.drawn, out=self.color)
''',
    "a buffer that a function reads": '''
class Glow(Node):
    """A shadow by a number."""

    numbers = Input(Any, kind="buffer", doc="Numbers.")
    lookup = Function(ShadowLookup, shader="numbers.glsl", reads=("numbers",), doc="Shadow of a number.")
''',
    "a function that gives a matrix": '''
Turn = Signature("turned", "mat3 turned(vec3 axis)", ("axis",), "*", "mat3(1.0)", "A rotation.")


class Glow(Node):
    """A rotation."""

    turned = Function(Turn, shader="turned.glsl", doc="Rotation about an axis.")
''',
    "samples": '''
class Glow(Node):
    """The scene's triangles with samples."""

    color = Output(Radiance, samples=lambda node, facts: node.samples, clear=0.0, doc="Colour.")
    four = Output(Any, format="r32ui", samples=4, clear=0, doc="Four samples.")
    depth = Output(Depth, format="depth32f", samples=lambda node, facts: node.samples, clear=0.0, doc="Depth.")
    samples: int = structural(default=4, min=1, max=16, doc="Samples a texel: more than some devices have.")

    def record(self, steps: Steps) -> None:
        if steps.used(self.color) or steps.used(self.depth):
            steps.geometry("white.frag", out={"white": self.color, "depth": self.depth}, materials="none")
        if steps.used(self.four):
            steps.clear(self.four, 1)
''',
    "a kept table": '''
class Glow(Node):
    """A table that outlives the frame."""

    table = Output(Radiance, size=(4, 4), kept=True, doc="White.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("white.frag", out={"white": self.table})
''',
    "what is inherited through a module": '''
class Glow(base.GaussianBlur):
    """A blur and no more."""
''',
}
RIGHT_SHADERS = {
    "white.frag": "out vec4 white;\nvoid main() { white = vec4(1.0); }\n",
    "same.geom": "layout(triangles) in;\nlayout(triangle_strip, max_vertices = 3) out;\n"
    "void main() { for (int i = 0; i < 3; ++i) { gl_Position = gl_in[i].gl_Position; EmitVertex(); } }\n",
    "glow.frag": "uniform sampler2D drawn;\nout vec4 color;\nvoid main() { color = texelFetch(drawn, ivec2(0), 0); }\n",
    "numbers.glsl": "layout(std430) readonly buffer numbers { uint words[]; };\n"
    "float shadow(int light, vec3 position, vec3 normal) { return words[0] > 5u ? 1.0 : 0.5; }\n",
    "turned.glsl": "mat3 turned(vec3 axis) { return mat3(axis, axis.yzx, axis.zxy); }\n",
}


def written(tmp_path: Path, text: str) -> Path:
    """`glow.py` with all shaders beside it."""
    for name, shader in RIGHT_SHADERS.items():
        (tmp_path / name).write_text(shader)
    (tmp_path / "glow.py").write_text(IMPORTS + text)
    return tmp_path / "glow.py"


@pytest.mark.parametrize("name", RIGHT)
def test_what_is_right_is_not_complained_of(name: str, tmp_path: Path) -> None:
    report = examine(written(tmp_path, RIGHT[name]))
    assert report.problems == ()


BASE = '''
class Surfaces(Node):
    """The scene in white, behind nothing that a pre-pass has drawn."""

    depth = Input(Depth, use="depth_test", optional=True, doc="Depth of a pre-pass.")
    radiance = Output(Radiance, clear=0.0, doc="White.")
    surface_depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        if steps.connected(self.depth):
            steps.geometry("white.frag", out={"white": self.radiance}, depth=self.depth, view=self.depth, materials="none")
        else:
            out = {"white": self.radiance, "depth": self.surface_depth}
            steps.geometry("white.frag", out=out, materials="none")
'''
DERIVED = '''
from ._surfaces import Surfaces


class Glow(Surfaces):
    """The scene in white, with samples."""

    radiance = Output(Radiance, clear=0.0, samples=lambda node, facts: 4, doc="Four samples.")
    surface_depth = Output(Depth, format="depth32f", clear=0.0, samples=lambda node, facts: 4, doc="Four samples.")
'''


def test_an_optional_input_of_a_base_that_does_not_go_with_the_node_is_left_out_and_said(tmp_path: Path) -> None:
    nodes, shaders = tmp_path / "nodes" / "light", tmp_path / "shaders" / "light"
    nodes.mkdir(parents=True)
    shaders.mkdir(parents=True)
    written(shaders, "")
    (nodes / "_surfaces.py").write_text(IMPORTS + BASE)
    (nodes / "glow.py").write_text(IMPORTS + DERIVED)
    (problem,) = examine(nodes / "glow.py").problems
    assert (problem.code, problem.severity) == ("RG425", "warning")
    assert problem.message.endswith("; tried without 'depth', which is inherited")
    (nodes / "glow.py").write_text(IMPORTS + DERIVED.replace("0.0, samples=lambda node, facts: 4", "0.0", 1))
    broken = examine(nodes / "glow.py")
    assert any(problem.severity == "error" for problem in broken.problems)


def test_a_hangup_ends_the_child_too_and_leaves_no_folder(tmp_path: Path) -> None:
    (tmp_path / "temporary").mkdir()
    hanging = HEAD + "import os, time\nprint(os.getpid(), file=open('pid', 'w'), flush=True)\ntime.sleep(60)\n"
    (tmp_path / "glow.py").write_text(hanging)
    parent = subprocess.Popen(
        [sys.executable, "-m", "rendergraph", "check-node", "glow.py", "--limit", "import-seconds=60"],
        cwd=tmp_path,
        env=os.environ | {"TMPDIR": str(tmp_path / "temporary")},
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    end = time.monotonic() + PATIENCE
    pid = tmp_path / "pid"
    while not (pid.exists() and pid.read_text().strip()) and time.monotonic() < end:
        time.sleep(0.05)
    assert list((tmp_path / "temporary").iterdir())
    parent.send_signal(signal.SIGHUP)
    assert parent.communicate(timeout=PATIENCE)[1] == "terminated\n"
    assert parent.returncode == 129
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)
    assert not list((tmp_path / "temporary").iterdir())
