"""Limits without a device: what every OpenGL 4.5 driver offers, held against pipelines and their programs."""

from __future__ import annotations

import pytest

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.program.limits import program_excesses
from rendergraph.session import stages


def said(pipeline: rg.Pipeline) -> list[str]:
    with pytest.raises(InputError) as caught:
        stages.check_profile(stages.check(pipeline.link()))
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize("name", ["forward", "shadow-cascaded"])
def test_most_pipelines_need_no_more_than_every_driver_offers(name: str) -> None:
    stages.check_profile(stages.check(rg.load(name).link()))


def test_samples_textures_and_storage_in_vertex_shaders_are_named_with_their_place() -> None:
    message = said(rg.load("forward-msaa"))[0]
    assert (
        "forward-msaa.yaml:6:3: RG435 'light.radiance' has 4 samples per texel, which is more than a minimal" in message
    )
    message = said(rg.load("shadow-volumes-zpass"))[0]
    assert "node 'shadows' (shadow_volumes)" in message
    assert "_volumes.py:" in message
    assert "its vertex shader has 1 storage block, which is more than a minimal OpenGL 4.5 device's 0" in message


def test_programs_are_counted_by_what_they_use() -> None:
    samplers = "\n".join(f"uniform sampler2D s{n};" for n in range(18))
    blocks = "\n".join(f"layout(std140) uniform b{n} {{ vec4 m{n}; }};" for n in range(15))
    storage = "#ifdef A\nreadonly buffer x { float y[]; };\n#else\nlayout(std140) uniform x { float y[4]; };\n#endif"

    def found(*used: str, head: str = "") -> list[str]:
        text = f"{head}\n{samplers}\n{blocks}\n{storage}\nout vec4 c;\nvoid main() {{ c = {' + '.join(used)}; }}"
        return list(program_excesses({"fragment": text}))

    sampled = [f"texture(s{n}, vec2(0.5))" for n in range(17)]
    assert found(*sampled[:16]) == []
    assert found(*sampled) == [
        "its fragment shader has 17 samplers, which is more than a minimal OpenGL 4.5 device's 16"
    ]
    assert found(*(f"m{n}" for n in range(14))) == []
    assert "has 15 uniform blocks" in found(*(f"m{n}" for n in range(15)))[0]
    assert found("vec4(y[0])", *(f"m{n}" for n in range(14)), head="#define A") == []
    assert "has 15 uniform blocks" in found("vec4(y[0])", *(f"m{n}" for n in range(14)))[0]


def test_outputs_count_if_a_later_stage_reads_them() -> None:
    vertex = "\n".join(f"out mat4 v_{n};" for n in range(4)) + "\nvoid main() { gl_Position = vec4(0.0); }"

    def found(*read: str) -> list[str]:
        fragment = "".join(f"in mat4 {name};\n" for name in read) + "out vec4 c;\n"
        fragment += f"void main() {{ c = {' + '.join(f'{name}[0]' for name in read)}; }}"
        return list(program_excesses({"vertex": vertex, "fragment": fragment}))

    assert found("v_0", "v_1", "v_2") == []
    message = "its vertex shader has 64 output components, which is more than a minimal OpenGL 4.5 device's 60"
    assert found("v_0", "v_1", "v_2", "v_3") == [message]
