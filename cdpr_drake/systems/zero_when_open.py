"""An input that may stay open."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from cdpr_drake.systems._template import check_finite, optional_input, scalar_convertible, value


@scalar_convertible
class ZeroWhenOpen(LeafSystem):
    """Passes its input on, or zeros while the input is left open.

    .. pydrake_system::

        name: ZeroWhenOpen
        input_ports:
        - u (optional)
        output_ports:
        - y

    Args:
        size: of both ports.
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size
        self._port = self.DeclareVectorInputPort("u", size)
        self.DeclareVectorOutputPort("y", size, self._calc, {self._port.ticket()})

    def _calc(self, context: Context, output: BasicVector) -> None:
        u = np.asarray(optional_input(self._port, context))
        check_finite(value(u), self, context, "input u")
        output.SetFromVector(u)
