"""Convert between coefficients of the empirical models and metallic-roughness (design.md §8).

`kd = base (1 - metallic)`, `ks = f0`, `4n = 2/α² - 2` with `α = roughness²`; the ambient coefficient is the albedo.
"""

from __future__ import annotations

import math

from rendergraph.scene.model import Material, Vec3

_LEAST_ALPHA = 1e-3


def dielectric_f0(ior: float) -> float:
    """Return the reflectance at normal incidence, `((ior-1)/(ior+1))²`; an ior of 0 stands for infinity."""
    return 1.0 if ior == 0 else ((ior - 1) / (ior + 1)) ** 2


def f0_of(material: Material) -> Vec3:
    """Return the specular reflectance at normal incidence, a mix of dielectric and metal."""
    f0, metallic = dielectric_f0(material.ior), material.metallic
    r, g, b = (
        min(f0 * tint, 1.0) * material.specular * (1 - metallic) + base * metallic
        for tint, base in zip(material.specular_color, material.base_color, strict=False)
    )
    return r, g, b


def exponent(roughness: float) -> float:
    alpha = max(roughness * roughness, _LEAST_ALPHA)
    return (1 / (alpha * alpha) - 1) / 2


def roughness_of(shininess: float) -> float:
    return math.sqrt(math.sqrt(1 / (2 * max(0.0, shininess) + 1)))


def phong_of(material: Material) -> tuple[Vec3, Vec3, Vec3, float]:
    """Return ambient, diffuse and specular coefficient and the exponent n: the material's own, or derived ones."""
    r, g, b, _ = material.base_color
    keep = 1 - material.metallic
    diffuse = material.diffuse or (r * keep, g * keep, b * keep)
    ambient = material.ambient or material.diffuse or (r, g, b)
    specular = material.specular_phong or f0_of(material)
    n = exponent(material.roughness) if material.shininess is None else material.shininess
    return ambient, diffuse, specular, n
