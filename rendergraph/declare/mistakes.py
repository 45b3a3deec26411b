"""What can be wrong with a node's declaration."""

from __future__ import annotations

import re
from typing import get_args

from rendergraph.declare.node import Node
from rendergraph.declare.parameters import open_name
from rendergraph.declare.ports import History, Internal, Made
from rendergraph.textures import FORMATS

_IDENTIFIER = re.compile(r"[a-z][a-z0-9_]*\Z")

_OF_THE_BASE = frozenset(
    """
    copy json dict schema construct fields validate record update ports inputs outputs groups parameters shader role_of
    """.split()  # noqa: SIM905 - as below
)

# Words that cannot be a GLSL identifier, that hide a built-in function used everywhere, or that the base class owns.
RESERVED_NAMES: frozenset[str] = (
    frozenset(
        """
    attribute const uniform varying buffer shared coherent volatile restrict readonly writeonly layout centroid flat
    smooth noperspective patch sample break continue do for while switch case default if else subroutine in out inout
    float double int void bool true false invariant precise discard return mat2 mat3 mat4 vec2 vec3 vec4 ivec2 ivec3
    ivec4 bvec2 bvec3 bvec4 uint uvec2 uvec3 uvec4 lowp mediump highp precision struct common partition active asm
    class union enum typedef template this resource goto inline noinline public static extern external interface long
    short half fixed unsigned superp input output hvec2 hvec3 hvec4 fvec2 fvec3 fvec4 sampler3DRect filter image
    sizeof cast namespace using texture sampler2D sampler3D samplerCube image2D abs acos all any asin atan ceil clamp
    cos cross degrees determinant distance dot equal exp exp2 floor fma fract inverse inversesqrt length log log2 main
    max min mix mod modf normalize not pow radians reflect refract round sign sin smoothstep sqrt step tan transpose
    trunc
    """.split()  # noqa: SIM905 - a list of so many words reads best as text
    )
    | _OF_THE_BASE
)


def declaration_mistakes(cls: type[Node]) -> list[str]:
    """What is wrong with a node's declaration, one sentence each; empty where it is fine.

    Checked: names are GLSL identifiers and distinct, docs exist, defaults lie inside their range, formats exist,
    `like`, `view`, `lights`, `needs` and `reads` name ports of this node.
    """
    mistakes: list[str] = []
    ports = cls.ports()
    names = [*ports, *cls.parameters()]
    plan = {name for name in cls.parameters() if cls.role_of(name) == "structural"}  # these never reach a shader
    for name in names:
        if not _IDENTIFIER.match(name) or name.startswith("gl_") or "__" in name:
            mistakes.append(f"'{name}' is not a lower-case GLSL identifier")
        elif name in (_OF_THE_BASE if name in plan else RESERVED_NAMES) or name.startswith("model_"):
            mistakes.append(f"'{name}' is reserved by GLSL or by the node's base class; choose another name")
    for name in set(ports) & set(cls.parameters()):
        mistakes.append(f"'{name}' is both a port and a parameter")
    if not (cls.__doc__ or "").strip() or cls.__doc__ == Node.__doc__:
        mistakes.append("the class has no docstring")
    for name, port in ports.items():
        doc = getattr(port, "doc", "")
        if not doc and not isinstance(port, Internal | History):
            mistakes.append(f"port '{name}' has no doc")
        if isinstance(port, Made):
            if isinstance(port.format, str) and port.format not in FORMATS:
                mistakes.append(f"port '{name}' has an unknown format '{port.format}'")
            if port.semantic is None and port.like is None and not isinstance(port, Internal | History):
                mistakes.append(f"port '{name}' has neither a semantic nor `like`")
            if isinstance(port, History) and port.kind == "buffer":
                mistakes.append(f"'{name}' is a History of a buffer; only textures keep last frame's values")
            for rule in ("like", "view", "lights"):
                target = getattr(port, rule)
                if isinstance(target, str) and target not in ports:
                    mistakes.append(f"port '{name}' is {rule} '{target}', which is no port")
        for rule in ("needs", "reads"):
            mistakes += [
                f"port '{name}' {rule} '{target}', which is no port"
                for target in getattr(port, "read_names" if rule == "reads" else rule, ())
                if target not in ports
            ]
    for name, info in cls.parameters().items():
        if not info.description:
            mistakes.append(f"parameter '{name}' has no doc")
        if open_name(info) and str not in get_args(info.annotation):
            mistakes.append(f"plugins add choices to '{name}', so its type is a Literal of its own `| str`")
    try:
        cls.model_validate(cls().model_dump(), strict=False)
    except ValueError as error:
        mistakes.append(f"a default lies outside its range: {error}")
    return mistakes
