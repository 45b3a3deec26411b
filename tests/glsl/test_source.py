"""Includes: what is put together, whose line each line is, and what is wrong with an include."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import yaml

from rendergraph.errors import InputError, Problem
from rendergraph.glsl import Includes, Links, strip_comments
from rendergraph.resources import folder as folder_of


def write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        file = folder / name.replace("__", ".")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def problem(error: pytest.ExceptionInfo[InputError]) -> Problem:
    (found,) = error.value.problems
    return found


def test_lines_know_their_file_and_line(shaders: Path) -> None:
    write(shaders, a__frag='int one;\n#include "b.glsl"\nint four;\n', b__glsl="int two;\nint three;\n")
    source = Includes(shaders.parent / "include").expand(shaders / "a.frag")
    rows = [
        (line, o.file.name, o.line) for line, o in zip(source.lines, source.origins, strict=True) if line and o.file
    ]
    assert rows == [
        ("int one;", "a.frag", 1),
        ("int two;", "b.glsl", 1),
        ("int three;", "b.glsl", 2),
        ("int four;", "a.frag", 3),
    ]


def test_a_file_is_compiled_once_a_stage(shaders: Path) -> None:
    write(
        shaders,
        a__frag='#include "b.glsl"\n#include "c.glsl"\n#include "b.glsl"\n',
        b__glsl="int b;\n",
        c__glsl='#include "b.glsl"\n',
    )
    assert Includes(shaders.parent / "include").expand(shaders / "a.frag").text.count("int b;") == 1


def test_what_is_not_beside_the_file_is_taken_from_the_extended_nodes_folders(shaders: Path) -> None:
    base, include = shaders.parent / "base", shaders.parent / "include"
    write(shaders, a__frag='#include "b.glsl"\n#include "d.glsl"\n', d__glsl="int own;\n")
    write(base, b__glsl='#include "c.glsl"\n', c__glsl="int c;\n", d__glsl="int hidden;\n")
    words = Includes(include).expand(shaders / "a.frag", inherited=(base,)).text.split()
    assert words == ["int", "c;", "int", "own;"]
    with pytest.raises(InputError, match=r"no include 'b\.glsl' beside the file;") as alone:
        Includes(include).expand(shaders / "a.frag")
    assert problem(alone).code == "RG401"
    write(shaders, a__frag='#include "lihgt.glsl"\n')
    write(base, light__glsl="int light;\n", out__frag='#include "../include/x.glsl"\n')
    with pytest.raises(InputError, match=r"what its node extends; did you mean 'light\.glsl'"):
        Includes(include).expand(shaders / "a.frag", inherited=(base,))
    with pytest.raises(InputError, match="RG406"):
        Includes(include).expand(
            base / "out.frag", inherited=(shaders,)
        )  # neither from beside the file nor from the other


@pytest.mark.parametrize("opens", ["if X", "ifdef X", "ifndef X"])
def test_an_include_that_may_not_be_compiled_does_not_hide_a_later_one(shaders: Path, opens: str) -> None:
    write(shaders, a__frag=f'#{opens}\n#include "b.glsl"\n#endif\n#include "b.glsl"\n', b__glsl="int b;\n")
    text = Includes(shaders.parent / "include").expand(shaders / "a.frag").text
    assert text.count("int b;") == 2
    assert text.count("#ifndef INCLUDED_0") == 2
    write(shaders, a__frag=f'#{opens}\n#endif\n#include "b.glsl"\n#include "b.glsl"\n')
    text = Includes(shaders.parent / "include").expand(shaders / "a.frag").text
    assert text.count("int b;") == 1
    assert "INCLUDED" not in text


def test_comments_keep_their_room_and_hide_includes(shaders: Path) -> None:
    assert strip_comments("a /* b\nc */ d // e\nf") == "a     \n     d     \nf"
    assert strip_comments("a // b\n/* c */ /* d\ne") == "a     \n        /* d\ne"  # for the driver to say so
    write(shaders, a__frag='// #include "nowhere.glsl"\n/*\n#include "nowhere.glsl"\n*/\n')
    assert Includes(shaders.parent / "include").expand(shaders / "a.frag").text.strip() == ""


@pytest.mark.parametrize(
    ("text", "code", "line", "says"),
    [
        ('int a;\n#include "lihgt.glsl"', "RG401", 2, "did you mean 'light.glsl'?"),
        ("#include <veiw.glsl>", "RG401", 1, "did you mean 'view.glsl'?"),
        ('#include "a.frag"', "RG402", 1, "a.frag includes a.frag"),
        ('#include "loop.glsl"', "RG402", 1, "loop.glsl includes loop2.glsl includes loop.glsl"),
        ("#version 450", "RG404", 1, "'#version' is written by rendergraph"),
        ("  #line 3", "RG404", 1, "'#line' is written by rendergraph"),
        ("#include light.glsl", "RG405", 1, "is not '#include <name.glsl>'"),
        ('#include "../../secret.glsl"', "RG406", 1, "lies outside"),
        ("#include </etc/passwd>", "RG406", 1, "lies outside"),
    ],
)
def test_what_is_wrong_with_an_include(shaders: Path, text: str, code: str, line: int, says: str) -> None:
    write(shaders, a__frag=text, light__glsl="", loop__glsl='#include "loop2.glsl"', loop2__glsl='#include "loop.glsl"')
    with pytest.raises(InputError, match=code) as error:
        Includes(shaders.parent / "include").expand(shaders / "a.frag")
    found = problem(error)
    assert says in found.text
    assert found.place is not None
    assert found.place.line == (1 if "loop" in text else line)
    assert Path(found.place.file).name == ("loop2.glsl" if "loop" in text else "a.frag")


def test_a_link_does_not_lead_out_of_the_root(shaders: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.glsl").write_text("int secret;\n")
    (shaders / "inside.glsl").symlink_to(tmp_path / "secret.glsl")
    write(shaders, a__frag='#include "inside.glsl"\n')
    with pytest.raises(InputError, match="RG406"):
        Includes(shaders.parent / "include").expand(shaders / "a.frag")


def test_links_are_followed_as_the_system_does(tmp_path: Path) -> None:
    (tmp_path / "far" / "deep").mkdir(parents=True)
    (tmp_path / "near").symlink_to("far/deep", target_is_directory=True)
    (tmp_path / "far" / "a.glsl").touch()
    (tmp_path / "far" / "deep" / "b.glsl").symlink_to("../a.glsl")
    (tmp_path / "round").symlink_to("round")
    links = Links()
    for name in (
        "near/b.glsl",
        "near/../a.glsl",
        "far/../near/../a.glsl",
        "none/../near/b.glsl",
        "round/a.glsl",
        "near/",
        "",
        ".",
    ):
        path = os.path.join(tmp_path, name)
        assert links.follow(path) == os.path.realpath(path) == links.follow(path)


@pytest.mark.slow
def test_limits_of_depth_and_size(shaders: Path) -> None:
    for number in range(40):
        (shaders / f"n{number}.glsl").write_text(f'#include "n{number + 1}.glsl"\n')
    write(shaders, n40__glsl="", big__frag="int a;\n" * 200_000, a__frag='#include "n0.glsl"\n')
    with pytest.raises(InputError, match="RG403 includes are nested deeper than 32"):
        Includes(shaders.parent / "include").expand(shaders / "a.frag")
    with pytest.raises(InputError, match="RG403 the shader is larger than 1,000,000 bytes"):
        Includes(shaders.parent / "include").expand(shaders / "big.frag")
    write(shaders, half__glsl="int a;\n" * 100_000)
    write(shaders, b__frag='#if A\n#include "half.glsl"\n#endif\n#if B\n#include "half.glsl"\n#endif\n')
    with pytest.raises(InputError, match="with its includes is larger than 1,000,000 bytes") as error:
        Includes(shaders.parent / "include").expand(shaders / "b.frag")
    place = problem(error).place
    taken = 6 + 700_000 + 7 + 6  # three directives, and all of the file once
    assert place is not None
    assert (Path(place.file).name, place.line) == ("half.glsl", (1_000_000 - taken) // 7 + 1)


def test_missing_and_unreadable_files(shaders: Path) -> None:
    write(shaders, glow__frag="")
    with pytest.raises(InputError, match=r"RG400 there is no shader .*glov\.frag'; did you mean 'glow\.frag'\?"):
        Includes(shaders.parent / "include").expand(shaders / "glov.frag")
    (shaders / "latin.frag").write_bytes(b"int a; \xe9\n")
    with pytest.raises(InputError, match="RG407 the shader is not UTF-8"):
        Includes(shaders.parent / "include").expand(shaders / "latin.frag")


def test_includes_of_two_prefixes_are_both_there(shaders: Path) -> None:
    write(shaders, a__glsl='#include "b.glsl"\n', b__glsl="int b;\n")
    resolver = Includes(shaders.parent / "include")
    assert "int b;" in resolver.expand(shaders / "a.glsl", prefix="one_").text
    assert "int b;" in resolver.expand(shaders / "a.glsl", prefix="two_").text


PAGES = {path.name[:5]: path for path in sorted(folder_of("rendergraph.errors").glob("RG40*.yaml"))}


def message_of(error: InputError) -> str:
    """A problem as its page has it: without the file, and without the line of text."""
    (found,) = error.problems
    place = f"{found.place.line}:{found.place.column}: " if found.place and found.place.line else ""
    return f"{place}{found.code} {found.message}"


@pytest.mark.parametrize("code", ["RG401", "RG402", "RG404", "RG405", "RG406"])
def test_error_pages_say_what_is_said(shaders: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    page = yaml.safe_load(PAGES[code].read_text())
    monkeypatch.chdir(shaders)
    write(shaders, glow__frag=page["wrong"], kernel__glsl="", secret__glsl="")
    with pytest.raises(InputError, match=code) as error:
        Includes(shaders.parent / "include").expand(shaders / "glow.frag")
    assert message_of(error.value) == page["message"]
    write(shaders, glow__frag=page["right"])
    Includes(shaders.parent / "include").expand(shaders / "glow.frag")


def test_error_pages_of_files(shaders: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pages = {code: yaml.safe_load(path.read_text()) for code, path in PAGES.items()}
    monkeypatch.chdir(shaders)
    write(shaders, glow__frag="", big__frag="int a;\n" * 200_000)
    (shaders / "latin.frag").write_bytes(pages["RG407"]["wrong"].encode("latin-1"))
    for code, name in (("RG400", "glov.frag"), ("RG403", "big.frag"), ("RG407", "latin.frag")):
        with pytest.raises(InputError, match=code) as error:
            Includes(shaders.parent / "include").expand(shaders / name)
        assert message_of(error.value) == pages[code]["message"]
