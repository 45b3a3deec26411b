"""Parameters: annotated fields of a node with unit, default, range and one line of doc."""

from __future__ import annotations

from typing import Any

from pydantic import Field


def _parameter(
    role: str, default: Any, unit: str, doc: str, min: float | None, max: float | None, extra: dict[str, Any]
) -> Any:
    limits = {key: value for key, value in (("minimum", min), ("maximum", max)) if value is not None}
    return Field(default=default, description=doc, json_schema_extra={"role": role, "unit": unit} | limits | extra)


def param(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None,
          glsl: str = "") -> Any:  # fmt: skip
    """A parameter that becomes a uniform: changing it rebuilds nothing.

    Args:
        default: value where the file gives none.
        doc: one line.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal value, inclusive.
        glsl: the uniform's type where it is not what the annotation says (`vec3` for a number or a colour).
    """
    return _parameter("param", default, unit, doc, min, max, {"glsl": glsl} if glsl else {})


def define(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """A parameter that becomes program text: `#define NAME value`, and `#define NAME_CHOICE` for a choice.

    Numbers and switches become `#define SAMPLES 16`; a choice `curve: aces` becomes `#define CURVE CURVE_ACES`, where
    every choice has a number, so that shaders say `#if CURVE == CURVE_ACES`.
    """
    return _parameter("define", default, unit, doc, min, max, {})


def structural(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """A parameter that is part of the plan: a resolution, a light's name."""
    return _parameter("structural", default, unit, doc, min, max, {})
