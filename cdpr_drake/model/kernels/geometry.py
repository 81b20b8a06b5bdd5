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
    """Return R b, a point or vector of the platform in W."""
    return (
        R[0, 0] * b[0] + R[0, 1] * b[1] + R[0, 2] * b[2],
        R[1, 0] * b[0] + R[1, 1] * b[1] + R[1, 2] * b[2],
        R[2, 0] * b[0] + R[2, 1] * b[1] + R[2, 2] * b[2],
    )


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
    # Plain floats: uncompiled, arithmetic on NumPy's scalars takes four times as long.
    x, y, z = float(position[0]), float(position[1]), float(position[2])
    wx, wy, wz = float(omega[0]), float(omega[1]), float(omega[2])
    vx, vy, vz = float(velocity[0]), float(velocity[1]), float(velocity[2])
    for i in range(attachment.shape[0]):
        e = turned(R, attachment[i])
        ex, ey, ez = float(e[0]), float(e[1]), float(e[2])
        p_WB[i, 0], p_WB[i, 1], p_WB[i, 2] = ex + x, ey + y, ez + z
        v_WB[i, 0] = vx + wy * ez - wz * ey
        v_WB[i, 1] = vy + wz * ex - wx * ez
        v_WB[i, 2] = vz + wx * ey - wy * ex
