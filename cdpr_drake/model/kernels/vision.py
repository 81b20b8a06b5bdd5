"""What cameras see, and a pose from it: projection with distortion, Gauss-Newton on SE(3).

Arguments: cameras (c, 21): rows [R_CW (9), p_CW (3), fx, fy, cx, cy, k1, k2, p1, p2, k3], `camera`
one row; p: a point (3,) in W; x, y: normalised image coordinates; u, v, pixel: pixels; points
(n, 3): in P; which (n,): the camera of each; seen (n, 2): its pixel; X (4, 3): R_WP over p_WP;
G (6, 6), g (6,): the normal equations G d = g of a step d = [rotation vector; translation] in W;
out: results; jacobian: derivatives.
"""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit
from cdpr_drake.model.kernels.servo import solve_symmetric

MAX_STEPS = 50
CONVERGED = 1e-12  # of a step [rad, m]
ROUNDING = 1e-9  # of the cost: what a step promises to save, when rounding hides whether it does
SMALLEST = 1e-18  # [px^2], the same where the cost is zero


@jit
def distort(camera, x, y, jacobian):
    """Return x'', y'' of Brown's model as OpenCV has it, and write their jacobian (2, 2)."""
    k1, k2, p1, p2, k3 = camera[16], camera[17], camera[18], camera[19], camera[20]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # d radial / dx = slope x
    jacobian[0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    jacobian[0, 1] = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    jacobian[1, 0] = jacobian[0, 1]
    jacobian[1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
    )


@jit
def undistort(camera, u, v):
    """Return the normalised coordinates x, y that a pixel u, v shows, by Newton's method."""
    a, b = (u - camera[14]) / camera[12], (v - camera[15]) / camera[13]
    x, y = a, b
    J = np.empty((2, 2))
    for _ in range(MAX_STEPS):
        c, d = distort(camera, x, y, J)
        c, d = a - c, b - d
        det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
        dx, dy = (J[1, 1] * c - J[0, 1] * d) / det, (J[0, 0] * d - J[1, 0] * c) / det
        x, y = x + dx, y + dy
        if abs(dx) + abs(dy) < 1e-14:
            break
    return x, y


@jit
def project(camera, p, pixel, jacobian):
    """Write the pixel of a point p and its jacobian (2, 3); False if it is behind the camera."""
    x = camera[0] * p[0] + camera[1] * p[1] + camera[2] * p[2] + camera[9]
    y = camera[3] * p[0] + camera[4] * p[1] + camera[5] * p[2] + camera[10]
    z = camera[6] * p[0] + camera[7] * p[1] + camera[8] * p[2] + camera[11]
    if not z > 1e-6:
        return False
    J = np.empty((2, 2))
    x, y = x / z, y / z
    a, b = distort(camera, x, y, J)
    pixel[0], pixel[1] = camera[12] * a + camera[14], camera[13] * b + camera[15]
    for row in range(2):
        f = camera[12 + row] / z
        jx, jy = f * J[row, 0], f * J[row, 1]
        jz = -(jx * x + jy * y)
        for i in range(3):
            jacobian[row, i] = jx * camera[i] + jy * camera[3 + i] + jz * camera[6 + i]
    return True


@jit
def undistorted(camera, seen, out):
    """Write the normalised coordinates (n, 2) of pixels seen (n, 2) by one camera."""
    for i in range(seen.shape[0]):
        out[i, 0], out[i, 1] = undistort(camera, seen[i, 0], seen[i, 1])


@jit
def project_all(cameras, which, p, out):
    """Write the pixels (n, 2) of points p (n, 3); NaN for those behind their cameras."""
    J = np.empty((2, 3))
    for i in range(p.shape[0]):
        if not project(cameras[which[i]], p[i], out[i], J):
            out[i, 0] = out[i, 1] = np.nan


@jit
def normal_equations(points, which, seen, cameras, X, G, g):
    """Write G = J^T J, g = J^T r for the pixels' errors r; return r^T r, inf behind a camera."""
    G[:], g[:] = 0.0, 0.0
    cost = 0.0
    J, row = np.empty((2, 3)), np.empty(6)
    p, arm, pixel = np.empty(3), np.empty(3), np.empty(2)
    for n in range(points.shape[0]):
        for i in range(3):
            arm[i] = X[i, 0] * points[n, 0] + X[i, 1] * points[n, 1] + X[i, 2] * points[n, 2]
            p[i] = arm[i] + X[3, i]
        if not project(cameras[which[n]], p, pixel, J):
            return np.inf
        for a in range(2):
            error = seen[n, a] - pixel[a]
            cost += error * error
            # A turn d moves the point by d x arm.
            row[0] = J[a, 2] * arm[1] - J[a, 1] * arm[2]
            row[1] = J[a, 0] * arm[2] - J[a, 2] * arm[0]
            row[2] = J[a, 1] * arm[0] - J[a, 0] * arm[1]
            row[3], row[4], row[5] = J[a, 0], J[a, 1], J[a, 2]
            for i in range(6):
                g[i] += row[i] * error
                for j in range(6):
                    G[i, j] += row[i] * row[j]
    return cost


@jit
def moved(X, d, share, out):
    """Write X turned and shifted by a share of the step d (6,), about the platform's origin."""
    x, y, z = share * d[0], share * d[1], share * d[2]
    theta2 = x * x + y * y + z * z
    if theta2 < 1e-12:
        s, c = 1.0 - theta2 / 6.0, 0.5 - theta2 / 24.0
    else:
        theta = np.sqrt(theta2)
        s, c = np.sin(theta) / theta, 2.0 * (np.sin(0.5 * theta) / theta) ** 2
    for j in range(3):
        a, b, e = X[0, j], X[1, j], X[2, j]
        k0, k1, k2 = y * e - z * b, z * a - x * e, x * b - y * a
        out[0, j] = a + s * k0 + c * (y * k2 - z * k1)
        out[1, j] = b + s * k1 + c * (z * k0 - x * k2)
        out[2, j] = e + s * k2 + c * (x * k1 - y * k0)
        out[3, j] = X[3, j] + share * d[3 + j]


@jit
def minimise(points, which, seen, cameras, X, G):
    """Move X to where the pixels' errors are least; G becomes J^T J there.

    Returns (steps, cost): steps is -1 where the points do not determine a pose or the method does
    not converge; cost is the sum of squared errors [px^2].
    """
    g, step, factored = np.empty(6), np.empty(6), np.empty((6, 6))
    trial, H, h = np.empty((4, 3)), np.empty((6, 6)), np.empty(6)
    cost = normal_equations(points, which, seen, cameras, X, G, g)
    for steps in range(MAX_STEPS):
        factored[:], step[:] = G, g
        if not np.isfinite(cost) or not solve_symmetric(factored, step):
            return -1, cost
        share, lower = 1.0, False
        while not lower and share > 1e-3:
            moved(X, step, share, trial)
            new = normal_equations(points, which, seen, cameras, trial, H, h)
            lower = new <= cost
            if not lower:
                share *= 0.5
        size, gain = 0.0, 0.0
        for i in range(6):
            size, gain = max(size, abs(step[i])), gain + step[i] * g[i]
        if lower:
            X[:], G[:], g[:], cost = trial, H, h, new
        if size < CONVERGED or (not lower and gain < ROUNDING * cost + SMALLEST):
            return steps + 1, cost
        if not lower:
            return -1, cost
    return -1, cost
