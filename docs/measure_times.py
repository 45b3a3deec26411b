"""Time every shipped pipeline on this machine's device, and write the page that lists the times: `docs/gpu-times.md`.

`make gpu-times` calls this, on a machine with a GPU. A file name as argument is written instead of the page.
"""

from __future__ import annotations

import datetime
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from rendergraph.resources import shipped_pipelines

HERE = Path(__file__).resolve().parent
SIZE, FRAMES, MOST_SECONDS = "1920x1080", "20", 40
HEAD = """# Times on a GPU

Milliseconds of each shipped pipeline in its own scene at {size}, measured on {date} on
{device} by `make gpu-times`. Each is the median of {frames} frames, after one that is not measured.
The slowest passes are listed with their share of the frame. Memory is that of the pipeline's textures, of which several
may share one.

Times differ between devices. To measure yours, use `rendergraph bench`, which has each pass with its spread:

```console
$ rendergraph bench full --size 1920x1080
…frame …
```
{note}
| pipeline | ms | slowest passes | memory |
| --- | ---: | --- | ---: |
"""
NOTE = """
An H100 is made for computing. By NVIDIA's own account ("NVIDIA H100 Tensor Core GPU Architecture", 2022), only two of
its 66 texture processing clusters run vertex, geometry and fragment shaders. So it draws about as fast as the GPU of a
small laptop, and passes in compute shaders look better here than elsewhere. Compare the rows with each other, and not
with other devices.
"""


def measured(name: str) -> dict[str, Any] | str:
    """What `rendergraph bench` finds, or why it finds nothing."""
    command = [sys.executable, "-m", "rendergraph", "bench", name, "--size", SIZE, "--frames", FRAMES, "--json"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=MOST_SECONDS)
    except subprocess.TimeoutExpired:
        return f"more than {MOST_SECONDS / int(FRAMES) * 1000:.0f}"
    if result.returncode:
        return result.stderr.strip().splitlines()[-1]
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def row(name: str, found: dict[str, Any] | str) -> str:
    """A row of the table."""
    page = f"[`{name}`](gallery/{name}.md)" if (HERE / "gallery" / f"{name}.md").exists() else f"`{name}`"
    if isinstance(found, str):
        return f"| {page} | {found} | | |\n"
    times = {each["node"]: each["gpu_ms"]["median"] for each in found["passes"] if each["gpu_ms"]}
    total = sum(times.values())
    slowest = sorted(times, key=lambda node: -times[node])[:3]
    shares = ", ".join(f"`{node}` {times[node] / total:.0%}".replace("%", " %") for node in slowest)
    return f"| {page} | {found['frame_ms']['median']:.2f} | {shares} | {found['memory']} |\n"


def main() -> None:
    """Measure, and write the page or the given file."""
    rows, device = [], ""
    for name in shipped_pipelines():
        found = measured(name)
        if not isinstance(found, str):
            device = found["device"]["renderer"].partition("/")[0]
            found["memory"] = f"{found['memory']['allocated_bytes'] / 2**20:.0f} MiB"
        rows.append(row(name, found))
        print(rows[-1], end="", flush=True)
    head = HEAD.format(
        size=SIZE.replace("x", "×"),
        date=datetime.date.today(),
        device=device,
        frames=FRAMES,
        note=NOTE if "H100" in device else "",
    )
    (Path(sys.argv[1]) if sys.argv[1:] else HERE / "gpu-times.md").write_text(head + "".join(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
