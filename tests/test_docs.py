"""The documentation says what is true: every block of code in it is checked or run, every generated page is there.

The blocks of a page run in order in one empty folder. A block whose first line is a comment with a file's name
(`# a.yaml`, `// effects/a.frag`) is written there. YAML that is a pipeline or a scene must pass `check`; of `console` blocks
every `rendergraph` line is run, small, and the lines under it are compared with what it prints, where `…` stands for
anything.
"""

from __future__ import annotations

import importlib
import inspect
import re
import shlex
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rendergraph as rg
from rendergraph.cli.app import VERBS, group, main
from rendergraph.compare import truth
from rendergraph.images.cache import DiskCache
from rendergraph.link import endpoint
from rendergraph.resources import shipped_pipelines

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(page for page in DOCS.rglob("*.md") if "generated" not in page.parts)]
SMALL = {  # added to what draws: of options given twice the last one counts
    "run": ["--size", "48x27"],
    "bench": ["--size", "48x27", "-n", "2"],
    "compare": ["--size", "48x27", "-n", "1"],
    "sweep": ["--size", "48x27", "-n", "1"],
}
NOT_RUN = ("apt-get ", "python3 -m venv ")


@dataclass(frozen=True)
class Block:
    """One fenced block."""

    line: int
    language: str
    text: str

    @property
    def file(self) -> str | None:
        """The name in the first line's comment."""
        found = re.match(r"(?:#|//) ((?:[\w-]+/)*[\w.-]+\.\w+)\n", self.text)
        return found[1] if found else None


def blocks(page: Path) -> Iterator[Block]:
    """All fenced blocks, those in items of lists without their indentation."""
    text = page.read_text(encoding="utf-8")
    for found in re.finditer(r"^( *)(`{3,})(\w+)\n(.*?)^\1\2$", text, re.MULTILINE | re.DOTALL):
        yield Block(text.count("\n", 0, found.start()) + 1, found[3], textwrap.dedent(found[4]))


def commands_in_the_text(page: Path) -> list[str]:
    """`rendergraph …` between backticks, those with words of their own; what stands in blocks is run."""
    text = re.sub(r"^( *`{3,}).*?^\1$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    found = [" ".join(words.split()) for words in re.findall(r"`(rendergraph [^`]+)`", text)]
    return [command for command in dict.fromkeys(found) if " " in command.removeprefix("rendergraph ")]


@pytest.mark.parametrize(
    ("page", "command"),
    [(page, command) for page in PAGES for command in commands_in_the_text(page) if "…" not in command],
    ids=lambda value: value if isinstance(value, str) else str(value.relative_to(ROOT)),
)
def test_a_command_in_the_text_is_one(page: Path, command: str) -> None:
    """Its options are there, and what is shipped takes its settings, changes by all of them, and has what it taps."""
    verb, *words = shlex.split(command)[1:]
    with group.make_context("rendergraph", [verb, *words]) as context:
        found = group.get_command(context, verb)
        assert found is not None
        asked = found.make_context(verb, words, parent=context).params
    if verb not in ("run", "compare", "bench", "plan", "view"):
        return
    for pipeline in set(shipped_pipelines()) & {asked.get("pipeline"), *asked.get("pipelines", ())}:
        for more in asked.get("withs") or [()]:
            sets = [*asked["sets"], *more]
            linked = rg.load(pipeline, scene=asked["scene"], environment=asked["environment"], sets=sets).link()
            assert not linked.graph.warnings
            for tap in asked.get("taps", ()):
                endpoint(linked.graph, tap.name)


LONG_PAGES = {
    "compare",
    "compute-node",
    "continuous-integration",
    "forward-prepass",
    "geometry-node",
    "gpu-data",
    "ground",
    "hybrid",
    "laptop-to-cluster",
    "light-parts",
    "own-data",
    "path-traced",
    "python",
    "scenes",
    "test-a-node",
    "view",
}
"""Pages whose commands take 3 seconds or more; README.md, the longest, and the first pages of the guide stay in `make check`."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[pytest.mark.nightly] if page.stem in LONG_PAGES else []) for page in PAGES],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_blocks_of_a_page(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], lent_gpu: None
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RENDERGRAPH_TRACEBACK", "1")
    monkeypatch.setattr(truth, "_CACHE", DiskCache(str(tmp_path / "truths"), 1 << 30))  # not that of another page
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.file:
            (tmp_path / block.file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
        if block.language == "console":
            _run_console(block.text, where, capsys)
        elif block.language == "python" and not block.file:
            exec(compile(block.text, where, "exec"), {})
        elif block.language == "yaml":
            _check_yaml(block, where, capsys)
        elif block.language == "toml":
            importlib.import_module("tomllib").loads(block.text)


def _check_yaml(block: Block, where: str, capsys: pytest.CaptureFixture[str]) -> None:
    if any(file.read_text(encoding="utf-8") == block.text for file in (ROOT / "pipelines").glob("*.yaml")):
        return  # a shipped one as it stands, which has tests of its own and may name what lies beside it
    document = yaml.load(block.text, yaml.BaseLoader)
    assert isinstance(document, dict), where
    name = block.file or "block.yaml"
    if name.startswith("broken") or "inputs" in document:  # shown for its mistakes; or no pipeline on its own
        return
    path = Path(name)
    path.write_text(block.text, encoding="utf-8")
    found = [*Path().glob("*.py"), *dict.fromkeys(file.parent for file in Path().glob("*/*.py"))]
    plugins = [word for plugin in found for word in ("--plugin", str(plugin))]
    if "scene" in document and "nodes" not in document and "extends" not in document:
        words = ["check", "forward", "--scene", name]
    elif "extends" in document or "outputs" in document:
        words = ["check", name, *plugins]
    elif "nodes" in document:  # a patch
        words = ["check", "forward", "-p", name]
    else:
        return
    code = main(words)
    assert code == 0, f"{where}: {capsys.readouterr().err}"


def _run_console(text: str, where: str, capsys: pytest.CaptureFixture[str]) -> None:
    commands = re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE)
    assert commands, f"{where}: a console block without a line that starts with '$ '"
    for command, shown in commands:
        if command.startswith(NOT_RUN):
            continue
        words = shlex.split(command)
        assert words[0] == "rendergraph", f"{where}: what is '{words[0]}'?"
        capsys.readouterr()
        drawn = words[1] in SMALL and not words[2].endswith(".png") and "--list" not in words
        code = main([*words[1:], *(SMALL[words[1]] if drawn else [])])
        out, err = capsys.readouterr()
        expected = shown.strip()
        fails = re.search(r"\bRG(?:\d|…)", expected) is not None
        assert (code == 3) if fails else (code == 0), f"{where}: {command}\n{err}"
        if expected:
            pattern = ".*".join(re.escape(part) for part in re.split(r"\s*…\s*", expected))
            printed = (err if fails else out).strip()
            assert re.fullmatch(pattern, printed, re.DOTALL), f"{where}: {command}\n{printed}"


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["spheres", "stairs"])
def test_lines_of_the_geometry_guide_are_hidden_nowhere_in_sight(
    scene: str, gl: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for block in blocks(DOCS / "guide" / "geometry-node.md"):
        if block.file:
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    solid = "out vec4 radiance;\nvoid main() { radiance = vec4(123.0, 0.0, 0.0, 1.0); }\n"
    (tmp_path / "wireframe.frag").write_text(solid, encoding="utf-8")
    pipeline = rg.load(tmp_path / "wireframe.yaml", plugins=[tmp_path / "wireframe.py"], scene=scene, size=(320, 180))
    frame = pipeline.render(outputs=["radiance"], taps=["light.surface_depth"])
    drawn = frame["radiance"][..., 0] > 100  # of the output: that has the lines in it, too
    seen = frame.arrays["light.surface_depth"][..., 0] > 0
    assert seen.sum() > 1000
    assert (seen & ~drawn).sum() == 0
    assert (drawn & ~seen).sum() == 0


@pytest.mark.parametrize("page", sorted((DOCS / "guide").glob("*.md")), ids=lambda page: page.stem)
def test_what_a_guide_sends_to_the_display_is_what_its_radiance_output_holds(page: Path) -> None:
    for block in blocks(page):
        document: Any = yaml.load(block.text, yaml.BaseLoader) if block.language == "yaml" else None
        match document:
            case {"extends": "forward", "nodes": {"display": {"inputs": {"radiance": shown}}}}:
                told = document.get("outputs", {}).get("radiance")
                assert told == shown or (block.file or "").startswith("broken"), f"{page.name}:{block.line}"


# --- what is generated -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated pages: those that `make pages` wrote, where no source has changed since."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS))
        generator: Any = importlib.import_module("_generate")
        if generator.is_fresh(DOCS / "reference" / "generated"):
            return DOCS / "reference" / "generated"
        folder = tmp_path_factory.mktemp("generated")
        generator.generate(folder, pictures=False)
    return folder


@pytest.mark.slow
def test_a_pipeline_that_looks_like_its_base_is_shown_where_they_differ(
    gl: rg.Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rendergraph.images import read

    monkeypatch.syspath_prepend(str(DOCS))
    pictures: Any = importlib.import_module("_generate.pictures")
    studio = pictures.Studio(tmp_path)
    monkeypatch.setattr(studio, "_session", gl)
    assert studio.draw_difference(rg.load("shadow-pcf"), rg.load("shadow-map"), "map.png") == "map.png"
    shown = read(tmp_path / "map.png")[..., :3].astype(int)
    (width, height), times = pictures.SHOWN, pictures.ENLARGED
    assert shown.shape == (height * times, 2 * width * times + 6, 3)
    assert np.abs(shown[:, : width * times] - shown[:, -width * times :]).mean() > 1
    for base, alike in (("forward", "forward-prepass"), ("forward", "ibl")):  # no difference to see, another scene
        assert studio.draw_difference(rg.load(base), rg.load(alike), "none.png") is None


@pytest.mark.slow
def test_every_node_type_has_its_page(generated: Path) -> None:
    from rendergraph.catalog import Catalog

    for name in Catalog.discover().names():
        page = (generated / "nodes" / f"{name}.md").read_text(encoding="utf-8")
        cls = Catalog.discover().get(name).cls
        for word in [*cls.inputs(), *cls.outputs(), *cls.parameters()]:
            assert f"| `{word}` |" in page, f"{name}: {word}"


@pytest.mark.slow
def test_the_sources_of_a_node_are_on_its_page(generated: Path) -> None:
    page = (generated / "nodes" / "shadow_pcf.md").read_text(encoding="utf-8")
    shown = re.findall(r"<summary><code>(.*?)</code>", page)
    assert shown[0] == "shadow_pcf.py"
    assert {"shadow_pcf.glsl", "map_shadow.glsl", "map_visibility.frag"} <= set(shown)  # own, included, and the base's


@pytest.mark.slow
def test_every_error_code_has_its_page(generated: Path) -> None:
    codes = {file.name.partition("-")[0] for file in (ROOT / "rendergraph" / "errors").glob("RG*.yaml")}
    assert codes == {file.stem for file in (generated / "errors").glob("RG*.md")}


@pytest.mark.slow
def test_every_verb_and_shipped_file_is_listed(generated: Path) -> None:
    verbs = (generated / "cli.md").read_text(encoding="utf-8")
    assert all(f"## {verb}\n" in verbs for verb in VERBS)
    for page, folder in (("pipelines.md", ROOT / "pipelines"), ("shipped-scenes.md", ROOT / "pipelines" / "scenes")):
        text = (generated / page).read_text(encoding="utf-8")
        assert all(f"## {file.stem}\n" in text for file in folder.glob("*.yaml"))


def test_every_function_of_the_shared_includes_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """A comment above it says what it returns; arguments are in the comment, or in the table of common arguments."""
    monkeypatch.syspath_prepend(str(DOCS))
    includes: Any = importlib.import_module("_generate.includes")
    common = {name for names in includes.ARGUMENTS for name in names.split(", ")}
    (_, page), *_ = includes.pages()
    found, missing = 0, []
    for file in sorted((ROOT / "shaders" / "include").glob("*.glsl")):
        assert f"### `<{file.name}>`" in page
        text = file.read_text(encoding="utf-8")
        assert includes.header(text), f"{file.name} does not begin with a comment"
        for one in includes.functions(text):
            found += 1
            assert f"| `{one.declaration}` |" in page
            unknown = [
                name for name in one.arguments if name not in common and not re.search(rf"\b{name}\b", one.comment)
            ]
            missing += [f"{file.name}: {one.declaration}: {unknown}"] if unknown or not one.comment else []
    assert not missing
    assert found > 80
    for file in (ROOT / "shaders" / "include").glob("*/*.glsl"):
        assert f"| `{file.parent.name}/{file.name}` |" in page
        assert includes.header(file.read_text(encoding="utf-8")), f"{file.name} does not begin with a comment"


def test_what_the_page_says_of_a_function_is_in_its_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    includes: Any = importlib.import_module("_generate.includes")
    text = (
        "// Fog.\n#include <view.glsl>\nuniform sampler2D depth;\n\n"
        "// What is left, 0 to 1, of light from a `place`.\n// In metres.\nfloat fog(vec3 place,\n          int n) {\n"
        "#ifdef HAS_HAZE\n    return shadow(n, place, depth_views[0].eye.xyz);\n#endif\n    return 0.0;\n}\n"
        "float later();  // defined by the shader\n"
    )
    fog, later = includes.functions(text)
    assert fog == includes.Function(
        "fog",
        "float fog(vec3 place, int n)",
        ("place", "n"),
        "What is left, 0 to 1, of light from a `place`. In metres.",
        "`shadow()`, `depth_views`, `HAS_HAZE`",
    )
    assert (later.declaration, later.comment) == ("float later()", "defined by the shader")
    assert includes.header(text) == "Fog.\n"


@pytest.mark.parametrize("page", ["docs/how-it-works.md", "CONTRIBUTING.md", "tests/README.md"])
def test_the_files_that_a_page_names_exist(page: str) -> None:
    folders = ("rendergraph", "nodes", "shaders", "tests", "docs")
    files = [str(path) for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".frag")]
    named = re.findall(r"`((?:\w+/)*\w+\.(?:py|frag))`", (ROOT / page).read_text(encoding="utf-8"))
    assert [name for name in named if not any(file.endswith(f"/{name}") for file in files)] == []


def test_every_shipped_pipeline_is_in_the_gallery() -> None:
    pages = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "gallery").glob("*.md"))
    shown = set(re.findall(r"\{literalinclude\} \.\./\.\./pipelines/([\w-]+)\.yaml", pages))
    files = list((ROOT / "pipelines").glob("*.yaml"))
    shown |= {file.stem for file in files if f"```yaml\n{file.read_text(encoding='utf-8')}```\n" in pages}
    assert shown == {file.stem for file in files}  # a forge shows no include: pages may hold the file's own text


LISTS = ("index", "bibliography")
"""Pages of the gallery that show no technique."""


def test_the_gallery_shows_every_page_with_its_picture() -> None:
    grid = (DOCS / "gallery" / "index.md").read_text(encoding="utf-8")
    shown = re.findall(r"\[!\[[^\]]+\]\(\.\./images/([\w.-]+)\)\]\(([\w-]+)\.md\)", grid)
    assert sorted(page for _, page in shown) == sorted(
        page.stem for page in (DOCS / "gallery").glob("*.md") if page.stem not in LISTS
    )
    assert all((DOCS / "images" / picture).is_file() for picture, _ in shown)


def test_every_page_of_the_gallery_has_a_picture() -> None:
    pages = [page for page in (DOCS / "gallery").glob("*.md") if page.stem not in LISTS]
    without = [page.stem for page in pages if "../images/" not in page.read_text(encoding="utf-8")]
    assert not without


def sentences(text: str) -> Iterator[str]:
    """The sentences of a page's prose, with a word in place of each piece of code or formula."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$", "", text, flags=re.S)
    for paragraph in re.split(r"\n\s*\n", text):
        if paragraph.lstrip().startswith(("|", "#", "!")):
            continue
        for item in re.split(r"\n(?=\s*(?:[-*]|\d+\.) )", paragraph):
            plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(item.split()))
            plain = re.sub(r"`[^`]*`|\$[^$]*\$", "Code", plain)
            yield from re.split(r"(?<=[.!?])\s+", plain)


def test_no_sentence_has_more_than_forty_words() -> None:
    long = []
    for page in (*DOCS.rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        if not {"generated", "_build"} & set(page.relative_to(ROOT).parts):
            for sentence in sentences(page.read_text(encoding="utf-8")):
                if len(re.findall(r"[A-Za-z0-9][\w'’.-]*", sentence)) > 40:
                    long.append(f"{page.name}: {sentence}")
    assert not long


def test_every_exercise_has_its_answer() -> None:
    for page in (DOCS / "gallery").glob("*.md"):
        for part in re.findall(r"^## Exercises\n(.*?)(?=^## |\Z)", page.read_text(), re.S | re.M):
            asked = re.split(r"(?m)^(?=\d+\. )", part)[1:]
            assert [item for item in asked if "<summary>Answer</summary>" not in item] == [], page.name


def test_folded_text_stands_between_blank_lines() -> None:
    """Without them it is HTML to a reader of Markdown, who then sees the source of formulas, links and code."""
    for page in PAGES:
        for folded in re.findall(r"<details>.*?</details>", page.read_text(encoding="utf-8"), re.S):
            assert re.search(r"</summary>\n\n(.*\S)\n\n *</details>$", folded, re.S), f"{page.name}: {folded}"


def test_names_for_node_authors_are_all_documented(generated: Path) -> None:
    import rendergraph.api

    text = (generated / "node-api.md").read_text(encoding="utf-8")
    names = [name for name, value in vars(rendergraph.api).items() if name[0] != "_" and not inspect.ismodule(value)]
    missing = [name for name in names if f"## {name}\n" not in text and f"| `{name}` |" not in text]
    assert not missing


# --- the README ------------------------------------------------------------------------------------------------------


def test_the_picture_is_what_the_file_draws(gl: Any, tmp_path: Path) -> None:
    import rendergraph as rg
    from rendergraph.images import read

    text = next(block.text for block in blocks(ROOT / "README.md") if block.file == "study.yaml")
    (tmp_path / "study.yaml").write_text(text, encoding="utf-8")
    drawn = gl.render(rg.load(tmp_path / "study.yaml"), outputs=["image"])["image"][..., :3]
    shown = read(DOCS / "images" / "study.png")[..., :3]
    assert shown.shape == drawn.shape
    difference = np.abs(np.asarray(drawn, np.float64) - shown)
    assert difference.mean() < 1.0, "render README's study.yaml again: docs/images/study.png"


@pytest.mark.slow
def test_the_comparison_is_what_the_files_give(gl: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The table's figures but for times, which are a machine's, and the pictures beside it."""
    from rendergraph.images import read

    monkeypatch.syspath_prepend(DOCS)
    made: Any = importlib.import_module("_generate.comparison")
    found = made.readme_comparison(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for result in found.results:
        row = re.search(rf"^{result.name} +(.*)$", text, re.MULTILINE)
        assert row is not None, f"README's table lacks {result.name}"
        flip, rmse, relative, psnr, ssim, *_, passes, size, unit = row[1].split()
        m = result.metrics
        for shown, value in ((flip, m.flip), (rmse, m.rmse), (ssim, m.ssim)):
            assert float(shown) == pytest.approx(value, abs=5e-4)
        assert float(relative) == pytest.approx(result.relative_mse, rel=0.05, abs=1e-6)
        assert psnr == "∞" if m.psnr is None else float(psnr) == pytest.approx(m.psnr, abs=0.2)
        assert int(passes) == result.pass_count
        assert unit == "MiB"
        assert float(size) == pytest.approx(float(str(result.memory["allocated_bytes"])) / (1 << 20), abs=0.06)
    difference = np.abs(made.side_by_side(found).astype(np.float64) - read(made.PICTURE)[..., :3])
    assert difference.mean() < 1.0, "make pictures ONLY=comparison"
