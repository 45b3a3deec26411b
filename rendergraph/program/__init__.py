"""One step's program as text, and the driver's messages about it. No GL.

`stage_texts` generates the text of each stage; `messages.compile_problems` and `messages.link_problems` translate the
driver's messages.

A stage's text has, in this order: version, `#extension` lines, macros, `<view.glsl>`, views and light tables of its
input textures; for each function that the stage calls, its providers' texts and the function that combines them; the
author's file. Names in a provider's text get a prefix, `prefix(node id) + name`: its textures (`shadows_shadow_map`),
uniforms (`shadows_bias`), view blocks (`shadows_shadow_map_view_block`). The step's own textures keep their names, with
`<name>_view_block` for the views. Unused blocks and tables are not declared. A shader that mentions
`SHADOW_LIGHT_COUNT` gets it and, if it is not 0, the table `shadow_lights` of the lights that any provider of `shadow`
knows; the same holds for other functions, by their name.
"""

from __future__ import annotations

from rendergraph.program.checks import check_texts, ray_warnings, used_blocks, used_names
from rendergraph.program.text import StageText, StepTexts, TextSources, positions_macro, prefix, stage_texts, text_key
