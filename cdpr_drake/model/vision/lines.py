"""The cables' edges found in the images of the stereo pairs: tracked, and searched when lost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.cable_drawing import Image, StereoImage
from cdpr_drake.model.vision.tangents import FLATTEST_CROSSING, StereoGeometry

REACH = 12.0
"""How far from its expected place a cable is looked for [px]: at 20 Hz and 1.2 m, 0.25 m/s."""

LEAST_CONTRAST = 40.0
"""Between panel and cable, below which nothing is seen [grey levels of 256]."""

WIDEST_TURN = 0.3
"""A cable is searched within this angle of the straight line from A to B, in the image [rad]."""

BIN = 0.005
"""Of the angles whose dark pixels are counted in a search [rad]: 3 px at the cable's far end."""

FEWEST_PIXELS = 30
"""Dark pixels that make a line."""

MOST_PIXELS = 1500
"""Dark pixels that a search looks at; of more an even choice."""


class CableLines:
    """Finds both edges of each cable in the images of the stereo pairs.

    Where a cable was seen a frame ago, the piece that hangs in that direction is projected, and
    each image is scanned across it, at the robot's edge points and `REACH` around, along a row or
    column of pixels. What a pixel's grey level says of the part that the cable covers gives the
    edges to a few hundredths of a pixel. A line is fitted to their distances from the edge
    expected, weighted by contrast, outliers rejected by Tukey's biweight.

    A cable that was not seen, or is not found there, is searched in the whole images: its line
    leads through the point where it leaves the frame, for a pulley as a straight cable would, so
    the dark pixels are counted by their angle about it.

    Args:
        robot: the robot as the controller believes it.

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
    """

    def __init__(self, robot: CableRobot) -> None:
        from cdpr_drake.model.kernels import cable_lines

        self._stereo = StereoGeometry(robot)
        self._kernel = cable_lines

    def __call__(
        self,
        images: Sequence[StereoImage | None],
        tension: ArrayLike,
        X_WP: RigidTransform,
        tangents: ArrayLike | None = None,
        known: NDArray[np.bool_] | None = None,
    ) -> Array:
        """Return pixels (k, 2, 2, n, 2), as `CableImages` gives them; NaN where not seen.

        Args:
            images: left and right one of each pair; None for a pair that delivers none.
            tension: (k,) [N], measured, at the drawing points; it says how the cable sags.
            X_WP: measured pose of the platform; says where to search.
            tangents: (k, 3), of the last frame; all cables are searched if None.
            known: (k,), whether those were measured; if None they were.
        """
        k = self._stereo.robot.num_cables
        last = np.zeros((k, 3)) if tangents is None else np.array(tangents, float).reshape(-1, 3)
        if tangents is None:
            known = np.zeros(k, bool)
        elif known is None:
            known = np.ones(k, bool)
        T = self._stereo.believable(tension)
        edges, found = self.track(images, last, T, known)
        if not found.all():
            tangents, there = self.search(images, X_WP, ~found)
            again, _ = self.track(images, tangents, T, there)
            edges[there] = again[there]
        return edges

    def track(
        self,
        images: Sequence[StereoImage | None],
        tangents: Array,
        tension: Array,
        which: NDArray[np.bool_],
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return the edges (k, 2, 2, n, 2) [px] around cables expected, and which are found (k,).

        Args:
            images: as for the call.
            tangents: (k, 3), unit, expected.
            tension: (k,) [N], at the drawing points.
            which: (k,), the cables to track.
        """
        s = self._stereo
        edges = np.full((*s.shape, 2), np.nan)
        found = np.zeros(len(which), bool)
        EA, p_WA = s.stiffness(tension), s.leaving(tangents)
        for i in np.flatnonzero(which):
            pair = images[s.pairs[i]]
            if pair is None:
                continue
            both = [
                self._kernel.track(
                    pair[side], camera, p_WA[i], tangents[i], tension[i],
                    s.robot.weight_per_metre, EA[i], s.radius, s.stations, REACH, LEAST_CONTRAST,
                    edges[i, side],
                )
                for side, camera in enumerate((s.lefts[i], s.rights[i]))
            ]  # fmt: skip
            found[i] = all(both)
        return edges, found

    def search(
        self,
        images: Sequence[StereoImage | None],
        X_WP: RigidTransform,
        which: NDArray[np.bool_],
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return tangents (k, 3), to some milliradians, and which cables are found (k,).

        Args:
            images: as for the call.
            X_WP: measured pose of the platform.
            which: (k,), the cables to search.
        """
        s = self._stereo
        ends = s.ends(X_WP)
        p_WA, chords = ends.p_WA, ends.chord
        tangents, found = np.zeros((len(which), 3)), np.zeros(len(which), bool)
        for index, pair in enumerate(images):
            cables = np.flatnonzero(which & (s.pairs == index))
            if pair is None or not len(cables):
                continue
            cameras = s.lefts[cables[0]], s.rights[cables[0]]
            rays = [_dark_rays(*both) for both in zip(pair, cameras, strict=True)]
            for i in cables:
                left, right = (
                    self._plane(camera, dark, p_WA[i], chords[i])
                    for camera, dark in zip(cameras, rays, strict=True)
                )
                if left is None or right is None:
                    continue
                u = np.cross(left, right)  # eq. 17
                size = np.linalg.norm(u)
                found[i] = size > FLATTEST_CROSSING
                tangents[i] = u / size * np.sign(u @ chords[i]) if found[i] else 0.0
        return tangents, found

    def _plane(self, camera: Array, rays: Array, A: Array, chord: Array) -> Array | None:
        """Return the normal of the plane through camera and A with the most dark pixels.

        That of a cable, as none of other cables passes through A. Only pixels at least half as far
        from A as where the cable starts to be looked at count, and those near the chord's angle.
        """
        centre = -camera[:9].reshape(3, 3).T @ camera[9:12]
        axis = (A - centre) / np.linalg.norm(A - centre)
        frame = np.linalg.svd(axis[None])[2]  # rows: axis, and two across it
        start = A - centre + 0.5 * self._stereo.stations[0] * chord / np.linalg.norm(chord)
        a, b = frame[1:] @ start
        x, y = frame[1:] @ rays.T
        ahead = (x * a + y * b) / np.abs(rays @ axis) > (a * a + b * b) / abs(start @ axis)
        angle = np.arctan2(y * a - x * b, x * a + y * b)[ahead]
        angle = angle[np.abs(angle) < WIDEST_TURN]
        if len(angle) < FEWEST_PIXELS:
            return None
        count, borders = np.histogram(angle, np.arange(-WIDEST_TURN, WIDEST_TURN + BIN, BIN))
        count = np.convolve(count, np.ones(3), "same")
        peak = borders[np.argmax(count)] + 0.5 * BIN
        near = angle[np.abs(angle - peak) < 1.5 * BIN]
        if len(near) < FEWEST_PIXELS:
            return None
        turn = np.arctan2(b, a) + np.median(near)
        across = np.cos(turn) * frame[1] + np.sin(turn) * frame[2]
        return np.cross(axis, across)


def _dark_rays(image: Image, camera: Array) -> Array:
    """Return the lines of sight (n, 3), in W, of pixels nearer to the darkest than to the panel."""
    from cdpr_drake.model.kernels import vision

    panel = float(np.median(image[::16, ::16]))
    depth = panel - float(image.min())
    if depth < LEAST_CONTRAST:
        return np.empty((0, 3))
    places = np.flatnonzero(image < panel - 0.5 * depth)
    places = places[:: 1 + len(places) // MOST_PIXELS]
    pixels = np.column_stack([places % image.shape[1], places // image.shape[1]]).astype(float)
    plane = np.empty_like(pixels)
    vision.undistorted(camera, pixels, plane)
    return np.column_stack([plane, np.ones(len(plane))]) @ camera[:9].reshape(3, 3)
