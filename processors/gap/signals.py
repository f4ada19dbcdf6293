"""The signals that are compared, the regimes of each, and how finely a control commonly shows them."""

from twin.vocabulary import twin_signals
from twin.vocabulary.signals import PROGRAM_TIME_S as PROGRAM_TIME
from twin.vocabulary.signals import TOOL_CHANGE_S as TOOL_CHANGE

LOAD, TEMPERATURE, SPEED = "spindle_load_pct", "spindle_temp_c", "spindle_rpm"
AXIS_LOADS = tuple(f"axis_{letter}_load_pct" for letter in "xyzabc")
SIGNALS = (TEMPERATURE, LOAD, SPEED, TOOL_CHANGE, PROGRAM_TIME, *AXIS_LOADS)
REGIMES = {
    TEMPERATURE: ("warm_up", "steady", "cool_down"),
    LOAD: ("air", "cutting"),
    SPEED: ("turning",),
    TOOL_CHANGE: ("spindle_stopped", "spindle_turning"),
    PROGRAM_TIME: ("section",),
} | dict.fromkeys(AXIS_LOADS, ("standstill",))
UNITS = {TEMPERATURE: "K", LOAD: "%", SPEED: "rev/min", TOOL_CHANGE: "s", PROGRAM_TIME: "s"} | dict.fromkeys(AXIS_LOADS, "%")
RESOLUTIONS = {TEMPERATURE: 0.1, LOAD: 1.0, SPEED: 1.0, TOOL_CHANGE: 0.1, PROGRAM_TIME: 0.1} | dict.fromkeys(AXIS_LOADS, 1.0)
"""The rounding of what a control commonly shows; no floor is taken to be finer than that."""
REGIMES_MAX = {PROGRAM_TIME: 24}
REGIMES_OF_SIGNAL_MAX = 8
"""The most regimes that a signal is kept in: programs have no end."""
GAP = twin_signals.GAP_PREFIX
NAMES = {
    signal: {f"{GAP}{signal}": ""} | {f"{GAP}{signal}/{regime}": regime for regime in regimes if len(regimes) > 1}
    for signal, regimes in REGIMES.items()
}
"""The metrics of a signal's figures, with the regime that each is of, "" for all."""
