"""Laws of the scores that compare a cut with the same cut of earlier parts, on a small machine."""

import json
from functools import cache
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from tests.twin.anomaly.parts import shop
from twin.anomaly.alarm import AlarmRule
from twin.anomaly.parts.following import told_after
from twin.anomaly.parts.judging import judged
from twin.anomaly.parts.learning import learned
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Own, begun
from twin.anomaly.parts.replay import Ablation, Line, Recorded, fit, replayed

PARTS = 80
STATE = TypeAdapter(Own)


@cache
def model() -> PartsModel:
    """A model of eighty healthy parts."""
    return fit([shop.recorded(PARTS, seed=1)])[0]


@cache
def rule() -> AlarmRule:
    """A threshold of twice the largest score in twenty other healthy parts."""
    scores = replayed([model()], [shop.recorded(20, seed=2)]).scores
    return AlarmRule(2.0 * float(np.nanmax(scores)), dwell_ticks=3)


def highest(one: Recorded, part: int, with_model: PartsModel | None = None) -> float:
    """The largest score within a part."""
    scores = replayed([with_model or model()], [one]).scores[:, 0]
    return float(np.nanmax(scores[part * shop.PART_TICKS : (part + 1) * shop.PART_TICKS]))


def test_healthy_parts_score_low() -> None:
    """Another week of the same parts stays near what training saw."""
    scores = replayed([model()], [shop.recorded(20, seed=15)]).scores[:, 0]
    assert np.nanquantile(scores, 0.9) < 1.0
    assert np.nanmax(scores) < rule().threshold


@pytest.mark.parametrize(
    ("change", "signal"),
    [
        ({"load": 1.5}, "spindle_load_pct"),
        ({"vibration": 2.5}, "vibration_rms_g"),
        ({"feed": 0.7}, "feed_mm_min"),
        ({"rpm": 0.9}, "spindle_rpm"),
    ],
)
def test_a_change_shows_in_the_signal_that_changed(change: dict[str, float], signal: str) -> None:
    """The reason names the signal, the program and the lines, and says about how large the change is."""
    out = replayed([model()], [shop.recorded(6, 3, shop.in_part(4, **change))], [rule()])
    assert len(out.whys) == 1
    tick, _, why = out.whys[0]
    assert 4 * shop.PART_TICKS <= tick < 5 * shop.PART_TICKS
    assert (why.signal, why.program) == (signal, "O1")
    assert why.lines is not None
    assert why.lines[0] <= 60
    assert (why.measured > why.expected) == (next(iter(change.values())) > 1.0)
    assert json.loads(why.in_json())["by"].endswith("parts")


def test_a_restart_anywhere_changes_nothing() -> None:
    """The state as JSON and back, at each tick, gives the same scores to the last bit."""
    one = shop.recorded(3, 4, shop.in_part(1, load=1.6))
    straight, restarted, restored = begun(model()), begun(model()), 0
    for told in one.told():
        assert told is not None
        scores = []
        for state in (straight, restarted):
            after = told_after(model(), state, told)
            now = judged(model(), after, ())
            scores.append((now, learned(model(), after, now, False)))
        assert scores[0] == scores[1]
        straight = scores[0][1][0]
        dumped = json.loads(json.dumps(STATE.dump_python(scores[1][1][0], mode="json")))
        restarted = STATE.validate_python(dumped)
        assert restarted == straight
        restored += 1
    assert restored == 3 * shop.PART_TICKS


def test_nothing_is_learned_from_a_part_that_alarmed() -> None:
    """A machine that has alarmed in five parts judges the sixth as before: what it knows of the sections is the same."""
    one = shop.recorded(8, 5, lambda part, row: {**row, "load": row["load"] * (1.6 if part >= 2 else 1.0)})
    out = replayed([model()], [one], [rule()])
    alarmed = out.is_alarm[:, 0].reshape(8, shop.PART_TICKS)
    assert not alarmed[:2].any()
    assert alarmed[3:].mean() > 0.9


def test_a_gradual_wear_is_followed() -> None:
    """A load that rises by a fifth of a per cent from part to part, as a tool wears, is no fault."""
    one = shop.recorded(30, 6, lambda part, row: {**row, "load": 3.0 + (row["load"] - 3.0) * 1.002**part})
    assert np.nanmax(replayed([model()], [one]).scores) < rule().threshold


def test_a_new_program_is_judged_from_its_second_part() -> None:
    """Nothing is known of it in its first part, and that is said; a change in the second is found."""
    first = replayed([model()], [shop.recorded(1, 7, program="O2")])
    assert np.isnan(first.scores).all()
    changed = shop.recorded(4, 7, shop.in_part(2, load=1.6), program="O2")
    assert highest(changed, 2) > rule().threshold
    assert highest(shop.recorded(4, 7, program="O2"), 2) < rule().threshold


def test_a_program_whose_first_part_was_the_odd_one_is_learned_all_the_same() -> None:
    """The second part alarms and is not learned; when the third shows the same, it is the first that was odd."""
    odd = shop.recorded(8, 7, shop.in_part(0, load=0.5, vibration=0.5), program="O2")
    alarmed = replayed([model()], [odd], [rule()]).is_alarm[:, 0].reshape(8, shop.PART_TICKS).any(axis=1)
    assert alarmed[1]
    assert not alarmed[6:].any()


def test_a_floor_that_shakes_is_no_fault() -> None:
    """The same energy on a machine that mills and on one that stands; on one alone it is a fault."""

    def shaken(part: int, row: shop.Row) -> shop.Row:
        return {**row, "vibration": (row["vibration"] ** 2 + 0.25**2) ** 0.5} if part == 3 else row

    models = fit([shop.recorded(PARTS, seed=seed) for seed in (1, 2, 3)])
    part = slice(3 * shop.PART_TICKS, 4 * shop.PART_TICKS)
    together = replayed(models, [shop.recorded(5, seed, shaken) for seed in (9, 10, 11)]).scores[part]
    alone = replayed(models, [shop.recorded(5, 9, shaken), *(shop.recorded(5, seed) for seed in (10, 11))]).scores[part]
    assert np.nanmax(alone[:, 0]) > 1.5 * np.nanmax(together)


def test_a_new_program_is_judged_in_its_first_part_by_the_twin() -> None:
    """A first part that takes half as much again as expected is found, one as expected is not."""

    def with_twin(one: Recorded) -> Recorded:
        lines = {}
        for place, (tool, rpm, load, feed, _) in enumerate(shop.OPERATIONS):
            for line in range(shop.LINES):
                cut = load * (1.0 + 0.1 * line) * 0.97
                lines[tool, 100 * place + 10 + 10 * line] = Line(cut, cut + 3.0, feed, rpm, 10.0 * cut, 7.0)
        nothing = Line(*(np.nan,) * 6)
        rows = [lines.get(key, nothing) for key in zip(one.tool.tolist(), one.line.tolist(), strict=True)]
        return Recorded(**{**{name: getattr(one, name) for name in Recorded.__dataclass_fields__}, "expected": np.array(rows)})

    (known,) = fit([with_twin(shop.recorded(PARTS, seed=1))])
    usual = highest(with_twin(shop.recorded(1, 8, program="O2")), 0, known)
    changed = highest(with_twin(shop.recorded(1, 8, shop.in_part(0, load=2.2), program="O2")), 0, known)
    assert changed > rule().threshold
    assert changed > 1.3 * usual
    blind = replayed([known], [with_twin(shop.recorded(1, 8, program="O2"))], None, Ablation(has_twin=False))
    assert np.isnan(blind.scores).all()


def test_what_peers_share_is_no_fault() -> None:
    """The same rise on all machines is a disturbance; on one of them it is a fault."""
    rise: Any = shop.in_part(3, load=1.4)
    cell = [shop.recorded(5, seed, rise) for seed in (9, 10, 11)]
    models = fit([shop.recorded(PARTS, seed=seed) for seed in (1, 2, 3)])
    part = slice(3 * shop.PART_TICKS, 4 * shop.PART_TICKS)
    together = replayed(models, cell).scores[part]
    assert np.nanmax(together) < rule().threshold
    alone = replayed(models, [cell[0], *(shop.recorded(5, seed) for seed in (10, 11))]).scores[part]
    assert np.nanmax(alone[:, 0]) > rule().threshold
    assert np.nanmax(alone[:, 1:]) < rule().threshold


def test_values_that_are_not_known_are_left_out() -> None:
    """A change of the load is found without vibration, and with holes in the load."""
    one = shop.recorded(6, 12, shop.in_part(4, load=1.6))
    values = one.values.copy()
    values[:, 3] = np.nan
    values[::3, 0] = np.nan
    holed = Recorded(**{**{name: getattr(one, name) for name in Recorded.__dataclass_fields__}, "values": values})
    assert highest(holed, 4) > rule().threshold


def test_an_operation_that_is_met_in_its_middle_teaches_no_sections() -> None:
    """A machine that is first seen in the middle of a new operation forms no course from the rest of it."""
    one = shop.recorded(2, 13, program="O3")
    state = begun(model())
    for tick, told in enumerate(one.told()):
        if tick >= 35 and told is not None:
            state = told_after(model(), state, told)
            state, _ = learned(model(), state, judged(model(), state, ()), False)
    assert "O3|T1|1" not in state.usual or state.usual["O3|T1|1"].parts == 1


def test_a_record_says_how_much_more_load_a_cut_took() -> None:
    """The frozen reference keeps a rise visible, also once the levels have followed it."""
    one = shop.recorded(12, 14, lambda part, row: {**row, "load": 3.0 + (row["load"] - 3.0) * 1.01**part})
    records = [record for _, record in replayed([model()], [one]).records if record.tool == 1]
    assert len(records) >= 10
    first, last = records[0].load_ratio, records[-1].load_ratio
    assert first is not None
    assert last is not None
    assert last / first == pytest.approx(1.01 ** (len(records) - 1), abs=0.05)
    assert {record.reference for record in records} == {"parts"}


def test_a_model_with_the_tails_of_other_scales_is_refused() -> None:
    with pytest.raises(ValueError, match="up has 16 tails for 4 signals, 20 are needed"):
        model().changed(up=(1.0,) * 16)


def test_a_recording_in_which_nothing_works_is_refused() -> None:
    """Training names the machine."""
    one = shop.recorded(2, 1)
    still = Recorded(**{**{n: getattr(one, n) for n in Recorded.__dataclass_fields__}, "values": np.zeros_like(one.values)})
    with pytest.raises(ValueError, match="mill: neither spindle nor feed"):
        fit([still])
