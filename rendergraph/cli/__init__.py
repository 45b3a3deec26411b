"""The command line: one file a verb, imported when it is called; nothing here but words, files and exit codes."""

from rendergraph.cli.app import main

__all__ = ["main"]
