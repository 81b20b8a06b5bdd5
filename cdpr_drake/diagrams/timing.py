"""When a vision-based loop looks and acts: its period and latency, with their holds and delays."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import DiscreteTimeDelay, ZeroOrderHold


@dataclass(frozen=True, kw_only=True)
class Timing:
    """When the loop takes its measurements and when it acts on them.

    Attributes:
        sample_time: period T [s]; None for an all-continuous loop.
        latency: from image to change of the motor rates [s]; without effect if all is continuous.

    Raises:
        ValueError: a value is out of range.
    """

    sample_time: float | None = 0.05
    latency: float = 0.04

    def __post_init__(self) -> None:
        period, latency = self.sample_time, self.latency
        if period is not None and not (math.isfinite(period) and period > 0.0):
            raise ValueError(f"the sample time must be positive, got {period} s")
        if not (math.isfinite(latency) and latency >= 0.0):
            raise ValueError(f"the latency must not be negative, got {latency} s")

    def check_gain(self, gain: float) -> None:
        """Raise ValueError unless a `gain` lambda [1/s] can work at all with this period."""
        if self.sample_time is not None and gain * self.sample_time >= 1.0:
            raise ValueError(
                f"gain * sample time = {gain:g}/s * {self.sample_time:g} s = "
                f"{gain * self.sample_time:.3g} must be below 1: the loop would overshoot at every "
                "sample"
            )

    @property
    def delay(self) -> float:
        """From image to change of the motor rates [s], 0 if all is continuous."""
        return 0.0 if self.sample_time is None else self.latency

    def split(self) -> tuple[int, float]:
        """Return (n, phase) with latency = n T + phase, 0 <= phase < T, phases near T rounded.

        Raises:
            ValueError: all is continuous.
        """
        if self.sample_time is None:
            raise ValueError("an all-continuous loop has no frames")
        frames = math.floor(self.latency / self.sample_time + 1e-9)
        phase = self.latency - frames * self.sample_time
        return frames, (phase if phase > 1e-9 * self.sample_time else 0.0)

    def held_rates(self, builder: DiagramBuilder, rates: OutputPort) -> OutputPort:
        """Add the block "held_rates" and return its output: the rates from k T + latency on.

        Args:
            builder: of the loop.
            rates: the law's motor rates.
        """
        if self.sample_time is None:
            return rates
        hold = ZeroOrderHold(self.sample_time, rates.size(), offset_sec=self.split()[1])
        builder.AddNamedSystem("held_rates", hold)
        builder.Connect(rates, hold.get_input_port())
        return hold.get_output_port()

    def sampled(
        self,
        builder: DiagramBuilder,
        measured: Mapping[str, OutputPort],
        held: Collection[str] = (),
    ) -> dict[str, OutputPort]:
        """Add blocks "sampled_..." and return their outputs: what was measured at k T.

        Systems that update at the same instant read each other's old values. So when the latency is
        a whole number n of frames, `held_rates`, updating at k T too, reads what the samplers took
        a frame earlier: they delay by n - 1 frames only, and for n = 0 there are none.

        Args:
            builder: of the loop.
            measured: the measurements by name.
            held: names of those that come from systems that sample and hold by themselves: what
                these took at k T can be read a frame later at the earliest, one sampler less is
                needed.
        """
        if self.sample_time is None:
            return dict(measured)
        frames, phase = self.split()
        delay = frames if phase > 0.0 else frames - 1
        sampled = dict(measured)
        for name, port in measured.items():
            steps = delay - 1 if name in held else delay
            if steps < 0:
                continue
            sampler = (
                ZeroOrderHold(self.sample_time, port.size())
                if steps == 0
                else DiscreteTimeDelay(self.sample_time, steps, port.size())
            )
            builder.AddNamedSystem(f"sampled_{name}", sampler)
            builder.Connect(port, sampler.get_input_port())
            sampled[name] = sampler.get_output_port()
        return sampled
