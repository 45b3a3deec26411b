"""Names in GLSL: which a text declares, which it calls, and renaming them."""

from __future__ import annotations

from rendergraph.glsl import declared
from rendergraph.glsl.names import calls, mentions, renamed

TEXT = """#define SCALE 2.0
#define TWICE(x) ((x) * SCALE)
layout(location = 0) uniform sampler2D map;
uniform vec3 color, tints[4];
layout(std140) uniform box_block { vec4 low; vec4 high[2]; };
uniform named_block { float size; } named;
layout(rgba16f) uniform writeonly image2D target;
layout(std430) readonly buffer list { uint entries[]; };
struct Hit { float size; vec3 color; };
const int table[2] = int[](1, 2);
float before = 1.0, after;
in vec2 v_uv;
flat in int v_material;
out vec4 made;
precision highp float;
float area(Hit hit);
float area(Hit hit) { float local = hit.size; return local * named.size + low.x; }
void main() { made = vec4(color, 1.0); }
"""


def test_declared_names() -> None:
    assert declared(TEXT) == {
        "SCALE",
        "TWICE",
        "map",
        "color",
        "tints",
        "box_block",
        "low",
        "high",
        "named_block",
        "named",
        "target",
        "list",
        "entries",
        "Hit",
        "table",
        "before",
        "after",
        "v_uv",
        "v_material",
        "made",
        "area",
        "main",
    }


def test_renaming_leaves_members_alone() -> None:
    names = declared(TEXT) | {"size"}
    text = renamed(TEXT, lambda word: f"p_{word}" if word in names else word)
    assert "struct p_Hit { float size; vec3 color; };" in text
    assert "uniform p_named_block { float size; } p_named;" in text
    assert "float local = hit.size; return local * p_named.size + p_low.x;" in text
    assert "#define p_TWICE(x) ((x) * p_SCALE)" in text
    assert "p_made = vec4(p_color, 1.0);" in text


def test_calls() -> None:
    assert calls("void main() { float x = shadow(0, p, n); }", "shadow")
    assert not calls("float shadow(int i) { return 1.0; } void main() { shadow(0); }", "shadow")
    assert not calls("void main() { my_shadow(0); a.shadow(); }", "shadow")
    assert calls("float my_shadow; void main() { a.shadow(); shadow\n    (0); }", "shadow")
    assert not calls("uniform float shadow; void main() { float x = shadow; }", "shadow")
    assert calls(
        "float f() { return shadow(0); } float g() { if (a) b(); else shadow(0); return a[0]+shadow(1); }", "shadow"
    )
    assert not calls("float[2] shadow(int i); void main() { float x[2] = shadow(0); }", "shadow")
    assert not calls("void main() { x = shadow(0); } vec4_type_\n\tshadow (int i) { return a; }", "shadow")


def test_mentions_whole_words() -> None:
    assert mentions("depth_views", "depth_views")
    assert mentions("a_depth_views + b.depth_views[0]", "depth_views")
    for text in (
        "",
        "depth_view",
        "a_depth_views",
        "2depth_views",
        "depth_views2",
        "depth_views_depth_views",
        "édepth_views",
    ):
        assert not mentions(text, "depth_views"), text
