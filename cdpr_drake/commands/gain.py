"""The gain of a command, asked for or chosen, in words and as values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cdpr_drake.study import DefaultGain


def gain_in_words(gain: float, chosen: DefaultGain | None, where: str = "at the goal") -> str:
    """Return the gain as part of a sentence, with the reason unless it was asked for or customary.

    Args:
        gain: lambda [1/s].
        chosen: why it is this one, if nobody asked for one.
        where: a limit holds.
    """
    reason = "" if chosen is None else chosen.reason(where)
    return f"lambda = {gain:g} 1/s" + (f" ({reason})" if reason else "")


def gain_values(gain: float, chosen: DefaultGain | None, asked: str = "option") -> dict[str, Any]:
    """Return the gain, who decided it, and the limit where that was looked for, for a summary.

    Args:
        gain: lambda [1/s].
        chosen: why it is this one, if nobody asked for one.
        asked: who has decided else, "option" or "test".
    """
    if chosen is not None:
        return chosen.to_dict()
    return {"gain_per_s": gain, "gain_decided_by": asked, "gain_limit_per_s": None}
