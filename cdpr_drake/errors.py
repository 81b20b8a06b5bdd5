"""The errors this package raises: each names the file and field, or the cable, time and value."""

from __future__ import annotations


class CdprError(Exception):
    """Base of every error of this package; catching it catches them all."""


class RobotFileError(CdprError, ValueError):
    """A robot file cannot be used. Names the file and the field."""

    def __init__(self, file: str, field: str, message: str) -> None:
        super().__init__(f"{file}: {field}: {message}" if field else f"{file}: {message}")
        self.file, self.field, self.message = file, field, message

    def __reduce__(self):
        return type(self), (self.file, self.field, self.message)


class GeometryError(CdprError, ValueError):
    """The geometry does not allow what was asked, e.g. a wrench matrix of rank below 6."""


class TensionError(CdprError, ValueError):
    """No tension distribution within the limits balances the wrench at a pose."""


class EquilibriumError(CdprError, RuntimeError):
    """No equilibrium was found; the message gives the residual and the limiting cable."""


class CalibrationError(CdprError, ValueError):
    """Measurements do not determine what they shall calibrate; the message says why."""


class RenderingError(CdprError, RuntimeError):
    """Images cannot be rendered on this machine; the message says why."""


class LinearizationError(CdprError, ValueError):
    """A diagram cannot be linearised; the message names the block in the way."""


class PredictionError(CdprError, ValueError):
    """The stability of a loop is not predicted; the message says why."""


class CableError(CdprError, RuntimeError):
    """A cable leaves what the model covers.

    `cable` counts from 1, as in the paper; `time` [s] is None outside of a run.
    """

    def __init__(self, cable: int, time: float | None, message: str) -> None:
        when = "" if time is None else f" at t = {time:.6g} s"
        super().__init__(f"cable {cable}{when}: {message}")
        self.cable, self.time, self.message = cable, time, message

    def __reduce__(self):
        return type(self), (self.cable, self.time, self.message)


class SimulationError(CdprError, RuntimeError):
    """A run left what the model covers. Names the quantity and the time."""

    def __init__(self, quantity: str, time: float, message: str) -> None:
        super().__init__(f"{quantity} at t = {time:.6g} s: {message}")
        self.quantity, self.time, self.message = quantity, time, message

    def __reduce__(self):
        return type(self), (self.quantity, self.time, self.message)


class SweepError(CdprError, RuntimeError):
    """A sweep came to no end; the message says why. What it had done is kept in its folder."""
