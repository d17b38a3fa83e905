"""Materials, textures and lights that make SAPIEN's pictures clear and pleasant."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.meshes import TriangleMesh, shaded

AMBIENT = (0.34, 0.35, 0.37)
"""Light from everywhere, and the colour of the background (linear RGB)."""

_LIGHTS = (
    # Direction of the light, colour, whether it casts shadows.
    ((0.55, -0.30, -1.0), (1.55, 1.48, 1.36), True),
    ((0.2, 1.0, -0.45), (0.42, 0.45, 0.50), False),
    ((-1.0, -0.5, -0.6), (0.30, 0.32, 0.36), False),
)


def linear(colour: tuple[float, float, float]) -> list[float]:
    """Linear RGBA of an sRGB colour."""
    return [*(float(c) ** 2.2 for c in colour), 1.0]


def add_lights(scene: Any, shadow_size: int) -> None:
    """A sun with soft shadows, two fill lights, and light from everywhere.

    Args:
        scene: A ``sapien.Scene`` with a render system.
        shadow_size: Width of the shadow map in pixels; 0 for no shadows.
    """
    import sapien
    from sapien import render

    scene.render_system.ambient_light = list(AMBIENT)
    for direction, colour, shadow in _LIGHTS:
        light = render.RenderDirectionalLightComponent()
        light.color = list(colour)
        light.shadow = shadow and shadow_size > 0
        if light.shadow:
            light.shadow_half_size = 1.3
            light.shadow_near, light.shadow_far = 0.1, 5.0
            light.shadow_map_size = shadow_size
        forward = np.array(direction) / np.linalg.norm(direction)
        side = np.cross([0.0, 0.0, 1.0], forward)
        side /= np.linalg.norm(side)
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([forward, side, np.cross(forward, side)], axis=-1)
        matrix[:3, 3] = np.array([0.4, 0.0, 0.3]) - 2.5 * forward
        light.local_pose = sapien.Pose(matrix)
        entity = sapien.Entity()
        entity.add_component(light)
        scene.add_entity(entity)


def material(colour: tuple[float, float, float], material: str = "matte") -> Any:
    """A ``RenderMaterial``.

    Args:
        colour: sRGB, 0 to 1.
        material: ``matte`` (plastic), ``wood`` or ``metal``.
    """
    from sapien import render

    match material:
        case "metal":
            return render.RenderMaterial(
                base_color=linear(colour), metallic=0.35, roughness=0.38, specular=0.5
            )
        case "wood":
            made = render.RenderMaterial(base_color=[1, 1, 1, 1], metallic=0, roughness=0.75, specular=0.2)
            made.base_color_texture = _wood(colour)
            return made
        case _:
            return render.RenderMaterial(base_color=linear(colour), metallic=0, roughness=0.45, specular=0.35)


def mesh_shape(mesh: TriangleMesh, coat: Any) -> Any:
    """A ``RenderShapeTriangleMesh`` of a mesh, shaded smoothly where it is smooth."""
    from sapien import render

    vertices, normals, faces = shaded(mesh)
    return render.RenderShapeTriangleMesh(
        vertices.astype(np.float32),
        faces.astype(np.uint32),
        normals.astype(np.float32),
        np.zeros((len(vertices), 2), np.float32),
        coat,
    )


def plank_shape(size: tuple[float, float, float], coat: Any) -> Any:
    """A box ``(3,)`` in metres whose texture has its real size, the grain along its longest side."""
    from sapien import render

    half = np.array(size) / 2
    long = int(np.argmax(size))
    vertices: list[Array] = []
    normals: list[Array] = []
    uvs: list[Array] = []
    faces: list[Array] = []
    for axis in range(3):
        others = [(axis + 1) % 3, (axis + 2) % 3]
        grain = long if long in others else others[0]
        cross = others[1] if grain == others[0] else others[0]
        for sign in (1.0, -1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, others[0]] = [-1, 1, 1, -1]
            corners[:, others[1]] = [-1, -1, 1, 1]
            corners *= half
            normal = np.zeros(3)
            normal[axis] = sign
            start = len(vertices) * 4
            order = [0, 1, 2, 0, 2, 3] if sign > 0 else [0, 2, 1, 0, 3, 2]
            vertices.append(corners)
            normals.append(np.tile(normal, (4, 1)))
            uvs.append(np.stack([corners[:, grain] / 0.8, corners[:, cross] / 0.4], axis=-1) + 0.37 * axis)
            faces.append(np.array(order).reshape(2, 3) + start)
    return render.RenderShapeTriangleMesh(
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(faces).astype(np.uint32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate(uvs).astype(np.float32),
        coat,
    )


@lru_cache(maxsize=32)
def _wood(colour: tuple[float, float, float]) -> Any:
    from sapien import render

    return render.RenderTexture2D(
        wood_grain(colour), "R8G8B8A8Unorm", mipmap_levels=6, filter_mode="linear", srgb=True
    )


def wood_grain(colour: tuple[float, float, float], size: int = 256) -> Array:
    """A repeating tile ``(size, size, 4)`` of wood, uint8, sRGB, with its grain along the rows."""
    rng = np.random.default_rng(7)
    frequency = np.fft.fftfreq(size) * size
    fy, fx = np.meshgrid(frequency, frequency, indexing="ij")

    def noise(along: float, across: float) -> Array:
        spectrum = np.fft.fft2(rng.normal(size=(size, size)))
        field = np.fft.ifft2(spectrum * np.exp(-((fx / along) ** 2) - (fy / across) ** 2)).real
        return field / np.std(field)

    broad, fine = noise(1.5, 7.0), noise(3.0, 60.0)
    tone = 1.0 + 0.045 * np.sin(2.5 * broad) + 0.028 * fine
    pixels = np.clip(np.array(colour) * tone[..., None] ** np.array([0.8, 1.0, 1.25]), 0, 1)
    alpha = np.ones((size, size, 1))
    return np.round(255 * np.concatenate([pixels, alpha], axis=-1)).astype(np.uint8)
