"""Two pictures of what is wrong, into a folder: `python fails.py FOLDER`.

`ssao-disc-fails.png`: discs, few strips, and a bitmask on `posts.yaml`. `ssao-errors.png`: six techniques against the
ray-traced stairs, eight times as strong; red is too dark, blue too light.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from OpenImageIO import ImageBuf, ImageSpec

import rendergraph as rg

HERE = Path(__file__).parent
GAP = 4
POSTS = (
    ("ssao-disc", ["form=disc", "samples=64", "radius=1.2"]),
    ("ssao-disc", ["samples=8", "radius=3"]),
    ("ssil", ["samples=64", "radius=1.2"]),
)
STAIRS = ("ssao-hemisphere", "ssao-disc", "ssao-hbao", "ssao-gtao", "ssao-ssgi", "ssil")


def occlusion(session: rg.Session, pipeline: str, scene: str, size: tuple[int, int], sets: list[str]) -> Any:
    """How open surfaces are found to be, shape (height, width)."""
    node = "gi" if pipeline in ("ssao-ssgi", "ssil") else "ao"
    patch = {"outputs": {"occlusion": f"{node}.occlusion"}}
    named = [f"{node}.{one}" for one in [*sets, *(["wider=1"] if node == "gi" else [])]]
    loaded = rg.load(pipeline, scene=HERE / scene, size=size, sets=named, patches=[patch])
    return np.asarray(session.render(loaded)["occlusion"][..., 0], np.float32)


def traced(session: rg.Session) -> npt.NDArray[np.float32]:
    """The same by rays: the traced picture over one without occlusion, both under ambient light of 1 alone."""
    truth = ImageBuf(str(HERE / "traced.exr")).get_pixels("float")
    assert truth is not None
    sets = ["light.terms=ambient", "light.ambient=1"]
    size = (truth.shape[1], truth.shape[0])
    bare = session.render(rg.load("deferred", scene=HERE / "stairs.yaml", size=size, sets=sets), outputs=["radiance"])
    whole = np.asarray(bare["radiance"][..., :3]).sum(-1)
    return np.asarray(np.where(whole > 0, truth[..., :3].sum(-1) / np.maximum(whole, 1e-6), 1), np.float32)


def write(file: Path, rows: list[list[npt.NDArray[Any]]]) -> None:
    """Panels of equal size as a sheet, values 0 to 1, a gap between them."""
    lines = []
    for row in rows:
        gap = np.ones((row[0].shape[0], GAP, 3))
        lines.append(np.concatenate([part for panel in row for part in (panel, gap)][:-1], 1))
    sheet = [part for line in lines for part in (line, np.ones((GAP, *line.shape[1:])))][:-1]
    picture = np.ascontiguousarray(np.concatenate(sheet), np.float32)
    buffer = ImageBuf(ImageSpec(picture.shape[1], picture.shape[0], 3, "float"))
    buffer.set_pixels(buffer.roi, picture)
    buffer.write(str(file), "uint8")


def main() -> None:
    """Draw both."""
    folder = Path(sys.argv[1])
    with rg.Session() as session:
        grey = [occlusion(session, name, "posts.yaml", (270, 200), sets) for name, sets in POSTS]
        write(folder / "ssao-disc-fails.png", [[np.repeat(one[..., None], 3, -1) for one in grey]])
        truth = traced(session)
        size = (truth.shape[1], truth.shape[0])
        panels = []
        for name in STAIRS:
            off = 8 * (occlusion(session, name, "stairs.yaml", size, ["samples=64", "radius=1"]) - truth)
            dark, light = np.maximum(-off, 0), np.maximum(off, 0)
            panels.append(1 - np.clip(np.stack([light, dark + light, dark], -1), 0, 1))
        write(folder / "ssao-errors.png", [panels[:3], panels[3:]])


if __name__ == "__main__":
    main()
