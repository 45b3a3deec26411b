"""Fixtures for every test."""

from __future__ import annotations

import gc
import importlib.util
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from textwrap import dedent, indent
from typing import Any, ClassVar

import pytest

import rendergraph as rg
from rendergraph.api import Node
from rendergraph.catalog import Catalog
from rendergraph.errors import RendergraphError
from rendergraph.session import gpu
from rendergraph.session.gpu import Gpu
from rendergraph.session.gpu_cache import GpuCache

HEAD = '''"""A node of a stranger's."""

from __future__ import annotations

from typing import Literal

import numpy

from rendergraph.api import *
from rendergraph.api import Any as AnyTexel


'''
PIPELINE = "nodes:\n  a: {type: wrong}\noutputs: {image: a.color}\n"
WHITE = "out vec4 color;\nvoid main() { color = vec4(1.0); }\n"

# A process keeps thousands of tests alive, and visiting them takes a twentieth of the time.
gc.set_threshold(20_000, 20, 100)

# All processes of the tests share one cache, which is not the user's.
os.environ.setdefault("RENDERGRAPH_CACHE", str(Path(__file__).parents[1] / ".cache" / "rendergraph"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--nightly", action="store_true", help="run only the tests that are slow by nature")


SPREAD = {"test_docs", "test_registry", "test_modes", "test_cli_real"}
"""Files with long tests that share nothing: with `--dist loadgroup` any process may run them, and they come last."""


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Run tests marked `nightly` with `--nightly`, all others without, those that share fixtures in one process.

    `nightly(keep=2)` on a parametrised test leaves two of its cases in `make check`, spread over all of them.
    """
    for item in items:
        fixtures = set(getattr(item, "fixturenames", ()))
        shared = "page" if fixtures & {"browser", "served"} else "generated" if "generated" in fixtures else ""
        if shared or item.path.stem not in SPREAD:
            item.add_marker(pytest.mark.xdist_group(shared or item.path.stem))
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    nightly: set[pytest.Item] = set()
    for family in cases.values():
        mark = family[0].get_closest_marker("nightly")
        keep = mark.kwargs.get("keep", 0) if mark else 0
        stride = len(family) // keep + 1 if keep else 0  # on a grid of two parameters this walks along the diagonal
        kept = {family[number * stride % len(family)] for number in range(keep)}
        nightly.update(item for item in family if item.get_closest_marker("nightly") and item not in kept)
    wanted = bool(config.getoption("--nightly"))
    config.hook.pytest_deselected(items=[item for item in items if (item in nightly) != wanted])
    items[:] = [item for item in items if (item in nightly) == wanted]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data and assets beside the project; tests that need it skip where it is missing."""
    folder = Path(os.environ.get("RENDERGRAPH_SHARED", Path(__file__).parents[2] / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip("no shared reference data beside the project")
    return folder


@pytest.fixture(scope="session", autouse=True)
def made_pictures() -> Iterator[None]:
    """Keep pictures of skies, as many tests use the same ones and each takes a fifth of a second."""
    from rendergraph.pipelines.environments import sky

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sky, "sky_picture", lru_cache(32)(sky.sky_picture))
        yield


@pytest.fixture(scope="session")
def gl() -> Iterator[rg.Session]:
    """One GL session for all tests."""
    with rg.Session(cache=rg.CacheLimits(programs=128)) as session:
        yield session


@pytest.fixture(scope="session")
def toy_catalog() -> Catalog:
    """The node types of `toys.py`."""
    spec = importlib.util.spec_from_file_location("toys", Path(__file__).parent / "toys.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["toys"] = module
    spec.loader.exec_module(module)
    catalog: Catalog = module.CATALOG
    return catalog


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A Chromium, driven by Playwright; tests that need one skip where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api")
    found = shutil.which("chromium") or shutil.which("chromium-headless-shell")
    if found is None:
        pytest.skip("no Chromium")
    with sync_api.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])
        yield started
        started.close()


class LentGpu(Gpu):
    """What a command line opens in a test: caches of its own, on one context with the programs of earlier tests.

    Compiling them again, though Mesa has them on its disk, takes ten times as long as drawing a small picture.
    """

    lender: ClassVar[Gpu | None] = None

    def __init__(self, device: int | None = None, **options: Any) -> None:
        self.is_lent = device is None and options == {}
        if not self.is_lent:
            super().__init__(device, **options)
            return
        if LentGpu.lender is None or not LentGpu.lender.is_usable:
            LentGpu.lender = Gpu(cache=rg.CacheLimits(programs=192))
        lender = LentGpu.lender
        vars(self).update(vars(lender), cache=GpuCache(lender.device, rg.CacheLimits()))
        for name in ("programs", "_pool", "_generator"):
            setattr(self.cache, name, getattr(lender.cache, name))

    def close(self) -> None:
        if not self.is_lent:
            super().close()
        elif not self._closed:
            self._closed = True
            with self.device.current():
                self.cache.clear_scene()
                self.cache.kept.release()


@pytest.fixture
def lent_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let command lines that run in this process draw on one context."""
    assert issubclass(rg.Session, Gpu)  # it is imported here, before its base class is replaced
    monkeypatch.setattr(gpu, "Gpu", LentGpu)


class Bench:
    """Makes pipelines of node classes and shader texts, and draws them on the shared session."""

    def __init__(self, folder: Path, session: rg.Session) -> None:
        self.folder = folder
        self.session = session

    def pipeline(
        self,
        text: str,
        *classes: type[Node],
        shaders: Mapping[str, str] | None = None,
        scene: str | None = None,
        size: tuple[int, int] = (16, 8),
    ) -> rg.Pipeline:
        """A pipeline of YAML text, with the classes as its only node types."""
        for name, source in (shaders or {}).items():
            (self.folder / name).write_text(source)
        head = f"rendergraph: 1\nsize: [{size[0]}, {size[1]}]\n"
        if scene is not None:
            (self.folder / "scene.yaml").write_text("scene: 1\n" + scene)
            head += "scene: scene.yaml\n"
        (self.folder / "test.yaml").write_text(head + text)
        loaded = rg.load(self.folder / "test.yaml")
        return replace(loaded, catalog=Catalog.of(*classes, shaders=self.folder))

    def draw(self, text: str, *classes: type[Node], **options: Any) -> rg.Frame:
        """Draw it, and give the last frame; options of `pipeline` and of `Session.render` mixed."""
        return self.frames(text, *classes, **options)[-1]

    def frames(self, text: str, *classes: type[Node], **options: Any) -> list[rg.Frame]:
        """Draw it, and give every frame."""
        own = {key: options.pop(key) for key in ("shaders", "scene", "size") if key in options}
        frames = list(self.session.frames(self.pipeline(text, *classes, **own), **options))
        with self.session.current():
            assert self.session.device.raw.error() is None
        return frames


@pytest.fixture
def bench(tmp_path: Path, gl: rg.Session) -> Bench:
    return Bench(tmp_path, gl)


@pytest.fixture
def draw(bench: Bench) -> Callable[..., rg.Frame]:
    return bench.draw


class Author:
    """Writes plugins and uses them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.plugins = folder / "plugins"
        self.plugins.mkdir()

    def write(self, **files: str) -> None:
        """Files of the plugin; `__` stands for the dot."""
        for name, text in files.items():
            (self.plugins / name.replace("__", ".")).write_text(text)

    def node(self, body: str, name: str = "wrong", before: str = "") -> None:
        """A module with one node class of this body."""
        lines = indent(dedent(body).strip("\n"), "    ")
        text = f'{HEAD}{dedent(before)}class {name.title()}(Node):\n    """A node of a stranger\'s."""\n\n{lines}\n'
        self.write(**{f"{name}__py": text})

    def line(self, marker: str = "# here", file: str = "wrong.py") -> int:
        """The line of the plugin's file that holds a marker."""
        lines = (self.plugins / file).read_text().splitlines()
        return next(number for number, line in enumerate(lines, start=1) if marker in line)

    def pipeline(self, text: str = PIPELINE, *, scene: str | None = None, size: str = "[16, 8]") -> rg.Pipeline:
        """A pipeline that uses the plugin."""
        head = f"rendergraph: 1\nsize: {size}\n"
        if scene is not None:
            (self.folder / "scene.yaml").write_text("scene: 1\n" + scene)
            head += "scene: scene.yaml\n"
        (self.folder / "test.yaml").write_text(head + text)
        return rg.load(self.folder / "test.yaml", plugins=[self.plugins])

    def said(self, act: Any) -> list[str]:
        """What is said, without folders: places read `wrong.py:12`."""
        with pytest.raises(RendergraphError) as caught:
            act()
        return [
            str(problem).splitlines()[0].replace(f"{self.plugins}/", "").replace(f"{self.folder}/", "")
            for problem in caught.value.problems
        ]


@pytest.fixture
def author(tmp_path: Path) -> Author:
    made = Author(tmp_path)
    made.write(wrong__frag=WHITE)
    return made


@pytest.fixture
def shaders(tmp_path: Path) -> Path:
    """A folder for an author's shaders, with a shared include folder beside it."""
    (tmp_path / "include").mkdir()
    (tmp_path / "include" / "view.glsl").write_text("struct View { mat4 view; };\n")
    (tmp_path / "include" / "fullscreen.vert").write_text("void main() {}\n")
    (tmp_path / "own").mkdir()
    return tmp_path / "own"
