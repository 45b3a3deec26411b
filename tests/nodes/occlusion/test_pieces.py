"""The pieces of screen-space occlusion, each against NumPy or a closed form."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.geometry.gbuffer import GBuffer
from rendergraph.nodes.occlusion._kernel import spread_points
from rendergraph.nodes.occlusion._screen_space import reduced_size
from rendergraph.nodes.occlusion.ssao_disc import SSAODisc
from rendergraph.nodes.occlusion.ssao_hemisphere import SSAOHemisphere

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Node, Output, ViewMatrices
from rendergraph.catalog import Catalog
from rendergraph.resources import folder
from rendergraph.scene.cameras import view_matrices

Floats = npt.NDArray[np.float64]
Evaluate = Callable[..., Floats]


# --- directions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "least"),
    [
        (2, 0.5),
        (3, 3**0.5),
        (4, 3.674234614),
        (8, 19.675287861),
        (12, 49.165253058),
        (14, 69.306363297),
        (16, 92.911655302),
        (32, 412.261274651),
    ],
)
def test_directions_rest_at_least_energy(count: int, least: float) -> None:
    """The known least energies of the Thomson problem."""
    points = spread_points(count)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1)
    first, second = np.triu_indices(count, 1)
    energy = (1 / np.linalg.norm(points[first] - points[second], axis=1)).sum()
    assert least * (1 - 1e-9) <= energy < least * 1.001


# --- disc to disc ----------------------------------------------------------------------------------------------------


def test_disc_occlusion(evaluate: Evaluate) -> None:
    rng = np.random.default_rng(3)
    r, area = rng.uniform(0.01, 3, 500), rng.uniform(1e-4, 4, 500)
    emitter, receiver = rng.uniform(-1, 1, 500), rng.uniform(-1, 1, 500)
    found = evaluate(
        "disc_form_factor.glsl",
        {"r": r, "area": area, "emitter": emitter, "receiver": receiver},
        "result.x = disc_occlusion(r, area, emitter, receiver);",
    )[:, 0]
    share = 1 - r / np.sqrt(area / np.pi + r**2)
    expected = share * np.maximum(emitter, 0) * np.minimum(np.maximum(4 * receiver, 0), 1)
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_disc_overhead_hides_its_share_of_the_hemisphere(evaluate: Evaluate) -> None:
    """Face to face: the solid angle 2π(1 − cos α) of a disc, of the 2π above the receiver."""
    half_angle = np.linspace(0.05, 1.5, 20)
    distance = np.full(20, 0.7)
    area = np.pi * (distance * np.tan(half_angle)) ** 2
    found = evaluate(
        "disc_form_factor.glsl", {"r": distance, "area": area}, "result.x = disc_occlusion(r, area, 1.0, 1.0);"
    )
    np.testing.assert_allclose(found[:, 0], 1 - np.cos(half_angle), atol=1e-5)


# --- blur and upsampling ---------------------------------------------------------------------------------------------


class ShownOcclusion(SSAOHemisphere):
    """The same with its scratch textures to look at."""

    surfaces = Output(AnyTexel, format="rgba32f", size=reduced_size, view="depth", doc="Surfaces.")  # type: ignore[assignment]
    unfiltered = Output(AnyTexel, format="r16", size=reduced_size, doc="Before the blur.")  # type: ignore[assignment]
    blurred = Output(AnyTexel, format="r16", size=reduced_size, doc="After it.")  # type: ignore[assignment]
    noise = Output(AnyTexel, format="rgba16_snorm", size=(64, 64), doc="Noise.")  # type: ignore[assignment]


Show = Callable[..., tuple[rg.Frame, ViewMatrices]]
RADIUS, BLUR, SAMPLES = 0.4, 4, 12


@pytest.fixture
def show(tmp_path: Path, session: rg.Session) -> Show:
    """`show(size, scale)`: every texture of the Cornell box's occlusion, and the camera's projection."""

    def run(size: tuple[int, int], scale: float) -> tuple[rg.Frame, ViewMatrices]:
        blurred = ", blurred: ao.blurred" if scale < 1 else ""
        text = f"""
  ao:
    type: shown_occlusion
    inputs: {{depth: g.depth, normal: g.normal}}
    params: {{radius: {RADIUS}, blur: {BLUR}, scale: {scale}, refine: false, samples: {SAMPLES}}}
  disc:
    type: ssaodisc
    inputs: {{depth: g.depth, normal: g.normal}}
    params: {{radius: {RADIUS}, samples: {SAMPLES}, form: disc, scale: 1}}
outputs: {{occlusion: ao.occlusion, surfaces: ao.surfaces, unfiltered: ao.unfiltered, depth: g.depth, normal: g.normal, noise: ao.noise, disc: disc.occlusion{blurred}}}
"""
        return drawn(session, tmp_path, size, text, ShownOcclusion, SSAODisc)

    return run


def drawn(
    session: rg.Session, home: Path, size: tuple[int, int], text: str, *types: type[Node]
) -> tuple[rg.Frame, ViewMatrices]:
    """What nodes of these types make of the Cornell box's G-buffer `g`, and the camera."""
    for family in ("geometry", "occlusion"):
        shutil.copytree(folder("rendergraph.shaders") / family, home / "shaders", dirs_exist_ok=True)
    head = f"rendergraph: 1\nsize: [{size[0]}, {size[1]}]\nscene: cornell_box\nnodes:\n"
    (home / "test.yaml").write_text(f"{head}  g: {{type: gbuffer, params: {{precision: full}}}}{text}")
    pipeline = replace(rg.load(home / "test.yaml"), catalog=Catalog.of(GBuffer, *types, shaders=home / "shaders"))
    camera = view_matrices(next(iter(pipeline.link().scene.cameras.values())), size)
    return session.render(pipeline), camera


def places(small: tuple[int, int], screen: tuple[int, int]) -> tuple[Floats, Floats]:
    """Window coordinates of the texels that a smaller picture stands for, columns and rows, bottom row first."""
    return tuple(  # type: ignore[return-value]
        (((2 * np.arange(s) + 1) * full // (2 * s)) + 0.5) / full for s, full in zip(small, screen, strict=True)
    )


def positions(distance: Floats, x: Floats, y: Floats, camera: ViewMatrices) -> Floats:
    """View-space positions of a perspective picture, bottom row first."""
    p = camera.projection
    ndc_x, ndc_y = np.meshgrid(x * 2 - 1, y * 2 - 1)
    return np.stack([ndc_x * distance / p[0, 0], ndc_y * distance / p[1, 1], -distance], -1)


def same_surface(offset: Floats, normal: Floats, neighbour: Floats) -> Floats:
    off_plane = (offset * normal).sum(-1) / (0.1 * RADIUS)
    facing = np.maximum((normal * neighbour).sum(-1), 0) ** 8
    return np.asarray(np.maximum(1 - off_plane**2 / 4, 0) ** 4 * facing)


def flipped(frame: rg.Frame, name: str) -> Floats:
    return np.asarray(frame.arrays[name][::-1], np.float64)


def blur_by_hand(values: Floats, surfaces: Floats, where: Floats, axis: int) -> Floats:
    made = np.ones_like(values)
    height, width = values.shape
    for i in range(height):
        for j in range(width):
            if surfaces[i, j, 3] == 0:
                continue
            n, last = ((i, height), (j, width))[axis]
            centre = n + (-0.5 if n % 2 else 0.5)  # of its own two
            taps = [int(np.clip(n + k, 0, last - 1)) for k in range(-BLUR, BLUR + 1, 2)]
            ends = np.clip((BLUR + 1 - np.abs(centre - n + np.arange(-BLUR, BLUR + 1, 2))) / 2, 0, 1)
            line = (taps, j) if axis == 0 else (i, taps)
            there = surfaces[line]
            weights = same_surface(where[line] - where[i, j], surfaces[i, j, :3], there[:, :3]) * (there[:, 3] > 0)
            weights *= ends
            made[i, j] = ((weights * values[line]).sum() + 1e-3 * values[i, j]) / (weights.sum() + 1e-3)
    return made


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("size", "scale"), [((48, 36), 1), ((81, 61), 0.5)])
def test_the_blur_is_a_mean_over_the_same_surface(show: Show, size: tuple[int, int], scale: float) -> None:
    frame, camera = show(size, scale)
    surfaces, unfiltered = flipped(frame, "surfaces"), flipped(frame, "unfiltered")[..., 0]
    where = positions(surfaces[..., 3], *places((unfiltered.shape[1], unfiltered.shape[0]), size), camera)
    expected = blur_by_hand(blur_by_hand(unfiltered, surfaces, where, 1), surfaces, where, 0)
    found = flipped(frame, "occlusion" if scale == 1 else "blurred")[..., 0]
    assert np.abs(found - unfiltered).max() > 0.1
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize(("size", "scale"), [((64, 48), 0.5), ((81, 61), 0.25), ((64, 48), 0.125)])
def test_upsampling_keeps_to_the_surface(show: Show, size: tuple[int, int], scale: float) -> None:
    frame, camera = show(size, scale)
    surfaces, small = flipped(frame, "surfaces"), flipped(frame, "blurred")[..., 0]
    height, width = small.shape
    assert (width, height) == tuple(int(np.ceil(side * scale)) for side in size)
    p, depth = camera.projection, flipped(frame, "depth")[..., 0]
    x, y = ((np.arange(side) + 0.5) / side for side in size)
    where = positions(p[2, 3] / (p[2, 2] + 1 - 2 * depth), x, y, camera)
    where_small = positions(surfaces[..., 3], *places((width, height), size), camera)
    normals = flipped(frame, "normal")[..., :3] @ camera.view[:3, :3].T
    expected = np.ones((size[1], size[0]))
    for i, j in np.ndindex(expected.shape):
        if depth[i, j] == 0:
            continue
        at = np.array([y[i] * height, x[j] * width]) - 0.5
        first, total, weighted = np.floor(at).astype(int), 0.0, 0.0
        for corner in np.ndindex(2, 2):
            k = tuple(int(n) for n in np.clip(first + corner, 0, (height - 1, width - 1)))
            if surfaces[k][3] == 0:
                continue
            near = np.prod(np.where(corner, at - first, 1 - at + first) + 1e-3)
            weight = near * (same_surface(where_small[k] - where[i, j], normals[i, j], surfaces[k][:3]) + 1e-4)
            total, weighted = total + weight, weighted + weight * small[k]
        if total > 0:
            expected[i, j] = weighted / total
    found = flipped(frame, "occlusion")[..., 0]
    assert found.std() > 0.02
    assert np.quantile(np.abs(found - expected), 0.999) < 2e-3


def test_surfaces_are_view_space(show: Show) -> None:
    frame, camera = show((48, 36), 1)
    surfaces, normal = flipped(frame, "surfaces"), flipped(frame, "normal")[..., :3]
    covered = np.asarray(surfaces[..., 3] > 0)
    np.testing.assert_allclose(surfaces[covered][:, :3], normal[covered] @ camera.view[:3, :3].T, atol=1e-5)
    np.testing.assert_array_equal(covered, flipped(frame, "depth")[..., 0] > 0)


# --- occlusion itself ------------------------------------------------------------------------------------------------


def leaves_the_picture(start: Floats, way: Floats, camera: ViewMatrices) -> Floats:
    """How many times as far as `way` it is to the picture's nearest edge: shape of the picture."""
    x, y = (camera.projection[n, n] for n in (0, 1))
    edges = np.array([[x, 0, 1], [-x, 0, 1], [0, y, 1], [0, -y, 1]])  # planes through the eye; inside is negative
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = -(start @ edges.T) / (way @ edges.T)
    return np.asarray(np.where(shares > 0, shares, np.inf).min(-1))


def test_hemispheres_in_numpy(show: Show) -> None:
    """All pixels at once, one sample after the other; a sample on a texel's border may round to either side."""
    size = (64, 48)
    frame, camera = show(size, 1)
    surfaces, noise = flipped(frame, "surfaces"), flipped(frame, "noise")
    normal, distance = surfaces[..., :3], surfaces[..., 3]
    where = positions(distance, *places(size, size), camera)
    random = noise[: size[1], : size[0]]
    mirror = random[..., :3] / np.linalg.norm(random[..., :3], axis=-1, keepdims=True)
    blocked = np.zeros(distance.shape)
    for number, even in enumerate(spread_points(SAMPLES // 4)):
        turned = even - 2 * (mirror @ even)[..., None] * mirror
        along = (normal + turned) / np.maximum(np.linalg.norm(normal + turned, axis=-1, keepdims=True), 1e-6)
        jitter = (random[..., 3] / 2 + 0.5 + number * 0.618034) % 1
        most, doubtful, face = np.zeros(distance.shape), np.zeros(distance.shape), np.zeros((*distance.shape, 4))
        whole = np.minimum(0.9999 * leaves_the_picture(where, along * RADIUS, camera), 1)
        for reach in (0.2 * (0.4 + 0.6 * jitter), *(0.2 + 0.8 * (step + jitter) / 3 for step in range(3))):
            point = where + along * (RADIUS * whole * reach)[..., None]
            clip = point @ camera.projection[:2, :3].T / np.maximum(-point[..., 2:], 1e-9)
            column, row = (np.floor((clip[..., n] / 2 + 0.5) * size[n]).astype(int) for n in (0, 1))
            inside = (column >= 0) & (column < size[0]) & (row >= 0) & (row < size[1]) & (point[..., 2] < 0)
            there = np.clip(row, 0, size[1] - 1), np.clip(column, 0, size[0] - 1)
            offset, facing = where[there] - where, normal[there]
            length, behind = np.linalg.norm(offset, axis=-1), -point[..., 2] - distance[there]
            in_sight = inside & ((distance[there] == 0) | (behind <= 0))
            through = (point * face[..., :3]).sum(-1) > face[..., 3]
            most = np.maximum(most, doubtful * (in_sight & through))
            doubtful = np.where(in_sight, 0, doubtful)
            above = (offset * normal).sum(-1) > 0.02 * length + 1e-6
            away = (offset * facing).sum(-1) > 0
            cuts = ~away & (((where[there] - point) * facing).sum(-1) > 0)
            counts = inside & ~in_sight & above & (cuts | (length <= RADIUS))
            blocks = counts * np.maximum(1 - (behind / (4 * RADIUS)) ** 2, 0)
            most, doubtful = np.maximum(most, blocks * ~away), np.maximum(doubtful, blocks * away)
            plane = np.concatenate([facing, (facing * where[there]).sum(-1, keepdims=True)], -1)
            face = np.where((counts & away)[..., None], plane, face)
        blocked += np.maximum(most, doubtful)
    alone = np.where(distance > 0, 1 - blocked / (SAMPLES // 4), 1)
    expected = shared_by_four(alone, surfaces, where)
    found = flipped(frame, "unfiltered")[..., 0]
    assert found.std() > 0.1
    assert np.mean(np.abs(found - expected) > 1e-3) < 0.01


def shared_by_four(blocked: Floats, surfaces: Floats, where: Floats) -> Floats:
    """Pairs along x, then along y; which of a pair is the other one depends on the parity alone."""
    for axis in (1, 0):
        other = np.arange(blocked.shape[axis]) ^ 1
        there = np.take(surfaces, other, axis)
        offset = np.take(where, other, axis) - where
        weight = same_surface(offset, surfaces[..., :3], there[..., :3]) * (there[..., 3] > 0)
        blocked = blocked + (np.take(blocked, other, axis) - blocked) * weight / (1 + weight)
    return blocked


def mean_of_four(blocked: Floats, surfaces: Floats, where: Floats) -> Floats:
    """The mean of the diagonal neighbours, each of which stands for four pixels."""
    height, width = blocked.shape
    total = np.full(blocked.shape, 1e-3)
    weighted = total * blocked
    for up, right in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        rows, columns = np.arange(height) + up, np.arange(width) + right
        inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))
        there = np.ix_(rows % height, columns % width)
        seen = surfaces[there]
        weight = same_surface(where[there] - where, surfaces[..., :3], seen[..., :3]) * inside * (seen[..., 3] > 0)
        total, weighted = total + weight, weighted + weight * blocked[there]
    return np.asarray(weighted / total)


def test_discs_in_numpy(show: Show) -> None:
    size = (64, 48)
    frame, camera = show(size, 1)
    surfaces = flipped(frame, "surfaces")
    normal, distance = surfaces[..., :3], surfaces[..., 3]
    x, y = places(size, size)
    where = positions(distance, x, y, camera)
    reach = RADIUS / np.maximum(distance, 1e-3) / 2
    blocked = np.zeros(distance.shape)

    def hiding(offset: Floats, area: Floats, emitter: Floats) -> Floats:
        apart = np.maximum(np.linalg.norm(offset, axis=-1), 1e-9)
        receiver = (offset * normal).sum(-1) / apart
        share = 1 - apart / np.sqrt(area / np.pi + apart**2)
        return np.asarray(share * emitter * np.clip(4 * receiver, 0, 1) * (apart <= RADIUS) * (receiver > 0.02))

    at_x, at_y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    turn = (((at_x + at_y) % 4 * 4 + at_x % 4) + 0.5) / 16
    stretch = (((at_y - at_x) % 4 * 4 + at_y % 4) + 0.5) / 16
    arms, count = SAMPLES // 8 * 2, 4
    eye = -where / np.maximum(np.linalg.norm(where, axis=-1, keepdims=True), 1e-9)
    for arm in range(arms):
        angle = 2 * np.pi * (arm + turn) / arms
        hidden, horizon = np.zeros(distance.shape), np.full(distance.shape, -1.0)
        for step in range(count):
            u = (step + (stretch + 0.618034 * arm) % 1) / count
            column = np.floor((x + u**2 * reach * camera.projection[0, 0] * np.cos(angle)) * size[0]).astype(int)
            row = np.floor((y[:, None] + u**2 * reach * camera.projection[1, 1] * np.sin(angle)) * size[1]).astype(int)
            inside = (column >= 0) & (column < size[0]) & (row >= 0) & (row < size[1])
            there = np.clip(row, 0, size[1] - 1), np.clip(column, 0, size[0] - 1)
            at, facing, far = where[there], normal[there], np.maximum(distance[there], 1e-3)
            offset, sight = at - where, at / far[..., None]
            apart = np.linalg.norm(offset, axis=-1)
            inside &= (distance[there] > 0) & (apart > 0)
            across = 4 * np.pi * RADIUS**2 * u**3 / 2048 * (far / np.maximum(distance, 1e-3)) ** 2
            emitter = -(facing * offset).sum(-1) / np.maximum(apart, 1e-9)
            slant = np.maximum(np.abs((facing * sight).sum(-1)), 0.05)
            rise = (offset * eye).sum(-1) / np.maximum(apart, 1e-9)
            seen = hiding(offset, across / slant, np.abs(emitter)) * (rise >= horizon)
            raises = inside & (apart <= RADIUS) & ((offset * normal).sum(-1) > 0)
            horizon = np.where(raises, np.maximum(horizon, rise), horizon)
            line = sight / np.maximum(np.linalg.norm(sight, axis=-1, keepdims=True), 1e-9)
            nearest = offset + line * np.clip(-(offset * line).sum(-1), 0, RADIUS)[..., None]
            unseen = hiding(nearest, across, np.ones(distance.shape))
            hidden += inside * np.where(emitter < 0, np.maximum(seen, unseen), seen) * 2048 / count
        blocked += np.minimum(hidden, 2) / arms
    expected = np.where(
        distance > 0, np.clip(mean_of_four(shared_by_four(1 - blocked, surfaces, where), surfaces, where), 0, 1), 1
    )
    found = flipped(frame, "disc")[..., 0]
    assert found.std() > 0.05
    assert np.mean(np.abs(found - expected) > 1e-3) < 0.02
