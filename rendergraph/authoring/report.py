"""The result of a check, for the process that runs it and for its parent."""

from __future__ import annotations

from dataclasses import dataclass

from rendergraph.errors import Problem


@dataclass(frozen=True)
class Report:
    """The result of a check: the type's name, the rendered variants in order, mistakes and warnings."""

    node: str
    variants: tuple[str, ...]
    problems: tuple[Problem, ...]

    @property
    def mistakes(self) -> tuple[Problem, ...]:
        return tuple(problem for problem in self.problems if problem.severity == "error")
