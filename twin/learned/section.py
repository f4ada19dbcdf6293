"""[[effects]] with `effect = "learned"`: a learned term in machine.toml, as it stands in diagnosis.json (formats, section 6).

A term describes what recordings show; beside its table, an entry keeps what the diagnosis said of it.
"""

from typing import TYPE_CHECKING, Literal, Self

from pydantic import BaseModel, ConfigDict, model_validator

from twin.errors import EffectError
from twin.learned.sites import UNITS, unit_at
from twin.learned.table import arguments_of, checked_rows, grid_of, is_recording
from twin.learned.words import LearnedSite, word_of

if TYPE_CHECKING:
    from twin.learned.term import Term

LEARNED = "learned"
"""The name under which learned terms stand among the effects of a file."""


class Likeness(BaseModel):
    """A catalogue effect that is near a learned term, and why it is not its name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    effect: str
    on: str = ""
    why_not: str = ""


class LearnedSection(BaseModel):
    """One learned term. table: argument columns, then value and, where it is known, low and high."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    effect: Literal["learned"] = "learned"
    site: LearnedSite
    on: str = ""
    unit: str = ""
    depends_on: tuple[str, ...] = ()
    repeats: bool | None = None
    closure: float | None = None
    closure_low: float | None = None
    closure_high: float | None = None
    table: dict[str, tuple[float, ...] | tuple[str, ...]]
    looks_like: tuple[Likeness, ...] = ()
    sentence: str = ""

    @model_validator(mode="after")
    def _is_a_term(self) -> Self:
        try:
            arguments = arguments_of(self.table)
            checked_rows(self.table)
            if not self.is_recording:
                grid_of(self.table)
        except EffectError as error:
            raise ValueError(f"the learned term at {self}: {error}") from None
        if self.depends_on and set(self.depends_on) != {word_of(column) for column in arguments}:
            said, over = ", ".join(self.depends_on), ", ".join(arguments)
            raise ValueError(f"the learned term at {self} says that it depends on {said}; its table is over {over}")
        right = (unit_at(self.site, self.on),) if self.site is LearnedSite.CUT_FORCE else UNITS[self.site]
        if self.unit and self.unit not in right:
            raise ValueError(f"the learned term at {self} is in {self.unit}; a term there is in {' or '.join(right)}")
        return self

    def __str__(self) -> str:
        return f"{self.site.value} on {self.on}" if self.on else self.site.value

    @property
    def arguments(self) -> tuple[str, ...]:
        """The columns that it depends on."""
        return arguments_of(self.table)

    @property
    def is_recording(self) -> bool:
        """True where it describes the time of single runs; no other run can be simulated with it."""
        return is_recording(self.table)

    @property
    def term(self) -> "Term":
        """The term itself. Raises EffectError where it describes recordings only."""
        from twin.learned.term import term_of  # noqa: PLC0415 - a machine is read without numpy

        if self.is_recording:
            raise EffectError(f"the learned term at {self} is over the time of a recording; it says nothing of other runs")
        return term_of(self.site, self.on, self.table)

    @classmethod
    def of(cls, term: "Term", *, repeats: bool | None = None, sentence: str = "") -> Self:
        """Return the entry of a term."""
        own = {"site": term.site, "on": term.on, "unit": unit_at(term.site, term.on), "depends_on": term.depends_on}
        return cls.model_validate(own | {"repeats": repeats, "table": term.table(), "sentence": sentence})
