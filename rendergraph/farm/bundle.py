"""The files that pipelines are drawn from, so that they can be laid out elsewhere as they lie here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rendergraph.session.selection import Selection


@dataclass(frozen=True)
class Bundle:
    """Which."""


def placed(selection: Selection, root: Path | None) -> Selection:
    """A selection whose files lie beneath a folder as they lie beneath `/` where it was made."""
    if root is None:
        return selection

    def moved(path: Path) -> Path:
        return root / path.relative_to(path.anchor) if path.is_absolute() else path

    return replace(
        selection,
        source=str(moved(Path(selection.source))),
        scene=None if selection.scene is None else str(moved(Path(selection.scene))),
        environment=None if selection.environment is None else moved(selection.environment),
        patches=tuple(moved(each) if isinstance(each, Path) else each for each in selection.patches),
        asset_roots=tuple(map(moved, selection.asset_roots)),
        plugins=tuple(map(moved, selection.plugins)),
    )
