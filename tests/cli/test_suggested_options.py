"""What the command line answers to options of other programs, and to misspelt ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from rendergraph.cli import app
from rendergraph.cli.app import VERBS, verb


@pytest.mark.parametrize(
    ("typed", "answer"),
    [
        ("run forward --width 640", "did you mean '--size WxH'?"),
        ("run forward --height=480", "did you mean '--size WxH'?"),
        ("run forward -width 640", "unknown option '-width'; did you mean '--size WxH'?"),
        ("run forward --resolution 640x360", "did you mean '--size WxH'?"),
        ("run forward --open", "did you mean 'rendergraph view'?"),
        ("run forward --gui", "did you mean 'rendergraph view'?"),
        ("run forward --gif", "did you mean '-o film.mp4'?"),
        ("run forward --video", "did you mean '-o film.mp4'?"),
        ("run forward --render-anim", "did you mean '-o film.mp4'?"),
        ("run forward --samples 16", "did you mean '-s NODE.samples=N'?"),
        ("run forward --spp=16", "did you mean '-s NODE.samples=N'?"),
        ("run forward --outfile a.png", "did you mean '-o FILE'?"),
        ("run forward --render_output a.png", "did you mean '-o FILE'?"),
        ("run forward --render-format PNG", "did you mean '-o picture.png'?"),
        ("run forward --frame-start 3", "did you mean '--frames A-B'?"),
        ("run forward -r 30", "did you mean '--fps N'?"),
        ("run forward --framerate 30", "did you mean '--fps N'?"),
        ("run -i forward", "did you mean '--scene FILE'?"),
        ("run forward --gltf a.glb", "did you mean '--scene FILE'?"),
        ("run forward -D spp=4", "did you mean '-s PATH=VALUE'?"),
        ("run forward --exposure 1", "did you mean '-s display.exposure=EV'?"),
        ("run forward --hdri a.exr", "did you mean '--environment NAME'?"),
        ("run forward --lookat 0,0,0", "did you mean '--camera NAME'?"),
        ("run forward --threads 4", "did you mean '--executor processes:N'?"),
        ("run forward --gpu 0", "did you mean '--device NUMBER'?"),
        ("run forward --background", "leave it out: no verb but `view` opens a window"),
        ("run forward -y", "leave it out: pictures are overwritten without asking"),
        ("run forward --verbose", "leave it out: all messages are printed unless there is --quiet"),
        ("run forward --dry-run", "did you mean 'rendergraph check'?"),
        ("run forward --stats", "did you mean 'rendergraph bench'?"),
        ("run forward --version", "did you mean 'rendergraph --version'?"),
        ("plan forward --gif", "did you mean '-o film.mp4' of `rendergraph run`?"),
        ("compare forward --outfile a.html", "did you mean '-o FILE'?"),
        ("compare forward --gif", "did you mean '-o film.mp4' of `rendergraph run`?"),
        ("run forward --against deferred", "it is an option of `view`; see"),
        ("run forward --fraems 1-2", "did you mean '--frames'?"),
        ("run forward --env sky", "did you mean '--environment'?"),
        ("compare forward --refernce deferred", "did you mean '--reference'?"),
        ("run forward --wobble", "unknown option '--wobble'; see 'rendergraph run --help'"),
    ],
)
def test_an_unknown_option_is_answered_with_what_is_meant(cli: Any, typed: str, answer: str) -> None:
    result = cli(*typed.split())
    assert (result.code, answer in result.err) == (2, True), result.err


def test_what_is_suggested_exists_and_no_word_stands_twice() -> None:
    known = {option for parameter in verb("run").params for option in parameter.opts}
    table = yaml.safe_load(Path(app.__file__).with_name("suggestions.yaml").read_text())
    for advice in table["meanings"]:
        first, second, *_ = advice.split()
        assert first in known or second in (*VERBS, "--version"), advice
    words = " ".join((*table["meanings"].values(), *table["needless"].values())).split()
    assert sorted(set(words)) == sorted(words)
