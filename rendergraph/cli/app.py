"""The group of verbs, and the one place where an exception becomes a message and an exit code."""

from __future__ import annotations

import contextlib
import errno
import importlib
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from copy import copy
from pathlib import Path
from types import FrameType
from typing import NoReturn

from rendergraph import activity
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import only_data, print_error, say, set_quiet
from rendergraph.errors import (
    EXIT_CODES,
    InputError,
    Interruption,
    Place,
    Problem,
    RendergraphError,
    is_framework,
    nearest,
    suggestion,
)
from rendergraph.version import __version__

_MODULES = {
    "run": ("run",),
    "view": ("view", "gallery"),
    "inspection": ("check", "plan", "graph", "config", "diff"),
    "edit": ("edit", "upgrade"),
    "compare": ("compare",),
    "sweep": ("sweep", "farm"),
    "bench": ("bench",),
    "lists": ("nodes", "pipelines", "scenes", "environments"),
    "explain": ("explain", "schema"),
    "authoring": ("init", "copy", "new-node", "check-node"),
    "doctor": ("doctor",),
    "mcp": ("mcp",),
}
VERBS = {verb: module for module, verbs in _MODULES.items() for verb in verbs}
"""The module of each verb, in the order of `--help`; the verb is the function of its name there."""

INTERRUPTED = 130
_FLOOR = 0.7
"""Similarity below which a word is another word: `width` is not `watch` (0.6), `siez` is `size` (0.75)."""


def verb(name: str) -> click.Command:
    module = importlib.import_module(f"rendergraph.cli.{VERBS[name]}")
    found: click.Command = getattr(module, name.replace("-", "_"))
    return found


_QUIET = click.Option(
    ["-q", "--quiet"],
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=lambda ctx, param, value: set_quiet(value),
    help="Print only errors.",
)
"""An option of every verb."""


class _Verbs(click.Group):
    """A group whose members are imported when they are needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        found = copy(verb(cmd_name))
        found.params = [*found.params, _QUIET]
        if found.callback is not None:
            found.callback = only_data()(found.callback)
        return found

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in VERBS and not args[0].startswith("-"):
            from rendergraph.resources import shipped_pipelines  # only needed for a misspelt verb

            is_pipeline = args[0] in shipped_pipelines() or args[0].endswith((".yaml", ".yml"))
            meant = _meant_by(args[0].lower(), "verbs") or (f"run {args[0]}" if is_pipeline else None)
            hint = f"; did you mean '{meant}'?" if meant else suggestion(args[0], VERBS)
            ctx.fail(f"unknown verb '{args[0]}'{hint}")
        return super().resolve_command(ctx, args)


_EPILOG = "\b\nExit codes:\n" + "\n".join(f"  {code:<4} {meaning}" for code, meaning in EXIT_CODES.items())


@click.group(
    cls=_Verbs, epilog=_EPILOG, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, prog_name="rendergraph")
def group() -> None:
    """A laboratory for real-time rendering: a renderer is one YAML file.

    \b
    Examples:
      rendergraph run forward
      rendergraph explain pipeline
      rendergraph check my.yaml
    """


def main(args: Sequence[str]) -> int:
    """Run one command line, given without the program's name, and return the exit code of design.md §7."""
    as_json = "--json" in args
    set_quiet(False)
    try:
        with _terminable():
            code = _invoke(list(args))
            _flush()
            return code
    except RendergraphError as error:
        return fail(error.problems, error.exit_code, as_json)
    except click.exceptions.NoArgsIsHelpError as error:
        say(error.format_message())
        return error.exit_code
    except click.UsageError as error:
        return fail([_usage(error)], error.exit_code, as_json)
    except click.ClickException as error:
        return fail([Problem("RG500", error.format_message())], error.exit_code, as_json)
    except (KeyboardInterrupt, click.Abort):
        say("interrupted")
        return INTERRUPTED
    except Interruption as signalled:
        with contextlib.suppress(OSError):  # the terminal may be gone
            say("terminated")
        return 128 + signalled.number
    except BrokenPipeError:
        _discard_stdout()  # the reader closed the pipe: `rendergraph nodes | head`
        return 0
    except MemoryError:
        return fail([Problem("RG509", f"out of memory{activity.during()}")], 1, as_json)
    except OSError as error:
        if os.environ.get("RENDERGRAPH_TRACEBACK"):
            raise
        where = Place(str(error.filename)) if error.filename else None
        code = InputError.exit_code if error.errno == errno.ENAMETOOLONG else 1
        return fail([Problem("RG509", error.strerror or str(error), where)], code, as_json)
    except BaseException as error:  # SystemExit in third-party code, too
        if isinstance(error, ImportError) and not is_framework(error.name or ""):
            missing = isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0]
            fix = f"install it: pip install {missing}" if missing else "install it again"
            text = f"a library that rendergraph needs cannot be loaded: {error}; {fix}"
            return fail([Problem("RG509", text)], 1, as_json)
        if os.environ.get("RENDERGRAPH_TRACEBACK"):
            raise
        return fail([unexpected(error)], 1, as_json)


def _invoke(words: list[str]) -> int:
    if "_RENDERGRAPH_COMPLETE" in os.environ:  # the shell asks for completions
        from rendergraph.cli.completion import install

        install()
        try:
            group.main(words, prog_name="rendergraph", complete_var="_RENDERGRAPH_COMPLETE")
        except SystemExit as done:
            return int(done.code or 0)
    try:
        with group.make_context("rendergraph", words, obj=tuple(words)) as context:
            group.invoke(context)
    except click.exceptions.Exit as done:
        return int(done.exit_code)
    return 0


def fail(problems: Sequence[Problem], code: int, as_json: bool) -> int:
    """Print the problems and return the exit code, even if nothing can be printed."""
    try:
        print_error(problems, code, as_json=as_json)
        _flush()
    except OSError:
        _discard_stdout()
    return code


def _usage(error: click.UsageError) -> Problem:
    path = error.ctx.command_path if error.ctx else "rendergraph"
    if isinstance(error, click.NoSuchOption) and error.ctx:
        text = _unknown_option(error, error.ctx)
    else:
        text = " ".join(error.format_message().split()).rstrip(".")
    return Problem("RG500", f"{text[:1].lower()}{text[1:]}; see '{path} --help'")


def _meant_by(word: str, kind: str) -> str | None:
    """Return the entry for another program's word in `meanings`, `needless` or `verbs` of the table."""
    import yaml  # only needed for a misspelt word

    table = yaml.safe_load(Path(__file__).with_name("suggestions.yaml").read_text(encoding="utf-8"))
    return next((advice for advice, words in table[kind].items() if word in words.split()), None)


def _unknown_option(error: click.NoSuchOption, context: click.Context) -> str:
    name = error.option_name
    if not name.startswith("--"):  # click reports only the first letter of `-width`
        name = next((word for word in context.obj or () if word.startswith(name)), name)
    return f"unknown option '{name}'{_meant(name, context)}"


def _meant(name: str, context: click.Context) -> str:
    word = name.lstrip("-").partition("=")[0].lower().replace("_", "-")
    own = _options(context.command)
    if (advice := _meant_by(word, "meanings")) is not None:
        # Only `run` writes pictures.
        picture = advice.startswith("-o ") and "." in advice and context.command.name != "run"
        known = advice.startswith("rendergraph") or (advice.partition(" ")[0] in own and not picture)
        return f"; did you mean '{advice}'" + ("?" if known else " of `rendergraph run`?")
    if (reason := _meant_by(word, "needless")) is not None:
        return f"; leave it out: {reason}"
    if (near := nearest(word, {option[2:] for option in own if option.startswith("--")}, floor=_FLOOR)) is not None:
        return f"; did you mean '--{near}'?"
    owners = [f"`{one}`" for one in VERBS if name in _options(verb(one))]
    return f"; it is an option of {', '.join(owners)}" if owners else ""


def _options(command: click.Command) -> list[str]:
    return [option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)]


def unexpected(error: BaseException) -> Problem:
    what = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
    text = f"internal error (a bug in rendergraph): {what}; RENDERGRAPH_TRACEBACK=1 shows where, please report it "
    return Problem("RG599", text + "with the output of `rendergraph doctor`")


def _flush() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def _discard_stdout() -> None:
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """Unwind on the first SIGINT, SIGTERM or SIGHUP: remove half-written files and end child processes.

    Signals that are ignored, as SIGHUP under nohup, stay ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handled = [number for number in signals if signal.getsignal(number) is not signal.SIG_IGN]
    interruptions: list[BaseException] = []

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        for each in handled:  # unwinding must not be interrupted; the supervisor limits its time
            signal.signal(each, signal.SIG_IGN)
        interruptions.append(KeyboardInterrupt() if number == signal.SIGINT else Interruption(number))
        raise interruptions[0]

    before = {number: signal.signal(number, stop) for number in handled}
    try:
        yield
    except BaseException as error:
        if interruptions and error is not interruptions[0]:
            raise interruptions[0] from error  # third-party code has replaced it
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
