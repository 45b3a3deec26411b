"""Mean errors of filtered shadows of `avenue` against rays: `python errors.py`.

Visibility of a sun, at pixels that the sun can reach and that lie away from edges of shadows. Each technique filters 5
and 15 texels of a map of 2048, and 5 texels of four cascades of 1024.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

import rendergraph as rg

SIZE = (480, 270)
WIDTHS = {5: ("taps=5", "radius=2"), 15: ("taps=15", "radius=7")}
TECHNIQUES = ("shadow_pcf", "shadow_vsm", "shadow_esm", "shadow_msm", "shadow_convolution", "shadow_pcss")


def draw(session: rg.Session, pipeline: str, port: str, *sets: str) -> npt.NDArray[np.float32]:
    """Return the first channel of a port, shape (height, width)."""
    loaded = rg.load(pipeline, scene="avenue", size=SIZE, sets=sets)
    found: Any = session.render(loaded, outputs=["radiance"], taps=[port])[port]
    return np.asarray(found.reshape(*SIZE[::-1], -1)[..., 0], np.float32)


def main() -> None:
    """Print a row for each technique."""
    with rg.Session() as session:
        bare = draw(session, "deferred", "light.direct_diffuse", "light.visibility=null", "light.blended_lookup=null")
        rays = "traced-shadows", "shadows.visibility"
        hard = draw(session, *rays, "shadows.angle=0")
        sun = draw(session, *rays, "shadows.angle=0.0093", "shadows.samples=64")
        around = np.lib.stride_tricks.sliding_window_view(np.pad(hard, 2, mode="edge"), (5, 5))
        judged = (bare > 0.01) & (around.min((-1, -2)) == around.max((-1, -2)))
        print(f"{judged.sum()} pixels, {100 * (hard[judged] < 0.5).mean():.0f} % of them in shadow")
        for technique in TECHNIQUES:
            cells = []
            for map_type, resolution, width in (
                ("shadow_map", 2048, 5),
                ("shadow_map", 2048, 15),
                ("shadow_cascaded", 1024, 5),
            ):
                taps, radius = WIDTHS[width]
                filtered = taps if technique == "shadow_pcf" else radius
                sets = [f"shadows.type={technique}", f"sun.type={map_type}", f"sun.resolution={resolution}"]
                own = "shadows.angle=0.0093" if technique == "shadow_pcss" else f"shadows.{filtered}"
                found = draw(session, "deferred", rays[1], *sets, own)
                truth = sun if technique == "shadow_pcss" else hard
                cells.append(f"{np.abs(found - truth)[judged].mean():.4f}")
            print(f"| `{technique}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
