"""Sensors that fail for a while: lost cameras, stuck and dead load cells."""

from __future__ import annotations

import math
from dataclasses import dataclass

POSE_CAMERA, STEREO_PAIR, LOAD_CELL = "pose camera", "stereo pair", "load cell"
SENSORS = (POSE_CAMERA, STEREO_PAIR, LOAD_CELL)


@dataclass(frozen=True, kw_only=True)
class Outage:
    """A sensor that fails from one time to another.

    Attributes:
        sensor: "pose camera", "stereo pair" or "load cell".
        number: which of them, counting from 1; None for all.
        start: [s].
        end: [s], not included.
        reading: of a load cell [N]: what it reads meanwhile, 0 if it is dead; None if it is stuck
            at what it read last. Without effect on cameras, which see nothing.
    """

    sensor: str
    number: int | None = None
    start: float = 0.0
    end: float = math.inf
    reading: float | None = None

    def __post_init__(self) -> None:
        if self.sensor not in SENSORS:
            raise ValueError(f'unknown sensor "{self.sensor}"; known are {", ".join(SENSORS)}')
        if not self.start < self.end:
            raise ValueError(f"an outage must end after {self.start} s, got {self.end} s")
        if self.reading is not None and not math.isfinite(self.reading):
            raise ValueError(f"a reading must be finite, got {self.reading} N")


class Outages:
    """The outages of one kind of sensor.

    Args:
        outages: of any sensors.
        sensor: the kind that counts here.
        count: how many there are of it.

    Raises:
        ValueError: an outage of a sensor that is not there.
    """

    def __init__(self, outages: tuple[Outage, ...], sensor: str, count: int) -> None:
        self._count = count
        self._outages = [o for o in outages if o.sensor == sensor]
        for outage in self._outages:
            if outage.number is not None and not 1 <= outage.number <= count:
                raise ValueError(f"there is no {sensor} {outage.number} among {count}")

    def __bool__(self) -> bool:
        return bool(self._outages)

    def at(self, time: float) -> dict[int, float | None]:
        """Return which sensors fail at a `time` [s], by index from 0, and what each reads."""
        failing: dict[int, float | None] = {}
        for outage in self._outages:
            if outage.start <= time < outage.end:
                one = range(self._count) if outage.number is None else (outage.number - 1,)
                failing |= dict.fromkeys(one, outage.reading)
        return failing
