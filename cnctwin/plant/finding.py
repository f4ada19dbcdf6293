"""A finding of `cnctwin doctor`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at. note: it is advice, or worth knowing, and no fault."""

    good: bool
    text: str
    note: bool = False

    @property
    def mark(self) -> str:
        """The word in front of it: good, note or bad."""
        return "note" if self.good and self.note else "good" if self.good else "bad"
