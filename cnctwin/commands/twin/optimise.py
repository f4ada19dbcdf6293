"""`cnctwin optimise`: feed and spindle speed for each line of a part program."""

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from cnctwin.commands.options import AsJson, Dask, MachineDescription, Seed, StockBox
from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_encoded
from cnctwin.processes.extras import needed_by
from cnctwin.processes.stopping import stopped_by_signals

if TYPE_CHECKING:
    import twin.optimisation.question as asked
    from cnctwin.batch.optimisation import Files
    from twin.machine import MachineFile
    from twin.optimisation.answer import Objective, Optimised, Sensitivity, SpeedChanges
    from twin.programs import Settings

BINDS_SHOWN, FRONT_SHOWN = 6, 20


def optimise(
    program: Annotated[Path, typer.Argument(help="The part program")],
    machine: MachineDescription,
    out: Annotated[Path, typer.Option(help="Write the program there; its report beside it as .html, everything as .json")],
    objective: Annotated[str, typer.Option(help="time, cost or pareto")] = "time",
    force_limit_n: Annotated[float | None, typer.Option(help="Greatest cutting force, N; else that of \\[limits]")] = None,
    feed_range: Annotated[str | None, typer.Option(help="LOW:HIGH, mm/min; else that of \\[limits]")] = None,
    speed_range: Annotated[str | None, typer.Option(help="LOW:HIGH, rev/min; else that of \\[limits]")] = None,
    probability: Annotated[
        float | None, typer.Option(help="Keep the force limit with this probability, as 0.95; else with the constants as stated")
    ] = None,
    speed_changes: Annotated[
        str, typer.Option(help="Where the spindle may change its speed: anywhere, in_air (never in the material) or per_tool")
    ] = "anywhere",
    pick: Annotated[int | None, typer.Option(help="pareto: which program of the front, from 0; else its knee", min=0)] = None,
    leave: Annotated[list[int] | None, typer.Option(help="Leave this line alone (from 1); may be given again")] = None,
    stock: StockBox = None,
    engagement: Annotated[Path | None, typer.Option(help="Run log of this program: take what it cuts, not \\[stock]")] = None,
    seed: Seed = 1,
    evolutions: Annotated[int, typer.Option(help="Evolutions of each island", min=0)] = 60,
    population: Annotated[int, typer.Option(help="Programs in each island, an even number", min=4)] = 64,
    islands: Annotated[int, typer.Option(help="Populations beside each other", min=1)] = 2,
    workers: Annotated[int, typer.Option(help="Processes for the islands", min=1)] = 1,
    dask: Dask = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Do not go on with a search that was stopped")] = False,
    no_resimulation: Annotated[
        bool, typer.Option("--no-resimulation", help="Do not run both programs on the whole twin")
    ] = False,
    paper: Annotated[bool, typer.Option("--paper", help="Show the reference paper's own search beside it")] = False,
    as_json: AsJson = False,
) -> None:
    """Find feed and spindle speed for each line, by time or cost, within the limits. Exit code 1: limits that cannot be kept."""
    with needed_by("the optimiser", "twin"):
        import twin.optimisation.question as asked
        from cnctwin.batch.optimisation import Files, left_alone
        from cnctwin.batch.stock import with_stock
        from cnctwin.files.called_programs import speaking
        from twin.machine import read_machine
        from twin.machine_toml import machine_to_toml
        from twin.optimisation.allowed import check_tools
    described = read_machine(machine)
    check_tools(described)
    described = _with_ranges(with_stock(described, stock), feed_range, speed_range)
    text, encoding = read_encoded(program)
    described = speaking(described, program, text)
    question = asked.Question(
        program_text=text,
        machine_toml=machine_to_toml(described),
        name=program.name,
        objective=_objective(objective),
        force_limit_n=force_limit_n,
        probability=probability,
        seed=seed,
        evolutions=evolutions,
        population=population,
        islands=islands,
        planned=_planned(engagement, text, described.settings),
        left_alone=left_alone(leave or ()),
        pick=pick,
        speed_changes=_speed_changes(speed_changes),
    )
    _check_out(out, program, machine)
    files = Files.beside(out, encoding)
    how = Run(out, files, workers, dask, fresh=fresh, resimulate=not no_resimulation, paper=paper, as_json=as_json)
    raise typer.Exit(_run(question, how))


def _check_out(out: Path, *inputs: Path) -> None:
    """Raises UsageError where the answer cannot go there, before anything is worked out."""
    if not out.name or out.is_dir():
        raise UsageError(f"{out}: is a folder; name the file of the program, as {out / 'optimised.nc'}")
    if out.suffix in (".json", ".html", ".toml") or out.resolve() in {path.resolve() for path in inputs}:
        raise UsageError(f"{out}: write the program under another name, as optimised.nc; its .json and .html go beside it")
    if not out.parent.is_dir():
        raise UsageError(f"{out.parent}: there is no such folder")


@dataclass(frozen=True, slots=True)
class Run:
    """The options that are not part of the question: how it is worked out and shown."""

    out: Path
    files: "Files"
    workers: int
    dask: str | None
    fresh: bool
    resimulate: bool
    paper: bool
    as_json: bool


def _run(question: "asked.Question", how: Run) -> int:
    from cnctwin.batch.optimisation import run
    from cnctwin.jobs.dask_cluster import DaskCluster
    from cnctwin.jobs.spread import spread_over
    from twin.errors import LimitsError
    from twin.optimisation.optimise import Stopped
    from twin.optimisation.paper import paper_search

    files, kept = how.files, how.out.with_suffix(".checkpoint.json")
    if how.fresh:
        kept.unlink(missing_ok=True)
    cluster = DaskCluster.from_text(how.dask) if how.dask is not None else None
    try:
        with stopped_by_signals() as stop, spread_over(how.workers, cluster) as spread, _progress() as progress:
            found = run(
                question, files, progress=progress, spread=spread, checkpoint=kept, stop=stop.is_set, resimulate=how.resimulate
            )
    except Stopped:
        print(f"cnctwin: stopped; the same command goes on where it was ({kept})", file=sys.stderr)
        return 1
    except LimitsError as error:
        print(f"cnctwin: {question.name}: {error}", file=sys.stderr)
        return 1
    code = 1 if found.after.over else 0
    beside = paper_search(question, time.perf_counter) if how.paper else None
    if how.as_json:
        sys.stdout.write(json.dumps(found.as_json() | {"out": str(how.out)}) + "\n")
        return code
    console = Console(width=None if sys.stdout.isatty() else 120)
    _show(found, console)
    if beside is not None:
        value = f"{beside.seconds:.2f} s" if beside.objective == "time" else f"{beside.cost:.2f} {found.currency}"
        line = (
            f"the reference paper's own search (10 evolutions of 64, random start, penalty): {value}, "
            f"{100 * beside.distance:.1f} % above the bound, greatest force {beside.force_n:.1f} N, "
            f"{beside.evaluations} evaluations in {beside.took_s:.2f} s"
        )
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(f"{files.program}, {files.report}, {files.answer}", markup=False, highlight=False, soft_wrap=True)
    return code


def _with_ranges(machine: "MachineFile", feed: str | None, speed: str | None) -> "MachineFile":
    """The machine with other ranges of feed and speed. Raises UsageError."""
    if feed is None and speed is None:
        return machine
    from twin.machine import Limits

    given = {
        name: _pair(option, text)
        for name, option, text in (("feed_mm_min", "--feed-range", feed), ("spindle_rpm", "--speed-range", speed))
        if text is not None
    }
    stated = machine.limits.model_dump() if machine.limits is not None else {}
    if missing := {"feed_mm_min", "spindle_rpm"} - {**stated, **given}.keys():
        raise UsageError(f"no [limits] in the machine: --{'feed' if 'feed_mm_min' in missing else 'speed'}-range is needed too")
    return machine.model_copy(update={"limits": Limits.model_validate(stated | given)})


def _pair(option: str, text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    try:
        pair = float(low), float(high)
    except ValueError:
        pair = 0.0, 0.0
    if not colon or not 0.0 < pair[0] <= pair[1] < float("inf"):
        raise UsageError(f"{option} {text}: is no range; write it as 100:3000")
    return pair


def _objective(text: str) -> "Objective":
    from twin.optimisation.answer import Objective

    try:
        return Objective(text)
    except ValueError:
        raise UsageError(f"--objective {text}: is not known; it is time, cost or pareto") from None


def _speed_changes(text: str) -> "SpeedChanges":
    from twin.optimisation.answer import SpeedChanges

    try:
        return SpeedChanges(text)
    except ValueError:
        raise UsageError(f"--speed-changes {text}: is not known; it is anywhere, in_air or per_tool") from None


def _planned(run: Path | None, text: str, settings: "Settings") -> dict[int, list[list[float]]] | None:
    if run is None:
        return None
    from twin.optimisation.planned import planned_cuts
    from twin.runlog import read_run

    found = planned_cuts(read_run(run), text, settings)
    if not found:
        raise UsageError(
            f"{run}: no line of it cuts; axial_depth_mm is 0 or missing all along (simulate needs [tool] and [stock])"
        )
    return found


@contextmanager
def _progress() -> Iterator[Callable[[float, str], None]]:
    """A bar on stderr, where that is a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal or os.environ.get("TERM") == "dumb":
        yield lambda _part, _what: None
        return
    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("optimising", total=1.0)
        yield lambda part, what: bar.update(task, completed=part, description=what)


def _show(found: "Optimised", console: Console) -> None:
    """Before, after, distance, what limits it, and how sure it is."""
    console.print(f"{found.name}: {found.sentence}", style="bold", markup=False, highlight=False, soft_wrap=True)
    table = Table(title_justify="left")
    for column in ("", "before", "after", "unit"):
        table.add_column(column, justify="right" if column in ("before", "after") else "left")
    before, after = found.before, found.after
    table.add_row("time", f"{before.seconds:.2f}", f"{after.seconds:.2f}", "s")
    if before.cost is not None and after.cost is not None:
        table.add_row("cost", f"{before.cost:.2f}", f"{after.cost:.2f}", found.currency)
    table.add_row("greatest resultant force", f"{before.force_n:.1f}", f"{after.force_n:.1f}", "N")
    table.add_row("greatest power", f"{before.power_kw:.3g}", f"{after.power_kw:.3g}", "kW")
    table.add_row("greatest torque", f"{before.torque_nm:.3g}", f"{after.torque_nm:.3g}", "N·m")
    table.add_row("greatest chip", f"{1000 * before.chip_mm:.1f}", f"{1000 * after.chip_mm:.1f}", "µm")
    table.add_row("lines above a limit", str(before.over), str(after.over), "")
    console.print(table)
    unit = "s" if found.objective == "time" else found.currency
    console.print(f"bound: {found.bound.value:.2f} {unit} ({found.bound.how})", markup=False, highlight=False, soft_wrap=True)
    seconds: dict[str, float] = {}
    for line in found.lines:
        binds = line.binds or ("" if line.left_alone else "no limit")
        seconds[binds] = seconds.get(binds, 0.0) + line.after.seconds
    if sum(seconds.values()) > 0.0:
        console.print(_what_limits(seconds), markup=False, highlight=False, soft_wrap=True)
    if found.sensitivity is not None:
        console.print(_how_surely(found.sensitivity, found.objective), markup=False, highlight=False, soft_wrap=True)
    if len(found.front) > 1:
        console.print(_front_table(found))
    for note in found.notes:
        console.print(f"note: {note}", markup=False, highlight=False, soft_wrap=True)


def _how_surely(known: "Sensitivity", objective: str) -> str:
    """Return how surely the force limit is kept, where that is from, and the price of more."""
    said = (
        f"the force limit is kept with a probability of {100 * known.kept:.0f} % (greatest force {known.force_low_n:.1f} to "
        f"{known.force_high_n:.1f} N, 90 %; {known.source})"
    )
    surely = f"with {100 * known.priced:g} %"
    if not math.isfinite(known.price_pct):
        return f"{said}; no program is known that keeps it {surely}"
    how_much = "no" if known.price_pct < 0.05 else f"{known.price_pct:+.1f} %"
    costs = "costs" if known.asked is not None else "would cost"
    return f"{said}; keeping it {surely} {costs} {how_much} {'time' if objective == 'time' else 'cost'}"


def _what_limits(seconds: dict[str, float]) -> str:
    """Return what limits it by its part of the time, from the time in s by what binds; "" = the time in lines left alone.

    >>> _what_limits({"": 6.7, "cutting force": 2.3, "feed range": 1.0})
    '67 % of the time is in lines left alone; what limits the others: cutting force 23 %, feed range 10 %'
    """
    total = sum(seconds.values())
    alone = seconds.get("", 0.0)
    most = sorted(((spent, binds) for binds, spent in seconds.items() if binds), reverse=True)[:BINDS_SHOWN]
    what = ", ".join(f"{binds} {100 * spent / total:.0f} %" for spent, binds in most)
    if not alone:
        return f"what limits it, by time: {what}"
    told = f"{100 * alone / total:.0f} % of the time is in lines left alone"
    return f"{told}; what limits the others: {what}" if what else told


def _front_table(found: "Optimised") -> Table:
    table = Table(title=f"{len(found.front)} programs of the front; --pick writes another one", title_justify="left")
    for column in ("", "time, s", f"cost, {found.currency}", "force, N", "speed, rev/min"):
        table.add_column(column, justify="right")
    step = -(-len(found.front) // FRONT_SHOWN)
    for number, point in enumerate(found.front):
        if number % step and not point.chosen and number != len(found.front) - 1:
            continue
        speed = " to ".join(dict.fromkeys(f"{v:.0f}" for v in point.spindle_rpm))
        mark = f"{number} *" if point.chosen else str(number)
        table.add_row(mark, f"{point.seconds:.2f}", f"{point.cost:.2f}", f"{point.force_n:.1f}", speed)
    return table
