"""Cables near where they leave in the images of stereo pairs, and their tangents from them.

Arguments: A (3,), u (3,): where a cable leaves, and its unit tangent there, from A to B, in W; T:
tension there [N]; w: weight per unstrained metre [N/m]; EA: axial stiffness [N]; radius: of the
cable [m]; s, stations (n,): unstrained lengths from A [m]; camera (21,): as kernels/vision.py has
it; plane (2, n, 2): normalised image coordinates of both edges, NaN where not seen; pixels: the
same in pixels; normal (3,): unit normal of an interpretation plane, in W. For k cables: points (4,
k, 3): as in `model.arrays`, of which each A follows with the tangent; tangents (k, 3), tensions
(k,), lefts, rights (k, 21), images (k, 2, 2, n, 2) by cable, camera and edge.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.geometry import place_leaving
from cdpr_drake.model.kernels.vision import distort, undistort

CORRECTIONS = 3  # of the curvature; each leaves less than a hundredth of what was wrong
FEWEST = 0.5  # part of an edge's points that must be seen


@jit
def cable_point(A, u, T, w, EA, s, point, tangent):
    """Write the point and unit tangent of the elastic catenary at s, exact for any slope.

    With V = T u_z + w s: x = H s / EA + (H / w) ln((V + T(s)) / (V_A + T)), and z as in Irvine; the
    logarithm is written by differences, so that nothing cancels over a short piece.
    """
    H2 = T * T * (u[0] * u[0] + u[1] * u[1])
    V_A = T * u[2]
    V = V_A + w * s
    T_s = np.sqrt(H2 + V * V)
    rise = w * s * (V_A + V) / (T + T_s)  # T(s) - T
    if V_A > 0.0:
        spread = np.log1p((w * s + rise) / (V_A + T)) / w
    else:
        spread = -np.log1p((rise - w * s) / (T - V_A)) / w
    along = T * (s / EA + spread)
    point[0], point[1] = A[0] + along * u[0], A[1] + along * u[1]
    point[2] = A[2] + s * (V_A + V) / (2.0 * EA) + rise / w
    tangent[0], tangent[1], tangent[2] = T * u[0] / T_s, T * u[1] / T_s, V / T_s


@jit
def edges(camera, A, u, T, w, EA, radius, stations, plane):
    """Write both edges of a cable as a camera without distortion sees them.

    At the edge the line of sight touches the round cable: (c - o + r m) m = 0 for the centre c, the
    camera o and m across the cable, so m = -(r / D) d + sqrt(1 - (r / D)^2) (+-t x d) with D d the
    part of c - o across the tangent t.
    """
    o, c, t = np.empty(3), np.empty(3), np.empty(3)
    d, e, x, y = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        o[i] = -(camera[i] * camera[9] + camera[3 + i] * camera[10] + camera[6 + i] * camera[11])
    for n in range(stations.shape[0]):
        cable_point(A, u, T, w, EA, stations[n], c, t)
        along = 0.0
        for i in range(3):
            d[i] = c[i] - o[i]
            along += d[i] * t[i]
        D = 0.0
        for i in range(3):
            d[i] -= along * t[i]
            D += d[i] * d[i]
        D = np.sqrt(D)
        for i in range(3):
            d[i] /= D
        e[0], e[1], e[2] = (
            t[1] * d[2] - t[2] * d[1],
            t[2] * d[0] - t[0] * d[2],
            t[0] * d[1] - t[1] * d[0],
        )
        sine = radius / D
        cosine = np.sqrt(max(0.0, 1.0 - sine * sine))
        for edge in range(2):
            sign = 1.0 - 2.0 * edge
            for i in range(3):
                x[i] = c[i] + radius * (sign * cosine * e[i] - sine * d[i])
            for i in range(3):
                y[i] = camera[9 + i]
                for j in range(3):
                    y[i] += camera[3 * i + j] * x[j]
            if y[2] > 1e-6:
                plane[edge, n, 0], plane[edge, n, 1] = y[0] / y[2], y[1] / y[2]
            else:
                plane[edge, n, 0] = plane[edge, n, 1] = np.nan


@jit
def to_pixels(camera, width, height, plane, pixels):
    """Write the pixels of points without distortion; NaN outside of the image, width x height."""
    J = np.empty((2, 2))
    for edge in range(2):
        for n in range(plane.shape[1]):
            x, y = plane[edge, n, 0], plane[edge, n, 1]
            a, b = distort(camera, x, y, J)
            u, v = camera[12] * a + camera[14], camera[13] * b + camera[15]
            # Far out the polynomial may lead back in, so the straight ray must come near too.
            near = abs(camera[12] * x) < width and abs(camera[13] * y) < height
            inside = 0.0 <= u <= width - 1.0 and 0.0 <= v <= height - 1.0
            pixels[edge, n, 0] = u if near and inside else np.nan
            pixels[edge, n, 1] = v if near and inside else np.nan


@jit
def edge_plane(camera, points, normal):
    """Write the normal, in W, of the plane through the camera and a line fitted to an edge.

    The line a x + b y + c = 0 has the least sum of squared distances; points (n, 2), NaN where not
    seen. Returns whether enough of the edge was seen.
    """
    count, mx, my = 0, 0.0, 0.0
    for n in range(points.shape[0]):
        if np.isfinite(points[n, 0]):
            count, mx, my = count + 1, mx + points[n, 0], my + points[n, 1]
    if count < 2 or count < FEWEST * points.shape[0]:
        return False
    mx, my = mx / count, my / count
    xx, xy, yy = 0.0, 0.0, 0.0
    for n in range(points.shape[0]):
        if np.isfinite(points[n, 0]):
            dx, dy = points[n, 0] - mx, points[n, 1] - my
            xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    a, b = -np.sin(angle), np.cos(angle)
    c = -(a * mx + b * my)
    size = np.sqrt(1.0 + c * c)
    for i in range(3):
        normal[i] = (a * camera[i] + b * camera[3 + i] + c * camera[6 + i]) / size
    return True


@jit
def cable_plane(camera, plane, normal):
    """Write the normal, in W, of the plane through the camera and a cable: midway of its edges'."""
    other = np.empty(3)
    if not edge_plane(camera, plane[0], normal) or not edge_plane(camera, plane[1], other):
        return False
    sign = 1.0 if normal[0] * other[0] + normal[1] * other[1] + normal[2] * other[2] > 0 else -1.0
    size = 0.0
    for i in range(3):
        normal[i] += sign * other[i]
        size += normal[i] * normal[i]
    for i in range(3):
        normal[i] /= np.sqrt(size)
    return True


@jit
def direction(left, right, left_plane, right_plane, towards, u):
    """Write the direction u of the line in which two interpretation planes meet (eq. 17).

    left and right are cameras, left_plane and right_plane what they see. Returns the sine of the
    angle between the planes, 0 if one is not seen; u points `towards` (3,).
    """
    n, m = np.empty(3), np.empty(3)
    if not cable_plane(left, left_plane, n) or not cable_plane(right, right_plane, m):
        return 0.0
    u[0], u[1], u[2] = (
        n[1] * m[2] - n[2] * m[1],
        n[2] * m[0] - n[0] * m[2],
        n[0] * m[1] - n[1] * m[0],
    )
    sine = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    if sine < 1e-12:
        return 0.0
    if u[0] * towards[0] + u[1] * towards[1] + u[2] * towards[2] < 0.0:
        sine = -sine
    for i in range(3):
        u[i] /= sine
    return abs(sine)


@jit
def leave(points, tangents, p_WA):
    """Write where k cables leave along their tangents, p_WA (k, 3)."""
    for i in range(tangents.shape[0]):
        place_leaving(i, points, tangents[i], p_WA[i])


@jit
def see(points, tangents, tensions, w, EA, radius, stations, lefts, rights, sizes, images):
    """Write the images of k cables; sizes (k, 2, 2): width and height of left and right images."""
    plane, A = np.empty((2, stations.shape[0], 2)), np.empty(3)
    for i in range(tangents.shape[0]):
        u, T = tangents[i], tensions[i]
        place_leaving(i, points, u, A)
        for side in range(2):
            camera = lefts[i] if side == 0 else rights[i]
            edges(camera, A, u, T, w, EA[i], radius, stations, plane)
            to_pixels(camera, sizes[i, side, 0], sizes[i, side, 1], plane, images[i, side])


@jit
def shake(images, noise, sigma):
    """Move each point of each edge across it, by sigma [px] times its noise (k, 2, 2, n)."""
    for i in range(images.shape[0]):
        for side in range(2):
            for edge in range(2):
                line = images[i, side, edge]
                first, last = -1, -1
                for n in range(line.shape[0]):
                    if np.isfinite(line[n, 0]):
                        first = n if first < 0 else first
                        last = n
                if last <= first:
                    continue
                dx, dy = line[last, 0] - line[first, 0], line[last, 1] - line[first, 1]
                size = np.sqrt(dx * dx + dy * dy)
                if size > 0.0:
                    for n in range(line.shape[0]):
                        step = sigma * noise[i, side, edge, n] / size
                        line[n, 0] -= step * dy
                        line[n, 1] += step * dx


@jit
def measure(
    images,
    towards,
    points,
    tensions,
    w,
    EA,
    radius,
    stations,
    lefts,
    rights,
    tangents,
    sines,
    bias,
):
    """Write the tangents (k, 3) where the cables leave from images of them.

    What the pairs see is the direction of a line laid through a sagging piece of cable. For a
    tangent u and the tension, the same line is laid through the piece computed, from where a cable
    leaves along u; u is moved until both agree. towards (k, 3): directions from A to B; sines (k,):
    of the angles between planes, 0 where a cable is not seen; bias (k,): angle from tangent to line
    [rad].
    """
    n = stations.shape[0]
    seen = np.empty((2, 2, n, 2))
    piece = np.empty((2, 2, n, 2))
    line, computed, A = np.empty(3), np.empty(3), np.empty(3)
    for i in range(images.shape[0]):
        for side in range(2):
            camera = lefts[i] if side == 0 else rights[i]
            for edge in range(2):
                for j in range(n):
                    u, v = images[i, side, edge, j, 0], images[i, side, edge, j, 1]
                    if np.isfinite(u) and np.isfinite(v):
                        x, y = undistort(camera, u, v)
                    else:
                        x, y = np.nan, np.nan
                    seen[side, edge, j, 0], seen[side, edge, j, 1] = x, y
        sines[i] = direction(lefts[i], rights[i], seen[0], seen[1], towards[i], line)
        bias[i] = 0.0
        if sines[i] == 0.0:
            continue
        t = tangents[i]
        t[:] = line
        for _ in range(CORRECTIONS):
            place_leaving(i, points, t, A)
            for side in range(2):
                camera = lefts[i] if side == 0 else rights[i]
                edges(camera, A, t, tensions[i], w, EA[i], radius, stations, piece[side])
                for edge in range(2):
                    for j in range(n):
                        if not np.isfinite(seen[side, edge, j, 0]):
                            piece[side, edge, j, 0] = piece[side, edge, j, 1] = np.nan
            if direction(lefts[i], rights[i], piece[0], piece[1], t, computed) == 0.0:
                sines[i] = 0.0
                break
            size = 0.0
            for a in range(3):
                t[a] += line[a] - computed[a]
                size += t[a] * t[a]
            for a in range(3):
                t[a] /= np.sqrt(size)
        x = t[1] * line[2] - t[2] * line[1]
        y = t[2] * line[0] - t[0] * line[2]
        z = t[0] * line[1] - t[1] * line[0]
        bias[i] = np.arcsin(min(1.0, np.sqrt(x * x + y * y + z * z)))
