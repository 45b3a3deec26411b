"""The shipped kinds of generated textures, which lie beside the shipped scenes: they are content, like shapes."""

from __future__ import annotations

from rendergraph.pipelines.textures import TEXTURES as TEXTURES
