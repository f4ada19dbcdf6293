"""Texts that also have a number, so that a chart, or a server that knows no texts, can show them: the place in the list."""

from collections.abc import Mapping

from twin.vocabulary.twin_signals import SEVERITY

CODES: Mapping[str, tuple[str, ...]] = {
    "exec_state": (
        "ACTIVE",
        "READY",
        "INTERRUPTED",
        "FEED_HOLD",
        "STOPPED",
        "OPTIONAL_STOP",
        "PROGRAM_STOPPED",
        "PROGRAM_COMPLETED",
    ),
    "controller_mode": ("AUTOMATIC", "MANUAL", "MANUAL_DATA_INPUT", "SEMI_AUTOMATIC", "EDIT"),
    "tool_change_source": ("controller", "detector", "none", "stale"),
    SEVERITY: ("none", "low", "medium", "high"),
}
"""Signal -> its texts. Append only: the numbers are in people's databases."""


def code(signal: str, text: str) -> float | None:
    """The number of a text of a signal; None where it has none.

    >>> code("exec_state", "FEED_HOLD"), code("program", "O1000")
    (3.0, None)
    """
    texts = CODES.get(signal)
    return float(texts.index(text)) if texts and text in texts else None
