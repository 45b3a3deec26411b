"""Macros of a program's text: those that follow from a step's reads; unused ones are left out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from rendergraph.expand import ViewTable
from rendergraph.glsl.source import Origin, SourceText
from rendergraph.steps import Read, Resource
from rendergraph.textures import TextureDesc


def read_defines(
    reads: Iterable[Read], resources: Mapping[str, Resource], views: Mapping[str, ViewTable]
) -> dict[str, str]:
    """Return `<X>_LAYERS`, `<X>_SAMPLES`, `<X>_VIEW_COUNT` of textures read, `<X>_COUNT` of lists of inputs."""
    macros: dict[str, str] = {}
    counts: dict[str, int] = {}
    for read in reads:
        resource = resources.get(read.resource)
        if resource is None or not isinstance(resource.desc, TextureDesc) or read.use == "attach":
            continue
        name = read.name.upper()
        macros[f"{name}_LAYERS"] = str(resource.desc.layers)
        macros |= dict(sample_macros(name, resource.desc.samples))
        if resource.view is not None:
            macros[f"{name}_VIEW_COUNT"] = str(views.get(resource.view, ViewTable()).count)
        if match := re.match(r"(.+)_(\d+)\Z", name):
            counts[match[1]] = max(counts.get(match[1], 0), int(match[2]) + 1)
    return {f"{name}_COUNT": str(count) for name, count in counts.items()} | macros


def sample_macros(name: str, samples: int) -> Iterator[tuple[str, str]]:
    """Yield `<X>_SAMPLES`, and for several samples their positions in the texel."""
    yield f"{name}_SAMPLES", str(samples)
    if samples > 1:
        yield f"{name}_SAMPLE_POSITIONS", positions_macro(samples)


def positions_macro(samples: int) -> str:
    """Return the macro of the device's sample positions; its value is known only with GL."""
    return f"SAMPLE_POSITIONS_{samples}"


def used_macros(macros: Mapping[str, str], text: str) -> dict[str, str]:
    """Return the macros whose names occur in a text or in the value of such a macro.

    The others would only make different programs of equal ones: a blur is the same for any number of lights.
    """
    found: dict[str, str] = {}
    texts = [text]
    while texts:
        new = {name: macros[name] for name in macros if name not in found and any(name in text for text in texts)}
        found |= new
        texts = list(new.values())
    return {name: macros[name] for name in macros if name in found}


def macro_text(macros: Mapping[str, str]) -> SourceText:
    return SourceText.of(
        (f"#define {key} {value}".rstrip(), Origin(made=f"the macro {key}")) for key, value in macros.items()
    )
