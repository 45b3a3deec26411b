"""Hold every technique against its traced twin: `python against_twins.py [FOLDER] [shadows] [occlusion] [light]`.

Tables go to stdout. A folder gets a picture of each family, with a magnified part of the truth and the same part of
every technique above its signed error (red is too dark, blue too bright). In `how-wrong-fails.png` the truth itself has
too few rays.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from images.layout import Layout, laid_out  # how the documentation's pictures are put together

import rendergraph as rg
from rendergraph import images

Floats = npt.NDArray[np.float32]
GAP = 8
LABEL = 19
FRAME = 200
SHADOWS = {
    "shadow_map": "shadow-map",
    "shadow_pcf": "shadow-pcf",
    "shadow_vsm": "shadow-vsm",
    "shadow_esm": "shadow-esm",
    "shadow_msm": "shadow-msm",
    "shadow_convolution": "shadow-convolution",
    "shadow_pcss": "shadow-pcss",
    "shadow_cascaded": "shadow-cascaded",
    "shadow_trapezoidal": "shadow-trapezoidal",
    "shadow_volumes": "shadow-volumes-auto",
    "shadow_planar": "shadow-planar",
}
BULBS = {"shadow_cube": "shadow-cube", "shadow_cube_map": "shadow-cube-map"}
OCCLUSION = {
    "ssao_hemisphere": "ssao-hemisphere",
    "ssao_disc": "ssao-disc",
    "hbao": "ssao-hbao",
    "gtao": "ssao-gtao",
    "ssao_ssgi": "ssao-ssgi",
    "ssil": "ssil",
}
LIGHT = {
    "ssgi": "ssgi",
    "ssgi, back faces": "ssgi-back-faces",
    "ssgi, guard band": "ssgi-guard-band",
    "ssgi, hemicube": "ssgi-hemicube",
    "ssao_ssgi": "ssao-ssgi",
    "ssil": "ssil",
}


@dataclass(frozen=True)
class Shots:
    """A session with one scene and size.

    Attributes:
        session: where pictures are drawn.
        scene: a shipped scene.
        size: width and height in pixels.
    """

    session: rg.Session
    scene: str
    size: tuple[int, int]

    def draw(self, pipeline: str, port: str, *sets: str) -> Floats:
        """Return what a port holds, shape (height, width, channels): the first layer, without a guard band."""
        loaded = rg.load(pipeline, scene=self.scene, size=self.size, sets=sets)
        frame = self.session.render(loaded, outputs=["radiance"], taps=[port])
        found = np.asarray(frame.arrays[port], np.float32)
        found = found[0] if found.ndim == 4 else found
        width, height = self.size
        y, x = (found.shape[0] - height) // 2, (found.shape[1] - width) // 2
        return found[y : y + height, x : x + width]

    def surfaces(self) -> npt.NDArray[np.bool_]:
        """Return where the picture shows a surface, shape (height, width)."""
        return np.asarray(np.abs(self.draw("deferred", "gbuffer.normal")).sum(-1) > 0)

    def lit(self) -> npt.NDArray[np.bool_]:
        """Return where a light would shine without shadows, shape (height, width): only there visibility counts."""
        bare = self.draw("deferred", "light.direct_diffuse", "light.visibility=null", "light.blended_lookup=null")
        return np.asarray(bare[..., :3].sum(-1) > 0.01)


def table(title: str, truth: Floats, found: dict[str, Floats], mask: npt.NDArray[np.bool_]) -> None:
    """Print RMSE, the mean of the signed error, and the part of the pixels that are off by more than 0.1."""
    print(f"\n{title}; the mean of the truth is {truth[mask].mean():.3f}")
    for name, one in found.items():
        off = (one - truth)[mask]
        rmse, far = np.sqrt((off**2).mean()), (np.abs(off).max(-1) > 0.1).mean()
        energy = one[mask].mean() / truth[mask].mean()
        print(f"| `{name}` | {rmse:.4f} | {off.mean():+.4f} | {100 * far:.1f} % | {energy:.2f} |", flush=True)


def errors(panel: Floats, truth: Floats, mask: npt.NDArray[np.bool_], part: tuple[slice, slice], gain: float) -> Floats:
    """Return the signed error of a part, (height, width, 3): red is too dark, blue too bright, white is no error."""
    off = gain * ((panel - truth).mean(-1) * mask)[part]
    dark, bright = np.maximum(-off, 0), np.maximum(off, 0)
    return np.asarray(1 - np.stack([bright, dark + bright, dark], -1))


def sheet(
    found: dict[str, Floats],
    truth: Floats,
    mask: npt.NDArray[np.bool_],
    crop: tuple[int, int, int, int],
    enlarge: int,
    gain: float,
    columns: int,
) -> npt.NDArray[np.uint8]:
    """Return a part of the truth, twice as large, and right of it and below the techniques, each above its error."""
    x, y, width, height = crop
    part = slice(y, y + height), slice(x, x + width)

    def tile(panel: Floats) -> Floats:
        return np.broadcast_to(panel[part], (height, width, 3)) ** np.float32(1 if panel.shape[-1] == 1 else 1 / 2.2)

    def block(names: list[str]) -> npt.NDArray[np.uint8]:
        wrong = [framed(enlarged(errors(found[name], truth, mask, part, gain), enlarge)) for name in names]
        shown = [enlarged(tile(found[name]), enlarge) for name in names]
        return laid_out([*shown, *wrong], Layout(len(names), GAP, names, label_size=LABEL))

    names = list(found)
    beside, below = names[: columns - 2], names[columns - 2 :]
    right = block(beside)
    large = enlarged(tile(truth), 2 * enlarge)
    large = np.pad(large, ((0, GAP), (0, GAP), (0, 0)), mode="edge")  # as high as two rows with the gap between them
    top = laid_out([large, right], Layout(2, GAP, ["rays"], label_size=LABEL))
    return laid_out([top, *([block(below)] if below else [])], Layout(1, GAP))


def enlarged(tile: Floats, times: int) -> npt.NDArray[np.uint8]:
    """Return a tile with every pixel repeated, as bytes."""
    return np.repeat(np.repeat((np.clip(tile, 0, 1) * 255 + 0.5).astype(np.uint8), times, 0), times, 1)


def framed(tile: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return a tile with a thin grey line around it, which shows where a white one ends."""
    tile[[0, -1]], tile[:, [0, -1]] = FRAME, FRAME
    return tile


def shadows(session: rg.Session, folder: Path | None) -> None:
    """Measure shadows of a sun and of a point light."""
    study = Shots(session, "shadow_study", (320, 180))
    mask, port = study.lit(), "shadows.visibility"
    hard = study.draw("traced-shadows", port, "shadows.angle=0")
    soft = study.draw("traced-shadows", port, "shadows.samples=256")
    found = {name: study.draw(pipeline, port) for name, pipeline in SHADOWS.items()}
    table("Shadows of a sun without a size", hard, found, mask)
    table("Shadows of a sun 0.05 rad wide", soft, found, mask)
    if folder:
        fine, crop = Shots(session, "shadow_study", (640, 360)), (425, 225, 64, 52)
        mask, hard = fine.lit(), fine.draw("traced-shadows", port, "shadows.angle=0")
        names = (
            "shadow_map",
            "shadow_pcf",
            "shadow_vsm",
            "shadow_esm",
            "shadow_msm",
            "shadow_convolution",
            "shadow_pcss",
            "shadow_volumes",
        )
        shown = {name: fine.draw(SHADOWS[name], port) for name in names}
        images.write(folder / "how-wrong-shadows.png", sheet(shown, hard, mask, crop, 4, 1, 5))
        soft = fine.draw("traced-shadows", port, "shadows.samples=48")
        shown = {name: shown[name] for name in ("shadow_pcss", "shadow_pcf", "shadow_map")}
        images.write(folder / "how-wrong-penumbra.png", sheet(shown, soft, mask, crop, 4, 1, 5))
    room = Shots(session, "lantern", (320, 180))
    traced = room.draw("shadow-cube", port, "shadows.type=traced_shadows")
    bulbs = {name: room.draw(pipeline, port) for name, pipeline in BULBS.items()}
    table("Shadows of a point light", traced, bulbs, room.lit())


def occlusion(session: rg.Session, folder: Path | None) -> None:
    """Measure occlusion on a staircase."""
    stairs = Shots(session, "stairs", (240, 180))
    mask = stairs.surfaces()
    exact = stairs.draw("traced-occlusion", "ao.occlusion", "ao.radius=1", "ao.samples=256")
    found = {}
    for name, pipeline in OCCLUSION.items():
        node = "gi" if name in ("ssao_ssgi", "ssil") else "ao"
        found[name] = stairs.draw(pipeline, f"{node}.occlusion", f"{node}.radius=1", f"{node}.samples=64")
    table("Occlusion", exact, found, mask)
    if folder:
        crop = 70, 70, 60, 60
        images.write(folder / "how-wrong-occlusion.png", sheet(found, exact, mask, crop, 5, 4, 4))
        rough = stairs.draw("traced-occlusion", "ao.occlusion", "ao.radius=1", "ao.samples=8")
        part = slice(70, 130), slice(70, 130)
        parts = [framed(enlarged(errors(found["gtao"], truth, mask, part, 4), 8)) for truth in (exact, rough)]
        both = laid_out(parts, Layout(2, GAP, ["against 256 rays", "against 8 rays"]))
        images.write(folder / "how-wrong-fails.png", both)


def light(session: rg.Session, folder: Path | None) -> None:
    """Measure one bounce of light in the Cornell box."""
    box = Shots(session, "cornell_box", (192, 108))
    mask, port = box.surfaces(), "gi.indirect"
    twin = "gi.type=traced_interreflection", "gi.denoise=0", "gi.samples=256"
    exact = box.draw("ssgi", port, *twin)[..., :3]
    found = {name: box.draw(pipeline, port, "gi.samples=64")[..., :3] for name, pipeline in LIGHT.items()}
    table("Light between surfaces", exact, found, mask)
    if folder:
        images.write(folder / "how-wrong-light.png", sheet(found, exact, mask, (62, 40, 64, 60), 5, 4, 4))


FAMILIES = {"shadows": shadows, "occlusion": occlusion, "light": light}


def main() -> None:
    """Print the tables, and draw the pictures where a folder is named."""
    words = sys.argv[1:]
    folder = next((Path(word) for word in words if word not in FAMILIES), None)
    with rg.Session() as session:
        for name, family in FAMILIES.items():
            if name in words or not set(FAMILIES) & set(words):
                family(session, folder)


if __name__ == "__main__":
    main()
