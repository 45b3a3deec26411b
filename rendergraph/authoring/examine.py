"""Everything that `check-node` examines: declarations without GL, then every variant with it.

Runs in the child process of a check, and in this project's own tests.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from types import FunctionType, MethodType
from typing import Literal

from msgspec.structs import asdict

from rendergraph.authoring.harness import NodeVariant, Report, variants
from rendergraph.authoring.node_check import SCENE, NodeCheck
from rendergraph.catalog import Catalog, NodeType
from rendergraph.catalog.types import shared_includes
from rendergraph.declare import Input, Node
from rendergraph.declare.blame import declaration_of
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.glsl import Includes, read_text, strip_comments

LONGEST_DOC = 160
OnStage = Callable[[str, str], None]
"""Called with the stage, `import` or `pass`, and the file or variant that comes next."""


def examine_file(file: Path, plugins: Sequence[Path], scene: str | None, on_stage: OnStage) -> Report:
    on_stage("import", shown_file(file))
    return examine(find_node(file, plugins), scene or SCENE, on_stage)


def find_node(file: Path, plugins: Sequence[Path] = ()) -> NodeType:
    """Return the type that a file defines, as part of an installed package or of a plugin's folders, or alone."""
    file = file.resolve()
    catalog = Catalog.discover(plugins)
    if file.stem in catalog and (found := catalog.get(file.stem)).file.resolve() == file:
        return found
    named = [*plugins, _plugin_of(file)]
    try:
        return Catalog.discover(named).get(file.stem)
    except InputError as error:
        if any(problem.code != "RG493" for problem in error.problems):
            raise
        return Catalog.discover(named, installed=False).get(file.stem)  # the installed copy is older


def _plugin_of(file: Path) -> Path:
    """Return the path for `--plugin`: the folder above `nodes/` and `shaders/`, or else the file."""
    plugins = (folder.parent for folder in file.parents if folder.name == "nodes")
    return next((plugin for plugin in plugins if (plugin / "shaders").is_dir()), file)


def examine(
    node: NodeType,
    scene: str = SCENE,
    on_stage: OnStage = lambda stage, what: None,
    renders: Callable[[NodeVariant], bool] = lambda variant: True,
) -> Report:
    severity: Literal["error", "warning"] = "warning" if node.is_shader else "error"
    problems = [*node.warnings, *_declared(node)]
    with tempfile.TemporaryDirectory() as folder:
        on_stage("pass", "default")
        check = NodeCheck(node, Path(folder), scene)
        check.check_scene()
        for variant in variants(node.cls):
            on_stage("pass", variant.name or "default")
            check.run(variant, renders(variant))
        discards = any(problem.code == "RG446" for problem in node.warnings)  # RG446 reports the same as RG454
        problems += [problem for problem in check.close() if not (discards and problem.code == "RG454")]
    if check.tried and not any(problem.severity == "error" for problem in problems):  # otherwise nothing may have run
        for name in _unused(node, check.active, check.files):
            text = f"'{name}' is declared, but no shader program uses it, or it has no effect there"
            problems.append(Problem("RG455", text, declaration_of(node.cls, node.file, name), severity=severity))
        for ((file, line), name), used in check.keywords.items():
            if not used:
                text = f"the step is given {name}=…, but no program of it uses '{name}', or it has no effect there"
                problems.append(Problem("RG455", text, Place(shown_file(file), line, 1), severity="warning"))
    return Report(node.name, tuple(check.tried), tuple(dict.fromkeys(problems)))


def _declared(node: NodeType) -> Iterator[Problem]:
    if node.is_shader:
        return
    for problem in doc_problems(node.cls):
        place = declaration_of(node.cls, node.file, problem.subject)
        yield problem.relocate(place, context=f"node type '{node.name}'")
    for name, parameter in node.cls.parameters().items():
        if parameter.type in (int, float) and None in (parameter.limits.low, parameter.limits.high):
            text = f"parameter '{name}' has no range; declare min and max"
            yield Problem("RG460", text, declaration_of(node.cls, node.file, name), severity="warning")


def doc_problems(cls: type[Node]) -> Iterator[Problem]:
    """Yield mistakes in the docs of a class, its ports and parameters: each must be one line that ends in '.'."""
    first = (cls.__doc__ or "").strip().partition("\n")[0]
    if not first:
        yield Problem("RG490", "has no docs")
    elif not first.endswith("."):
        yield Problem("RG490", "the first line of its docs must be a sentence that ends in '.'")
    public = cls.inputs().keys() | cls.outputs().keys()
    docs = {name: getattr(port, "doc", "") for name, port in cls.ports().items()}
    docs = {name: doc for name, doc in docs.items() if doc or name in public}
    docs |= {name: parameter.doc for name, parameter in cls.parameters().items()}
    for name, doc in docs.items():
        if not doc:
            yield Problem("RG490", f"'{name}' has no doc", subject=name)
        elif not doc.endswith("."):
            yield Problem("RG490", f"the doc of '{name}' must be a sentence that ends in '.'", subject=name)
        elif len(doc) >= LONGEST_DOC:
            text = f"the doc of '{name}' has {len(doc)} characters; expected less than {LONGEST_DOC}"
            yield Problem("RG490", text, subject=name)


def _unused(node: NodeType, active: Collection[str], files: Iterable[Path]) -> Iterator[str]:
    """Yield inputs and parameters that no program (`active`), no shader file and no Python code uses."""
    text = _python_text(node)
    shaders = "".join(_shader_text(file, node.inherited) for file in files)
    cls = node.cls
    for name, parameter in cls.parameters().items():
        symbol = name.upper() if parameter.role == "define" else name
        in_shader = name in active if parameter.role == "param" else re.search(rf"\b{symbol}(_\w+)?\b", shaders)
        if not in_shader and not re.search(rf"\.{name}\b", text):
            yield name
    for name, port in cls.inputs().items():
        if isinstance(port, Input) and port.kind in ("view", "function"):
            continue
        of_scene = port.kind == "scene" and any(other.startswith("scene_") for other in active)
        in_program = name in active or of_scene or any(re.fullmatch(rf"{name}_\d+", other) for other in active)
        not_sampled = getattr(port, "use", "sample") != "sample" or not isinstance(port, Input)
        if not in_program and not not_sampled and not re.search(rf"\.{name}\b", text):
            yield name


def _shader_text(file: Path, inherited: tuple[Path, ...]) -> str:
    if not file.is_file():
        return ""
    includes = Includes(shared_includes())
    origins = includes.expand(file, root=file.parent, versions=True, inherited=inherited).origins
    files = dict.fromkeys(origin.file for origin in origins if origin.file is not None)
    return "\n".join(strip_comments(read_text(one)) for one in files)  # also for `#include <CURVE>`


def _python_text(node: NodeType) -> str:
    """Return the modules of the node, of those that it extends, and of the rules of its ports."""
    if node.is_shader:
        return ""
    modules = {cls.__module__ for cls in node.cls.__mro__ if issubclass(cls, Node) and cls is not Node}
    values = [value for port in node.cls.ports().values() for value in asdict(port).values()]
    modules |= {rule.__module__ for rule in values if isinstance(rule, FunctionType | MethodType)}
    files = {Path(sys.modules[module].__file__ or "") for module in modules}
    return "".join(file.read_text(encoding="utf-8", errors="replace") for file in files)
