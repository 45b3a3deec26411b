"""The shipped kinds of generated textures, stored beside the shipped scenes because they are content, like shapes."""

from __future__ import annotations

from rendergraph.pipelines.textures import TEXTURES as TEXTURES
