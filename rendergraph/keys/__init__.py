"""The grammar of the files we read: tables of keys with what each takes, and one walk that holds a file against them.

Pipelines, scenes, sweeps, project settings and the headers of shader files have one table each. From it come the check
of a file, `rendergraph explain`, the pages of the reference and the JSON Schemas for editors.
"""

from __future__ import annotations

from rendergraph.keys.forms import Form, Schema
from rendergraph.keys.tables import (
    Key,
    Later,
    Names,
    Naming,
    Table,
    Takes,
    as_markdown,
    briefly,
    file_schema,
    plain,
    schema,
)
from rendergraph.keys.walk import MOST_PROBLEMS, Codes, Walk

__all__ = [
    "MOST_PROBLEMS",
    "Codes",
    "Form",
    "Key",
    "Later",
    "Names",
    "Naming",
    "Schema",
    "Table",
    "Takes",
    "Walk",
    "as_markdown",
    "briefly",
    "file_schema",
    "plain",
    "schema",
]
