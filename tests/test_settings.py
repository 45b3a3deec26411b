"""The project's settings file. What roots mean for pipelines is in `resolve/`."""

from __future__ import annotations

from pathlib import Path

import pytest

from rendergraph.errors import InputError, Place
from rendergraph.settings import CacheLimits, Roots, load, nearest_settings


def test_the_nearest_above(tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    assert nearest_settings(inner) is None
    (tmp_path / "rendergraph.toml").write_text('asset_roots = ["../assets", "/data"]\nplugins = ["nodes"]\n')
    found = nearest_settings(inner)
    assert found is not None
    assert found.folder == tmp_path
    assert found.asset_roots == (tmp_path / "../assets", Path("/data"))
    assert found.plugins == (tmp_path / "nodes",)
    (tmp_path / "a" / "rendergraph.toml").touch()
    nearer = nearest_settings(inner)
    assert nearer is not None
    assert nearer.folder == tmp_path / "a"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("asset_roots = [", "RG017 not a valid settings file"),
        ("asset_root = []", r"RG017 a settings file has no key 'asset_root'; did you mean 'asset_roots'\?"),
        (
            'plugins = "nodes"',
            r"RG017 'plugins': expected a list of paths, as in plugins = \[\"my_effects\"\], got 'nodes'",
        ),
        ("cache = {programs = -1}", "RG017 'programs': expected a whole number"),
        ("plugins = [1]", "RG017 'plugins': expected a list of paths"),
        ('plugins = ["a\\u0000b"]', "RG017 'plugins': expected a list of paths"),
    ],
)
def test_wrong_settings(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "rendergraph.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        load(tmp_path / "rendergraph.toml")
    (tmp_path / "rendergraph.toml").write_bytes(b"\xff")
    with pytest.raises(InputError, match="RG017"):
        load(tmp_path / "rendergraph.toml")


def test_limits_of_the_cache(tmp_path: Path) -> None:
    (tmp_path / "rendergraph.toml").write_text("[cache]\nmebibytes = 64\n")
    assert load(tmp_path / "rendergraph.toml").cache == CacheLimits(mebibytes=64)


def test_the_home_of_nobody_is_a_path_like_any(tmp_path: Path) -> None:
    (tmp_path / "rendergraph.toml").write_text('plugins = ["~/nodes", "~of_nobody/nodes"]\n')
    assert load(tmp_path / "rendergraph.toml").plugins == (Path.home() / "nodes", tmp_path / "~of_nobody/nodes")


def test_roots_say_where_a_path_stands(tmp_path: Path) -> None:
    roots = Roots.of_file(tmp_path / "pipeline.yaml")
    (tmp_path / "texture.png").touch()
    assert roots.check(tmp_path / "." / "texture.png") == (tmp_path / "texture.png").resolve()
    place = Place("scene.yaml", 3, 5)
    for path, message in (
        (tmp_path / "textures.png", r"scene.yaml:3:5: RG011 .*; did you mean 'texture.png'\?"),
        (tmp_path, "scene.yaml:3:5: RG011 .* is a folder"),
        (tmp_path / ".." / "x.png", "scene.yaml:3:5: RG012"),
        (Path("/dev/zero"), "scene.yaml:3:5: RG012"),
    ):
        with pytest.raises(InputError, match=message):
            roots.check(path, place)
    with pytest.raises(InputError, match=r"RG011 there is no file 'a/b.png'"):
        roots.check(tmp_path / "b.png", place, written="a/b.png")
