"""The fold of a machine's challenger: the samples of the live fold again, with another description and a state of its own.

Of its outputs those that are declared `of_challenger` are published, as `twin/challenger/…`. What the challengers of other
processors say stands in its rows in the place of what their live folds say. Nothing that it does touches the live fold.
"""

from collections import ChainMap
from collections.abc import Collection, Mapping, MutableMapping, Sequence
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from processors.actions import Action, DeadLetter, Publish
from processors.contract import Output, Outputs, OutputSpec
from processors.description import Given
from processors.discovery import AnyProcessor
from processors.running.counts import Counts
from processors.running.dead_letter import dead_letter
from processors.running.emission import Emission
from processors.sample import Sample, SampleKind
from sparkplug.metric import Reading
from twin.vocabulary.twin_signals import challenger_name, live_name

Row = MutableMapping[str, Reading]
_DATA = SampleKind.DATA


@lru_cache(maxsize=100)
def challenger_specs(outputs: tuple[OutputSpec, ...]) -> tuple[OutputSpec, ...]:
    """Return the declared outputs of a challenger, under its names."""
    return tuple(
        replace(spec, name=challenger_name(spec.name), meaning=f"by the challenger: {spec.meaning}", is_alarm=False)
        for spec in outputs
        if spec.of_challenger
    )


def said_by_challengers(readings: Sequence[Reading], inputs: Collection[str]) -> dict[str, Reading]:
    """Return what challengers say in a message, by the names of the live twin's signals that are read."""
    named = ((live_name(one.name), one) for one in readings)
    return {name: one._replace(name=name) for name, one in named if name is not None and name in inputs}


class Challenger:
    """See the module. `row` is the machine's, `others` what the challengers of other processors say; a lane keeps both up."""

    __slots__ = ("_counts", "_given", "_names", "_others", "_processor", "_view", "emission", "state", "version")

    def __init__(self, processor: AnyProcessor, given: Given, state: Any, rows: tuple[Row, Row], counts: Counts) -> None:
        """`rows`: the machine's, and what other challengers say."""
        (self.version, self._given), self.state = given, state
        self.emission = Emission(processor.name, challenger_specs(processor.outputs))
        row, self._others = rows
        self._view: Mapping[str, Reading] = MappingProxyType(ChainMap(self._others, row))
        self._processor, self._counts = processor, counts
        self._names = {spec.name: challenger_name(spec.name) for spec in processor.outputs if spec.of_challenger}

    def describe(self, given: Given) -> None:
        """Go on with what the same version makes of the configuration, its programs planned by now."""
        self.version, self._given = given

    def take(self, sample: Sample, at_ms: int) -> list[Action]:
        """Fold a sample of the live fold, less what other live folds say in it where their challengers say it too."""
        if sample.kind is _DATA and self._others and not self._others.keys().isdisjoint(sample.changed):
            changed = tuple(name for name in sample.changed if name not in self._others)
            if not changed:
                return []
            sample = sample._replace(changed=changed)
        return self._fold(sample._replace(row=self._view), at_ms)

    def hear(self, machine: str, names: tuple[str, ...], at_ms: int) -> list[Action]:
        """Fold what other challengers have just said; it stands in the rows by now."""
        return self._fold(Sample(machine, _DATA, at_ms / 1000, self._view, names), at_ms)

    def begin(self, machine: str, at_ms: int) -> list[Action]:
        """Begin with a machine that is online, as after a restart: with a birth of all that is known of it."""
        return self._fold(Sample(machine, SampleKind.BIRTH, at_ms / 1000, self._view, tuple(self._view)), at_ms)

    def _fold(self, sample: Sample, at_ms: int) -> list[Action]:
        try:
            state, outputs = self._processor.step(self._given, self.state, sample)
            changes = self.emission.news(self._published(outputs), at_ms)
        except Exception as error:  # the live fold goes on
            self._counts.dead_letters += 1
            return [DeadLetter(sample.machine, dead_letter(self._processor.name, sample, error))]
        self.state = state
        if not changes:
            return []
        self.emission.published(changes)
        return [Publish(sample.machine, tuple(changes))]

    def _published(self, outputs: Outputs) -> list[Output]:
        names = self._names
        return [one._replace(name=names[one.name]) for one in outputs if type(one) is Output and one.name in names]
