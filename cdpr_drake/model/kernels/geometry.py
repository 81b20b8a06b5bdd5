"""Where the cables of a robot are, in real or complex numbers; vectors are tuples (x, y, z).

The one place among the kernels that knows where a cable leaves the frame and where it reaches the
platform. `kinematics.cable_ends` is the same for NumPy's arrays.

Arguments in common: R (3, 3): orientation of the platform in W; position, omega, velocity (3,) [m,
rad/s, m/s]: of its origin; drawing, attachment (k, 3) [m]: p_WA and p_PB; i: the cable; a, b:
vectors; D (6, k): wrench matrix; p_WB, v_WB (k, 3): attachment points and their velocities in W.
"""

from __future__ import annotations

from cdpr_drake.model.kernels import jit


@jit
def cross(a, b):
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@jit
def turned(R, b):
    """Return R b, for R an array or its rows: a vector of the platform in W."""
    x, y, z = b[0], b[1], b[2]
    r, s, t = R[0], R[1], R[2]
    return (
        r[0] * x + r[1] * y + r[2] * z,
        s[0] * x + s[1] * y + s[2] * z,
        t[0] * x + t[1] * y + t[2] * z,
    )


@jit
def vector(a):
    """Return an array (3,) of floats as a vector.

    Uncompiled, arithmetic on NumPy's scalars takes four times as long as on these.
    """
    return float(a[0]), float(a[1]), float(a[2])


@jit
def chord(i, drawing, b):
    """Return the vector from where cable i leaves the frame to its attachment point b in W."""
    return b[0] - float(drawing[i, 0]), b[1] - float(drawing[i, 1]), b[2] - float(drawing[i, 2])


@jit
def arm_and_chord(i, R, position, drawing, attachment):
    """Return EB, from the platform's origin to the attachment point of cable i, and its chord."""
    e = turned(R, attachment[i])
    b = (e[0] + position[0], e[1] + position[1], e[2] + position[2])
    return e, chord(i, drawing, b)


@jit
def set_column(i, a, b, D):
    """Write the wrench [a x b; b] at the platform's origin of a force b on the arm a."""
    D[0, i], D[1, i], D[2, i] = cross(a, b)
    D[3, i], D[4, i], D[5, i] = b


@jit
def attachment_motion(R, position, omega, velocity, attachment, p_WB, v_WB):
    """Write positions and velocities of the attachment points in W; floats only."""
    (x, y, z), (wx, wy, wz), (vx, vy, vz) = vector(position), vector(omega), vector(velocity)
    rows = (vector(R[0]), vector(R[1]), vector(R[2]))
    for i in range(attachment.shape[0]):
        ex, ey, ez = turned(rows, vector(attachment[i]))
        p_WB[i, 0], p_WB[i, 1], p_WB[i, 2] = ex + x, ey + y, ez + z
        v_WB[i, 0] = vx + wy * ez - wz * ey
        v_WB[i, 1] = vy + wz * ex - wx * ez
        v_WB[i, 2] = vz + wx * ey - wy * ex
