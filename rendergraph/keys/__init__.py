"""The grammar of input files: tables of keys with their types, and a validator that checks a file against them.

Pipelines, scenes, sweeps, project settings and the headers of shader files have one table each, which defines the check
of a file, `rendergraph explain`, the reference pages and the JSON Schemas for editors.
"""

from __future__ import annotations

from rendergraph.keys.tables import Key, MapOf, Naming, Recursive, Table, as_markdown, brief, file_schema, plain, schema
from rendergraph.keys.validator import MOST_PROBLEMS, Codes, Validator
