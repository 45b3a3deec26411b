"""The grammar of the files we read: tables of keys with their types, and one validator that checks a file against them.

Pipelines, scenes, sweeps, project settings and the headers of shader files have one table each. From it come the check
of a file, `rendergraph explain`, the pages of the reference and the JSON Schemas for editors.
"""

from __future__ import annotations

from rendergraph.keys.tables import Key as Key
from rendergraph.keys.tables import MapOf as MapOf
from rendergraph.keys.tables import Naming as Naming
from rendergraph.keys.tables import Recursive as Recursive
from rendergraph.keys.tables import Table as Table
from rendergraph.keys.tables import Type as Type
from rendergraph.keys.tables import as_markdown as as_markdown
from rendergraph.keys.tables import brief as brief
from rendergraph.keys.tables import file_schema as file_schema
from rendergraph.keys.tables import nullable as nullable
from rendergraph.keys.tables import plain as plain
from rendergraph.keys.tables import schema as schema
from rendergraph.keys.validator import MOST_PROBLEMS as MOST_PROBLEMS
from rendergraph.keys.validator import Codes as Codes
from rendergraph.keys.validator import Validator as Validator
