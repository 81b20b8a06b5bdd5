"""An input that may stay open."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem_

from cdpr_drake.systems._template import check_finite, optional_input, system_template, value


@system_template("ZeroWhenOpen")
def ZeroWhenOpen_(T: type) -> type:
    class Impl(LeafSystem_[T]):
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

        def _construct(self, size: int, *, converter: Any = None) -> None:
            super().__init__(converter=converter)
            self.size = size
            self._port = self.DeclareVectorInputPort("u", size)
            self.DeclareVectorOutputPort("y", size, self._calc, {self._port.ticket()})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.size, converter=converter)

        def _calc(self, context: Any, output: Any) -> None:
            u = np.asarray(optional_input(self._port, context, self.size))
            check_finite(value(u), self, context, "input u")
            output.SetFromVector(u)

    return Impl


ZeroWhenOpen = ZeroWhenOpen_[None]
