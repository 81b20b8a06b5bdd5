"""White points in an image: found in a window or all over it, measured to a fraction of a pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Image = Any
"""uint8, (height, width), or with channels as a third axis, of which the second (green) is used."""

LEAST_CONTRAST = 24
"""A point is this many grey levels brighter than the face around it."""

SMALLEST_AREA = 6.0
"""Fewer pixels than this have no centre to speak of [px]."""

LARGEST_SIZE = 120
"""A point in an image is not wider than this, where it is searched for [px]."""

AREAS = (0.4, 2.5)
"""A point's area in an image over what is predicted: outside of these it is another thing."""

ROUND = 0.25
"""By how much the area of a blob may differ from that of the ellipse of the same moments."""

MOST_TRIES = 4
"""So many spots of a window are looked at, the nearest first."""

_NEIGHBOURS = np.ones((3, 3), np.uint8)
_MARK = 128  # between dark, 0, and bright, 255


@dataclass(frozen=True, kw_only=True)
class Blob:
    """A bright spot in an image.

    Attributes:
        u: of its centre [px], to the right from the centre of the first pixel.
        v: of its centre [px], down from there.
        area: [px].
    """

    u: float
    v: float
    area: float


def grey(image: Image, rows: slice = slice(None), columns: slice = slice(None)) -> Any:
    """Return a part of an image in grey: its green channel.

    Args:
        image: the image.
        rows: of the part.
        columns: of the part.
    """
    import cv2

    part = image[rows, columns]
    return np.ascontiguousarray(part) if part.ndim == 2 else cv2.extractChannel(part, 1)


def find_near(
    image: Image, u: float, v: float, reach: tuple[float, float], area: float
) -> Blob | None:
    """Return the spot of about an area next to a pixel, or None.

    Spots cut by the border of the window, and so of the image, do not count.

    Args:
        image: to be searched.
        u: of the middle of the window [px].
        v: of the middle of the window [px].
        reach: from there to the window's sides, across and down [px].
        area: expected [px].
    """
    import cv2

    height, width = image.shape[:2]
    left, top = max(int(u - reach[0]), 0), max(int(v - reach[1]), 0)
    right, bottom = min(int(u + reach[0]) + 2, width), min(int(v + reach[1]) + 2, height)
    if right - left < 3 or bottom - top < 3:
        return None
    window = grey(image, slice(top, bottom), slice(left, right))
    low, high, _, _ = cv2.minMaxLoc(window)
    if high - low < LEAST_CONTRAST:
        return None
    _, bright = cv2.threshold(window, 0.5 * (low + high), 255, cv2.THRESH_BINARY)
    seed = (
        min(max(round(u) - left, 0), right - left - 1),
        min(max(round(v) - top, 0), bottom - top - 1),
    )
    for _ in range(MOST_TRIES):
        if not bright[seed[1], seed[0]]:
            lit: Any = cv2.findNonZero(bright)
            if lit is None:
                return None
            lit = lit.reshape(-1, 2)  # OpenCV 4 gives it another axis
            distance = np.hypot(lit[:, 0] - (u - left), lit[:, 1] - (v - top))
            seed = tuple(lit[distance.argmin()].tolist())
        size, _, _, box = cv2.floodFill(bright, None, seed, _MARK)
        if _fits(size, box, area, window.shape):
            centre = _centre(window, bright, box, (low, high))
            return centre and Blob(u=left + centre[0], v=top + centre[1], area=float(size))
        cv2.floodFill(bright, None, seed, 0)
    return None


def find_all(image: Image) -> list[Blob]:
    """Return all spots of an image that could be white points: ellipses brighter than around them.

    Args:
        image: to be searched.
    """
    import cv2

    plain = grey(image)
    block = min(LARGEST_SIZE // 2 * 2 + 1, 2 * (min(plain.shape) // 2) - 1)
    mean, binary = cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY
    bright = cv2.adaptiveThreshold(plain, 255, mean, binary, block, -LEAST_CONTRAST)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(bright)
    left, top, width, height, area = boxes.T
    possible = (np.maximum(width, height) <= LARGEST_SIZE) & (area >= SMALLEST_AREA)
    possible &= (left > 0) & (top > 0) & (left + width < plain.shape[1])
    possible &= (top + height < plain.shape[0]) & (area > 0.4 * width * height)
    possible[0] = False
    blobs = []
    for label in np.flatnonzero(possible):
        left, top, width, height, _ = boxes[label].tolist()
        member = (labels[top : top + height, left : left + width] == label).astype(np.uint8)
        if _is_ellipse(member):
            # Its own levels of grey, not those of all around, give the threshold and centre.
            middle = left + 0.5 * (width - 1), top + 0.5 * (height - 1)
            reach = 0.5 * width + 2.0, 0.5 * height + 2.0
            blob = find_near(plain, *middle, reach, float(boxes[label][4]))
            if blob is not None:
                blobs.append(blob)
    return blobs


def _fits(size: int, box: Sequence[int], area: float, shape: tuple[int, int]) -> bool:
    """Return whether a spot has about the area expected and lies inside of its window."""
    left, top, width, height = box
    if not (size >= SMALLEST_AREA and AREAS[0] * area <= size <= AREAS[1] * area):
        return False
    return left > 0 and top > 0 and left + width < shape[1] and top + height < shape[0]


def _is_ellipse(member: Any) -> bool:
    """Return whether a spot, (height, width) of 0 and 1, fills the ellipse of its moments."""
    import cv2

    m = cv2.moments(member, binaryImage=True)
    # Each pixel is a square with a spread of its own.
    spread = (m["mu20"] / m["m00"] + 1.0 / 12.0) * (m["mu02"] / m["m00"] + 1.0 / 12.0)
    full = 4.0 * np.pi * np.sqrt(max(spread - (m["mu11"] / m["m00"]) ** 2, 0.0))
    return bool(abs(m["m00"] - full) <= ROUND * full)


def _centre(window: Any, bright: Any, box: Sequence[int], levels: Any) -> Any:
    """Return the centre u, v of what the marked spot has more of grey than the face, or None."""
    import cv2

    x, y, width, height = box
    x0, y0 = max(x - 2, 0), max(y - 2, 0)
    rows, columns = slice(y0, y + height + 2), slice(x0, x + width + 2)
    part = window[rows, columns]
    # With the pixels around it, which it covers in part.
    spot = cv2.compare(bright[rows, columns], float(_MARK), cv2.CMP_EQ)  # type: ignore[call-overload]
    near = cv2.dilate(spot, _NEIGHBOURS)
    # The darker quarter of the levels is the face: beyond its edge it may be brighter again.
    low, high = levels
    dark = cv2.compare(part, low + 0.25 * (high - low), cv2.CMP_LT)
    face = cv2.mean(part, cv2.subtract(dark, near))
    brighter = cv2.subtract(part, face)  # type: ignore[call-overload]
    m = cv2.moments(cv2.bitwise_and(brighter, near))
    if m["m00"] <= 0.0:
        return None
    return x0 + m["m10"] / m["m00"], y0 + m["m01"] / m["m00"]
