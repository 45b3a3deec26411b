"""What the page costs beside the frame: `python tests/bench/bench_view.py`.

A page without a browser moves the camera, turns a slider and changes nothing but looks, and waits for each picture; the
time until it comes is held against the frame's own, as the picture says it. Then memory over many changes.
"""

from __future__ import annotations

import contextlib
import json
import os
import statistics
import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from measure import options
from websockets.sync.client import connect
from websockets.typing import Origin

import rendergraph as rg


def main() -> None:
    """Print a line for each kind of change, and one for memory."""
    chosen = options(__doc__, frames=30, width=640, height=360)
    pipeline = rg.load("deferred", size=(chosen.width, chosen.height))
    # What is not saved is kept in the folder.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), rg.view(pipeline) as viewer:
        place = urlsplit(viewer.url)
        origin = Origin(f"http://{place.netloc}")
        with connect(f"ws://{place.netloc}{place.path}socket", origin=origin, max_size=None, proxy=None) as socket:
            measure(socket, chosen.frames)


def measure(socket: Any, count: int) -> None:
    """Everything there is to say."""

    def say(**message: Any) -> None:
        socket.send(json.dumps(message))

    def picture() -> dict[str, Any]:
        while True:
            data = socket.recv(timeout=120)
            if isinstance(data, bytes):
                (size,) = struct.unpack_from("<I", data)
                facts: dict[str, Any] = json.loads(data[4 : 4 + size])
                if facts["kind"] == "picture":
                    return facts

    def timed(name: str, act: Callable[[int], None]) -> None:
        own, waited = [], []
        for number in range(count):
            begun = time.perf_counter()
            act(number)
            facts = picture()
            waited.append((time.perf_counter() - begun) * 1e3)
            own.append(facts["frame_ms"])
        frame, all_of_it = statistics.median(own), statistics.median(waited)
        print(f"{name:24} {all_of_it:8.1f} ms to the picture, {frame:8.1f} ms of them the frame")

    picture()
    timed("still, full size", lambda n: say(do="camera", orbit=[0.01, 0.0]))
    say(do="hold", on=True)
    timed("camera, while dragging", lambda n: say(do="camera", orbit=[0.01, 0.0]))
    timed("slider, while dragging", lambda n: say(do="set", path="display.exposure", value=n / 100, again=True))
    timed("slider of shadows", lambda n: say(do="set", path="shadows.bias", value=n / 100, again=True))
    start = resident()
    for number in range(20 * count):
        say(do="set", path="display.exposure", value=number / 1000, again=True)
        picture()
    print(f"memory over {20 * count} changes: {start:.0f} MiB at first, {resident():.0f} MiB at last")


def resident() -> float:
    """MiB of this process, which serves, and of the one that draws."""
    drawing = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return sum(
        _resident(pid) for pid in (os.getpid(), *(int(pid) for file in drawing for pid in file.read_text().split()))
    )


def _resident(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


if __name__ == "__main__":
    main()
