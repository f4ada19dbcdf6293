"""Alarms to remember: a signature, and a memory in which one is on or over."""

from twin.anomaly.parts.alarms.episodes import Memory, Seen, followed
from twin.anomaly.parts.alarms.signature import Share, Signature, signature_of
from twin.anomaly.parts.alarms.verdict import Verdict, corrected_memory

LOAD, VIBRATION = "spindle_load_pct", "vibration_rms_g"
THRESHOLD = 2.0
NOTHING = Memory()


def signature(load: float = 3.0, vibration: float = 1.0, tool: int = 5, program: str = "O1") -> Signature:
    """A signature of load and vibration."""
    shares = [Share(LOAD, "cut", load), Share(VIBRATION, "seconds", vibration)]
    return signature_of(shares, f"{program}|T{tool}|1", program, tool)


def seen(score: float = 3.0, given: Signature | None = None, part: str = "O1#7") -> Seen:
    """A tick at which the score alarms."""
    return Seen(score, THRESHOLD, given or signature(), part)


def alarmed(memory: Memory = NOTHING, at_s: float = 1000.0, score: float = 3.0, given: Signature | None = None) -> Memory:
    """A memory in which an alarm has begun at `at_s`, in a part of its own, and was over ten seconds later."""
    part = "O1#7" if at_s == 1000.0 else f"O1 from {at_s}"
    return followed(followed(memory, seen(score, given, part), at_s), None, at_s + 10.0)


def verdict(word: str, alarm_at_s: float = 1000.0, at_s: float = 2000.0, by: str = "ada", **more: object) -> Verdict:
    """A verdict of a person."""
    return Verdict.model_validate({"alarm_at_s": alarm_at_s, "verdict": word, "at_s": at_s, "by": by, **more})


def spoken(memory: Memory, said: Verdict) -> Memory:
    """The memory after a verdict, where the machine's clock is the person's."""
    return corrected_memory(memory, said, said.at_s)
