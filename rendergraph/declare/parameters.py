"""Parameters: annotated fields of a node with unit, default, range and one line of doc."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin

from pydantic import Field
from pydantic.fields import FieldInfo


def _parameter(
    role: str, default: Any, unit: str, doc: str, min: float | None, max: float | None, extra: dict[str, Any]
) -> Any:
    limits = {key: value for key, value in (("minimum", min), ("maximum", max)) if value is not None}
    return Field(default=default, description=doc, json_schema_extra={"role": role, "unit": unit} | limits | extra)


def param(
    *, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None, glsl: str = ""
) -> Any:
    """A parameter that becomes a uniform: changing it rebuilds nothing.

    Args:
        default: value where the file gives none.
        doc: one line.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal value, inclusive.
        glsl: the uniform's type where it is not what the annotation says (`vec3` for a number or a colour).
    """
    return _parameter("param", default, unit, doc, min, max, {"glsl": glsl} if glsl else {})


def define(
    *,
    default: Any,
    doc: str,
    unit: str = "",
    min: float | None = None,
    max: float | None = None,
    choices: str = "",
    needs: tuple[str, ...] = (),
) -> Any:
    """A parameter that becomes program text: `#define NAME value`, and `#define NAME_CHOICE` for a choice.

    Numbers and switches become `#define SAMPLES 16`; a choice `curve: aces` becomes `#define CURVE CURVE_ACES`, where
    every choice has a number, so that shaders say `#if CURVE == CURVE_ACES`.

    Args:
        default: value where the file gives none.
        doc: one line.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal value, inclusive.
        choices: the name under which plugins add choices, for a type such as `Literal["neutral", "aces"] | str`. The
            shader takes a plugin's choice in by `#include <CURVE>`, which is empty where the choice is the node's own.
        needs: what such a choice may say that it needs, which others do without: `NEEDS_…` in the shader,
            `steps.needs(…)` in `record`.
    """
    extra = {"choices": choices, "needs": list(needs)} if choices else {}
    return _parameter("define", default, unit, doc, min, max, extra)


def structural(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """A parameter that is part of the plan: a resolution, a light's name."""
    return _parameter("structural", default, unit, doc, min, max, {})


def open_name(info: FieldInfo) -> str:
    """The name under which plugins add choices to a parameter, empty where they cannot."""
    extra = info.json_schema_extra
    return str(extra.get("choices", "")) if isinstance(extra, Mapping) else ""


def own_choices(annotation: Any) -> tuple[str, ...]:
    """The words that a parameter's type lists."""
    if get_origin(annotation) is Literal:
        return tuple(choice for choice in get_args(annotation) if isinstance(choice, str))
    return tuple(choice for part in get_args(annotation) for choice in own_choices(part))


def closed(info: FieldInfo, more: tuple[str, ...] = ()) -> Any:
    """A parameter's type; with what plugins add as the only other words where they can."""
    if not open_name(info):
        return info.annotation
    return Literal[(*own_choices(info.annotation), *more)]
