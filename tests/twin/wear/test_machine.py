"""The wear of a machine's tools over many parts."""

import json
from statistics import fmean

import pytest
from pydantic import TypeAdapter

from tests.twin.wear.made_parts import END, LENGTHS, TERMS, Made, judged, made
from twin.wear.cut import Cut
from twin.wear.machine import TOOLS_MAX, Wear, cut_added, wear_of
from twin.wear.status import status_of

EVEN = Made(450)


def test_replacements_are_found_within_two_parts() -> None:
    true_at = {tool: [] for tool in LENGTHS}  # type: dict[int, list[int]]
    before: dict[int, tuple[int, float]] = {}
    for number, (_, truth) in enumerate(made(EVEN)):
        for tool, (life, _) in truth.items():
            if before and life > before[tool][0]:
                true_at[tool].append(number)
        before = truth
    wear = judged(EVEN)
    for tool, parts in true_at.items():
        state = wear.tools[str(tool)]
        assert abs(state.replaced_part - parts[-1]) <= 1
        assert [life.uses for life in state.lives] == pytest.approx([LENGTHS[tool]] * len(state.lives), abs=3)
        assert len(state.lives) >= len(parts) - 2


def test_the_level_is_the_wear_whatever_the_batch() -> None:
    batches = {part: 0.06 * (-1) ** part for part in range(30, 450, 37)}
    plan = Made(450, batches)
    *_, (_, _), (_, truth) = made(Made(449, batches))
    wear = judged(plan)
    off = [wear_of(wear.tools[str(tool)], TERMS) - END * share for tool, (_, share) in truth.items()]
    assert max(map(abs, off)) < 0.04


def test_a_hard_batch_wears_no_tool() -> None:
    plan, hard = Made(431), Made(431, {420: 0.1})
    soft_tools, hard_tools = judged(plan).tools, judged(hard).tools
    moved = [wear_of(hard_tools[name], TERMS) - wear_of(soft_tools[name], TERMS) for name in soft_tools]
    assert abs(fmean(moved)) < 0.02
    assert judged(hard).material - judged(plan).material == pytest.approx(0.1, abs=0.02)


def test_a_tool_that_wears_five_times_as_fast_is_told_and_others_are_not() -> None:
    plan = Made(420, rates={(2, 5): 5.0})
    wear, told = Wear(), set()
    for cuts, truth in made(plan):
        for cut in cuts:
            wear, _ = cut_added(wear, cut, TERMS)
        told |= {(name, truth[int(name)][0]) for name, tool in wear.tools.items() if tool.is_fast}
    assert ("2", 5) in told
    assert {name for name, _ in told} == {"2"}


def test_a_broken_insert_is_no_wear_of_the_others() -> None:
    wear = judged(Made(400))
    broken = wear
    for cut in wear.cuts:
        ratio = (cut.load_ratio or 1.0) * (2.0 if cut.tool == 2 else 1.0)
        broken = broken._replace(
            cuts=tuple(one if one.tool != cut.tool else cut._replace(load_ratio=ratio) for one in broken.cuts)
        )
    following = Cut("O1", 1, "O1|T1|1", 999, 1e6, 1.0)
    as_it_was, _ = cut_added(wear, following, TERMS)
    after, _ = cut_added(broken, following, TERMS)
    for name in ("1", "3"):
        assert wear_of(after.tools[name], TERMS) == pytest.approx(wear_of(as_it_was.tools[name], TERMS), abs=0.01)


def test_what_is_known_goes_through_json() -> None:
    wear, adapter = judged(Made(90)), TypeAdapter(Wear)
    again = adapter.validate_python(json.loads(json.dumps(adapter.dump_python(wear, mode="json"))))
    assert again == wear


def test_a_record_that_comes_twice_counts_once() -> None:
    (cuts, _), *_ = made(Made(1))
    wear, _ = cut_added(Wear(), cuts[0], TERMS)
    assert cut_added(wear, cuts[0], TERMS) == (wear, False)


def test_tools_are_bounded() -> None:
    wear = Wear()
    for tool in range(TOOLS_MAX + 20):
        wear, _ = cut_added(wear, Cut("O1", tool, f"T{tool}", tool, float(tool), 1.0), TERMS)
    assert len(wear.tools) == TOOLS_MAX
    assert "0" not in wear.tools


def test_parts_left_are_given_from_the_third_life_on_and_are_in_their_band() -> None:
    wear, hits, given = Wear(), 0, 0
    for cuts, truth in made(Made(450)):
        for name, tool in wear.tools.items():
            status = status_of(name, tool, wear, TERMS)
            life, share = truth[int(name)]
            left = (1.0 - share) * LENGTHS[int(name)]
            if status.left is None:
                assert status.why_not_left
            elif 20.0 < left < 0.7 * LENGTHS[int(name)]:
                assert life >= 2
                given += 1
                hits += status.left.low - 2.0 <= left <= status.left.high + 2.0
        for cut in cuts:
            wear, _ = cut_added(wear, cut, TERMS)
    assert given > 200
    assert hits / given > 0.85
