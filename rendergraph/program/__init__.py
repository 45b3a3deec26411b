"""One step's program as text, and what a driver says of it. No GL.

`compile` calls

    stage_texts(step, types, resources, views, defines=..., include_folder=None) -> {stage: StageText}

with a `steps.Step`, node id to `catalog.NodeType`, and `Expansion.resources` and `Expansion.views`; `defines` are
the macros of the scene and the batch (`LIGHT_COUNT`, `MATERIAL_COUNT`, `HAS_UV0`, `PASS_VIEW_COUNT`, ...).
`StageText.text` goes to the driver; what it answers goes through `messages.compile_problems` and
`messages.link_problems`.

Names of a function's text are `prefix(node id) + name`: its textures (`shadows_shadow_map`), uniforms
(`shadows_bias`), view blocks (`shadows_shadow_map_view_block`). The consumer's own texture reads keep their names, with
`<name>_view_block` for the views; a block or table that the text does not look at is not declared.

A stage's text is, in this order: version, `#extension` lines, macros, `<view.glsl>`, views and light tables of the
textures read, then for each function the stage calls its providers' texts and the function that joins them, then the
author's file. A shader that mentions `SHADOW_LIGHT_COUNT` is given that and, where it is not 0, the table
`shadow_lights` of the scene's lights that some provider of `shadow` knows; the same for other functions, by their name.
"""

from __future__ import annotations

from rendergraph.program.checks import Texts, check_kept_text, check_texts, looked_at, named_reads, unfit_sampler
from rendergraph.program.macros import positions_macro
from rendergraph.program.text import StageText, StepTexts, prefix, stage_texts
from rendergraph.program.text_key import text_key

__all__ = [
    "StageText",
    "StepTexts",
    "Texts",
    "check_kept_text",
    "check_texts",
    "looked_at",
    "named_reads",
    "positions_macro",
    "prefix",
    "stage_texts",
    "text_key",
    "unfit_sampler",
]
