"""A session renders pipelines, by value, name or file, on one GL context."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Unpack

from rendergraph.session import stages
from rendergraph.session.drawing import Drawing
from rendergraph.session.frame import Frame
from rendergraph.session.gpu import Gpu
from rendergraph.session.pipeline import Pipeline, as_pipeline
from rendergraph.session.progress import Progress
from rendergraph.session.selection import RenderKeywords


class Session(Gpu):
    """Renders pipelines on one GL context, and caches on it what the next one can use.

    Programs are cached by source and macros; a scene stays on the GPU until another pipeline needs a different one; the
    last few compiled pipelines are kept with their textures, so that variants can take turns. When a shader or include
    changes, only the programs whose text it changes are compiled again. A session is bound to the thread that created
    it.
    """

    def render(
        self,
        pipeline: Pipeline | str | Path | Mapping[str, Any],
        size: tuple[int, int] | None = None,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Frame:
        """Render a pipeline and return the last frame; see `Pipeline.render`."""
        return as_pipeline(pipeline).render(size, session=self, progress=progress, **options)

    def frames(
        self,
        pipeline: Pipeline | str | Path | Mapping[str, Any],
        size: tuple[int, int] | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Iterator[Frame]:
        """Render a pipeline frame by frame; see `Pipeline.frames`."""
        return as_pipeline(pipeline).frames(size, session=self, **options)

    def compile(
        self, pipeline: Pipeline | str | Path | Mapping[str, Any], **options: Unpack[RenderKeywords]
    ) -> Drawing:
        """Compile a pipeline without rendering it; a cached executable is used again if only uniforms differ.

        Call it, and use the result, inside `with session.current()`. Its `runner` renders the bare frame, without the
        warm-up and the read-back of `render`.
        """
        return stages.compile(as_pipeline(pipeline).expand(**options), self)
