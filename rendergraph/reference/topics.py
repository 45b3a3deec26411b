"""The keys of every kind of file, and the pages of error codes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.resources import folder

if TYPE_CHECKING:
    from rendergraph.declare import Extensions
    from rendergraph.keys import Table

FILE_KINDS = {
    "pipeline": "a pipeline file",
    "scene": "a scene file",
    "sweep": "a sweep file",
    "settings": "`rendergraph.toml`",
    "header": "a shader file's header",
}


def table_of(kind: str, extensions: Extensions | None = None) -> Table:
    """Return the keys of a kind of file, with those of plugins. Each is imported only when it is asked for."""
    if kind == "pipeline":
        from rendergraph.read import PIPELINE as table  # see above
    elif kind == "scene":
        from rendergraph.declare import NO_EXTENSIONS  # see above
        from rendergraph.scene.scene_keys import scene_table, with_plugins  # see above

        table = scene_table(with_plugins(extensions or NO_EXTENSIONS))
    elif kind == "sweep":
        from rendergraph.compare.sweepfile import SWEEP as table  # see above
    elif kind == "settings":
        from rendergraph.settings import SETTINGS as table  # see above
    else:
        from rendergraph.catalog.header import HEADER as table  # see above
    return table


def file_keys(kind: str, extensions: Extensions | None = None) -> list[dict[str, Any]]:
    from rendergraph.keys import brief  # most topics need no keys

    return [
        {
            "section": section,
            "key": key.name,
            "value": brief(key.type),
            "default": list(key.default) if isinstance(key.default, tuple) else key.default,
            "unit": key.unit,
            "required": key.required,
            "doc": key.doc,
        }
        for section, keys in table_of(kind, extensions).sections()
        for key in keys
    ]


def error_codes() -> list[str]:
    return sorted(path.name.partition("-")[0] for path in folder("rendergraph.errors").glob("RG*.yaml"))


def error_page(code: str) -> dict[str, Any]:
    import yaml  # other topics need no YAML

    path = next(folder("rendergraph.errors").glob(f"{code}-*.yaml"), None)
    if path is None:
        raise InputError(Problem("RG511", f"unknown error code '{code}'{suggestion(code, error_codes())}"))
    page: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    return page
