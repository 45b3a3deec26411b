"""Driver messages that name the author's file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping

from rendergraph.errors import Problem
from rendergraph.glsl import Origin, SourceText
from rendergraph.program.text import StageText

_FORMS = (
    re.compile(
        r"\s*\d+:(?P<line>\d+)\((?P<column>\d+)\):\s*(?P<kind>(?:preprocessor )?error|warning)\s*:\s*(?P<text>.*)"
    ),
    re.compile(r"\s*\d+\((?P<line>\d+)\)\s*:\s*(?P<kind>(?:fatal )?error|warning)\s+(?:[A-Z]\d+\s*)?:\s*(?P<text>.*)"),
    re.compile(r"\s*(?P<kind>ERROR|WARNING):\s*\d+:(?P<line>\d+):\s*(?P<text>.*)"),
)


def compile_problems(message: str, text: StageText) -> list[Problem]:
    """What a driver says of one stage, at the places the author knows.

    Understands the forms of Mesa (`0:12(5): error: …`), NVIDIA (`0(12) : error C1008: …`) and of AMD, Intel and glslang
    (`ERROR: 0:12: …`). Warnings are left out where there are errors. A message that names no line becomes one problem.
    """
    found: list[Problem] = []
    for row in message.splitlines():
        match = next((match for form in _FORMS if (match := form.match(row))), None)
        if match is None:
            continue
        severity = "warning" if "warning" in match["kind"].lower() else "error"
        column = int(match.groupdict().get("column") or 1)
        found.append(_problem(match["text"].strip(), int(match["line"]), column, severity, text))
    errors = [problem for problem in found if problem.severity == "error"]
    if errors or found:
        return list(dict.fromkeys(errors or found))
    where = _first_place(text.source)
    plain = " ".join(message.split()) or "the driver refused the shader and did not say why"
    return [Problem("RG410", f"{text.stage} shader: {plain}", where.place() if where else None)]


def link_problems(message: str, texts: Mapping[str, StageText]) -> list[Problem]:
    """What a driver says when stages do not fit together; it names no line, so the last stage's file stands for it."""
    last = list(texts.values())[-1]
    where = _first_place(last.source)
    rows = [row.strip() for row in message.splitlines() if row.strip()]
    text = re.sub(r"^error:\s*", "", "; ".join(rows)) or "the driver refused the program and did not say why"
    return [Problem("RG411", f"the stages {', '.join(texts)} do not link: {text}", where.place() if where else None)]


def _problem(text: str, line: int, column: int, severity: str, stage: StageText) -> Problem:
    rows = stage.source
    if not 1 <= line <= len(rows.lines):
        return Problem("RG410", f"{stage.stage} shader: {text}", severity=severity)  # type: ignore[arg-type]
    origin = rows.origins[line - 1]
    shown_line = rows.lines[line - 1]
    if origin.prefix:
        text = text.replace(origin.prefix, "")
        column = len(shown_line[: column - 1].replace(origin.prefix, "")) + 1
        shown_line = shown_line.replace(origin.prefix, "")
    if origin.file is None:
        text += f" (in generated text: {shown_line.strip()})"
        near = _nearest_author(rows, line - 1)
        place = near.place() if near else None
        return Problem("RG410", f"{stage.stage} shader: {text}", place, severity=severity)  # type: ignore[arg-type]
    return Problem("RG410", f"{stage.stage} shader: {text}", origin.place(column), shown_line, severity)  # type: ignore[arg-type]


def _first_place(source: SourceText) -> Origin | None:
    """The first line of the author's own file, which stands last in the text."""
    last = next((origin for origin in reversed(source.origins) if origin.file is not None), None)
    return Origin(last.file, 1) if last else None


def _nearest_author(source: SourceText, position: int) -> Origin | None:
    return next((origin for origin in source.origins[position:] if origin.file is not None), None)
