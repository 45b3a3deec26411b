"""What somebody probably meant who typed an option that a verb does not have."""

from __future__ import annotations

from rendergraph.cli.lazy_click import click
from rendergraph.errors import nearest

_FLOOR = 0.7
"""Similarity below which a word is another word: `width` is not `watch` (0.6), `siez` is `size` (0.75)."""

MEANINGS = {
    "--size WxH": "width height w h resolution res dimensions geometry",
    "-o FILE": "out outfile output-file output-path save write to render-output dest",
    "-o film.mp4": "video movie film animation anim render-anim mp4 gif webp",
    "-o picture.png": "image picture png format render-format file-format",
    "-o radiance.exr": "exr hdr-output float",
    "--frames A-B": "frame start end frame-start frame-end render-frame duration time-range",
    "--fps N": "r rate framerate frame-rate",
    "--scene FILE": "i input model mesh object import file gltf glb obj world",
    "--camera NAME": "eye position look-at lookat fov viewpoint",
    "--environment NAME": "hdri envmap sky ibl",
    "--executor processes:N": "threads j jobs workers parallel processes num-threads",
    "--device NUMBER": "gpu cpu cuda backend engine",
    "--plugin PATH": "addons include include-path",
    "-s PATH=VALUE": "d define param params parameter option override opt config-options",
    "-s NODE.samples=N": "samples spp sample-count msaa antialias quality",
    "-s NODE.enabled=false": "disable without skip",
    "-s display.exposure=EV": "exposure ev brightness",
    "-s display.curve=NAME": "tonemap tone-map curve gamma vf",
    "-s light.background=COLOR": "background-color bg",
    "rendergraph view": "open gui window interactive preview display show play",
    "rendergraph bench": "benchmark profile timing timings stats",
    "rendergraph check": "check validate lint dry-run",
    "rendergraph compare": "diff",
    "rendergraph pipelines": "list ls",
    "rendergraph config": "c config print-config dump",
    "rendergraph --version": "version v",
}
"""What to type, and the words for it in other programs, Blender, Mitsuba, ffmpeg and git among them."""
NEEDLESS = {
    "pictures are overwritten without asking": "overwrite force yes y",
    "no verb but `view` opens a window": "b background headless no-window no-gui offscreen",
    "all messages are printed unless there is --quiet": "verbose debug loglevel log-level",
}


def unknown_option(error: click.NoSuchOption, context: click.Context) -> str:
    name = error.option_name
    if not name.startswith("--"):  # click found only the first letter of `-width`
        name = next((word for word in context.obj or () if word.startswith(name)), name)
    return f"unknown option '{name}'{_meant(name, context)}"


def _meant(name: str, context: click.Context) -> str:
    word = name.lstrip("-").partition("=")[0].lower().replace("_", "-")
    own = _options(context.command)
    for advice, words in MEANINGS.items():
        if word in words.split():
            # Other verbs than `run` write other files than pictures.
            picture = advice.startswith("-o ") and "." in advice and context.command.name != "run"
            known = advice.startswith("rendergraph") or (advice.partition(" ")[0] in own and not picture)
            return f"; did you mean '{advice}'" + ("?" if known else " of `rendergraph run`?")
    for reason, words in NEEDLESS.items():
        if word in words.split():
            return f"; leave it out: {reason}"
    if (near := nearest(word, {option[2:] for option in own if option.startswith("--")}, floor=_FLOOR)) is not None:
        return f"; did you mean '--{near}'?"
    root = context.find_root()
    assert isinstance(root.command, click.Group)
    verbs = {verb: root.command.get_command(root, verb) for verb in root.command.list_commands(root)}
    owners = [f"`{verb}`" for verb, command in verbs.items() if command and name in _options(command)]
    return f"; it is an option of {', '.join(owners)}" if owners else ""


def _options(command: click.Command) -> list[str]:
    return [option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)]
