"""Images of the cables near their drawing points, as the stereo pairs take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cdpr_drake.model.robot import CableRobot
from cdpr_drake.model.rotations import Array
from cdpr_drake.model.vision.tangents import StereoGeometry

Image = NDArray[np.uint8]
StereoImage = tuple[Image, Image]

PANEL, CABLE = 225.0, 40.0
"""Grey levels of the white panel under spotlights and of a cable before it."""

GREY_NOISE, BLUR = 2.0, 0.5
"""Noise of a pixel [grey levels] and standard deviation of the optics' blur [px]: usual ones."""

STATION = 0.01
"""Between computed points of a cable's edge, as part of the length the pairs look at [-]."""

FARTHEST = 4.0
"""A cable is drawn from A on to this many times that length, beyond the image [-]."""

QUANTILES = (np.arange(2**16) + 0.5) / 2**16
"""Of a pixel's noise: at their middles a normal variable's values are taken [-]."""

BORDER = 20.0
"""Beyond an image's border edges are followed this far [px]."""


class CableDrawing:
    """Draws the images of the stereo pairs: dark cables on a white panel that fills the image.

    A cable is the curved elastic catenary of `CableImages`, of the robot's diameter, between the
    two edges of its silhouette. It begins where it leaves the frame, at its drawing point or off
    its pulley, is cut off across there, and goes on to the image's border. A pixel is as dark as
    the part of it that the cable, blurred by the optics, covers; the integral is exact for an edge
    that is straight within the pixel. Where cables cross, both cover. Then come white noise and
    rounding to 8 bits.

    Args:
        robot: the true robot.
        grey_noise: standard deviation of a pixel [grey levels of 256].
        blur: standard deviation of the Gaussian blur [px].

    Raises:
        RobotFileError: a cable is seen by no stereo pair, or by two.
        ValueError: noise or blur below 0.
    """

    def __init__(
        self, robot: CableRobot, grey_noise: float = GREY_NOISE, blur: float = BLUR
    ) -> None:
        from scipy.special import ndtri

        from cdpr_drake.model.kernels import cable_lines

        if not (grey_noise >= 0.0 and blur >= 0.0):
            raise ValueError(f"noise and blur must be >= 0, got {grey_noise} and {blur}")
        self.grey_noise, self.blur = grey_noise, blur
        self._outline = cable_lines.outline
        # The noise is drawn by 16 random bits a pixel from as many equally likely values of it.
        self._shades = (grey_noise / (PANEL - CABLE) * ndtri(QUANTILES)).astype(np.float32)
        self._stereo = s = StereoGeometry(robot)
        self._cables = [np.flatnonzero(s.pairs == i) for i in range(s.pairs.max() + 1)]
        self._stations = s.stations[-1] * np.arange(0.0, FARTHEST, STATION)

    def __call__(
        self, tangents: ArrayLike, tension: ArrayLike, seed: int | None = None
    ) -> list[StereoImage]:
        """Return the left and right images (height, width), of 8 bits, of each stereo pair.

        Args:
            tangents: (k, 3), unit, at the drawing points, from A to B, in W.
            tension: (k,) [N], at the drawing points.
            seed: of the noise; none if None.
        """
        u, T = np.array(tangents, float).reshape(-1, 3), np.array(tension, float)
        noise = None if seed is None else np.random.SFC64(seed)
        return [
            (self._image(c, 0, u, T, noise), self._image(c, 1, u, T, noise)) for c in self._cables
        ]

    def _image(
        self, cables: NDArray[np.intp], side: int, u: Array, T: Array, noise: np.random.SFC64 | None
    ) -> Image:
        import cv2

        width, height = self._stereo.sizes[cables[0], side].astype(int)
        clear = np.ones((height, width), np.float32)
        for cable in cables:
            _cover(clear, self._silhouette(cable, side, u, T), self.blur)
        if noise is not None and self.grey_noise > 0.0:
            which = noise.random_raw(clear.size // 4 + 1).view(np.uint16)[: clear.size]
            clear += self._shades[which].reshape(clear.shape)
        np.maximum(clear, -CABLE / (PANEL - CABLE), out=clear)
        image = cv2.convertScaleAbs(clear, alpha=PANEL - CABLE, beta=CABLE)
        return np.asarray(image, np.uint8)

    def _silhouette(self, cable: int, side: int, u: Array, T: Array) -> Array:
        """Return pixels (2, n, 2) along both edges of a cable, from A on or where it comes in."""
        s = self._stereo
        camera = (s.lefts, s.rights)[side][cable]
        width, height = s.sizes[cable, side]
        edges = np.empty((2, len(self._stations), 2))
        s.kernel.edges(
            camera, s.leaving(u)[cable], u[cable], T[cable], s.robot.weight_per_metre,
            s.stiffness(T)[cable], s.radius, self._stations, edges,
        )  # fmt: skip
        self._outline(camera, width, height, edges.copy(), edges)
        near = np.all((edges > -BORDER) & (edges < s.sizes[cable, side] + BORDER), axis=(0, 2))
        first = int(np.argmax(near))
        count = int(np.argmin(np.append(near[first:], False)))
        return edges[:, first : first + count]


def _cover(clear: NDArray[np.float32], edges: Array, blur: float) -> None:
    """Darken an image by what a blurred cable between two edges (2, n, 2) covers of its pixels.

    Works along the rows or columns that the cable crosses: each edge is there a function of the
    row, linear between its points.
    """
    if edges.shape[1] < 2:
        return
    span = np.abs(edges[0, -1] - edges[0, 0])
    if span[1] > span[0]:
        clear, edges = clear.T, edges[..., ::-1]
    if edges[0, -1, 0] < edges[0, 0, 0]:
        edges = edges[:, ::-1]
    wide, long = clear.shape
    start, end = edges[:, 0, 0].max(), edges[:, -1, 0].min()
    first, last = max(0, int(np.ceil(start))), min(long - 1, int(np.floor(end)))
    if last < first:
        return
    at = np.arange(first, last + 1)
    sides = np.append(at, last + 1) - 0.5
    one, other = (np.interp(sides, e[:, 0], e[:, 1]) for e in edges)
    low, high = np.minimum(one, other), np.maximum(one, other)
    # Across an edge the blur is that of the image; along a column it is seen at a slant.
    sigma = blur * float(np.hypot(1.0, span.min() / span.max()))
    base = np.floor(np.minimum(low[:-1], low[1:]) - 4.0 * sigma).astype(int)
    size = int(np.ceil(np.maximum(high[:-1], high[1:]) + 4.0 * sigma - base).max()) + 2
    pixels = base[:, None] + np.arange(size)
    borders = base[:, None] + np.arange(size + 1) - 0.5
    covered = _below(high, borders, sigma) - _below(low, borders, sigma)
    inside = (pixels >= 0) & (pixels < wide)
    columns = np.broadcast_to(at[:, None], pixels.shape)
    clear[pixels[inside], columns[inside]] *= 1.0 - covered[inside].astype(np.float32)


def _below(edge: Array, borders: Array, sigma: float) -> Array:
    """Return the part of each pixel (n, m) below an edge, blurred by a Gaussian.

    A step's second antiderivative is differenced along the edge and divided by its rise, then over
    the pixel's height; where there is no rise, the first antiderivative midway is as exact.

    Args:
        edge: (n + 1,), where it crosses the left sides of n columns and the last one's right side.
        borders: (n, m + 1), of the pixels in each column.
        sigma: of the blur along the column.
    """
    a, b = edge[:-1, None], edge[1:, None]
    flat = np.abs(b - a) < 1e-6
    mean = (_twice(b - borders, sigma) - _twice(a - borders, sigma)) / np.where(flat, 1.0, b - a)
    if flat.any():
        mean = np.where(flat, _once(0.5 * (a + b) - borders, sigma), mean)
    return mean[:, :-1] - mean[:, 1:]


def _once(x: Array, sigma: float) -> Array:
    """Return the first antiderivative of a step at 0 that is blurred by a Gaussian."""
    if sigma == 0.0:
        return np.maximum(x, 0.0)
    return x * _step(x, sigma) + sigma * _bell(x, sigma)


def _twice(x: Array, sigma: float) -> Array:
    """Return its second antiderivative."""
    if sigma == 0.0:
        return 0.5 * np.maximum(x, 0.0) ** 2
    return 0.5 * ((x * x + sigma * sigma) * _step(x, sigma) + x * sigma * _bell(x, sigma))


def _step(x: Array, sigma: float) -> Array:
    from scipy.special import ndtr

    return ndtr(x / sigma)


def _bell(x: Array, sigma: float) -> Array:
    return np.exp(-0.5 * (x / sigma) ** 2) / np.sqrt(2.0 * np.pi)
