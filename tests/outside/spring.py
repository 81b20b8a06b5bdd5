"""Parts of the plant of one's own: springs from the ground to the platform."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake.systems import scalar_convertible


class PlainSpring(LeafSystem):
    """A linear bearing of springs: f = -k (p - p0) at the platform's origin. For floats alone.

    Args:
        stiffness: k (3,) [N/m] along x, y, z.
        relaxed: p0 (3,) [m] in W, where it pulls not.
    """

    def __init__(self, stiffness: ArrayLike, relaxed: ArrayLike) -> None:
        super().__init__()
        self._k, self._relaxed = np.asarray(stiffness, float), np.asarray(relaxed, float)
        self._pose = self.DeclareVectorInputPort("pose", 6)
        self.DeclareVectorOutputPort("wrench", 6, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        force = self._k * (self._relaxed - self._pose.Eval(context)[3:])
        output.SetFromVector(np.concatenate([0.0 * force, force]))


Spring = scalar_convertible(PlainSpring)
"""The same for floats and for derivatives."""


@scalar_convertible
class Rubber(LeafSystem):
    """A rubber rope from a point on the ground to the platform's origin, with damping.

    f = -(k (L - L0) + c dL/dt) n, along the rope; it takes the platform's state.

    Args:
        anchor: (3,) [m] in W.
        relaxed: L0 [m].
        stiffness: k [N/m].
        damping: c [N s/m].
    """

    def __init__(
        self, anchor: ArrayLike, relaxed: float, stiffness: float, damping: float = 0.0
    ) -> None:
        super().__init__()
        self._anchor, self._relaxed = np.asarray(anchor, float), relaxed
        self._k, self._c = stiffness, damping
        self._state = self.DeclareVectorInputPort("platform_state", 12)
        self.DeclareVectorOutputPort("wrench", 6, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        state = self._state.Eval(context)
        rope, velocity = state[3:6] - self._anchor, state[9:]
        length = np.sqrt(rope @ rope)
        along = rope / length
        pull = self._k * (length - self._relaxed) + self._c * (velocity @ along)
        output.SetFromVector(np.concatenate([0.0 * rope, -pull * along]))


class Weightless(LeafSystem):
    """A part that has no output "wrench": the loop has to refuse it."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclareVectorInputPort("pose", 6)
