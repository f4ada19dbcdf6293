"""Answers for the report, made by the closed form of a slot: what the optimiser would say of programs that have no corners.

    F = K_t a c √(1 + K_e²),  c = f / (N n),  V = π D n,  T = (C / V)^(1/taylor_n)

with the reconstruction's constants (K_t 1,230 N/mm², K_e 0.5, two flutes, 6 mm): 0.8 mm deep at 400 mm/min and 8,000 rev/min it
is 27.5 N, and 60 N is reached at 54.5 µm.
"""

import difflib
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from twin.optimisation.answer import (
    Binds,
    Bound,
    Cutting,
    FrontPoint,
    LineAnswer,
    Objective,
    Optimised,
    Parted,
    Resimulated,
    Search,
    Sensitivity,
    Totals,
)

LENGTHS_MM = (5.8, 40.0, 30.0, 15.7, 20.0, 12.0, 18.0, 9.4, 10.0, 4.8)
FIXED_S = 4.625
LABOUR, TOOL_PRICE, TOOL_CHANGE_S, TAYLOR_C, TAYLOR_N = 2.544 + 0.457, 28000.0, 60.0, 689.8, 0.25
LIMITS = {
    "feed range": "100 to 500 mm/min",
    "spindle speed range": "1000 to 8000 rev/min",
    "cutting force": "60 N",
    "spindle power": "11 kW",
    "chip thickness": "5 to 80 µm",
}


def cutting(feed: float, rpm: float, depth: float, length_mm: float) -> Cutting:
    """A slot of this depth."""
    chip = feed / (2.0 * rpm)
    force = 1230.0 * depth * chip * math.sqrt(1.25)
    torque = 1230.0 * depth * chip * 3.0 / 1000.0 * 2.0 / math.pi
    seconds = 60.0 * length_mm / feed
    speed = math.pi * 6.0 * rpm / 1000.0
    power = 0.25 + torque * rpm * 2.0 * math.pi / 60.0 / 1000.0 / 0.85
    return Cutting(feed, rpm, force, power, torque, chip, speed, seconds, seconds * rate(rpm))


def rate(rpm: float) -> float:
    """Return what a second costs at this speed."""
    life_s = 60.0 * (TAYLOR_C / (math.pi * 6.0 * rpm / 1000.0)) ** (1.0 / TAYLOR_N)
    return float(LABOUR + (TOOL_PRICE + TOOL_CHANGE_S * LABOUR) / life_s)


def totals(lines: tuple[LineAnswer, ...], which: Callable[[LineAnswer], Cutting], fixed_s: float) -> Totals:
    """Of all lines, and what is not on them at the speed of the first."""
    cuts = [which(line) for line in lines]
    cost = sum(c.cost or 0.0 for c in cuts) + fixed_s * rate(cuts[0].spindle_rpm)
    most = {f"{name}": max(getattr(c, name) for c in cuts) for name in ("force_n", "power_kw", "torque_nm", "chip_mm")}
    over = sum(c.force_n > 60.0 * (1.0 + 1e-9) for c in cuts)
    return Totals(sum(c.seconds for c in cuts) + fixed_s, cost, **most, over=over)


def line_answer(number: int, text: str, length: float, depth: float, after: tuple[float, float], binds: str) -> LineAnswer:
    """A line that was at 400 mm/min and 8,000 rev/min."""
    became = f"{text.replace(' F400.', '').replace(' S8000', '')} F{after[0]:.0f}. S{after[1]:.0f}" if binds else text
    was = cutting(400.0, 8000.0, depth, length)
    then = cutting(*after, depth, length) if binds else was
    return LineAnswer(number, text, became, length, length, 1, depth, was, then, binds, after if binds else None)


def answered(name: str, lines: tuple[LineAnswer, ...], fixed_s: float, objective: Objective = Objective.COST) -> Optimised:
    """The whole answer around these lines."""
    before, after = (totals(lines, which, fixed_s) for which in (lambda x: x.before, lambda x: x.after))
    assert before.cost is not None and after.cost is not None
    best = {Objective.TIME: after.seconds, Objective.COST: after.cost}.get(objective, after.seconds)
    head = ["%", "G90 G94 G17", "S8000 M3"]
    was, became = ([*head, *texts, "M30"] for texts in ([x.text_before for x in lines], [x.text_after for x in lines]))
    diff = "\n".join(difflib.unified_diff(was, became, name, f"{name}, optimised", lineterm="", n=1))
    saved = 100.0 * (1.0 - after.seconds / before.seconds)
    return Optimised(
        name=name,
        machine="vmc",
        objective=objective,
        currency="KRW",
        sentence=f"{name} takes {after.seconds:.2f} s instead of {before.seconds:.2f} s (−{saved:.1f} %), within all limits",
        limits=LIMITS,
        before=before,
        after=after,
        bound=Bound(best / 1.0004, 0.0004, True, "each line by its closed form; lines do not depend on each other"),
        lines=lines,
        front=(),
        sensitivity=SENSITIVITY,
        search=SEARCH,
        resimulated=Resimulated(
            (before.seconds + 0.02, after.seconds + 0.03), (27.4, 59.8), {"x": (0.0412, 0.0507), "y": (0.0398, 0.0491)}, ()
        ),
        notes=("speeds are rounded to 1 rev/min, feeds to 0.1 mm/min, downwards",),
        diff=diff,
        program="\n".join(became) + "\n",
    )


SENSITIVITY = Sensitivity(
    kept=0.953,
    asked=0.95,
    draws=2000,
    force_low_n=54.1,
    force_high_n=59.9,
    priced=0.95,
    price_pct=1.84,
    parts=(
        Parted("tool.tangential_coefficient_n_per_mm2", 0.03, 3.0),
        Parted("tool.radial_ratio", 0.05, 1.0),
        Parted("effects.edge_force.tangential_n_per_mm", 0.12, -0.4),
    ),
    source="identification of 2026-05, by [uncertainty] of machine.toml",
)
SEARCH = Search(
    "genetic algorithm, chip and speed, seeded with the closed form and the baseline",
    1,
    64,
    100,
    6400,
    tuple(float(76.4 * (1.0 + 0.6 * math.exp(-n / 9.0))) for n in range(100)),
    1.93,
)


@cache
def paper() -> Optimised:
    """The benchmark of ten lines: 29.48 s before, 24.51 s after; cost 120.1 KRW before, 76.4 KRW after."""
    at = np.cumsum((0.0, *LENGTHS_MM))
    lines = tuple(
        line_answer(n + 3, f"G1 X{at[n + 1]:.1f} Y{0.0:.1f} F400. S8000", length, 0.8, (500.0, 4584.0), Binds.FORCE)
        for n, length in enumerate(LENGTHS_MM)
    )
    return answered("benchmark.nc", lines, FIXED_S)


@cache
def mixed() -> Optimised:
    """A program of 37 lines of several depths: many things bind, and some lines are left alone."""
    chance = np.random.default_rng(4)
    reasons = [Binds.FORCE, Binds.FEED, Binds.TOOL_LIFE, Binds.SPEED_CHANGE, Binds.DYNAMICS, Binds.CHATTER, ""]
    lines = []
    for n in range(37):
        depth = float(chance.choice([0.3, 0.8, 1.4, 2.4]))
        feed, rpm = float(chance.uniform(200.0, 500.0)), float(chance.choice([3200.0, 4584.0, 6100.0]))
        feed = min(feed, 60.0 / (1230.0 * depth * math.sqrt(1.25)) * 2.0 * rpm)
        binds = str(chance.choice(reasons, p=[0.35, 0.2, 0.12, 0.1, 0.08, 0.05, 0.1]))
        text = f"N{10 * n} G{1 + n % 3} X{chance.uniform(0, 90):.3f} Y{chance.uniform(0, 90):.3f} F400. S8000"
        line = line_answer(2 * n + 6, text, float(chance.uniform(1.0, 60.0)), depth, (feed, rpm), binds)
        why = "feed is set by a macro variable" if n % 2 else "in a canned cycle, whose words are shared by all of its holes"
        lines.append(replace(line, left_alone="" if binds else why, times=1 + n % 2, bound=(500.0, 4583.9) if binds else None))
    found = answered("pocket.nc", tuple(lines), 31.0)
    over = found.after.over
    return replace(found, sentence=f"{found.sentence}" if not over else f"{over} lines that were left alone stay above the force")


@cache
def long(count: int = 5000) -> Optimised:
    """A program as long as those of free-form surfaces."""
    chance = np.random.default_rng(5)
    depth = 0.2 + 1.2 * np.abs(np.sin(np.arange(count) / 300.0)) + 0.1 * chance.random(count)
    lines = []
    for n in range(count):
        rpm = 4000.0 + 2000.0 * (n // 700 % 2)
        feed = min(500.0, 60.0 / (1230.0 * depth[n] * math.sqrt(1.25)) * 2.0 * rpm)
        text = f"N{n} G1 X{n * 0.013:.3f} Y{math.sin(n / 40.0):.4f} Z-{depth[n]:.4f} F400. S8000"
        lines.append(line_answer(n + 4, text, 0.4, float(depth[n]), (feed, rpm), Binds.FORCE if feed < 500.0 else Binds.FEED))
    return answered("surface.nc", tuple(lines), 12.0, Objective.TIME)


@cache
def pareto() -> Optimised:
    """Time and cost that disagree: forty programs of a front."""
    given = paper()
    points = [
        FrontPoint(s, 48.0 + 60.0 / (s - 10.0), 60.0, (112000.0 / s, min(112000.0 / s + 300.0, 8000.0)), chosen=k == 17)
        for k, s in enumerate(np.linspace(14.0, 24.0, 40).tolist())
    ]
    chosen = points[17]
    after = replace(given.after, seconds=chosen.seconds, cost=chosen.cost)
    history = tuple(float(1.0 - math.exp(-n / 20.0)) for n in range(100))
    search = replace(SEARCH, method="NSGA-II", history=history)
    bound = Bound(14.0 / 1.002, chosen.seconds / (14.0 / 1.002) - 1.0, False, "time of the fastest line by line")
    return replace(given, objective=Objective.PARETO, front=tuple(points), after=after, search=search, bound=bound)


@cache
def bare() -> Optimised:
    """No cost, no limits but the ranges, no sensitivity, not run again; half of the lines left alone."""
    given = mixed()

    def free(cut: Cutting) -> Cutting:
        return replace(cut, cost=None)

    lines = tuple(
        replace(line, before=free(line.before), after=free(line.after))
        if n % 2
        else replace(
            line, before=free(line.before), after=free(line.before), text_after=line.text_before, binds="", bound=None,
            left_alone="threading: its feed is its pitch",
        )
        for n, line in enumerate(given.lines)
    )  # fmt: skip
    before, after = replace(given.before, cost=None), replace(given.after, cost=None, over=0)
    limits = {"feed range": "100 to 500 mm/min", "spindle speed range": "1000 to 8000 rev/min"}
    bound = Bound(after.seconds * 0.93, 0.0753, False, "each line alone, changes of speed free")
    return replace(
        given, objective=Objective.TIME, currency="", limits=limits, before=before, after=after, bound=bound, lines=lines,
        sensitivity=None, resimulated=None, notes=(), search=replace(SEARCH, history=()),
    )  # fmt: skip


@cache
def nothing() -> Optimised:
    """A program that has no line that cuts or feeds."""
    given = bare()
    none = Totals(0.0, None, 0.0, 0.0, 0.0, 0.0, 0)
    return replace(given, lines=(), before=none, after=none, bound=Bound(0.0, 0.0, True, ""), limits={}, diff="", sentence="")


ANSWERS: dict[str, Callable[[], Optimised]] = {
    "paper": paper, "mixed": mixed, "long": long, "pareto": pareto, "bare": bare, "nothing": nothing,
}  # fmt: skip
