"""The edges of a cable in an image, sub-pixel, around where they are expected.

Arguments: image (height, width): grey levels; camera, A, u, T, w, EA, radius, stations (n,), plane
(2, n, 2): as kernels/stereo.py has them; expected, seen (n, 2): one edge in normalised coordinates;
pixels (2, n, 2): both in pixels, NaN where not seen; reach: how far from the expected place the
cable is looked for [px]; contrast: least difference of cable and panel [grey levels]. A scan runs
across the cable, along a row of pixels if the cable is `steep` in the image, else along a column;
at (n,): that row or column; places (n,): where on the scan the band's middle is expected; widths
(n,): of the band there; profile (m,): the scan's grey levels; start: its first pixel; run (2,):
first and last dark pixel, as indices in the profile; level (2,): grey of panel and cable; place,
width: one of places, from the start, and of widths; edges (n, 2): where the band begins and ends;
x, y, weight (n,): points and weights of a line; line (2,): y = line[0] + line[1] x; scale: size of
one pixel in units of y; values, spare (n,): numbers of which `count` count, and room for n.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.stereo import edges as stereo_edges
from cdpr_drake.model.kernels.stereo import to_pixels
from cdpr_drake.model.kernels.vision import distort, undistort

MARGIN = 3  # px beside the dark run that an edge's blur may reach
THIN = 3.0  # px; a narrower band may have no pixel that is wholly dark
LIKELY_WIDTHS = (0.5, 1.6)  # of a band, in expected ones; two cables that cross are wider
FEWEST = 0.5  # part of the scans that must agree on a line
STEPS = 5  # of reweighting
TUKEY = 4.685  # of Tukey's biweight: 95 % efficient for normal errors
FINEST = 0.05  # px, errors below this are never outliers


@jit
def outline(camera, width, height, plane, pixels):
    """Write the pixels of points without distortion, inside of the image or not.

    NaN far out, where the polynomial may lead back in.
    """
    J = np.empty((2, 2))
    for edge in range(2):
        for n in range(plane.shape[1]):
            x, y = plane[edge, n, 0], plane[edge, n, 1]
            if abs(camera[12] * x) < width and abs(camera[13] * y) < height:
                a, b = distort(camera, x, y, J)
                pixels[edge, n, 0] = camera[12] * a + camera[14]
                pixels[edge, n, 1] = camera[13] * b + camera[15]
            else:
                pixels[edge, n, 0] = pixels[edge, n, 1] = np.nan


@jit
def take(image, steep, at, start, profile):
    """Write the profile of a scan from pixel `start`; False if it leaves the image."""
    long, wide = (0, 1) if steep else (1, 0)
    inside = 0 <= at < image.shape[long] and start >= 0
    if not inside or start + profile.shape[0] > image.shape[wide]:
        return False
    for j in range(profile.shape[0]):
        profile[j] = image[at, start + j] if steep else image[start + j, at]
    return True


@jit
def median(values, count):
    """Return the middle one of the first values, which are reordered (Hoare's selection)."""
    low, high, wanted = 0, count - 1, count // 2
    while low < high:
        pivot, i, j = values[wanted], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if j < wanted:
            low = i
        if i > wanted:
            high = j
    return values[wanted]


@jit
def find_band(profile, place, width, contrast, run, level):
    """Write the dark run nearest to a place, and the levels of panel and cable.

    A band of few pixels may have none that is wholly dark, so the cable's level follows from all
    that is missing to the panel's and the expected width. False if the contrast is too small, or
    what is there has not a cable's width, or is so near to another dark band that the shades
    between could be either's.
    """
    m = profile.shape[0]
    low, high = np.inf, -np.inf
    for j in range(m):
        low, high = min(low, profile[j]), max(high, profile[j])
    half = 0.5 * (low + high)
    if high - low < contrast:
        return False
    first, best = -1, np.inf
    for j in range(m + 1):
        dark = j < m and profile[j] < half
        if dark and first < 0:
            first = j
        elif not dark and first >= 0:
            distance = abs(0.5 * (first + j - 1) - place)
            if distance < best:
                best, run[0], run[1] = distance, first, j - 1
            first = -1
    start, end = run[0] - MARGIN, run[1] + MARGIN
    size = run[1] - run[0] + 1
    if (
        start < 0
        or end >= m
        or not LIKELY_WIDTHS[0] * width - 1 < size < LIKELY_WIDTHS[1] * width + 1
    ):
        return False
    panel, count = np.empty(m), 0
    for j in range(m):
        if profile[j] >= half and not start <= j <= end:
            panel[count], count = profile[j], count + 1
        elif profile[j] < half and start <= j <= end and not run[0] <= j <= run[1]:
            return False
    if count < 2:
        return False
    level[0] = median(panel, count)
    total = 0.0
    for j in range(start, end + 1):
        total += level[0] - profile[j]
    level[1] = level[0] - total / width
    return True


@jit
def edges_of_band(profile, run, level, width):
    """Return where on its profile a band begins and ends [px].

    A pixel's grey level tells which part of it the cable covers, so the sum of the parts from the
    middle outwards is the distance of the edge, whatever its blur. A thin band may not cover its
    middle pixel; of it the centroid is taken, and the expected width.
    """
    before, after, own, moment = 0.0, 0.0, 0.0, 0.0
    middle = (run[0] + run[1]) // 2
    for j in range(run[0] - MARGIN, run[1] + MARGIN + 1):
        covered = (level[0] - profile[j]) / (level[0] - level[1])
        moment += covered * (j - middle)
        if j < middle:
            before += covered
        elif j > middle:
            after += covered
        else:
            own = covered
    if width < THIN:
        centre = middle + moment / (before + own + after)
        return centre - 0.5 * width, centre + 0.5 * width
    return middle - 0.5 * own - before, middle + 0.5 * own + after


@jit
def scan(image, steep, at, places, widths, reach, contrast, edges, weight):
    """Write where the band's edges (n, 2) are on n scans [px], NaN if not seen, and weights (n,).

    One dark level serves all scans of a cable: the median, which averages the noise.
    """
    n = at.shape[0]
    widest = 0.0
    for i in range(n):
        widest = max(widest, widths[i])
    m = 2 * int(reach + 0.5 * widest + MARGIN + 3.0) + 1
    profiles, starts = np.empty((n, m)), np.empty(n, np.int64)
    runs, levels = np.empty((n, 2), np.int64), np.empty((n, 2))
    found, dark = np.empty(n, np.bool_), np.empty(n)
    count = 0
    for i in range(n):
        found[i] = False
        if not np.isfinite(places[i]):
            continue
        starts[i] = int(np.floor(places[i] + 0.5)) - m // 2
        if take(image, steep, at[i], starts[i], profiles[i]):
            place = places[i] - starts[i]
            found[i] = find_band(profiles[i], place, widths[i], contrast, runs[i], levels[i])
        if found[i]:
            dark[count], count = levels[i, 1], count + 1
    cable = median(dark, count) if count else 0.0
    for i in range(n):
        edges[i, 0], edges[i, 1], weight[i] = np.nan, np.nan, 0.0
        if found[i] and levels[i, 0] - cable >= 0.5 * contrast:
            levels[i, 1] = cable
            a, b = edges_of_band(profiles[i], runs[i], levels[i], widths[i])
            edges[i, 0], edges[i, 1] = starts[i] + a, starts[i] + b
            weight[i] = (levels[i, 0] - cable) ** 2


@jit
def steady_line(x, y, spare):
    """Return the line (intercept, slope) of Theil and Sen: three in ten points may be wrong."""
    n = x.shape[0]
    slopes, count = np.empty(n * (n - 1) // 2 + 1), 0
    for i in range(n):
        for j in range(i):
            if x[i] != x[j]:
                slopes[count], count = (y[i] - y[j]) / (x[i] - x[j]), count + 1
    slope = median(slopes, count) if count else 0.0
    for i in range(n):
        spare[i] = y[i] - slope * x[i]
    return median(spare, n), slope


@jit
def weighted_line(x, y, weight, scale, line):
    """Write the line of least weighted squares, rejecting outliers by Tukey's biweight.

    Starts from Theil's and Sen's. The weights are multiplied by those of the last step: 0 for
    outliers. Returns the number of points that agree.
    """
    n = x.shape[0]
    error, share = np.empty(n), np.empty(n)
    line[0], line[1] = steady_line(x, y, error)
    count = 0
    for _ in range(STEPS):
        for i in range(n):
            error[i] = abs(y[i] - line[0] - line[1] * x[i])
        limit = TUKEY * max(1.4826 * median(error, n), FINEST * scale)
        s, sx, sy, sxx, sxy = 0.0, 0.0, 0.0, 0.0, 0.0
        count = 0
        for i in range(n):
            q = (y[i] - line[0] - line[1] * x[i]) / limit
            share[i] = (1.0 - q * q) ** 2 if abs(q) < 1.0 else 0.0
            w = weight[i] * share[i]
            count += 1 if w > 0.0 else 0
            s, sx, sy = s + w, sx + w * x[i], sy + w * y[i]
            sxx, sxy = sxx + w * x[i] * x[i], sxy + w * x[i] * y[i]
        det = s * sxx - sx * sx
        if count < 3 or not det > 1e-12 * s * sxx:
            return 0
        line[0], line[1] = (sxx * sy - sx * sxy) / det, (s * sxy - sx * sy) / det
    for i in range(n):
        weight[i] *= share[i]
    return count


@jit
def fit_edge(expected, seen, weight, scale):
    """Move an expected edge (n, 2) onto the points seen (n, 2); both in normalised coordinates.

    Two straight lines part linearly along either of them, and what the cable's sag bends them is
    the same: so a line is fitted to the distances of the points seen from the edge expected. What
    did not agree becomes NaN. Returns whether enough did.
    """
    n = expected.shape[0]
    which, count = np.empty(n, np.int64), 0
    for i in range(n):
        if np.isfinite(expected[i, 0]) and np.isfinite(seen[i, 0]):
            which[count], count = i, count + 1
    if count < max(3, FEWEST * n):
        return False
    first, last = which[0], which[count - 1]
    ox, oy = expected[first, 0], expected[first, 1]
    dx, dy = expected[last, 0] - ox, expected[last, 1] - oy
    size = np.sqrt(dx * dx + dy * dy)
    if not size > 0.0:
        return False
    dx, dy = dx / size, dy / size
    spot, bend, w = np.empty(count), np.empty(count), np.empty(count)
    x, y, line = np.empty(count), np.empty(count), np.empty(2)
    for k in range(count):
        a, b = expected[which[k], 0] - ox, expected[which[k], 1] - oy
        spot[k], bend[k] = a * dx + b * dy, b * dx - a * dy
    for k in range(count):
        a, b = seen[which[k], 0] - ox, seen[which[k], 1] - oy
        x[k], w[k] = a * dx + b * dy, weight[which[k]]
        # The bend of the edge expected, beside the point seen.
        j = min(max(k, 1), count - 1)
        part = (x[k] - spot[j - 1]) / (spot[j] - spot[j - 1])
        y[k] = b * dx - a * dy - (bend[j - 1] + part * (bend[j] - bend[j - 1]))
    if weighted_line(x, y, w, scale, line) < FEWEST * n:
        return False
    for i in range(n):
        if not np.isfinite(seen[i, 0]):
            expected[i, 0] = expected[i, 1] = np.nan
    for k in range(count):
        i = which[k]
        aside = line[0] + line[1] * spot[k] if w[k] > 0.0 else np.nan
        expected[i, 0], expected[i, 1] = expected[i, 0] - aside * dy, expected[i, 1] + aside * dx
    return True


@jit
def place_scans(pixels, at, places, widths):
    """Write where the scans of a cable run and where on each its band is expected.

    Returns (steep, flipped): whether scans run along rows, and whether the first edge lies beyond
    the second on them.
    """
    n = pixels.shape[1]
    first, last = -1, -1
    for i in range(n):
        if np.isfinite(pixels[0, i, 0] + pixels[1, i, 0]):
            first, last = i if first < 0 else first, i
    run = pixels[0, last, 0] - pixels[0, first, 0]
    fall = pixels[0, last, 1] - pixels[0, first, 1]
    steep = abs(fall) > abs(run)
    long, wide = (1, 0) if steep else (0, 1)
    long_enough = max(abs(run), abs(fall)) > 1.0  # else the cable points to the camera
    slope, signed = 0.0, 0.0
    if long_enough:
        slope = run / fall if steep else fall / run
    for i in range(n):
        at[i], places[i], widths[i] = 0, np.nan, 0.0
        if long_enough and np.isfinite(pixels[0, i, 0] + pixels[1, i, 0]):
            along = 0.5 * (pixels[0, i, long] + pixels[1, i, long])
            at[i] = int(np.floor(along + 0.5))
            middle = 0.5 * (pixels[0, i, wide] + pixels[1, i, wide])
            places[i] = middle + slope * (at[i] - along)
            ahead = pixels[1, i, long] - pixels[0, i, long]
            signed = pixels[1, i, wide] - pixels[0, i, wide] - slope * ahead
            widths[i] = abs(signed)
    return steep, signed < 0.0


@jit
def detect(image, camera, plane, reach, contrast, pixels):
    """Write the edges of a cable at the stations of the expected ones, `plane`, which is changed.

    NaN where not seen, everywhere if the cable is not found. Returns whether it is.
    """
    height, width = image.shape
    n = plane.shape[1]
    to_pixels(camera, width, height, plane, pixels)
    count = 0
    for i in range(n):
        count += 1 if np.isfinite(pixels[0, i, 0] + pixels[1, i, 0]) else 0
    found = count >= max(3, FEWEST * n)
    if found:
        at, places, widths = np.empty(n, np.int64), np.empty(n), np.empty(n)
        edges, weight, points = np.empty((n, 2)), np.empty(n), np.empty((n, 2))
        steep, flipped = place_scans(pixels, at, places, widths)
        scan(image, steep, at, places, widths, reach, contrast, edges, weight)
        scale = 1.0 / camera[12 if steep else 13]
        for edge in range(2):
            side = 1 - edge if flipped else edge
            for i in range(n):
                u, v = (edges[i, side], 1.0 * at[i]) if steep else (1.0 * at[i], edges[i, side])
                if np.isfinite(edges[i, side]):
                    points[i, 0], points[i, 1] = undistort(camera, u, v)
                else:
                    points[i, 0] = points[i, 1] = np.nan
            found = found and fit_edge(plane[edge], points, weight, scale)
    if found:
        to_pixels(camera, width, height, plane, pixels)
    else:
        pixels[:] = np.nan
    return found


@jit
def track(image, camera, A, u, T, w, EA, radius, stations, reach, contrast, pixels):
    """Write the edges of a cable around those of the piece computed from the tangent expected."""
    plane = np.empty((2, stations.shape[0], 2))
    stereo_edges(camera, A, u, T, w, EA, radius, stations, plane)
    return detect(image, camera, plane, reach, contrast, pixels)
