"""Load cells with filters in series."""

from __future__ import annotations

import numpy as np

from cdpr_drake.model.kernels import jit


@jit
def filter_derivatives(x, tension, noise, p, xdot):
    """Write the derivatives of n_f first-order filters in series and return whether all are finite.

    Arguments: x, xdot (n_f k,), filter after filter; tension [N], noise [-] (k,); p (4, k): gain,
    bias [N] and sigma [N] of the readings, and the filters' rate 2 pi f_c [1/s].
    """
    k = tension.shape[0]
    size = 0.0
    for i in range(k):
        rate = float(p[3, i])
        before = float(p[0, i]) * float(tension[i]) + float(p[1, i]) + float(p[2, i] * noise[i])
        for j in range(i, x.shape[0], k):
            after = float(x[j])
            change = rate * (before - after)
            size += abs(change)
            xdot[j] = change
            before = after
    return size < np.inf
