"""The way from what a step returns to what is published: checked against the declaration, and reported by exception."""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache

from processors.actions import Action, Pin
from processors.contract import PYTHON_TYPES, Output, OutputSpec, PlainOutput, PlainSpec
from processors.errors import OutputError
from sparkplug.metric import Change
from sparkplug.quality import Quality
from sparkplug.values import Value

PLAIN_TOPICS_MAX = 50_000


class Emission:
    """The outputs of one processor for one machine, with what was published last of each."""

    __slots__ = ("_rules", "is_history", "latest", "processor_name")

    def __init__(self, processor_name: str, outputs: tuple[OutputSpec, ...], *, is_history: bool = False) -> None:
        self.processor_name = processor_name
        self.is_history = is_history
        self.latest: dict[str, Change] = {}
        self._rules = _rules(outputs)

    def news(self, outputs: Iterable[Output], at_ms: int) -> list[Change]:
        """Return the changes that have to be published, each beside the one before it. Changes nothing: `published` does.

        Raises OutputError where an output is not declared or is of another type: our own bug.
        """
        latest, rules, is_history = self.latest, self._rules, self.is_history
        changes: list[Change] = []
        told: dict[str, Change] = {}  # in this step: a metric may have values of several moments
        for output in outputs:
            name, value, quality, reason, _, at_s = output
            known = (told.get(name) if told else None) or latest.get(name)
            if known is not None and known[1] == value and known[3] is quality and known[4] == reason:
                continue
            if name not in rules:
                raise OutputError(f"{self.processor_name} emits {name!r}, which it does not declare")
            spec, takes_floats, deadband = rules[name]
            if not (takes_floats and type(value) is float and -math.inf < value < math.inf):
                value, quality, reason = _checked(spec, output)
            if (
                known is not None
                and (deadband or value is None)  # else it was compared above
                and known[3] is quality
                and known[4] == reason
                and _is_near(known[1], value, deadband)
            ):
                continue
            if not (is_history and spec.is_alarm):
                stamp_ms = at_ms if at_s is None else round(at_s * 1000)
                told[name] = change = tuple.__new__(Change, (name, value, stamp_ms, quality, reason, is_history))
                changes.append(change)
        return changes

    def known(self, at_ms: int) -> tuple[Change, ...]:
        """Return the values of a new twin device: the last ones, and nulls that say why there is none yet."""
        nothing = "nothing computed yet"
        return tuple(self.latest.get(name) or Change(name, None, at_ms, Quality.BAD, nothing) for name in self._rules)

    def published(self, changes: Sequence[Change]) -> None:
        """Remember what readers now know."""
        for change in changes:
            self.latest[change[0]] = change


@lru_cache(maxsize=100)
def _rules(outputs: tuple[OutputSpec, ...]) -> dict[str, tuple[OutputSpec, bool, float]]:
    """The declaration of each output, whether it takes floats, and its deadband. The machines of a processor share them."""
    return {spec.name: (spec, float in PYTHON_TYPES[spec.datatype], spec.deadband) for spec in outputs}


class PlainTopics:
    """The topics on which a processor may publish plain messages. Those that were used are remembered with their QoS."""

    __slots__ = ("_declared", "_known", "_processor_name")

    def __init__(self, processor_name: str, declared: Sequence[PlainSpec]) -> None:
        self._processor_name, self._declared = processor_name, declared
        self._known: dict[str, int] = {}

    def ready(self, outputs: Iterable[Output | PlainOutput | Pin]) -> list[Action] | None:
        """Return outputs that can go as they are; None where one is no plain message, or its topic is not known yet."""
        known = self._known
        actions: list[Action] = []
        for output in outputs:
            if type(output) is not PlainOutput or known.get(output[0]) != output[2]:
                return None
            actions.append(output)
        return actions

    def message(self, output: PlainOutput) -> PlainOutput:
        """Return a plain message as it is sent. Raises OutputError where its topic is not declared: our own bug."""
        topic, _, qos, _ = output
        for spec in self._declared:
            if topic.startswith(spec.prefix):
                if len(self._known) >= PLAIN_TOPICS_MAX:
                    self._known.clear()
                self._known[topic] = spec.qos
                return output if qos == spec.qos else output._replace(qos=spec.qos)
        raise OutputError(f"{self._processor_name} emits {topic!r}, which it does not declare")


@lru_cache(maxsize=100)
def plain_topics(processor_name: str, declared: tuple[PlainSpec, ...]) -> PlainTopics:
    """Return the plain topics of a processor, which its machines share."""
    return PlainTopics(processor_name, declared)


def _checked(spec: OutputSpec, output: Output) -> tuple[Value, Quality, str | None]:
    """The value as it may be published: of the declared type, and never a number that is none."""
    _, value, quality, reason, *_ = output
    if value is None:
        return None, quality, reason
    allowed = PYTHON_TYPES[spec.datatype]
    if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
        raise OutputError(f"{spec.name} is declared {spec.datatype.name}, and a step returned {value!r:.80}")
    if isinstance(value, float) and not math.isfinite(value):
        return None, Quality.BAD, "the model has no finite answer"
    return value, quality, reason


def _is_near(old: Value, new: Value, deadband: float) -> bool:
    """Return True if the change is too small to be published."""
    if deadband and isinstance(old, (int, float)) and isinstance(new, (int, float)):
        return abs(new - old) < deadband
    return old == new
