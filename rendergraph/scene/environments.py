"""The shipped environments and surroundings, stored beside the shipped scenes because they are content, like nodes."""

from __future__ import annotations

from rendergraph.pipelines.environments import SHIPPED as SHIPPED
from rendergraph.pipelines.environments import SKIES as SKIES
from rendergraph.pipelines.environments import named as named
from rendergraph.pipelines.environments import shipped as shipped
from rendergraph.pipelines.environments.surroundings import grounded as grounded
from rendergraph.pipelines.environments.surroundings import lit as lit
