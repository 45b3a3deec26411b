"""Exit codes, streams and messages that hold for every verb."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from rendergraph.cli.app import VERBS
from rendergraph.errors import DeviceError, InputError, Place, Problem, RenderError

PROGRAM = [sys.executable, "-m", "rendergraph"]
HEAVY = {
    "numpy",
    "moderngl",
    "networkx",
    "OpenImageIO",
    "dataclasses",
    "yaml",
    "rich",
    "rich_click",
    "scipy",
    "trimesh",
}


@pytest.mark.parametrize("wanted", ["1", "3"])
def test_a_command_starts_threads_for_matrices_only_where_they_are_asked_for(wanted: str) -> None:
    code = (
        "import os, sys; from rendergraph.cli import main; sys.argv[1:] = ['--version']; assert 'numpy' not in sys.modules\n"
        "main(); import numpy\nprint(os.environ['OPENBLAS_NUM_THREADS'], len(os.listdir('/proc/self/task')))"
    )
    variables = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    if wanted != "1":
        variables["OPENBLAS_NUM_THREADS"] = wanted
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=variables)
    kept, started = done.stdout.splitlines()[-1].split()
    assert kept == wanted
    assert wanted != "1" or started == "1"


def test_help_imports_nothing_heavy_and_is_quick() -> None:
    code = f"import sys; from rendergraph.cli import main; main(['--help']); print({HEAVY!r} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
    taken = []
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*PROGRAM, "--help"], capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        taken.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    assert min(taken) < 0.3  # of the processor's time: the clock's depends on who else is at work


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_examples_and_json(cli: Any, verb: str) -> None:
    for flag in ("--help", "-h"):
        result = cli(verb, flag)
        assert result.code == 0
        assert "Examples:" in result.out
        assert f"    rendergraph {verb}" in result.out
        assert "--json" in result.out
        assert result.err == ""


def test_the_list_of_verbs_is_not_cut_off(cli: Any) -> None:
    result = cli("--help")
    assert "..." not in result.out.partition("Commands:")[2]
    for verb in VERBS:
        assert f"\n  {verb} " in result.out


@pytest.mark.slow
def test_the_terminal_gets_boxes_and_a_pipe_does_not() -> None:
    script = "import pty, sys; sys.exit(pty.spawn(sys.argv[1:]) >> 8)"
    shown = subprocess.run(
        [sys.executable, "-c", script, *PROGRAM, "run", "--help"], capture_output=True, stdin=subprocess.DEVNULL
    )
    assert "╭".encode() in shown.stdout
    assert "╭".encode() not in subprocess.run([*PROGRAM, "run", "--help"], capture_output=True).stdout


def test_version(cli: Any) -> None:
    assert cli("--version").out.startswith("rendergraph, version ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["render", "forward"], "RG500 unknown verb 'render'; did you mean 'run'?; see 'rendergraph --help'"),
        (["list"], "RG500 unknown verb 'list'; did you mean 'pipelines'?; see 'rendergraph --help'"),
        (["forward"], "RG500 unknown verb 'forward'; did you mean 'run forward'?; see 'rendergraph --help'"),
        (["my.yaml"], "RG500 unknown verb 'my.yaml'; did you mean 'run my.yaml'?; see 'rendergraph --help'"),
        (["rum"], "RG500 unknown verb 'rum'; did you mean 'run'?; see 'rendergraph --help'"),
        (
            ["run", "x", "--siez", "1x1"],
            "RG500 unknown option '--siez'; did you mean '--size'?; see",
        ),
        (["run", "x", "--size", "12"], "RG500 invalid value for '--size': '12' is not WIDTHxHEIGHT, as in 1280x720"),
        (["run", "x", "--size", "0x5"], "'0x5' is not WIDTHxHEIGHT"),
        (["run", "x", "--size", "-5x5"], "'-5x5' is not WIDTHxHEIGHT"),
        (["run", "x", "--frames", "5-2"], "'5-2' is not FIRST-LAST, as in 1-10; frame 1 is the first"),
        (["run", "x", "--frames", "0-2"], "'0-2' is not FIRST-LAST"),
        (["run", "x", "--frames", "a"], "'a' is not FIRST-LAST"),
        (["run", "x", "--fps", "0"], "'0' is not a number above 0"),
        (["run", "x", "--fps", "nan"], "'nan' is not a number above 0"),
        (["run", "x", "-s", "radius"], "'radius' is not PATH=VALUE, as in light.ambient=0"),
        (["run", "x", "-s", "=3"], "'=3' is not PATH=VALUE"),
        (["run", "x", "--tap", "sun.map"], "'sun.map' is not NODE.PORT=FILE"),
        (["run", "x", "--tap", "sun=a.exr"], "'sun=a.exr' is not NODE.PORT=FILE"),
        (["run", "x", "--tap", "sun.map[mip]=a.exr"], "'sun.map[mip]=a.exr' is not NODE.PORT=FILE"),
        (["run", "x", "--tap", "sun.map:depth=a.exr"], "'sun.map:depth=a.exr' is not NODE.PORT=FILE"),
        (["run", "x", "-o", "image="], "'image=' has no file name"),
        (["run", "x", "-o", "folder/"], "'folder/' has no file name"),
        (["run", "x", "--shuffle", "a"], "'a' is not a valid integer"),
        (["run", "x", "y"], "got unexpected extra argument"),
        (["bench", "x", "-n", "0"], "0 is not in the range"),
        (["graph", "x", "--format", "svgg"], "'svgg' is not one of 'text', 'dot', 'mermaid', 'svg'"),
        (["explain", "a", "b"], "got unexpected extra argument"),
    ],
)
def test_malformed_command_lines_exit_2(cli: Any, words: list[str], message: str) -> None:
    result = cli(*words)
    assert result.code == 2
    assert result.out == ""
    assert message in result.err
    assert len(result.err.splitlines()) == 1
    told = cli(*words, "--json")
    assert told.code == 2
    (problem,) = told.json["error"]["problems"]
    assert message.removeprefix("RG500 ") in problem["text"]
    assert told.json["error"]["exit_code"] == 2


def test_no_words_print_the_help(cli: Any) -> None:
    assert cli().code == 2
    assert "Commands:" in cli().err
    assert "Usage: rendergraph run" in cli("run").err


@pytest.mark.parametrize(("kind", "code"), [(InputError, 3), (RenderError, 1), (DeviceError, 5)])
def test_errors_become_messages_and_exit_codes(cli: Any, fake: Any, kind: Any, code: int) -> None:
    fake.fail = kind([Problem("RG103", "one\x1b[31m", Place("a.yaml", 2, 3), "b: 1"), Problem("RG110", "two")])
    result = cli("run", "x", "--frames", "1-3", "-o", "a.##.png", "--json")
    assert result.code == code
    assert result.err.splitlines()[0] == "a.yaml:2:3: RG103 one\\x1b[31m"
    assert result.json == {
        "error": {
            "exit_code": code,
            "problems": [
                {"code": "RG103", "severity": "error", "file": "a.yaml", "line": 2, "column": 3, "text": "one\x1b[31m"},
                {"code": "RG110", "severity": "error", "file": None, "line": None, "column": None, "text": "two"},
            ],
        }
    }


@pytest.mark.parametrize(
    ("raised", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (ZeroDivisionError("a\nb"), 1, "RG599 internal error (a bug in rendergraph): ZeroDivisionError: a b; "),
        (EOFError("marshal data too short"), 1, "RG599 internal error (a bug in rendergraph): EOFError: marshal data"),
        (MemoryError(), 1, "RG509 out of memory"),
        (OSError(28, "No space left on device", "x"), 1, "x: RG509 No space left on device"),
        (OSError(36, "File name too long", "x"), 3, "x: RG509 File name too long"),
        (
            ImportError("No module named 'numpy'", name="numpy"),
            1,
            "RG509 a library that rendergraph needs cannot be loaded",
        ),
        (ImportError("cannot import", name="rendergraph.x"), 1, "RG599 internal error (a bug in rendergraph): Import"),
        (BrokenPipeError(), 0, ""),
    ],
)
def test_whatever_happens_is_one_line(cli: Any, fake: Any, raised: BaseException, code: int, message: str) -> None:
    fake.fail = raised
    result = cli("run", "x", "--frames", "1-3", "-o", "a.##.png")
    assert result.code == code
    assert result.err.startswith(message)
    assert len(result.err.splitlines()) == bool(message)


def test_a_traceback_is_there_for_who_wants_it(cli: Any, fake: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from rendergraph.cli.app import main

    monkeypatch.setenv("RENDERGRAPH_TRACEBACK", "1")
    fake.fail = ZeroDivisionError("x")
    with pytest.raises(ZeroDivisionError, match="x"):
        main(["run", "x", "--frames", "1-3", "-o", "a.##.png"])


def test_sigterm_ends_with_143_and_leaves_no_files(
    cli: Any, fake: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rendergraph.session import stages

    def interrupted(expanded: Any, gpu: Any) -> Any:
        yield from draw(expanded, gpu)  # ended once its frame is written
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(1)

    draw = fake.draw
    monkeypatch.setattr(stages, "draw", interrupted)
    result = cli("run", "x")
    assert result.code == 143
    assert result.err == "terminated\n"
    assert os.listdir(tmp_path) == ["x.png"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_end_the_process_cleanly(tmp_path: Path, name: str) -> None:
    code = (
        "import sys, time; from rendergraph.cli import main; from rendergraph.session import stages\n"
        "def resolve(*a, **k):\n print('ready', flush=True); time.sleep(30)\n"
        "stages.resolve = resolve\nsys.exit(main(['check', 'x']))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        text=True,
        preexec_fn=lambda: [signal.signal(number, signal.SIG_DFL) for number in (signal.SIGINT, signal.SIGHUP)],
    )  # a background job's suite ignores SIGINT, and one under nohup SIGHUP
    assert process.stderr is not None
    assert process.stderr.readline() == "ready\n"  # stdout is for data
    process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=10)
    assert process.returncode == {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129}[name]
    assert (out, err) == ("", {"SIGINT": "interrupted\n"}.get(name, "terminated\n"))


@pytest.mark.slow
def test_a_closed_pipe_is_no_error() -> None:
    process = subprocess.Popen([*PROGRAM, "nodes", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    assert process.wait() == 0
    process.stderr.close()


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_behind_stdout_is_exit_1() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*PROGRAM, "nodes"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1
    assert done.stderr == "RG509 No space left on device\n"


@pytest.mark.slow
def test_without_stdout_and_stderr_it_still_works() -> None:
    for redirect in (">&-", "2>&-", ">&- 2>&-"):
        done = subprocess.run(f"exec '{sys.executable}' -m rendergraph nodes {redirect}", shell=True)
        assert done.returncode == 0, redirect


@pytest.mark.slow
def test_narrow_encodings_do_not_break_messages(tmp_path: Path) -> None:
    done = subprocess.run(
        [*PROGRAM, "check", "ö𝄞.yaml"],
        capture_output=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 3
    assert b"Traceback" not in done.stderr


def test_completion_for_the_shell() -> None:
    env = {**os.environ, "_RENDERGRAPH_COMPLETE": "bash_source"}
    done = subprocess.run(
        [sys.executable, "-c", "from rendergraph.cli import main; main()"], capture_output=True, text=True, env=env
    )
    assert "complete" in done.stdout


WORDS = [
    "run",
    "check",
    "forward",
    "nope",
    "--json",
    "--size",
    "10x10",
    "-s",
    "a.b=1",
    "--set=",
    "-o",
    "x.png",
    "-p",
    "--scene",
    "--tap",
    "a.b=c.exr",
    "--frames",
    "1-2",
    "",
    "-",
    "--",
    "\x00",
    "é𝄞",
    "--device",
    "-1",
    "../..",
    "9" * 400,
]


@pytest.mark.parametrize("seed", range(40))
def test_no_command_line_ends_in_a_traceback(cli: Any, seed: int) -> None:
    import random

    chosen = random.Random(seed)
    words = [chosen.choice(["run", "check", "plan", "graph", "config", "bench", "nodes", "explain", "schema"])]
    words += ["nope/nope.yaml", *(chosen.choice(WORDS) for _ in range(chosen.randint(0, 4)))]
    result = cli(*words)
    assert result.code in (0, 2, 3), (words, result)
    assert "RG599" not in result.err, (words, result)
    if "--json" in words and result.out:
        json.loads(result.out)


@pytest.mark.parametrize("frames", ["1-999999999", "5-100005"])
def test_more_frames_than_anybody_waits_for_are_refused(cli: Any, frames: str) -> None:
    found = cli("run", "forward", "--frames", frames, "-o", "a.####.png", "--size", "8x8")
    assert found.code == 2
    assert "frames exceed the limit of 100000 per run; render them in several runs" in found.err


def test_check_against_the_guaranteed_limits(cli: Any, tmp_path: Path) -> None:
    within = cli("check", "forward", "--profile", "guaranteed")
    assert within.code == 0
    assert "within the limits of every OpenGL 4.5 device" in within.err
    result = cli("check", "forward-msaa", "--profile", "guaranteed")
    assert result.code == 3
    assert (
        "RG435 'light.radiance' has 4 samples per texel, which is more than a minimal OpenGL 4.5 device's 1"
        in result.err
    )
    (tmp_path / "study.yaml").write_text("sweep: 1\npipeline: forward\naxes: {light.ambient: [0, 1]}\n")
    result = cli("check", "study.yaml", "--profile", "guaranteed")
    assert result.code == 2
    assert "--profile checks a pipeline, not a sweep file" in result.err
