"""Shipped scenes as tests need them."""

from __future__ import annotations

import yaml

import rendergraph as rg


def without_images(pipeline: rg.Pipeline) -> rg.Pipeline:
    """The same with plain materials: how images are filtered depends on the driver and on where a pixel's samples lie."""
    source = pipeline.link().scene.source
    assert source is not None
    materials = yaml.safe_load(source.read_text(encoding="utf-8")).get("materials", {})
    images = [f"scene.materials.{entry}.{key}" for entry, keys in materials.items() for key in keys if "texture" in key]
    return pipeline.set(dict.fromkeys(images))
