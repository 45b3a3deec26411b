"""The offline manual as plain JSON values: node types, pipelines, scenes, programs, keys of files, error codes.

`rendergraph explain` prints it, and the documentation's reference pages are generated from it. Everything is imported
on first use: `--help` needs none of it, and most topics need little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.lazy import lazy_exports

if TYPE_CHECKING:
    from rendergraph.reference.assets import describe_pipeline, describe_scene, kind_of
    from rendergraph.reference.examples import example_file, example_text
    from rendergraph.reference.node_types import describe_node, input_facts, meaning, output_facts, summary
    from rendergraph.reference.programs import complete_shader, describe_program, describe_programs, find_node_of_type
    from rendergraph.reference.python import describe_python, public_names
    from rendergraph.reference.topics import FILE_KINDS, error_codes, error_page, file_keys, table_of


__getattr__, __dir__ = lazy_exports(
    __name__,
    {
        "assets": ("describe_pipeline", "describe_scene", "kind_of"),
        "examples": ("example_file", "example_text"),
        "node_types": ("describe_node", "input_facts", "meaning", "output_facts", "summary"),
        "programs": ("complete_shader", "describe_program", "describe_programs", "find_node_of_type"),
        "python": ("describe_python", "public_names"),
        "topics": ("FILE_KINDS", "error_codes", "error_page", "file_keys", "table_of"),
    },
)
