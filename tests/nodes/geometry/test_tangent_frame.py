"""The tangent frame that is derived from texture coordinates, against the gradients of their linear function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

Floats = npt.NDArray[np.float64]
SET = "vec3 t, b; uv_tangent_frame(n, p_a, p_b, uv_a, uv_b, t, b); result.xyz = "


@pytest.mark.parametrize("behind", [False, True], ids=["front", "behind"])
def test_a_triangle_has_one_tangent_frame_from_both_sides(
    evaluate: Callable[..., Floats], shading_defines: Callable[..., dict[str, object]], behind: bool
) -> None:
    """The tangent points to where u grows, and the bitangent to where v falls, also on the back of a surface."""
    rng = np.random.default_rng(1)
    count = 400
    p = rng.normal(size=(2, count, 3))
    uv = rng.normal(size=(2, count, 2))
    n = np.cross(p[0], p[1])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    order = (1, 0) if behind else (0, 1)  # as seen from behind, the two directions turn the other way
    columns: dict[str, Any] = {
        "n": n,
        "p_a": p[order[0]],
        "p_b": p[order[1]],
        "uv_a": uv[order[0]],
        "uv_b": uv[order[1]],
    }
    defines = shading_defines("pbr", DEFAULT_SPECULAR=1)
    found = [evaluate("material_surface.glsl", columns, f"{SET}{v};", defines)[:, :3] for v in ("t", "b")]
    for axis, sign, vectors in ((0, 1.0, found[0]), (1, -1.0, found[1])):
        basis = np.stack([p[0], p[1], n], axis=1)  # the gradient's products with p_a, p_b and n are known
        slopes = np.stack([uv[0, :, axis], uv[1, :, axis], np.zeros(count)], axis=1)
        gradient = sign * np.linalg.solve(basis, slopes[..., None])[..., 0]
        units = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (vectors, gradient)]
        np.testing.assert_allclose(units[0], units[1], atol=2e-3)
