"""The shipped environments, which lie beside the shipped scenes: they are content, like nodes."""

from __future__ import annotations

from rendergraph.pipelines.environments import SHIPPED as SHIPPED
from rendergraph.pipelines.environments import SKIES as SKIES
from rendergraph.pipelines.environments import named as named
from rendergraph.pipelines.environments import shipped as shipped
