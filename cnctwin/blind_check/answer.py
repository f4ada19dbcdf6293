"""The answer to a question: the effects of its machine, their parameters, and their sizes over the floor."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cnctwin.blind_check.question import DrawnEffect, Sort, effect_on
from cnctwin.standins.reference_machine.effect import ActsAt


@dataclass(frozen=True, slots=True)
class Answered:
    """An effect. stated: its parameters under the catalogue's names; exact: those that mean there what they mean here."""

    effect: str
    on: str
    named: bool
    stated: Mapping[str, float]
    exact: tuple[str, ...]
    size_over_floor: Mapping[str, float]

    @property
    def acts_at(self) -> tuple[ActsAt, ...]:
        """The descriptions of it that are right, where no catalogue has it."""
        asked = DrawnEffect(self.effect, self.on, 0.0, self.named)
        return () if self.named else effect_on(asked).acts_at(self.on, self.stated)

    @property
    def size(self) -> float:
        """The size of its largest signal."""
        return max(self.size_over_floor.values(), default=0.0)


@dataclass(frozen=True, slots=True)
class Answer:
    """All effects of a machine.

    size_over_floor: of all of them together; controller: the structure of its controller where it is not the stated one, which
    is there beside what is asked
    """

    name: str
    sort: Sort
    effects: tuple[Answered, ...]
    size_over_floor: Mapping[str, float]
    controller: Answered | None = None

    @property
    def size(self) -> float:
        """The size of the smallest effect by its largest signal: it has to be seen for a right answer; 0 where healthy."""
        return min((effect.size for effect in self.effects), default=0.0)


def answers_json(answers: Sequence[Answer]) -> str:
    """All answers by the name of their case; the same text for the same answers."""
    table = {answer.name: {key: value for key, value in _plain(asdict(answer)).items() if key != "name"} for answer in answers}
    return json.dumps(table, indent=1, sort_keys=True) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return float(f"{value:.9g}") if isinstance(value, float) else value


def answers_from_json(text: str) -> tuple[Answer, ...]:
    """Back again."""
    return tuple(
        Answer(
            name,
            Sort(entry["sort"]),
            tuple(_answered(effect) for effect in entry["effects"]),
            entry["size_over_floor"],
            _answered(entry["controller"]) if entry["controller"] else None,
        )
        for name, entry in json.loads(text).items()
    )


def _answered(entry: Mapping[str, Any]) -> Answered:
    return Answered(**{**entry, "exact": tuple(entry["exact"])})
