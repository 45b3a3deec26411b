"""Mistakes in a node's declaration."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from inspect import get_annotations, getattr_static
from pathlib import Path
from typing import Literal, TypeAlias, get_args, get_origin
from weakref import WeakSet

from rendergraph.declare.blame import describe_error
from rendergraph.declare.node import Node, Parameter
from rendergraph.errors import Problem, is_interruption, suggestion
from rendergraph.ports import Function, History, InOut, Input, Internal, Output, Port, Views, WrittenPort
from rendergraph.textures import SceneData, Semantic, Signature
from rendergraph.typecheck import accepts, mistakes_in, mistakes_of, parts_of, quoted

_IDENTIFIER = re.compile(r"[a-z][a-z0-9_]*\Z")
_MACRO = re.compile(r"[A-Za-z0-9_-]+")

_OF_THE_BASE = frozenset(name for name in vars(Node) if not name.startswith("_"))
_CLASS_METHODS = [name for name, value in vars(Node).items() if isinstance(value, classmethod)]

RESERVED_NAMES = _OF_THE_BASE | {*Path(__file__).with_name("reserved_names.txt").read_text(encoding="ascii").split()}
"""Words that cannot be a GLSL identifier, that hide a built-in function used often, or that the base class owns."""
_OF_THE_FRAMEWORK = frozenset(
    """
    ALPHA_BLEND ALPHA_MASK ANISOTROPIC DEFAULT_SPECULAR DOUBLE_SIDED HAS_CLEARCOAT HAS_IRIDESCENCE HAS_SHEEN
    HAS_TANGENT HAS_TRANSMISSION HAS_UV0 HAS_UV1 HAS_UV_TRANSFORM HAS_VERTEX_COLOR LAYERED_MATERIALS LIGHT_COUNT
    LIGHT_DIRECTIONALS LIGHT_POINTS LIGHT_SPOTS LIGHT_STORAGE MATERIAL_COUNT MATERIAL_SLOTS MATERIAL_STORAGE
    MATERIAL_UV_STORAGE NO_EMISSIVE PASS_VIEW PASS_VIEW_COUNT SHADOW_LIGHT_COUNT UNIFORM_SCALE UNLIT
    """.split()  # noqa: SIM905 - a list of so many words reads best as text
)
"""Macros that shaders always get, whatever the node declares."""
_ROLES = "param(…), define(…) or structural(…)"

_METHODS = {"record": "self, steps", "update": "self, frame", "camera_jitter": "self, frame"}
_TAKES_ANY = 0x04  # code flag of a function with *arguments
Mistakes: TypeAlias = Iterator[tuple[str, str]]
"""The subject and text of each mistake."""
_SOUND: WeakSet[type[Node]] = WeakSet()
"""Cache of valid classes: they are checked for every pipeline, and an edited class is a new object."""


def declaration_mistakes(cls: type[Node], *, lenient: bool = False) -> list[Problem]:
    """Return the mistakes in a node's declaration; the subjects are ports and parameters, empty for the class.

    Names must be distinct GLSL identifiers, also as macros; docs must exist; types and defaults must suit a shader and
    lie inside their range; formats, kinds and words must exist; rules must name ports of this node. `lenient` accepts
    names with capitals and missing docs, as in shaders of other tools.
    """
    if cls in _SOUND:
        return []
    for name in _CLASS_METHODS:
        if getattr_static(cls, name) is not vars(Node)[name]:
            text = f"'{name}' is reserved by the node's base class; choose another name"
            return [Problem("RG490", text, subject=name)]
    try:
        cls.parameters()
    except Exception as error:  # evaluating an annotation can raise anything
        named = [name for name, hint in get_annotations(cls).items() if str(getattr(error, "name", None)) in str(hint)]
        text = f"the types of its parameters cannot be resolved: {describe_error(error)}"
        return [Problem("RG490", text, subject=next(iter(named), ""))]
    docs = [] if lenient else _docs(cls)
    found = [*_names(cls, lenient), *docs, *_ports(cls), *_macros(cls), *_parameters(cls)]
    if not found and not lenient:
        _SOUND.add(cls)
    return [Problem("RG490", text, subject=subject) for subject, text in found]


def _names(cls: type[Node], lenient: bool) -> Mistakes:
    ports, parameters = cls.ports(), cls.parameters()
    plan = {name for name in parameters if parameters[name].role == "structural"}  # these never reach a shader
    for name in [*ports, *parameters]:
        if name.startswith("gl_") or "__" in name or not _IDENTIFIER.match(name.lower() if lenient else name):
            yield name, f"'{name}' is not a lower-case GLSL identifier"
        elif name in (_OF_THE_BASE if name in plan else RESERVED_NAMES):
            yield name, f"'{name}' is reserved by GLSL or by the node's base class; choose another name"
    for name in sorted(set(ports) & set(parameters)):
        yield name, f"'{name}' is both a port and a parameter"
    given = {f"{name}_{word}": (name, word) for name in ports for word in ("views", "lights")}
    for name in [*ports, *(name for name in parameters if name not in plan)]:
        if name in given:
            port, word = given[name]
            yield name, f"'{name}' is what shaders are given for the {word} of port '{port}'; rename one"
    named = [getattr(port, "group", None) for port in ports.values()]
    for group in dict.fromkeys(group for group in named if isinstance(group, str)):
        if group in ports or group in parameters:
            yield group, f"group '{group}' has the name of a port or parameter"
    inherited = {name for base in cls.__mro__[1:] if issubclass(base, Node) for name in base.ports()}
    known = {"shader", "twin", *inherited, *parameters}
    for name, value in vars(cls).items():
        if value is None and name[0] != "_" and name not in known:
            yield name, f"'{name}' is None, which drops a port that a base declares; none declares '{name}'"
    for name, takes in _METHODS.items():
        code = getattr(getattr(cls, name), "__code__", None)
        if code is None or code is vars(Node)[name].__code__ or code.co_flags & _TAKES_ANY:
            continue
        named = code.co_varnames[: code.co_argcount]
        if not len(named) - len(getattr(cls, name).__defaults__ or ()) <= 2 <= len(named):
            yield name, f"`{name}` takes ({', '.join(named)}); declare it as {name}({takes})"
    shader = cls.shader
    if shader is not None and (not isinstance(shader, str) or not shader.endswith((".frag", ".comp"))):
        yield "shader", f"`shader` is {shader!r}; it is a file that ends in .frag or .comp"
    if cls.twin is not None and not (isinstance(cls.twin, str) and cls.twin.isidentifier()):
        yield "twin", f"`twin` is {cls.twin!r}; it is the name of a node type, such as 'traced_shadows'"


def _docs(cls: type[Node]) -> Mistakes:
    if not (cls.__doc__ or "").strip() or cls.__doc__ == Node.__doc__:
        yield "", "the class has no docstring"
    for name, port in cls.ports().items():
        doc = getattr(port, "doc", "")
        if isinstance(doc, str) and not doc and not isinstance(port, Internal | History):
            yield name, f"port '{name}' has no doc"
    for name, parameter in cls.parameters().items():
        if parameter.role == "plain":
            yield name, f"parameter '{name}' is a plain value; declare it with {_ROLES}"
        elif not parameter.doc:
            yield name, f"parameter '{name}' has no doc"


def _ports(cls: type[Node]) -> Mistakes:
    ports = cls.ports()
    for name, port in ports.items():
        wrong = [mistake.text for mistake in mistakes_of(port, f"port '{name}'", name)]
        # Fields are compared only if each is valid on its own.
        yield from ((name, text) for text in wrong or (*_alone(name, port), *_named(name, port, ports)))


def _alone(name: str, port: Port) -> Iterator[str]:
    if isinstance(port, Input):
        wanted, example = (Signature, "ShadowLookup") if port.kind == "function" else (Semantic, "Radiance")
        if not isinstance(port.semantic, wanted):
            yield f"port '{name}': semantic is {quoted(port.semantic)}, not a {wanted.__name__} such as {example}"
        elif isinstance(port.semantic, Signature) and port.many and not port.semantic.combine:
            yield f"port '{name}' takes a list, but {port.semantic.name}() of several nodes cannot be joined"
        elif port.kind == "scene" and (port.semantic != SceneData or port.many):
            yield f"port '{name}' is a scene; declare it as Input(SceneData), of which there is one"
        elif port.rays and port.kind != "scene":
            yield f"port '{name}' has rays, but is not the scene's data; declare it as Input(SceneData, rays=True)"
    elif isinstance(port, WrittenPort):
        if port.semantic is None and port.like is None and not isinstance(port, Internal | History):
            yield f"port '{name}' has neither a semantic nor `like`"
        if port.kind != "buffer":
            if port.bytes != 0 or port.element is not None:
                what = f"bytes={quoted(port.bytes)}" if port.element is None else "elements"
                yield f"port '{name}' has {what}, but is not a buffer; add kind='buffer'"
            return
        if (port.bytes == 0) == (port.element is None or port.count == 0):
            yield f"port '{name}' is a buffer without bytes; add bytes=…, from 1 up, or element=… and count=…"
        if port.first not in (None, 0):
            yield f"port '{name}' is a buffer, which holds 0 before the first frame, not {port.first!r}"
        if not callable(port.clear) and port.clear not in (None, 0):
            yield f"port '{name}' is a buffer, which can only be cleared to 0, not to {port.clear!r}"


def _named(name: str, port: Port, ports: Mapping[str, Port]) -> Iterator[str]:
    """Yield mistakes in the names of other ports."""
    inputs, viewed, sampled = (Input, InOut), (Input, InOut, Views), (Input, WrittenPort)
    named: list[tuple[str, object, tuple[type[Port], ...], str]] = []
    if isinstance(port, WrittenPort):
        size = port.size[0] if isinstance(port.size, tuple) else port.size
        named += [("like", port.like, inputs, "an input"), ("size", size, inputs, "an input")]
        named += [(key, getattr(port, key), viewed, "an input or a Views port") for key in ("view", "lights")]
    if isinstance(port, Output | Function):
        named += [("needs", target, inputs, "an input") for target in port.needs]
    if isinstance(port, Function):
        named += [("reads", target, sampled, "a texture or buffer") for target in port.read_names]
    for key, target, kinds, expected in named:
        if isinstance(target, str) and target not in ports:
            yield f"port '{name}': {key}: there is no port '{target}'{suggestion(target, ports, most=0)}"
        elif isinstance(target, str) and not isinstance(ports[target], kinds):
            yield f"port '{name}': {key}: '{target}' is not {expected}"


def _macros(cls: type[Node]) -> Mistakes:
    """Yield declarations that would define the same macro."""
    made: dict[str, list[tuple[str, str]]] = {}  # macro to the names that define it, with their descriptions
    for name in cls.inputs():
        for macro in (f"HAS_{name}".upper(), f"{name}_LAYERS".upper()):
            made.setdefault(macro, []).append((name, f"input '{name}'"))
    for name, parameter in cls.parameters().items():
        if parameter.role == "define":
            made.setdefault(name.upper(), []).append((name, f"define '{name}'"))
            for choice in () if parameter.open_name else parameter.words:
                macro = f"{name}_{choice}".upper().replace("-", "_")
                made.setdefault(macro, []).append((name, f"choice '{choice}' of '{name}'"))
    for macro, sources in made.items():
        (name, first), words = sources[0], " and ".join(source for _, source in sources)
        if macro in _OF_THE_FRAMEWORK:
            yield name, f"{first} would define the macro {macro}, which is rendergraph's own; choose another name"
        if len(sources) > 1:
            yield name, f"{words} would define the same macro, {macro}; rename one"


def _parameters(cls: type[Node]) -> Mistakes:
    sound = True
    for name, parameter in cls.parameters().items():
        if parameter.type is None:
            yield name, f"parameter '{name}' has no type; write it as in `{name}: float = param(…)`"
            sound = False
            continue
        if parameter.open_name and str not in get_args(parameter.type):
            yield name, f"plugins add choices to '{name}', so its type is a Literal of its own `| str`"
        if parameter.role in ("param", "define") and (wrong := _not_for_a_shader(parameter)):
            yield name, f"parameter '{name}' is {wrong}"
        if parameter.unless and not any(parameter.unless in vars(base) for base in cls.__mro__):  # it may be dropped
            hint = suggestion(parameter.unless, cls.inputs())
            yield name, f"parameter '{name}': unless: there is no input '{parameter.unless}'{hint}"
        wrong_limits = list(_limits(parameter))
        yield from wrong_limits
        sound = sound and not wrong_limits
        if parameter.glsl and not re.fullmatch(r"(float|int|uint|bool|[biu]?vec[234]|mat[234])", str(parameter.glsl)):
            yield name, f"parameter '{name}': glsl: {parameter.glsl!r} is not the GLSL type of a parameter"
    if sound:
        yield from _defaults(cls)


def _limits(parameter: Parameter) -> Mistakes:
    name, limits = parameter.name, parameter.limits
    wrong = [*mistakes_in(f"parameter '{name}': min", limits.low, float | None)]
    wrong += mistakes_in(f"parameter '{name}': max", limits.high, float | None)
    yield from ((name, mistake.text) for mistake in wrong)
    if not wrong and limits.empty:
        yield name, f"parameter '{name}' has an empty range: min {limits.low} > max {limits.high}"


def _defaults(cls: type[Node]) -> Mistakes:
    """Check defaults like values in a file."""
    sound = True
    for name, parameter in cls.parameters().items():
        wrong = ""
        try:
            parameter.convert(json.loads(json.dumps(parameter.default)))
        except (TypeError, ValueError) as error:
            wrong = str(error)
        if wrong and parameter.role != "plain":
            yield name, f"the default of '{name}', {quoted(parameter.default)}, is wrong: {wrong}"
        sound = sound and not wrong
    try:
        if sound:
            cls()
    except BaseException as error:  # a node's own check is third-party code
        if is_interruption(error):
            raise
        yield "", f"it cannot be instantiated with its defaults: {describe_error(error)}"


def _not_for_a_shader(parameter: Parameter) -> str:
    """Return why a parameter's type cannot become a uniform, or program text."""
    kinds = {get_origin(part) or part for part in parts_of(parameter.type)}
    if parameter.role == "param":
        if kinds <= {bool, int, float, Literal} and not parameter.words:
            return ""
        kinds_of_param = "a number, a switch or a tuple of them"
        return f"a param, so its type is {kinds_of_param}; make text a define with its choices as Literal[…]"
    fits = kinds <= {bool, int, float, Literal, *([str] if parameter.open_name else [])}
    if fits and not accepts(parameter.type, tuple) and all(map(_MACRO.fullmatch, parameter.words)):
        return ""
    return "a define, so its type is one number, a switch, or Literal[…] with words of letters, digits, '_' and '-'"
