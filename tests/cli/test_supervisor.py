"""The supervisor: signals, crashes and draws that hang end with an exit code and a sentence."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rendergraph import activity
from rendergraph.cli import main

pytestmark = pytest.mark.slow  # each test starts processes, and most wait for some of them to end

# One pixel takes about a quarter of a second, and llvmpipe draws all of them inside of one call.
SLOW = """/*---
doc: Burn time.
outputs: {color: {semantic: display_color, format: rgba8, doc: Picture.}}
---*/
out vec4 color;

void main() {
    float x = gl_FragCoord.x;
    for (int i = 0; i < 60000; ++i) x = sin(x * 1.7 + float(i));
    color = vec4(x);
}
"""
NODE = """from rendergraph.api import *
import ctypes, os, signal

class Wrong(Node):
    '''End the process.'''

    color = Output(DisplayColor, format="rgba8", doc="Picture.")

    def record(self, steps):
        steps.fullscreen("wrong.frag")

    def update(self, frame):
        {end}
"""


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "rendergraph", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=folder,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a background job's suite ignores SIGINT
        env={**os.environ, "LP_NUM_THREADS": "1"},
    )


def descendants(process: subprocess.Popen[str]) -> set[int]:
    """All processes below one, as Linux lists them."""
    found, left = set(), [process.pid]
    while left:
        for task in Path(f"/proc/{left.pop()}/task").glob("*/children"):
            numbers = [int(word) for word in task.read_text().split()]
            found |= set(numbers)
            left += numbers
    return found


def have_ended(pids: set[int]) -> bool:
    """Whether processes end within two seconds."""
    for _ in range(20):
        listed = subprocess.run(["ps", "-o", "stat=", *map(str, pids)], capture_output=True, text=True, check=False)
        if all(state.startswith("Z") for state in listed.stdout.split()):
            return True
        time.sleep(0.1)
    return False


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("slow")
    (folder / "slow.frag").write_text(SLOW)
    (folder / "slow.yaml").write_text(
        "rendergraph: 1\nsize: [512, 512]\nnodes: {burn: {type: slow}}\noutputs: {image: burn.color}\n"
    )
    return folder


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("words", [("run",), ("bench",), ("compare", "slow.yaml"), ("view", "--no-open")], ids=str)
def test_ctrl_c_ends_a_draw_that_hangs_within_two_seconds(slow: Path, words: tuple[str, ...]) -> None:
    process = start(slow, *words, "slow.yaml", "--plugin", "slow.frag")
    time.sleep(2)
    below = descendants(process)
    assert below
    begun = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert time.monotonic() - begun < 2
    assert (process.returncode, err.splitlines()[-1]) == (130, "interrupted")
    assert have_ended(below)


def test_a_draw_takes_no_longer_than_draw_timeout(slow: Path) -> None:
    process = start(slow, "run", "slow.yaml", "--plugin", "slow.frag", "--draw-timeout", "0.3")
    _, err = process.communicate(timeout=30)
    assert process.returncode == 1
    assert err == "RG622 --draw-timeout exceeded while drawing step 'burn'; allow more, or draw less at a time\n"


@pytest.mark.parametrize(
    ("end", "text"),
    [
        ("ctypes.string_at(0)", "the process crashed (SIGSEGV) while preparing a frame; too little memory can cause"),
        ("os._exit(1)", "the process was ended by a library (exit code 1) while preparing a frame; too little memory"),
        (
            "os.kill(os.getpid(), signal.SIGKILL)",
            "the process was killed (SIGKILL) while preparing a frame; the system",
        ),
    ],
)
def test_a_crash_is_reported_with_what_was_being_done(tmp_path: Path, end: str, text: str) -> None:
    (tmp_path / "wrong.py").write_text(NODE.format(end=end))
    (tmp_path / "wrong.frag").write_text("out vec4 color;\n\nvoid main() {\n    color = vec4(1.0);\n}\n")
    (tmp_path / "wrong.yaml").write_text(
        "rendergraph: 1\nsize: [8, 8]\nnodes: {wrong: {type: wrong}}\noutputs: {image: wrong.color}\n"
    )
    process = start(tmp_path, "run", "wrong.yaml", "--plugin", "wrong.py", "--json")
    out, err = process.communicate(timeout=30)
    assert (process.returncode, err.startswith(f"RG622 {text}")) == (1, True), err
    assert '"exit_code": 1' in out


def test_a_supervisor_that_is_killed_takes_its_worker_along(slow: Path) -> None:
    process = start(slow, "run", "slow.yaml", "--plugin", "slow.frag")
    time.sleep(1)
    below = descendants(process)
    assert below
    process.kill()
    process.communicate(timeout=30)  # the worker holds the pipes, too
    assert have_ended(below)


@pytest.mark.parametrize(("name", "deaf"), [("SIGTERM", True), ("SIGINT", False)])
def test_a_process_that_hears_no_signal_is_killed_after_a_while(tmp_path: Path, name: str, deaf: bool) -> None:
    code = (
        "import sys, time; from rendergraph import cli; from rendergraph.session import stages\n"
        "def resolve(*a, **k):\n print('ready', flush=True)\n"
        f" {'max(range(10**13))' if deaf else 'time.sleep(30)'}\n"
        f"cli.PATIENCE = {0.5 if deaf else 15}; stages.resolve = resolve; sys.argv[1:] = ['check', 'x']\n"
        "sys.exit(cli.main())"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stderr is not None
    assert process.stderr.readline() == "ready\n"
    time.sleep(0.5)  # until it is deaf
    begun = time.monotonic()
    process.send_signal(getattr(signal, name))
    _, err = process.communicate(timeout=20)
    taken = time.monotonic() - begun
    assert (process.returncode, err) == ((143, "terminated\n") if name == "SIGTERM" else (130, "interrupted\n"))
    assert taken > 0.4 if deaf else taken < 15


def test_signals_that_are_ignored_stay_ignored(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys; from rendergraph.cli import main; from rendergraph.session import stages\n"
        "def resolve(*a, **k):\n os.kill(os.getppid(), signal.SIGHUP); sys.exit('alive')\n"
        "stages.resolve = resolve; sys.argv[1:] = ['check', 'x']\nsys.exit(main())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN),  # as nohup does
    )
    assert "alive" in done.stderr, done


def test_a_limit_of_draws_ends_with_its_command_line() -> None:
    assert main(["run", "nowhere", "--draw-timeout", "9"]) == 3
    assert activity.draw_seconds() == 0
