"""A session draws pipelines, names and files on one GL context."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Unpack

from rendergraph.session import stages
from rendergraph.session.drawing import Drawing
from rendergraph.session.frame import Frame
from rendergraph.session.gpu import Gpu
from rendergraph.session.pipeline import Pipeline, loaded
from rendergraph.session.progress import Progress
from rendergraph.session.selection import RenderKeywords


class Session(Gpu):
    """Draws pipelines on one GL context, and keeps on it what the next one can use.

    Programs live as long as the session, keyed by source and macros; a scene stays on the GPU until another pipeline
    asks for a different one; compiled pipelines and their textures are kept for the last few that were drawn, so that
    variants can be drawn in turns. A changed shader or include is noticed, and only the programs whose text it changes
    are compiled anew. A session is bound to the thread that made it.
    """

    def render(
        self,
        pipeline: Pipeline | str | Path,
        size: tuple[int, int] | None = None,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Frame:
        """Draw a pipeline, or the one of a name or a file, and return the last frame; see `Pipeline.render`."""
        return loaded(pipeline).render(size, session=self, progress=progress, **options)

    def frames(
        self,
        pipeline: Pipeline | str | Path,
        size: tuple[int, int] | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Iterator[Frame]:
        """Draw a pipeline, or the one of a name or a file, frame by frame; see `Pipeline.frames`."""
        return loaded(pipeline).frames(size, session=self, **options)

    def compile(self, pipeline: Pipeline | str | Path, **options: Unpack[RenderKeywords]) -> Drawing:
        """Compile a pipeline without drawing it; one that is kept is taken again where only uniforms differ.

        To be called, and what it returns used, inside `with session.current()`. Its `runner` draws the bare frame: what
        `render` does before and after (warming up, reading back) is the caller's.
        """
        return stages.compile(loaded(pipeline).expand(**options), self)
