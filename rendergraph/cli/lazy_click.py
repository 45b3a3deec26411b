"""`click`, or `rich_click` where a person asks for help on a terminal.

The boxes and colours of rich-click cost 0.1 s at every start. In a pipe or a log plain lines are better.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import click
else:

    def _is_help() -> bool:
        words = sys.argv[1:]
        return len(words) < 2 or "--help" in words or "-h" in words

    if sys.stdout is not None and sys.stdout.isatty() and _is_help():
        import rich_click as click

        click.rich_click.TEXT_PARAGRAPH_LINEBREAKS = "\n\n"
        click.rich_click.TEXT_EMOJIS = False
    else:
        import click

__all__ = ["click"]
