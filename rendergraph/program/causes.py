"""Find the causes among a driver's messages about one stage: a misspelt name is one mistake with many consequences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from difflib import get_close_matches

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.catalog.types import shared_includes
from rendergraph.glsl.source import SourceText

_FORMS = (
    re.compile(
        r"\s*\d+:(?P<line>\d+)\((?P<column>\d+)\):\s*(?P<kind>(?:preprocessor )?error|warning)\s*:(?P<text>\s*.*)"
    ),
    re.compile(r"\s*\d+\((?P<line>\d+)\)\s*:\s*(?P<kind>(?:fatal )?error|warning)\s+(?:[A-Z]\d+\s*)?:\s*(?P<text>.*)"),
    re.compile(r"\s*(?P<kind>ERROR|WARNING):\s*\d+:(?P<line>\d+):\s*(?:(?:error|warning)\(#\d+\)\s*)?(?P<text>.*)"),
)
_UNKNOWN = re.compile(
    r"undeclared|undefined variable|no function with name|no matching overloaded function", re.IGNORECASE
)
"""Drivers' phrases for an unknown name."""
_QUOTED = re.compile(r"[`'\"]([A-Za-z_]\w*)['\"`]")
_CALL = re.compile(r"(?P<before>.*`\w+\((?P<types>[^()]*)\)'); candidates are:")
_CANDIDATE = re.compile(r"\s{3,}\w+ \w+\((?P<types>[^()]*)\)\s*\Z")
_MOST_CANDIDATES = 3
_CLOSE = 0.75
_ENDS = re.compile(r"[;{}]\s*\Z|^\s*#")
"""Matches the end of a line after which a new statement begins."""
_DECLARES = r"^(?:struct\s+{0}\b|#\s*define\s+{0}\b|\w+\s+{0}\s*\()"
"""Matches a line that declares a struct, a macro or a function with a name."""
_BUILT_IN = """
abs acos acosh all any asin asinh atan atanh barrier bitCount bitfieldExtract ceil clamp cos cosh cross dFdx
dFdxCoarse dFdxFine dFdy dFdyCoarse dFdyFine degrees determinant distance dot equal exp exp2 faceforward findLSB
findMSB floatBitsToInt floatBitsToUint floor fma fract fwidth greaterThan greaterThanEqual imageAtomicAdd
imageAtomicMax imageAtomicMin imageLoad imageSize imageStore intBitsToFloat interpolateAtCentroid
interpolateAtSample inverse inversesqrt isinf isnan length lessThan lessThanEqual log log2 matrixCompMult max
memoryBarrier memoryBarrierBuffer memoryBarrierImage memoryBarrierShared min mix mod modf normalize not notEqual
outerProduct packHalf2x16 packUnorm4x8 pow radians reflect refract round roundEven sign sin sinh smoothstep sqrt
step tan tanh texelFetch texelFetchOffset texture textureGather textureGatherOffset textureGrad textureLod
textureLodOffset textureOffset textureProj textureQueryLevels textureQueryLod textureSamples textureSize transpose
trunc uintBitsToFloat unpackHalf2x16 unpackUnorm4x8 gl_FragCoord gl_FragDepth gl_FrontFacing gl_GlobalInvocationID
gl_InstanceID gl_Layer gl_LocalInvocationID gl_LocalInvocationIndex gl_NumWorkGroups gl_Position gl_PrimitiveID
gl_SampleID gl_VertexID gl_WorkGroupID EmitVertex EndPrimitive
"""
"""Common names of GLSL 4.50, for suggestions."""


class DriverMessage(Struct, frozen=True):
    """One message of a driver, with its line in the stage's text and its column, 0 if it names none."""

    text: str
    line: int
    column: int
    is_warning: bool = False


def causes(rows: Sequence[str], source: SourceText) -> list[DriverMessage]:
    """Return the messages that name a line, without consequences of others; warnings only if there is no error.

    For each statement, only the first error and unknown names count. An unknown name is reported once, with a similar
    one; only the closest candidates for a call are listed.
    """
    found = list(_with_candidates([message for row in rows if (message := _read(row)) is not None]))
    errors = [message for message in found if not message.is_warning]
    if not errors:
        return list(dict.fromkeys(found))
    unknown = {
        name: None for message in errors if _UNKNOWN.search(message.text) for name in _QUOTED.findall(message.text)
    }
    words: list[str] = re.findall(r"[A-Za-z_]\w*", source.text)
    known = {*words, *_BUILT_IN.split()} - unknown.keys()
    kept: list[DriverMessage] = []
    reported: dict[str, int] = {}
    begun: set[int] = set()
    for message in errors:
        statement = _statement(source, message.line)
        if _UNKNOWN.search(message.text):
            if message.text not in reported:
                reported[message.text] = message.line
                kept.append(replace(message, text=message.text + _near(message.text, known)))
        elif statement not in begun and not re.search(r"\berror\b", message.text):
            kept.append(message)
        begun.add(statement)
    if kept or "NEW_IDENTIFIER" not in errors[0].text:
        return kept or errors[:1]
    return [replace(errors[0], text=errors[0].text + _unknown_type(source, errors[0].line))]


def _read(row: str) -> DriverMessage | None:
    match = next((match for form in _FORMS if (match := form.match(row))), None)
    if match is None:
        return None
    column = int(match.groupdict().get("column") or 0)
    return DriverMessage(match["text"].rstrip(), int(match["line"]), column, "warning" in match["kind"].lower())


def _with_candidates(found: Sequence[DriverMessage]) -> Iterator[DriverMessage]:
    """Append the overloads that Mesa lists beneath a call, one message each, to the message about the call."""
    at = 0
    while at < len(found):
        message = found[at]
        at += 1
        call = _CALL.match(message.text)
        listed: list[str] = []
        while call and at < len(found) and found[at].line == message.line and _CANDIDATE.match(found[at].text):
            listed.append(found[at].text.strip())
            at += 1
        text = message.text.strip()
        if call and listed:
            types = call["types"]
            near = sorted(listed, key=lambda one: _distance(types, one))[:_MOST_CANDIDATES]
            which = "available:" if len(near) == len(listed) else f"the nearest of {len(listed)} are"
            text = f"{call['before'].strip()}; {which} {'; '.join(near)}"
        yield replace(message, text=text)


def _distance(types: str, candidate: str) -> tuple[int, int, list[bool]]:
    """Return the distance of a candidate from the call: by argument count, then by differing arguments."""
    match = _CANDIDATE.match(f"   {candidate}")
    assert match  # candidates match by construction
    given, taken = types.split(", "), match["types"].split(", ")
    differ = [one != other for one, other in zip(given, taken, strict=False)]
    return abs(len(given) - len(taken)), sum(differ), differ


def _statement(source: SourceText, line: int) -> int:
    """Return the line in which the statement of a line begins."""
    line = min(line, len(source.lines))
    while line > 1 and source.lines[line - 2].strip() and not _ENDS.search(source.lines[line - 2]):
        line -= 1
    return line


def _near(text: str, known: set[str]) -> str:
    for name in _QUOTED.findall(text):
        if include := _include_with(name):
            return f"; #include <{include}> declares it"
        if close := get_close_matches(name, sorted(known), n=1, cutoff=_CLOSE):
            return f"; did you mean '{close[0]}'?"
    return ""


def _unknown_type(source: SourceText, line: int) -> str:
    """Explain Mesa's message about an undeclared name, where it expects a type or has taken one for a value."""
    for name in re.findall(r"[A-Za-z_]\w*", source.lines[line - 1]) if line <= len(source.lines) else ():
        if not re.search(_DECLARES.format(name), source.text, re.MULTILINE) and (include := _include_with(name)):
            return f": nothing declares '{name}'; #include <{include}> does"
    return ": a name that nothing declares"


def _include_with(name: str) -> str:
    """Return the shared include that declares a function, struct or macro with that name; empty if none does."""
    for file in sorted(shared_includes().glob("*.glsl")):
        if re.search(_DECLARES.format(name), file.read_text(encoding="utf-8"), re.MULTILINE):
            return file.name
    return ""
