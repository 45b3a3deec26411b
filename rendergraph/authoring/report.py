"""What a check finds."""

from __future__ import annotations

from dataclasses import dataclass

from rendergraph.errors import Problem


@dataclass(frozen=True)
class Report:
    """What was found.

    Attributes:
        node: the type's name.
        variants: what was drawn, in order.
        problems: mistakes and warnings.
    """

    node: str
    variants: tuple[str, ...]
    problems: tuple[Problem, ...]

    @property
    def mistakes(self) -> tuple[Problem, ...]:
        """The problems that are no warnings."""
        return tuple(problem for problem in self.problems if problem.severity == "error")
