"""Everything `check-node` looks at, one after the other; runs in the child, and in this project's own tests."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from rendergraph.authoring import declarations
from rendergraph.authoring.report import Report
from rendergraph.authoring.trial import SCENE, Trial
from rendergraph.authoring.variants import variants
from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare.blame import declaration_of
from rendergraph.errors import InputError, Problem, shown_file

Tell = Callable[[str, str], None]
"""Called with the stage, `import` or `pass`, and what is about to be done."""


def examine_file(file: Path, plugins: Sequence[Path], scene: str | None, tell: Tell) -> Report:
    """Find the node of a file and examine it.

    Raises:
        InputError: there is none, or it cannot be loaded.
    """
    tell("import", shown_file(file))
    return examine(find_node(file, plugins), scene or SCENE, tell)


def find_node(file: Path, plugins: Sequence[Path] = ()) -> NodeType:
    """The type that a file makes: one of an installed package, of a plugin's folders, or one by itself.

    Raises:
        InputError: there is none, or it cannot be loaded.
    """
    file = file.resolve()
    catalog = Catalog.discover(plugins)
    if file.stem in catalog:
        found = catalog.get(file.stem)
        if found.file.resolve() == file:
            return found
    named = [*plugins, _plugin_of(file)]
    try:
        return Catalog.discover(named).get(file.stem)
    except InputError as error:
        if any(problem.code != "RG493" for problem in error.problems):
            raise
        return Catalog.discover(named, installed=False).get(file.stem)  # the installed one is an older copy of it


def examine(node: NodeType, scene: str = SCENE, tell: Tell = lambda stage, what: None) -> Report:
    """Examine a type in every variant.

    Raises:
        DeviceError: there is no usable GL device.
    """
    problems = _declared(node)
    with tempfile.TemporaryDirectory() as folder:
        tell("pass", "default")
        trial = Trial(node, Path(folder), scene)
        trial.check_scene()
        for variant in variants(node.cls):
            tell("pass", variant.name or "default")
            trial.run(variant)
        problems += _drawn(node, trial.close())
    if trial.tried and not any(
        problem.severity == "error" for problem in problems
    ):  # what is not drawn looks at nothing
        for name in declarations.unused(node, trial.seen, trial.files):
            text = f"'{name}' is declared, but no program looks at it: none uses it, or it changes nothing"
            problems.append(Problem("RG455", text, declaration_of(node.cls, node.file, name), severity=_mild(node)))
    return Report(node.name, tuple(trial.tried), tuple(dict.fromkeys(problems)))


def _declared(node: NodeType) -> list[Problem]:
    """What is wrong with docs and ranges; of a shader file, what it lacks is a warning that its type has already."""
    found = list(node.warnings)
    for mistake in declarations.docs(node.cls) if not node.is_shader else ():
        place = declaration_of(node.cls, node.file, mistake.subject)
        found.append(mistake.relocate(place, context=f"node type '{node.name}'"))
    for name in declarations.ranges(node.cls) if not node.is_shader else ():
        text = f"parameter '{name}' does not say between which values it lies (min, max)"
        found.append(Problem("RG460", text, declaration_of(node.cls, node.file, name), severity="warning"))
    return found


def _drawn(node: NodeType, found: list[Problem]) -> list[Problem]:
    """What drawing has shown, without what a warning about discarded fragments says already."""
    if not any(problem.code == "RG446" for problem in node.warnings):
        return found
    return [problem for problem in found if problem.code != "RG454"]


def _mild(node: NodeType) -> Literal["error", "warning"]:
    return "warning" if node.is_shader else "error"


def _plugin_of(file: Path) -> Path:
    """What `--plugin` would name: the folder above `nodes/` and `shaders/` where a file lies in them, else the file."""
    for folder in file.parents:
        if folder.name == "nodes" and (folder.parent / "shaders").is_dir():
            return folder.parent
    return file
