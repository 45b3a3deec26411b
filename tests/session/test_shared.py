"""Calls without a session share a context within their thread."""

from __future__ import annotations

import threading

import numpy as np

import rendergraph as rg
from rendergraph.session import gpu


def test_calls_of_a_thread_share_a_context_and_threads_have_their_own() -> None:
    pipeline = rg.load("shading-unlit", size=(8, 8))
    first = pipeline.render()["image"]
    here = gpu.shared(None)
    made = here.cache.scenes_made
    again = pipeline.set("display.exposure", 0).render()["image"]
    assert gpu.shared(None) is here
    assert here.cache.scenes_made == made, "the second call found the scene on the GPU"
    seen: list[object] = []

    def work() -> None:
        seen.extend([pipeline.render()["image"], gpu.shared(None)])

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    np.testing.assert_array_equal([again, seen[0]], [first, first])
    assert isinstance(seen[1], gpu.Gpu)
    assert seen[1] is not here
    del thread
    assert not seen[1].is_usable, "closed with its thread"


def test_a_closed_context_is_replaced() -> None:
    here = gpu.shared(None)
    here.close()
    assert gpu.shared(None) is not here


def test_films_of_one_pipeline_can_take_turns() -> None:
    """Each has a context of its own, because each has a history of its own."""
    pipeline = rg.load("taa", size=(16, 9))
    alone = [frame["image"] for frame in pipeline.frames(frames=range(1, 4))]
    for expected, one, other in zip(
        alone, pipeline.frames(frames=range(1, 4)), pipeline.frames(frames=range(1, 4)), strict=True
    ):
        np.testing.assert_array_equal([one["image"], other["image"]], [expected, expected])
