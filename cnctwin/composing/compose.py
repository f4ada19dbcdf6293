"""Composes a case from a machine's history: finds its stretches and programs, gives them roles, writes them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

from cnctwin.composing.composed import Composed, ComposedRun, Role
from cnctwin.composing.executions import Execution, executions_of, pairs
from cnctwin.composing.history import AMBIENT, LOAD, RPM, TEMPERATURE, History, Span, history_of
from cnctwin.composing.observable import observability
from cnctwin.composing.roles import cut_at, divided
from cnctwin.composing.rows import EXECUTED, WORK, rows_of, thinned, unbroken, with_ambient
from cnctwin.composing.stretches import Stretch, stretches_of, turning_of, worth
from cnctwin.composing.written import CASE_FILE, MACHINE_FILE, RUNS, case_toml, complete_or_absent
from cnctwin.errors import UsageError
from cnctwin.files.program_folder import ProgramFolder
from cnctwin.memory.store.contract import Store
from processors.description import version_of
from twin.case import RunKind
from twin.machine import MachineFile, machine_from_toml
from twin.runlog import RunLog, write_run

STRETCHES_MAX: dict[Role, int] = {"fit": 4, "check": 2}
HEALTHY_MAX = 2
PROGRAMS_MAX, OF_ONE_PROGRAM_MAX = 12, 4
"""Executions of each role, and of one program among them: the latest."""
CUTS_MAX = 2
"""Programs without their text of which a pair that repeats is kept."""
ROWS_MIN = 10
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class _Piece:
    """A stretch of history that becomes a run."""

    span_ms: Span
    kind: RunKind
    role: Role
    what: str
    signals: tuple[str, ...]
    stem: str
    text: str | None = None
    execution: Execution | None = None
    healthy: bool = False


@dataclass(slots=True)
class _Folder:
    """The case as it grows: its runs with their logs, and what is to be said of it."""

    store: Store
    machine: MachineFile
    name: str
    folder: Path
    ambient_c: float | None
    runs: list[tuple[ComposedRun, RunLog]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    files: dict[Execution, ComposedRun] = field(default_factory=dict)


def compose(
    store: Store,
    machine: str,
    description: str,
    out: Path,
    *,
    span_ms: Span | None = None,
    healthy_ms: Span | None = None,
    programs: Path | None = None,
    ambient_c: float | None = None,
    progress: Progress = lambda _: None,
) -> Composed:
    """Write the case of a machine's history into the folder `out`, which appears when it is complete, and return it.

    description: the text of its machine.toml; span_ms: [from, to), else all that the store has of it
    healthy_ms: a stretch in which the twin was known to be right; programs: a folder with the NC files that it runs
    ambient_c: the surroundings, where no signal tells them

    The same history gives the same bytes. Raises UsageError where the history has nothing that could be compared, StoreError,
    and MachineError where the description is wrong.
    """
    described, texts = machine_from_toml(description, f"the description of {machine}"), ProgramFolder(programs)
    progress("looking the history over")
    history = history_of(store, machine, span_ms)
    if healthy_ms is not None and healthy_ms[0] < history.to_ms and history.from_ms < healthy_ms[1]:
        raise UsageError("the healthy period lies over the stretch that is composed; give two that do not")
    with complete_or_absent(out) as folder:
        case = _Folder(store, described, machine, folder, ambient_c)
        pieces = _pieces(case, history, texts)
        if healthy_ms is not None:
            pieces += _healthy(case, history_of(store, machine, healthy_ms))
        for number, piece in enumerate(pieces, start=1):
            progress(f"composing: run {number} of {len(pieces)}")
            _write(case, piece)
        if not case.runs:
            raise UsageError(f"{machine}: {_nothing(history, ambient_c)}")
        if not any(run.role == "fit" and not run.healthy for run, _ in case.runs):
            case.runs = [(replace(run, role="fit"), log) for run, log in case.runs]
        runs, name = tuple(run for run, _ in case.runs), _case_name(machine, history)
        effects = observability(described, case.runs)
        (folder / MACHINE_FILE).write_text(description, encoding="utf-8")
        (folder / CASE_FILE).write_text(case_toml(name, runs, case.notes, case.assumed), encoding="utf-8")
        return Composed(out, name, machine, version_of(description), runs, effects, tuple(case.notes))


def _case_name(machine: str, history: History) -> str:
    return f"{machine} {_day(history.from_ms)} to {_day(history.to_ms - 1)}"


def _day(t_ms: int) -> str:
    return datetime.fromtimestamp(t_ms / 1000, UTC).strftime("%Y-%m-%d")


def _moment(t_ms: int) -> str:
    return datetime.fromtimestamp(t_ms / 1000, UTC).strftime("%Y%m%dT%H%M%S")


def _stretch_kind(history: History, ambient_c: float | None) -> RunKind | None:
    """Return the kind of run that a stretch of the machine can be: with its heat, with its load alone, or none."""
    if history.has(RPM, LOAD, TEMPERATURE) and (ambient_c is not None or history.has(AMBIENT)):
        return RunKind.WARMUP
    return RunKind.AIR if history.has(RPM, LOAD) else None


def _told(history: History, kind: RunKind | None) -> list[Stretch]:
    """Return the stretches in which all was told that such a run needs."""
    needed = () if kind is None else (RPM, LOAD, TEMPERATURE) if kind is RunKind.WARMUP else (RPM, LOAD)
    known = [s for s in stretches_of(history) if needed and all(history.course(n).numbers(s.span_ms) for n in needed)]
    return [s for s in known if history.windows_told(s.span_ms) >= ROWS_MIN]


def _pieces(case: _Folder, history: History, texts: ProgramFolder) -> list[_Piece]:
    kind = _stretch_kind(history, case.ambient_c)
    stretches = _told(history, kind)
    executions = executions_of(history)
    division = divided(stretches, executions, turning_of(history))
    case.notes += [division.note] if division.note else []
    if kind is RunKind.WARMUP and not history.has(AMBIENT):
        case.notes.append(f"ambient_temp_c is not recorded: {case.ambient_c:g} °C throughout is an assumption")
        case.assumed.append(AMBIENT)
    found: list[_Piece] = []
    of_role: dict[Role, list[Stretch]] = {"fit": [], "check": []}
    for one in cut_at(stretches, division.at_ms):
        of_role["fit" if division.is_fitted(one.span_ms) else "check"].append(one)
    for role, some in of_role.items():
        kept = sorted(sorted(some, key=lambda s: worth(history, s.span_ms))[-STRETCHES_MAX[role] :], key=lambda s: s.from_ms)
        if len(kept) < len(some):
            case.notes.append(f"{role}: {len(kept)} of {len(some)} stretches are used, those in which the temperature did most")
        assert kind is not None or not kept
        found += [_Piece(s.span_ms, kind, role, s.what, WORK, s.what) for s in kept if kind is not None]
    for role in of_role:
        mine = [e for e in executions if division.is_fitted(e.span_ms) is (role == "fit")]
        found += _programs(case, mine, role, texts)
    return found


def _programs(case: _Folder, executions: Sequence[Execution], role: Role, texts: ProgramFolder) -> list[_Piece]:
    """Return the executions to be kept: of programs whose text is at hand, of others a pair that repeats."""
    by_name: dict[str, list[Execution]] = {}
    for one in executions:
        if one.completed and one.program:
            by_name.setdefault(one.program, []).append(one)
    kept: list[Execution] = []
    silent: list[str] = []
    cuts = 0
    for name, some in by_name.items():
        repeated = pairs(some)
        both = [e for one in reversed(repeated) for e in (repeated[one], one)]
        first = list(dict.fromkeys([*both, *reversed(some)]))
        if texts.text_of(name) is not None:
            kept += first[:OF_ONE_PROGRAM_MAX]
            continue
        silent.append(name)
        if both and cuts < CUTS_MAX:
            kept, cuts = [*kept, *both[:2]], cuts + 1
    if silent and role == "fit":
        case.notes.append(f"no NC text of {', '.join(sorted(silent)[:4])}: how long a program takes is not compared")
    pieces = []
    for one in sorted(sorted(kept, key=lambda e: e.from_ms)[-PROGRAMS_MAX:], key=lambda e: e.from_ms):
        text = texts.text_of(one.program)
        kind = RunKind.PROGRAM if text is not None else RunKind.CUT
        pieces.append(_Piece(one.span_ms, kind, role, f"program {one.program}", EXECUTED, "program", text, one))
    return pieces


def _healthy(case: _Folder, history: History) -> list[_Piece]:
    """Return the stretches of a healthy period that tell most."""
    kind = _stretch_kind(history, case.ambient_c)
    kept = sorted(_told(history, kind), key=lambda s: worth(history, s.span_ms))[-HEALTHY_MAX:]
    return [
        _Piece(s.span_ms, kind, "fit", f"{s.what} of the healthy period", WORK, "healthy", healthy=True)
        for s in sorted(kept, key=lambda s: s.from_ms)
        if kind is not None
    ]


def _write(case: _Folder, piece: _Piece) -> None:
    """Write a piece as a run; one that says nothing is left out."""
    log = rows_of(case.store, case.name, piece.span_ms, piece.signals)
    if piece.kind is RunKind.WARMUP:
        log = with_ambient(log, case.ambient_c)
        if not log.has("spindle_temp_c", "spindle_rpm", "spindle_load_pct", "ambient_temp_c"):
            return
    if len(log) < ROWS_MIN:
        return
    if piece.execution is None:
        log, period_s = thinned(unbroken(log))
        if period_s is not None:
            said = f"thinned to a row every {period_s:g} s: means of speed, load and feed, everything else as it was read there"
            case.notes += [said] if said not in case.notes else []
    file = f"{RUNS}/{piece.stem}-{_moment(piece.span_ms[0])}.parquet"
    write_run(log, case.folder / file)
    program = None
    if piece.text is not None:
        program = f"{file.removesuffix('.parquet')}.nc"
        (case.folder / program).write_text(piece.text, encoding="utf-8", newline="")
    earlier = (
        r.file for e, r in reversed(case.files.items()) if piece.execution and piece.execution.repeats(e) and r.role == piece.role
    )
    run = ComposedRun(
        file=file,
        kind=piece.kind,
        role=piece.role,
        what=piece.what,
        rows=len(log),
        lasted_s=round(float(log.t_s[-1] - log.t_s[0]), 3),
        from_ms=piece.span_ms[0],
        to_ms=piece.span_ms[1],
        program=program,
        repeats=next(earlier, None),
        healthy=piece.healthy,
    )
    if piece.execution is not None:
        case.files[piece.execution] = run
    case.runs.append((run, log))


def _nothing(history: History, ambient_c: float | None) -> str:
    """Say why a history gives no run at all."""
    absent = [s for s in (RPM, LOAD, TEMPERATURE) if not history.has(s)]
    absent += [] if ambient_c is not None or history.has(AMBIENT) else [AMBIENT]
    if absent:
        return f"no run can be composed: there is no {', '.join(absent)} in that stretch of its history"
    return "no run can be composed: that stretch of its history is too short; give a longer one"
