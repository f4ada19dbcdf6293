"""A composed case: its runs, what they can show, and what was decided on the way."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from twin.case import RunKind

Role = Literal["fit", "check"]


@dataclass(frozen=True, slots=True)
class ComposedRun:
    """One run of a composed case.

    file, program, repeats: as the case names them; what: in words, "warm-up", "production", "program O1701"
    from_ms, to_ms: the stretch of history that it is, ms since 1970; None where it came as a file
    """

    file: str
    kind: RunKind
    role: Role
    what: str
    rows: int
    lasted_s: float
    from_ms: int | None = None
    to_ms: int | None = None
    program: str | None = None
    repeats: str | None = None
    healthy: bool = False


@dataclass(frozen=True, slots=True)
class Observability:
    """An effect of the catalogue beside the runs that are fitted: missing is "" where they can show it, else what they lack."""

    effect: str
    on: tuple[str, ...]
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Composed:
    """A case that was written.

    folder: it holds case.toml; version: of the description that it is composed with; notes: a sentence each
    """

    folder: Path
    name: str
    machine: str
    version: str
    runs: tuple[ComposedRun, ...]
    effects: tuple[Observability, ...]
    notes: tuple[str, ...]

    @property
    def has_check(self) -> bool:
        """True where something is left to be judged on."""
        return any(run.role == "check" for run in self.runs)

    def as_json(self) -> dict[str, Any]:
        """Return it for a program to read."""
        runs = [asdict(run) | {"kind": run.kind.value} for run in self.runs]
        effects = [asdict(one) | {"on": list(one.on)} for one in self.effects]
        return {
            "case": str(self.folder),
            "name": self.name,
            "machine": self.machine,
            "version": self.version,
            "runs": runs,
            "effects": effects,
            "notes": list(self.notes),
        }
