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
from OpenImageIO import ImageBuf

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from images.layout import Layout, laid_out  # how the documentation's pictures are put together

import rendergraph as rg
from rendergraph import images

HERE = Path(__file__).parent
GAP = 8
POSTS = (
    ("ssao-disc", ["form=disc", "samples=64", "radius=1.2"]),
    ("ssao-disc", ["samples=8", "radius=3"]),
    ("ssil", ["samples=64", "radius=1.2", "thickness=0.1"]),
)
POST_NAMES = ("discs", "few strips", "a bitmask")
STAIRS = ("ssao-hemisphere", "ssao-disc", "ssao-hbao", "ssao-gtao", "ssao-ssgi", "ssil")


def occlusion(session: rg.Session, pipeline: str, scene: str, size: tuple[int, int], sets: list[str]) -> Any:
    """How open surfaces are found to be, shape (height, width)."""
    node = "gi" if pipeline in ("ssao-ssgi", "ssil") else "ao"
    patch = {"outputs": {"occlusion": f"{node}.occlusion"}}
    named = [f"{node}.{one}" for one in [*sets, *(["wider=1"] if node == "gi" else [])]]
    loaded = rg.load(pipeline, scene=HERE / scene, size=size, sets=named, patches=[patch])
    return np.asarray(session.render(loaded)["occlusion"], np.float32)


def traced(session: rg.Session) -> npt.NDArray[np.float32]:
    """The same by rays: the traced picture over one without occlusion, both under ambient light of 1 alone."""
    truth = ImageBuf(str(HERE / "traced.exr")).get_pixels("float")
    assert truth is not None
    sets = ["light.terms=ambient", "light.ambient=1"]
    size = (truth.shape[1], truth.shape[0])
    bare = session.render(rg.load("deferred", scene=HERE / "stairs.yaml", size=size, sets=sets), outputs=["radiance"])
    whole = np.asarray(bare["radiance"][..., :3]).sum(-1)
    return np.asarray(np.where(whole > 0, truth[..., :3].sum(-1) / np.maximum(whole, 1e-6), 1), np.float32)


def write(file: Path, panels: dict[str, npt.NDArray[Any]], columns: int, enlarge: int) -> None:
    """Panels of equal size as a sheet with their names, values 0 to 1; pixels are repeated."""
    large = [np.repeat(np.repeat(panel, enlarge, 0), enlarge, 1) for panel in panels.values()]
    bytes_ = [(np.clip(panel, 0, 1) * 255 + 0.5).astype(np.uint8) for panel in large]
    images.write(file, laid_out(bytes_, Layout(columns, GAP, list(panels))))


def main() -> None:
    """Draw both."""
    folder = Path(sys.argv[1])
    with rg.Session() as session:
        grey = [occlusion(session, name, "posts.yaml", (270, 200), sets) for name, sets in POSTS]
        shown = {name: np.repeat(one[..., None], 3, -1) for name, one in zip(POST_NAMES, grey, strict=True)}
        write(folder / "ssao-disc-fails.png", shown, 3, 2)
        truth = traced(session)
        size = (truth.shape[1], truth.shape[0])
        panels = {}
        for name in STAIRS:
            off = 8 * (occlusion(session, name, "stairs.yaml", size, ["samples=64", "radius=1"]) - truth)
            dark, light = np.maximum(-off, 0), np.maximum(off, 0)
            panels[name] = 1 - np.stack([light, dark + light, dark], -1)
        write(folder / "ssao-errors.png", panels, 3, 2)


if __name__ == "__main__":
    main()
