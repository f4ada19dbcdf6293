"""Regimes and prepared features of a recording are, tick by tick, those that the stream computes one by one."""

from bisect import bisect_left
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cnctwin.training.anomaly.regimes import Held, Ticks, fitted_preparation, held_run, left_in, standardised, tailed_preparations
from tests.cnctwin.training.anomaly.cells import FEATURES, machine_log
from twin.anomaly.common_features import left_over
from twin.anomaly.preparation import STANDING, regime_name, smoothed_after, standardised_row, unsmoothed
from twin.runlog import RunLog

TICKS = Ticks(features=FEATURES, tick_ms=1000, gap_ms=600_000, tail_s=8.0, look_back_s=0.0)


def log_in_operations(seed: int) -> RunLog:
    """Two programs, three tools, two overrides, each told when it changes; it stands half a minute each quarter of an hour."""
    log = machine_log(3000.0, seed, sparse=True)
    generator = np.random.default_rng(seed)
    count = len(log)
    tool = np.where(generator.random(count) < 0.004, generator.integers(1, 4, count), np.nan)
    override = np.where(generator.random(count) < 0.003, generator.choice([100.0, 97.0, 60.0], count), np.nan)
    program = np.full(count, None, dtype=object)
    program[20], program[count // 2] = "O1001", "O2002"
    stands = (log.t_s % 900.0) < 30.0
    speed = np.where(stands, 0.0, log["spindle_rpm"])
    columns = {**log.columns, "spindle_rpm": speed, "tool_number": tool, "feed_override_pct": override}
    return replace(log, columns=columns, text={"program": program})


LOGS = {name: log_in_operations(seed) for seed, name in enumerate("abc")}
HELD = {name: held_run(log, TICKS) for name, log in LOGS.items()}


@cache
def said(name: str) -> tuple[tuple[list[float], list[object]], ...]:
    """When program, tool and override were said, and what."""
    log = LOGS[name]
    columns = (log.text["program"], log["tool_number"], log["feed_override_pct"])
    known = [[(t, x) for t, x in zip(log.t_s.tolist(), one.tolist(), strict=True) if x is not None and x == x] for one in columns]
    return tuple(([t for t, _ in one], [x for _, x in one]) for one in known)


def context_of(name: str, at_s: float) -> tuple[object, ...]:
    """Return what was last said before a tick."""
    return tuple(values[place - 1] if (place := bisect_left(times, at_s)) else None for times, values in said(name))


def test_the_regime_at_each_tick_is_that_of_what_was_last_said() -> None:
    preparation = fitted_preparation([HELD["a"]], TICKS)
    held = HELD["a"]
    assert len(set(held.names)) == len(held.names) > 5
    assert STANDING in held.names
    for place in range(0, len(held.at_ms), 7):
        row = np.nan_to_num(held.rows[place], nan=1e9).tolist()
        name = regime_name(preparation, row, context_of("a", held.at_ms[place] / 1000))
        assert held.names[held.codes[place]] == name


def test_prepared_rows_are_those_of_the_stream() -> None:
    preparation = fitted_preparation([HELD["a"]], TICKS)
    values, judged = standardised(preparation, HELD["a"])
    assert 100 < judged.sum() < len(judged)
    for place in np.flatnonzero(HELD["a"].quiet)[::5].tolist():
        one = standardised_row(preparation, HELD["a"].rows[place].tolist(), context_of("a", HELD["a"].at_ms[place] / 1000))
        assert one.values == tuple(values[place].tolist())
        assert (one.unknown is None) == judged[place]


def test_what_is_left_beside_the_peers_is_that_of_the_stream() -> None:
    preparations = {name: fitted_preparation([held], TICKS) for name, held in HELD.items()}
    left = left_in(preparations, HELD, TICKS)
    first, last = (edge(one.at_ms[place] for one in HELD.values()) for edge, place in ((min, 0), (max, -1)))
    smooth = {name: unsmoothed(preparation) for name, preparation in preparations.items()}
    found: dict[str, list[tuple[float, ...]]] = {name: [] for name in HELD}
    for tick, at_ms in enumerate(range(int(first), int(last) + 1, 1000)):
        is_judged = {}
        for name, held in HELD.items():
            place = int(np.searchsorted(held.at_ms, at_ms))
            if place == len(held.at_ms) or held.at_ms[place] != at_ms:
                continue
            now = standardised_row(preparations[name], np.nan_to_num(held.rows[place]).tolist(), told_at(held, name, place))
            quiet = bool(held.quiet[place])
            smooth[name] = smoothed_after(preparations[name], smooth[name], now, not quiet, tick, 1.0)
            is_judged[name] = quiet and now.unknown is None
        for name in [name for name, judged in is_judged.items() if judged]:
            found[name].append(left_over(smooth[name], [smooth[other] for other in HELD if other != name], tick, 1.0))
    for name, rows in found.items():
        assert np.allclose(np.array(rows), left[name], rtol=1e-9, atol=1e-9)
    tailed = tailed_preparations(preparations, [LOGS], TICKS)
    assert all(tail > 0.3 for tail in tailed["a"].up)


def told_at(held: Held, name: str, place: int) -> tuple[object, ...]:
    return context_of(name, held.at_ms[place] / 1000)


def test_a_spindle_that_never_turns_teaches_nothing() -> None:
    log = replace(LOGS["a"], columns={**LOGS["a"].columns, "spindle_rpm": np.zeros(len(LOGS["a"]))})
    with pytest.raises(ValueError, match="the spindle turns in none"):
        fitted_preparation([held_run(log, TICKS)], TICKS)
