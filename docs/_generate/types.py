"""What ports carry: semantics, functions, formats; parts of a page that is written by hand."""

from __future__ import annotations

from collections.abc import Iterator

from rendergraph.catalog import NodeType
from rendergraph.textures import FORMATS, SEMANTICS, SIGNATURES

from .markdown import code, prose, table
from .pictures import catalog


def pages() -> Iterator[tuple[str, str]]:
    """A part of a page for each table."""
    types = [found for found in map(catalog().get, catalog().names()) if found.plugin == "builtin"]
    semantics = [
        (
            code(s.name),
            prose(s.doc),
            s.space or s.encoding,
            _linked(types, s.name, "outputs"),
            _linked(types, s.name, "inputs"),
        )
        for s in SEMANTICS
    ]
    functions = [
        (
            "<br>".join(code(each.declaration) for each in s.functions),
            "<br>".join(prose(each.doc) for each in s.functions),
            code(s.neutral) if s.combine else "not defined",
            code(s.combine) if s.combine else "only one provider",
            _linked(types, s.name, "outputs"),
            _linked(types, s.name, "inputs"),
        )
        for s in SIGNATURES
    ]
    formats = [
        (code(f.name), f.family.replace("_", " and "), f.components, f.bytes, f.view_class if not f.is_depth else "")
        for f in FORMATS.values()
    ]
    ends = ("made by", "taken by")
    yield "semantics-table.md", table(("semantic", "texels", "in", *ends), semantics)
    yield (
        "functions-table.md",
        table(("declaration", "returns", "without a provider", "joined by", *ends), functions),
    )
    yield "formats-table.md", table(("format", "family", "channels", "bytes a texel", "class"), formats)


def _linked(types: list[NodeType], meaning: str, side: str) -> str:
    """The standard nodes with such a port; of `any` and `view`, which most have, none."""
    if meaning in ("any", "view"):
        return ""
    found = [one.name for one in types if any(_means(port) == meaning for port in getattr(one.cls, side)().values())]
    return ", ".join(f"[`{name}`](generated/nodes/{name}.md)" for name in found)


def _means(port: object) -> str:
    carried = getattr(port, "signature", None) or getattr(port, "semantic", None)
    return carried.name if carried else ""
