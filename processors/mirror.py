"""The twin for clients that don't speak Sparkplug: each signal as a retained JSON object on `cnc/<machine>/<signal>`.

    {"value": 2400.0, "t": "2022-02-10T13:51:02.250Z", "unit": "rev/min", "quality": "good"}

quality is good, stale (its edge is offline; the value is the last one) or bad. A null stays null, with its reason. History is not
mirrored: a topic holds the present. Neither are arrays of more than 256 numbers, the raw blocks of sensors.

Where it is asked for, each machine is announced to Home Assistant too (home_assistant.py) with each birth, and withdrawn with the
first message after that is no longer asked for.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from types import MappingProxyType

from pydantic import Field
from pydantic_core import to_json

from processors.config import ProcessorConfig
from processors.contract import PlainOutput, PlainSpec, Processor, Sample, SampleKind
from processors.home_assistant import PREFIX as HOME_ASSISTANT
from processors.home_assistant import announcement, entities, topic_of
from processors.plain_topic import topic_level, topic_path
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import topics

PREFIX = topics.MIRROR
ARRAY_MAX = 256
DECIMAL_MIN, DECIMAL_END = 1e-4, 1e16
"""The numbers between which `repr` writes no exponent."""
_GOOD = Quality.GOOD
_QUALITY = {Quality.GOOD: "good", Quality.STALE: "stale", Quality.BAD: "bad"}
_new = tuple.__new__
_ENCODE = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode


class Config(ProcessorConfig):
    """The mirror's own topics are always published; these are about Home Assistant."""

    home_assistant: bool = Field(default=False, description="announce the machine to Home Assistant by MQTT discovery")
    home_assistant_entities_max: int = Field(default=100, ge=1, le=500, description="signals of one machine that are announced")


@dataclass(frozen=True, slots=True)
class State:
    """The entities of a machine announced to Home Assistant: platform and id of each entity; nothing where it is not asked
    for."""

    announced: tuple[str, ...] = ()


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[PlainOutput]]:
    """Publish what changed; at a death, what turned stale."""
    if sample.is_history or sample.kind in (SampleKind.TICK, SampleKind.HOLE):
        return state, ()
    outputs = _changed(sample)
    if not config.home_assistant:
        if not state.announced:
            return state, outputs
        return State(), [*outputs, PlainOutput(topic_of(sample.machine), b"")]
    if sample.kind is not SampleKind.BIRTH:
        return state, outputs
    announced, output = _announced(config, state, sample)
    return announced, [*outputs, output]


def _announced(config: Config, state: State, sample: Sample) -> tuple[State, PlainOutput]:
    """Announce what is known of a machine, and withdraw what of it is not known any more."""
    every = entities(sample.row)
    shown = every[: config.home_assistant_entities_max]
    components = tuple(sorted(one.component for one in shown))
    removed = sorted(set(state.announced).difference(components))
    payload = announcement(sample.machine, shown, len(every) - len(shown), removed)
    return State(components), PlainOutput(topic_of(sample.machine), payload)


def _changed(sample: Sample) -> list[PlainOutput]:
    row, names = sample.row, sample.changed
    readings = [row[name] for name in names]
    payloads = _numbers(readings)
    if payloads is None:
        readings = [one for one in readings if not _is_long(one.value)]
        names = tuple([one.name for one in readings])
        texts = _texts([one.value for one in readings if type(one.value) is float])
        payloads = [mirrored(one, texts) for one in readings]
    topics_of = _topics(sample.machine, names)
    return [_new(PlainOutput, (topic, payload, 0, True)) for topic, payload in zip(topics_of, payloads, strict=True)]


def _numbers(readings: Sequence[Reading]) -> list[bytes] | None:
    """Return good numbers of one moment as JSON, as `mirrored` writes each, in a third of the time; None for anything else."""
    if not readings:
        return None
    _, values, stamps, qualities, units, reasons, _ = zip(*readings, strict=True)
    count = len(readings)
    if not count == stamps.count(stamps[0]) == qualities.count(_GOOD) == reasons.count(None) == [*map(type, values)].count(float):
        return None
    texts = to_json(values)[1:-1].decode()
    if "e" in texts or "n" in texts or "N" in texts or "0.0000" in texts:  # it may be written in another way than by `repr`
        return None
    stamp = f',"t":{_iso(stamps[0])}'
    pairs = zip(texts.split(","), _tails(units), strict=True)
    return [f'{{"value":{text}{stamp}{tail}'.encode("utf-8", "replace") for text, tail in pairs]


def _is_long(value: object) -> bool:
    """A raw block of a sensor: thousands of numbers as text, twice a second, are nothing for a topic that shows the present."""
    return isinstance(value, tuple) and len(value) > ARRAY_MAX


def _texts(numbers: list[float]) -> dict[float, str]:
    """Return numbers as `repr` writes them, all at once: that takes a third of the time. Those with an exponent are left out."""
    plain = [number for number in numbers if DECIMAL_MIN <= abs(number) < DECIMAL_END]
    return dict(zip(plain, to_json(plain)[1:-1].decode().split(","), strict=True)) if plain else {}


def mirrored(reading: Reading, texts: Mapping[float, str] = MappingProxyType({})) -> bytes:
    """One reading as JSON that any parser takes; what JSON cannot say is null with a reason. `texts` has numbers as JSON.

    >>> mirrored(Reading("spindle_rpm", 2400.0, 1644501062250, Quality.GOOD, "rev/min", None, False)).decode()
    '{"value":2400.0,"t":"2022-02-10T13:51:02.250Z","unit":"rev/min","quality":"good"}'
    """
    _, value, timestamp_ms, quality, unit, reason, _ = reading
    if type(value) is float and -math.inf < value < math.inf:  # what nearly every reading is
        text = texts.get(value) or repr(value)  # which is JSON
    else:
        text, quality, reason = _encoded(value, quality, reason)
    why = f',"reason":{_ENCODE(reason)}}}' if reason else "}"
    return f'{{"value":{text},"t":{_iso(timestamp_ms)}{_unit_and_quality(unit, quality)}{why}'.encode("utf-8", "replace")


def _encoded(value: object, quality: Quality, reason: str | None) -> tuple[str, Quality, str | None]:
    """Return any value as JSON, with its quality and reason; what JSON cannot say is null."""
    if isinstance(value, float):
        if math.isfinite(value):
            return repr(value), quality, reason
        return "null", Quality.BAD, f"not a finite number: {value}"
    if value is None:
        return "null", quality, reason
    if not isinstance(value, (str, int, tuple)):
        return "null", quality, f"a {type(value).__name__} has no plain form; read it by Sparkplug"
    try:
        return _ENCODE(value), quality, reason
    except ValueError:
        return "null", Quality.BAD, "an array with a number that is not finite"


@lru_cache(maxsize=1000)
def _unit_and_quality(unit: str | None, quality: Quality) -> str:
    return f',"unit":{_ENCODE(unit)},"quality":"{_QUALITY.get(quality, "bad")}"'


@lru_cache(maxsize=1000)
def _tails(units: tuple[str | None, ...]) -> tuple[str, ...]:
    """Return what ends the JSON of each of several good readings."""
    return tuple([f"{_unit_and_quality(unit, _GOOD)}}}" for unit in units])


@lru_cache(maxsize=1000)
def _iso(timestamp_ms: int) -> str:
    """The time in ISO 8601, UTC, as JSON; null where no calendar reaches it. The signals of a message often share theirs."""
    try:
        stamp = datetime.fromtimestamp(timestamp_ms / 1000, UTC).isoformat(timespec="milliseconds")
    except (OverflowError, ValueError, OSError):
        return "null"
    return f'"{stamp.removesuffix("+00:00")}Z"'


@lru_cache(maxsize=20_000)
def _topics(machine: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the topics of a message. The messages of a machine mostly bring the same signals."""
    return tuple([f"{PREFIX}{topic_level(machine)}/{_path(name)}" for name in names])


_path = lru_cache(maxsize=10_000)(topic_path)
"""The machines share their signals, so that these are remembered apart."""


PROCESSOR = Processor(
    name="mirror",
    version=2,
    inputs=None,
    outputs=(),
    plain=(
        PlainSpec(PREFIX, "the last value of each signal of each machine"),
        PlainSpec(HOME_ASSISTANT, "what Home Assistant has to know of each machine, where it is asked for", qos=1),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
