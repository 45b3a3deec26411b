"""The grammar of the files we read: tables of keys with their types, and one validator that checks a file against them.

Pipelines, scenes, sweeps, project settings and the headers of shader files have one table each. From it come the check
of a file, `rendergraph explain`, the pages of the reference and the JSON Schemas for editors.
"""

from __future__ import annotations

from rendergraph.keys.tables import (
    Key,
    MapOf,
    Naming,
    Recursive,
    Table,
    Type,
    as_markdown,
    brief,
    file_schema,
    nullable,
    plain,
    schema,
)
from rendergraph.keys.validator import MOST_PROBLEMS, Codes, Validator
