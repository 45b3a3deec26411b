"""One sample of colours, whole numbers and depth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

TEXT = """  samples: {{type: sampled, inputs: {{source: picture.radiance}}}}
  one: {{type: one_sample, inputs: {{source: samples.{0}}}, params: {{index: {1}}}}}
outputs: {{chosen: one.chosen}}"""


@pytest.mark.parametrize("index", [0, 2, 15])
def test_it_is_the_one_asked_for_or_the_last(draw: Any, noise: Any, index: int) -> None:
    picture, number = noise(9, 7), min(index, 3)
    right = picture * (0.125, 1.0, 7.0, 40.0)[number]
    np.testing.assert_array_equal(draw(picture, TEXT.format("radiance", index))["chosen"][..., :3], right)
    assert (draw(picture, TEXT.format("numbers", index)).arrays["chosen"] == number).all()
    depth = draw(picture, TEXT.format("depth", index)).arrays["chosen"]
    np.testing.assert_array_equal(depth[..., 0], np.full((7, 9), np.float32(0.1) * np.float32(number + 1)))
