"""The numbers that a store keeps for words and yes or no, with the colours they are drawn in."""

from collections.abc import Mapping

from cnctwin.memory.store.influx.codes import CODES
from twin.vocabulary import twin_signals as twin

Words = tuple[tuple[float, str, str], ...]
GREEN, YELLOW, ORANGE, RED, BLUE, PURPLE, GREY = "green", "yellow", "orange", "red", "blue", "purple", "#8e8e8e"
_EXECUTION = {
    "ACTIVE": GREEN,
    "READY": BLUE,
    "INTERRUPTED": ORANGE,
    "FEED_HOLD": YELLOW,
    "STOPPED": GREY,
    "OPTIONAL_STOP": GREY,
    "PROGRAM_STOPPED": ORANGE,
    "PROGRAM_COMPLETED": "semi-dark-blue",
}
_SEVERITY = {"none": "transparent", "low": YELLOW, "medium": ORANGE, "high": RED}


def _coloured(signal: str, colours: Mapping[str, str]) -> Words:
    return tuple((float(code), word, colours[word]) for code, word in enumerate(CODES[signal]))


EXECUTION = _coloured("exec_state", _EXECUTION)
SEVERITY = _coloured(twin.SEVERITY, _SEVERITY)
ALARMS = ((0.0, "no", "transparent"), (1.0, "yes", RED))
GATE = ((0.0, "no", "transparent"), (1.0, "yes", GREY))
GROWTH = ((0.0, "as while healthy", GREEN), (1.0, "growing", RED))
QUALITY = ((0.0, "good", GREEN), (1.0, "stale", GREY), (2.0, "bad", RED))
ONLINE = ((0.0, "offline", RED), (1.0, "online", GREEN))
