"""What `docs/promise.md` says: public names are documented where it says, and schemas carry their version."""

from __future__ import annotations

import pytest

import rendergraph as rg
from rendergraph.catalog import Catalog
from rendergraph.compare.store import line_schema
from rendergraph.keys import file_schema
from rendergraph.reference import FILE_KINDS, describe_python, table_of
from rendergraph.reference.python import PUBLIC_ERRORS, public_names
from rendergraph.schema import schema


@pytest.mark.parametrize("kind", sorted(FILE_KINDS))
def test_every_schema_has_an_id_with_the_version_of_its_format(kind: str) -> None:
    found = file_schema(table_of(kind))["$id"]
    assert found.startswith("urn:rendergraph:")
    assert found.endswith(":1")


def test_the_schemas_of_pipelines_and_results_have_one_too() -> None:
    assert schema(Catalog.discover())["$id"] == "urn:rendergraph:pipeline:1"
    assert line_schema()["$id"] == "urn:rendergraph:results:1"


def test_every_public_name_is_there_and_can_be_explained() -> None:
    names = public_names()
    assert {*rg.__all__, *PUBLIC_ERRORS} <= names.keys()
    assert all(describe_python(name) for name in (*rg.__all__, *PUBLIC_ERRORS))
