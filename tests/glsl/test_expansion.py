"""Macros that grow without bound are refused before a driver meets them; ordinary ones pass."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Node, Output
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError
from rendergraph.glsl.expansion import check_expansion
from rendergraph.glsl.source import Origin, SourceBlock, SourceText

HERE = Path("/somewhere/a.frag")


def text_of(text: str, file: Path = HERE) -> SourceText:
    return SourceText((SourceBlock(tuple(text.split("\n")), Origin(file, 1)),))


def chain(length: int, body: str = "A{0} A{0}") -> str:
    return "\n".join(["#define A0 x", *(f"#define A{i + 1} {body.format(i)}" for i in range(length))])


BOMBS = {
    "doubling words": f"{chain(40)}\nfloat y = A40;",
    "a doubling call inside itself": "#define D(x) x x\nfloat y = " + "D(" * 40 + "a" + ")" * 40 + ";",
    "over several lines": "#define D(x) x x\nfloat y = " + "D(\n" * 40 + "a" + ")" * 40 + ";",
    "a call that is handed on": "#define D(x) x x\n#define AP(f, x) f(x)\nfloat y = "
    + "AP(D, " * 40
    + "a"
    + ")" * 40
    + ";",
    "all of each other": "\n".join(f"#define M{i} " + " ".join(f"M{j}" for j in range(12) if j != i) for i in range(12))
    + "\nM0;",
    "in a condition": f"{chain(40, 'A{0} + A{0}')}\n#if A40 > 3\n#endif",
    "only where the driver has an extension": f"{chain(40)}\n#define B 1\n#ifdef GL_EXT_some\n#undef B\n"
    "#define B A40\n#endif\nfloat y = B;",
    "only where it has not": f"{chain(40)}\n#if !defined(GL_EXT_some) && 2 * 3 == 0x6\nfloat y = A40;\n#endif",
    "continued lines": chain(40).replace("#define A40 ", "#define A40 \\\n") + "\nfloat y \\\n = A40;",
    "calls that do not end": "#define D(x) x\n" + "D(" * 100_000,
    "names pasted together": chain(40).replace("#define A40", "#define A4")
    + "\n#define P(a, b) a##b\nfloat y = P(A, 4);",
    "calls that wait for a second look": "#define NONE\n#define D(x) (x x)\n#define ID(x) x\nfloat y = "
    + "ID(" * 24
    + "D NONE " * 24
    + "(a)"
    + ")" * 24
    + ";",
    "brackets that come from arguments": "#define D(x) x x\n#define K(x) D x\nfloat y = "
    + "K((" * 24
    + "a"
    + "))" * 24,
    "a call that another macro opens": "#define D(x) x x\n#define O D(\nfloat y = " + "O " * 24 + "a" + ")" * 24,
    "a word that doubles": "#define D(a) a##a\n#define E(a) D(a)\n" + "E(" * 22 + "x" + ")" * 22 + ";",
    "one after the other, each hidden in all that follow": chain(3000, "A{0}") + "\nfloat y = A3000;",
    "the same around words of others": "#define F(x) x\n"
    + chain(900, "A{0}").replace("A0 x", "A0 " + "F(y) " * 90_000)
    + "\nA900",
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_in_time(name: str) -> None:
    start = time.perf_counter()
    with pytest.raises(
        InputError, match=r"RG409 (macros may expand this line to more than 1,000,000|more than 256 macros)"
    ):
        check_expansion(text_of(BOMBS[name]))
    assert time.perf_counter() - start < 10


FINE = {
    "a macro that names itself": "#define A A A\n#define f(x) f(x) + f(x)\nA f(f(f(1)))",
    "two that name each other": "#define A B B\n#define B A A\nA",
    "never used": f"{chain(40)}\nfloat y;",
    "a name that is not called": "#define D(x) x x\nfloat D = D + D;",
    "a call that does not end": "#define D(x) x x\nfloat y = D(D(D(1);",
    "a list of fields, handed a macro": "#define FIELDS(X) "
    + " ".join(f"X(vec3, f{i})" for i in range(40))
    + "\n#define FIELD(t, n) t n; t old_##n;\n#define RESET(t, n) s.n = t(0); s.old_##n = t(0);\n"
    + "struct S { FIELDS(FIELD) };\nvoid reset(inout S s) { FIELDS(RESET) }",
    "names for several dialects": "#ifdef OLD\n#define texture texture2D\n#else\n#define texture2D texture\n#endif\n"
    + "\n".join(f"#define TAP{i}(x) (texture(s, x) + texture(s, -x) + texture2D(s, 2 * x))" for i in range(20))
    + "\nvec4 y = "
    + " + ".join(f"TAP{i}(TAP{i}(x))" for i in range(20))
    + ";",
    "a name that stands for itself and more": "#define texture(s, x) texture(s, x, BIAS)\n#define BIAS -1.0\n"
    + "y = texture(s, texture(s, texture(s, x).xy).xy);\n" * 500,
    "a library of half precision": "\n".join(
        f"#define AH{i}_(a) half{i}(a)\n#define ALerp{i}(x, y, a) ((x) + (a) * ((y) - (x)))\n"
        f"#define ASat{i}(x) AMin{i}(AMax{i}(x, AH{i}_(0.0)), AH{i}_(1.0))\n#define AMin{i}(x, y) min(x, y)\n"
        f"#define AMax{i}(x, y) max(x, y)\n#define ATone{i}(x) ASat{i}(ALerp{i}(x, x * x, ASat{i}(x)))"
        for i in range(1, 60)
    )
    + "".join(f"\ny{i} = ATone{i}(ATone{i}(ALerp{i}(a, b, c)));" for i in range(1, 60)) * 2,
    "many small ones": "#define sq(x) ((x) * (x))\n" + "float y = sq(sq(a)) + sq(b) * sq(c);\n" * 2000,
    "a long row": f"{chain(200, 'A{0}')}\nfloat y = A200;",
    "a number of many digits": f"#if {'1' * 5000}\n#endif",
    "text alone": "float f() { return 1.0; }\n" * 20_000,
}


@pytest.mark.parametrize("name", FINE)
def test_what_stays_small_passes(name: str) -> None:
    check_expansion(text_of(FINE[name]))


def test_the_line_is_the_authors() -> None:
    with pytest.raises(InputError, match=r"/somewhere/a\.frag:42:1: RG409"):
        check_expansion(text_of(BOMBS["doubling words"]))


class Bomb(Node):
    """A shader that would fill the machine."""

    color = Output(AnyTexel, format="r32f", doc="Nothing.")


def test_a_bomb_does_not_reach_the_driver(tmp_path: Path, gl: rg.Session) -> None:
    (tmp_path / "bomb.frag").write_text(f"{chain(60)}\nout float color;\nvoid main() {{ color = A60; }}\n")
    (tmp_path / "test.yaml").write_text(
        "rendergraph: 1\nsize: [8, 8]\nnodes: {bomb: {type: bomb}}\noutputs: {image: bomb.color}"
    )
    pipeline = replace(rg.load(tmp_path / "test.yaml"), catalog=Catalog.of(Bomb, shaders=tmp_path))
    with pytest.raises(InputError, match=r"bomb\.frag:63:1: RG409"):
        gl.render(pipeline)


def test_shipped_shaders_are_not_looked_into(monkeypatch: pytest.MonkeyPatch) -> None:
    def look(source: SourceText) -> None:
        raise AssertionError(source.files)

    monkeypatch.setattr("rendergraph.glsl.expansion.check_expansion", look)
    with rg.Session() as session:  # which has compiled nothing yet
        session.render(rg.load("forward", scene="shapes", size=(8, 8)))
