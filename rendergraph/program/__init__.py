"""One step's program as text, and a driver's messages about it. No GL.

`stage_texts` makes the text of each stage; the driver's answers go through `messages.compile_problems` and
`messages.link_problems`.

A stage's text is, in this order: version, `#extension` lines, macros, `<view.glsl>`, views and light tables of the
textures read; for each function that the stage calls, its providers' texts and the function that joins them; the
author's file. Names of a provider's text are `prefix(node id) + name`: its textures (`shadows_shadow_map`), uniforms
(`shadows_bias`), view blocks (`shadows_shadow_map_view_block`). The step's own texture reads keep their names, with
`<name>_view_block` for the views. A block or table that the text does not use is not declared. A shader that mentions
`SHADOW_LIGHT_COUNT` gets it and, if it is not 0, the table `shadow_lights` of the lights that some provider of `shadow`
knows; the same for other functions, by their name.
"""

from __future__ import annotations

from rendergraph.program.checks import Texts as Texts
from rendergraph.program.checks import check_kept_text as check_kept_text
from rendergraph.program.checks import check_scene_includes as check_scene_includes
from rendergraph.program.checks import check_texts as check_texts
from rendergraph.program.checks import missing as missing
from rendergraph.program.checks import named_reads as named_reads
from rendergraph.program.checks import ray_warnings as ray_warnings
from rendergraph.program.checks import unfit_outputs as unfit_outputs
from rendergraph.program.checks import unfit_sampler as unfit_sampler
from rendergraph.program.checks import used_blocks as used_blocks
from rendergraph.program.checks import used_names as used_names
from rendergraph.program.text import StageText as StageText
from rendergraph.program.text import StepTexts as StepTexts
from rendergraph.program.text import positions_macro as positions_macro
from rendergraph.program.text import prefix as prefix
from rendergraph.program.text import stage_texts as stage_texts
from rendergraph.program.text import text_key as text_key
from rendergraph.program.unbound import unbound_block as unbound_block
from rendergraph.program.unbound import unbound_sampler as unbound_sampler
from rendergraph.program.unbound import unset_uniform as unset_uniform
