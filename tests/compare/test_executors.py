"""Sweeps whose runs are drawn elsewhere: the same pictures and rows, whoever draws them and whatever happens meanwhile."""

from __future__ import annotations

import contextlib
import io
import json
import logging
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.compare.engine import Sweep, compare, sweep
from rendergraph.compare.store import read_results
from rendergraph.errors import InputError, RenderError, UsageError
from rendergraph.farm import dask_cluster
from rendergraph.farm.executors import Processes

distributed: Any = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow  # they start processes

MAKE = """// Stripes.
/*---
outputs:
  color: {semantic: radiance, format: rgba32f, doc: Stripes.}
params:
  wave: {default: 1.0, min: 0, max: 99, doc: How many.}
---*/
uniform float wave;
out vec4 color;
void main() { color = vec4(fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * wave), wave, 0.25, 1.0); }
"""
BEND = """// Powers.
/*---
inputs:
  source: {semantic: radiance, doc: What.}
outputs:
  color: {semantic: radiance, format: rgba16f, doc: A power of it.}
params:
  power: {default: 1, min: 1, max: 9, role: define, doc: Which.}
  gain: {default: 1.0, min: 0, max: 9, doc: Then.}
---*/
uniform sampler2D source;
uniform float gain;
out vec4 color;
void main() {
    vec4 seen = texelFetch(source, ivec2(gl_FragCoord.xy), 0);
    color = gain * pow(seen, vec4(float(POWER)));
#if POWER == 9
    color = vec4(nonsense);
#endif
}
"""
FILE = """rendergraph: 1
size: [16, 9]
nodes:
  make: {type: ./make.frag}
  bend: {type: ./bend.frag, inputs: {source: make.color}}
outputs: {radiance: bend.color}
"""
AXES: Mapping[str, list[float]] = {
    "make.wave": list(range(1, 5)),
    "bend.power": [1, 2, 3, 4],
    "bend.gain": [0.5, 1, 2, 3],
}
FEW: Mapping[str, list[float]] = {"make.wave": [1, 2, 3], "bend.power": [1, 2]}


@pytest.fixture
def base(tmp_path: Path) -> rg.Pipeline:
    for name, text in (("make.frag", MAKE), ("bend.frag", BEND), ("p.yaml", FILE)):
        (tmp_path / name).write_text(text)
    return rg.load(tmp_path / "p.yaml")


def rows(folder: Path) -> dict[str, dict[str, Any]]:
    """Each run's row, without what is measured in seconds and where."""
    measured = ("frame_ms", "gpu_ms", "cpu_ms", "passes", "repeats", "machine", "device", "sha256")
    records, torn = read_results(folder)
    assert torn == 0
    found = {record["name"]: {key: value for key, value in record.items() if key not in measured} for record in records}
    assert len(found) == len(records)
    return found


def pictures(folder: Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in folder.glob("*/*.exr")}


@pytest.mark.nightly
def test_64_variants_are_the_same_one_by_one_and_by_processes(
    base: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    here = sweep(base, AXES, tmp_path / "here", frames=1, session=gl)
    told: list[Mapping[str, Any]] = []
    there = sweep(base, AXES, tmp_path / "there", frames=1, executor="processes:2", events=told.append)
    same(here, tmp_path / "here", there, tmp_path / "there")
    assert len(rows(tmp_path / "there")) == 64
    # The first run is drawn alone, before all others, whose passes it would share; that is all that is drawn more.
    assert (here.executed, there.executed) == (4 * (1 + 16), 4 * (1 + 16) + 1)
    assert {event["worker"] for event in told} == {"process-0", "process-1"}
    assert [event["done"] for event in told if event["event"] == "run"] == list(range(1, 65))
    last = [event for event in told if event["event"] == "run"][-1]
    assert (last["of"], last["seconds_left"], last["failed"]) == (64, 0.0, False)


def same(one: Sweep, first: Path, other: Sweep, second: Path) -> None:
    """Two sweeps have the same results."""
    assert rows(first) == rows(second)
    assert pictures(first) == pictures(second)
    for a, b in zip(one.comparison.results, other.comparison.results, strict=True):
        assert (a.name, a.metrics, a.radiance_rmse) == (b.name, b.metrics, b.radiance_rmse)
        assert a.pixels is not None
        assert b.pixels is not None
        assert a.pixels.tobytes() == b.pixels.tobytes()
        assert (a.flip_map is None) == (b.flip_map is None)
        assert a.flip_map is None or b.flip_map is None or a.flip_map.tobytes() == b.flip_map.tobytes()


def test_a_worker_that_is_killed_costs_nothing_but_time(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    here = sweep(base, FEW, tmp_path / "here", frames=1, session=gl)
    farm = Processes(2)
    killed: list[int] = []

    def kill(event: Mapping[str, Any]) -> None:
        told.append(event["event"])
        if not killed and farm.busy_pids:
            killed.append(farm.busy_pids[0])
            os.kill(killed[0], signal.SIGKILL)

    told: list[str] = []
    with farm:
        there = sweep(base, FEW, tmp_path / "there", frames=1, executor=farm, events=kill)
    assert killed
    assert "lost" in told
    assert there.failures == ()
    same(here, tmp_path / "here", there, tmp_path / "there")


DEADLY = '''"""A node that ends the process that draws it, where that is no test."""

import os
import signal
import sys

from rendergraph.api import Node, Output, Radiance, Steps, define


class Deadly(Node):
    """One colour."""

    color = Output(Radiance, format="rgba16f", clear=0.5, doc="The colour.")
    dose: int = define(default=1, min=1, max=9, doc="Deadly at 3.")

    def record(self, steps: Steps) -> None:
        """Nothing but a clear."""
        if self.dose == 3 and "pytest" not in sys.modules:
            os.kill(os.getpid(), signal.SIGKILL)
        steps.clear(self.color, 0.5)
'''


def test_a_run_that_is_deadly_is_a_row_with_its_reason_and_resume_tries_it_again(
    tmp_path: Path,
) -> None:
    (tmp_path / "plugin").mkdir()
    (tmp_path / "plugin" / "deadly.py").write_text(DEADLY)
    file = tmp_path / "p.yaml"
    file.write_text("rendergraph: 1\nsize: [8, 8]\nnodes: {a: {type: deadly}}\noutputs: {radiance: a.color}\n")
    base, axes, out = rg.load(file, plugins=[tmp_path / "plugin"]), {"a.dose": [1, 2, 3, 4, 5]}, tmp_path / "out"
    found = sweep(base, axes, out, frames=1, executor="processes:2")
    assert [result.name for result in found.comparison.results] == [f"a.dose={dose}" for dose in (1, 2, 4, 5)]
    (failure,) = found.failures
    assert failure.name == "a.dose=3"
    assert "RG640 worker" in failure.text
    assert "SIGKILL" in failure.text
    assert rows(out)["a.dose=3"]["error"] == failure.text


def test_a_value_that_fails_is_a_row_there_as_here(base: rg.Pipeline, tmp_path: Path) -> None:
    found = sweep(base, {"bend.power": [1, 9, 2]}, tmp_path / "out", frames=1, executor="processes:2")
    assert [result.name for result in found.comparison.results] == ["bend.power=1", "bend.power=2"]
    assert "nonsense" in found.failures[0].text


def test_a_file_that_changes_meanwhile_is_told(base: rg.Pipeline, tmp_path: Path) -> None:
    def change(event: Mapping[str, Any]) -> None:  # at once: whoever reads it meanwhile shall not find half of it
        (tmp_path / "new.frag").write_text(MAKE.replace("0.25", "0.5"))
        (tmp_path / "new.frag").replace(tmp_path / "make.frag")

    found = sweep(base, FEW, tmp_path / "out", frames=1, executor="processes:1", events=change)
    assert len(found.comparison.results) == 6  # one group, begun before: what it was planned of was read before, too
    with Processes(2) as farm:
        (tmp_path / "make.frag").write_text(MAKE)
        told = sweep(base.set("bend.gain", 2), FEW, tmp_path / "b", frames=1, executor=farm, events=change)
    assert told.failures
    assert all("RG642" in failure.text and "a file has changed" in failure.text for failure in told.failures)


def test_a_full_disk_keeps_what_is_there(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    """A file that may grow no further is what a disk without room is to whoever writes it."""
    words = ["sweep", "p.yaml", "-x", "make.wave=1:12:1", "-n", "1", "-o", "out", "--executor", "processes:2"]
    ended = subprocess.run(
        [sys.executable, "-m", "rendergraph", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # a module's bytecode may be longer than that
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9000, resource.RLIM_INFINITY)),
    )
    assert ended.returncode == 1, ended.stderr
    assert "RG507 the results cannot be written" in ended.stderr
    records, _ = read_results(tmp_path / "out")
    assert 1 <= len(records) < 12
    again = sweep(
        rg.load(tmp_path / "p.yaml"), ["make.wave=1:12:1"], tmp_path / "out", frames=1, resume=True, session=gl
    )
    assert (again.resumed >= len(records), len(again.comparison.results)) == (True, 12)
    assert len({record["key"] for record in read_results(tmp_path / "out")[0]}) == 12


def test_pipelines_are_compared_elsewhere_as_here(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    others = [base, base.set("bend.power", 2), base.set("make.wave", 3)]
    truth = base.set("bend.gain", 2)
    for reference in (None, truth):
        here = compare(others, reference, frames=2, session=gl)
        there = compare(others, reference, frames=2, executor="processes:2")
        measured = {"frame_ms", "gpu_ms", "cpu_ms", "passes", "repeats"}
        told = [
            [{key: value for key, value in each.as_json().items() if key not in measured} for each in found.results]
            for found in (here, there)
        ]
        assert told[0] == told[1]
        assert there.results[2].first is not None
        assert there.results[2].first.node == "make"
        assert here.reference.as_json() == there.reference.as_json()
        assert [result.times.frames for result in there.results] == [2, 2, 2]
        assert there.device["renderer"] == here.device["renderer"]


def test_node_classes_at_hand_are_drawn_here_alone(make: Any, tmp_path: Path) -> None:
    pattern = make({"a": {"type": "pattern", "params": {}}}, "a.color")
    axes = {"a.seed": [1.0, 2.0]}
    assert len(sweep(pattern, axes, tmp_path / "a", frames=1).comparison.results) == 2
    with pytest.raises(UsageError, match="RG641 in-memory node classes cannot be sent"):
        sweep(pattern, axes, tmp_path / "b", frames=1, executor="processes:2")


def test_two_sweeps_do_not_share_a_folder_whoever_draws(base: rg.Pipeline, tmp_path: Path) -> None:
    def second(event: Mapping[str, Any]) -> None:
        with pytest.raises(InputError, match=r"RG504 .*another sweep is running in it"):
            sweep(base, FEW, tmp_path / "out", frames=1, executor="processes:2", resume=True)
        seen.append(json.dumps(event))

    seen: list[str] = []
    sweep(base, {"bend.power": [1, 2]}, tmp_path / "out", frames=1, executor="processes:1", events=second)
    assert seen


# --- Dask ------------------------------------------------------------------------------------------------------------


class Cluster:
    """A scheduler and workers on the loopback, each a process that stands in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.workers = folder, dict[str, subprocess.Popen[bytes]]()
        with socket.socket() as found:
            found.bind(("127.0.0.1", 0))
            self.address = f"127.0.0.1:{found.getsockname()[1]}"
        self.scheduler = self._start_scheduler()

    def _start_scheduler(self) -> subprocess.Popen[bytes]:
        port = self.address.partition(":")[2]
        return self.start("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")

    def repair(self) -> None:
        """Start what a test has killed, and end what it has added: a scheduler and workers `a` and `b`."""
        lost = self.scheduler.poll() is not None
        for name, worker in list(self.workers.items()):
            if lost or name not in ("a", "b") or worker.poll() is not None:
                worker.kill()
                worker.wait()
                del self.workers[name]
        if lost:
            self.scheduler = self._start_scheduler()
        for name in {"a", "b"} - self.workers.keys():
            self.worker(name)

    def start(self, what: str, *words: str) -> subprocess.Popen[bytes]:
        own = Path(tempfile.mkdtemp(dir=self.folder))
        program = "import sys; from distributed.cli import dask_" + what + " as it; it.main()"
        settings = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
        return subprocess.Popen(
            [sys.executable, "-c", program, *words],
            cwd=own,
            env=os.environ | settings,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def worker(self, name: str) -> None:
        flags = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory", str(self.folder / name))
        self.workers[name] = self.start("worker", self.address, "--name", name, *flags)

    def client(self, workers: int) -> Any:
        found = distributed.Client(f"tcp://{self.address}", timeout=60, set_as_default=False)
        found.wait_for_workers(workers, timeout=60)
        return found

    def close(self) -> None:
        for process in (*self.workers.values(), self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with contextlib.closing(Cluster(tmp_path_factory.mktemp("cluster"))) as cluster:
        yield cluster


@pytest.fixture
def cluster(processes: Cluster) -> Cluster:
    """The cluster of the module, with all that a test before has killed."""
    processes.repair()
    return processes


@pytest.mark.nightly
def test_64_variants_are_the_same_by_dask_though_a_worker_is_killed_and_no_disk_is_shared(
    base: rg.Pipeline, gl: rg.Session, cluster: Cluster, tmp_path: Path
) -> None:
    here = sweep(base, AXES, tmp_path / "here", frames=1, session=gl)
    with cluster.client(2) as client:
        told: list[Mapping[str, Any]] = []

        def meanwhile(event: Mapping[str, Any]) -> None:
            if not told:
                (tmp_path / "make.frag").rename(tmp_path / "gone")  # workers have their own
                cluster.workers["a"].kill()
            told.append(event)

        there = sweep(base, AXES, tmp_path / "there", frames=1, executor=client, events=meanwhile)
        assert there.failures == ()
        same(here, tmp_path / "here", there, tmp_path / "there")
        assert len(rows(tmp_path / "there")) == 64
        assert {event["worker"].partition("://")[0] for event in told} <= {"tcp", "cluster"}
        assert client.status == "running"  # it is its owner's
        assert not list(cluster.folder.glob("b/**/make.frag"))  # nor is anything left there


@pytest.mark.nightly
@pytest.mark.parametrize("changed", [False, True])
def test_what_was_lost_with_all_workers_is_sent_to_the_next(
    base: rg.Pipeline, gl: rg.Session, cluster: Cluster, tmp_path: Path, changed: bool
) -> None:
    here = sweep(base, FEW, tmp_path / "here", frames=1, session=gl)
    told: list[str] = []

    def meanwhile(event: Mapping[str, Any]) -> None:
        if not told:
            for name in ("a", "b"):
                cluster.workers[name].kill()
            cluster.worker("c")
            if changed:
                (tmp_path / "make.frag").write_text(MAKE.replace("0.25", "0.5"))
        told.append(event["event"])

    with cluster.client(2) as client:
        if changed:
            with pytest.raises(RenderError, match=r"RG641 .*make.frag' has changed since; finished runs are saved"):
                sweep(base, FEW, tmp_path / "there", frames=1, executor=client, events=meanwhile)
            return
        there = sweep(base, FEW, tmp_path / "there", frames=1, executor=client, events=meanwhile)
    assert "lost" in told
    assert there.failures == ()
    same(here, tmp_path / "here", there, tmp_path / "there")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("error", [OSError("closed"), KeyError("tcp://10.0.0.1:1"), ValueError("no replicas")])
def test_what_a_worker_does_not_get_as_it_goes_is_sent_to_others(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """What Dask's scheduler says where a worker goes before, while and after it is sent something."""
    sent: list[Any] = []

    def scatter(client: Any, named: Any, **words: Any) -> Any:
        sent.append(named)
        if len(sent) == 1:
            raise error
        return scattered(client, named, **words)

    scattered = distributed.Client.scatter
    monkeypatch.setattr(distributed.Client, "scatter", scatter)
    with dask_cluster.start_local_cluster(1, (), timeout=60.0) as farm:
        farm.put("what is needed")
    assert len(sent) == 2
    assert sent[0] == sent[1]


def test_what_dask_logs_after_the_end_of_its_cluster_is_not_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    printed = io.StringIO()
    monkeypatch.setattr(logging.getLogger("distributed"), "handlers", [logging.StreamHandler(printed)])
    with dask_cluster.start_local_cluster(1, (), timeout=60.0):
        pass
    logging.getLogger("distributed.batched").error("Batched Comm Closed")
    assert printed.getvalue() == ""


HALO = '''"""A node of an installed plugin."""

from rendergraph.api import Node, Output, Radiance, Steps, param


class Halo(Node):
    """One colour."""

    color = Output(Radiance, format="rgba16f", doc="The colour.")
    much: float = param(default=1.0, min=0, max=9, doc="How much.")

    def record(self, steps: Steps) -> None:
        """A clear."""
        steps.clear(self.color, self.much)
'''


@pytest.mark.nightly
def test_a_plugin_that_a_worker_lacks_is_told_before_anything_runs_and_a_lost_scheduler_keeps_what_is_there(
    base: rg.Pipeline, cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with cluster.client(2) as client:
        installed = tmp_path / "installed"
        (installed / "halo_nodes").mkdir(parents=True)
        (installed / "halo_nodes" / "__init__.py").write_text("")
        (installed / "halo_nodes" / "halo.py").write_text(HALO)
        (installed / "halo-1.5.dist-info").mkdir()
        for name, text in {
            "METADATA": "Metadata-Version: 2.1\nName: halo\nVersion: 1.5\n",
            "entry_points.txt": "[rendergraph.nodes]\nhalo = halo_nodes\n",
            "top_level.txt": "halo_nodes\n",
            "RECORD": "halo_nodes/__init__.py,,\nhalo_nodes/halo.py,,\n",
        }.items():
            (installed / "halo-1.5.dist-info" / name).write_text(text)
        with monkeypatch.context() as patched:
            patched.syspath_prepend(str(installed))
            (tmp_path / "h.yaml").write_text(
                "rendergraph: 1\nsize: [8, 8]\nnodes: {a: {type: halo}}\noutputs: {radiance: a.color}\n"
            )
            with pytest.raises(InputError, match=r"RG642 worker 'tcp://.*' lacks the plugin 'halo'; .*halo==1.5"):
                sweep(rg.load(tmp_path / "h.yaml"), {"a.much": [1, 2]}, tmp_path / "h", frames=1, executor=client)
            assert not list((tmp_path / "h").glob("*/*"))
    killed: list[str] = []

    def kill(event: Mapping[str, Any]) -> None:
        if not killed and event["event"] == "finished":
            killed.append(event["task"])
            cluster.scheduler.kill()

    out = tmp_path / "out"
    monkeypatch.setattr("rendergraph.farm.dask_cluster.CONNECT_SECONDS", 2.0)
    with pytest.raises(RenderError, match=r"RG641 the Dask scheduler is gone; finished runs are saved"):
        sweep(base, AXES, out, frames=1, executor=f"dask://{cluster.address}", events=kill)
    there = len(rows(out))
    assert 1 <= there < 64
    again = sweep(base, AXES, out, frames=1, resume=True)
    assert (again.resumed, len(rows(out))) == (there, 64)
    with pytest.raises(RenderError, match=rf"RG641 no Dask scheduler answers at {cluster.address}"):
        sweep(base, FEW, tmp_path / "none", frames=1, executor=f"dask://{cluster.address}")


def test_dask_starts_a_cluster_of_its_own(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    here = sweep(base, FEW, tmp_path / "here", frames=1, session=gl)
    there = sweep(base, FEW, tmp_path / "there", frames=1, executor="dask:2")
    same(here, tmp_path / "here", there, tmp_path / "there")
