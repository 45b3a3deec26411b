"""What ports carry: semantics, functions, formats."""

from __future__ import annotations

from collections.abc import Iterator

from rendergraph.textures import FORMATS, SEMANTICS, SIGNATURES

from .markdown import code, page, prose, table


def pages() -> Iterator[tuple[str, str]]:
    """One page."""
    semantics = [(code(s.name), prose(s.doc), s.space, s.encoding) for s in SEMANTICS]
    functions = [(f"`{s.declaration}`", prose(s.doc), code(s.neutral), code(s.combine)) for s in SIGNATURES]
    formats = [
        (code(f.name), f.family.replace("_", " and "), f.components, f.bytes, f.view_class if not f.is_depth else "")
        for f in FORMATS.values()
    ]
    yield (
        "types.md",
        page(
            "Port types",
            "A link is checked for what its texels mean, not only for how they are stored. Plugins add semantics of "
            "their own; `any` connects to all of them, both ways.",
            "## Semantics\n\n" + table(("semantic", "texels", "space", "encoding"), semantics),
            "## Functions\n\nA port of kind `function` carries GLSL that its reader calls in place; several providers "
            "are joined.\n\n" + table(("declaration", "returns", "without a provider", "joined by"), functions),
            "## Formats\n\nTextures of one class can share memory through views; depth shares with its own format "
            "only.\n\n" + table(("format", "family", "channels", "bytes a texel", "class"), formats),
        ),
    )
