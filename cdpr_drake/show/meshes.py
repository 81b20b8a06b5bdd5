"""Shapes that Drake has not, as meshes: bodies of revolution, whole or a part of the way round."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

AROUND = 48
"""Flat faces for a whole turn."""

THICK = 12
"""Flat faces round a tube."""


class TriangleMesh(NamedTuple):
    """Triangles, as Meshcat takes them.

    Attributes:
        vertices: (3, n) [m].
        triangles: (3, m) indices of vertices.
    """

    vertices: np.ndarray
    triangles: np.ndarray


def revolved(profile: ArrayLike, start: float = 0.0, end: float = 2.0 * math.pi) -> TriangleMesh:
    """Return the body that a closed profile in the plane of x and z makes when turned about z.

    Args:
        profile: (p, 2) [m], x and z of its corners.
        start: [rad] from where it is turned.
        end: [rad] up to where; a body less than whole has no faces at its ends.
    """
    corners = np.asarray(profile, float)
    p, span = len(corners), end - start
    steps = max(1, math.ceil(AROUND * span / (2.0 * math.pi) - 1e-9))
    turn = np.linspace(start, end, steps + 1)[:, None]
    r, z = corners.T
    across = np.broadcast_to(z, (steps + 1, p))
    vertices = np.stack([r * np.cos(turn), r * np.sin(turn), across]).reshape(3, -1)
    i, j = np.meshgrid(np.arange(steps), np.arange(p), indexing="ij")
    here, beside = i * p + j, i * p + (j + 1) % p
    pairs = [(here, here + p, beside + p), (here, beside + p, beside)]
    triangles = np.concatenate([np.stack(t).reshape(3, -1) for t in pairs], axis=1)
    return TriangleMesh(np.asfortranarray(vertices), np.asfortranarray(triangles, np.int32))


def bent_tube(radius: float, thickness: float, start: float, end: float) -> TriangleMesh:
    """Return a tube bent about z.

    Args:
        radius: of its centre line [m].
        thickness: its own radius [m].
        start: [rad] from x on, where it begins.
        end: [rad] where it ends.
    """
    turn = 2.0 * np.pi * np.arange(THICK) / THICK
    profile = [radius + thickness * np.cos(turn), thickness * np.sin(turn)]
    return revolved(np.transpose(profile), start, end)


def tapered_bar(bottom: float, top: float) -> TriangleMesh:
    """Return a round bar of length 1 along z, its middle at the origin.

    Args:
        bottom: radius at its lower end [m].
        top: radius at its upper end [m].
    """
    return revolved([[0.0, -0.5], [bottom, -0.5], [top, 0.5], [0.0, 0.5]])
