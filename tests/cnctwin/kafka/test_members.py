"""The reports of bridges and runners become metrics: who lives, who is silent, and counts that never fall."""

import json
from dataclasses import asdict, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.kafka.bridge.members import FORGOTTEN_S, GONE_S, MEMBERS_MAX, Members, Rising
from cnctwin.kafka.report import BridgeReport, Report, RunnerReport, parsed, payload_of
from processors.running.health import node_metrics

T0_MS = 1_790_000_000_000
PUBLISHABLE = [spec.name.removeprefix("health/") for spec in node_metrics(on_log=True)]
LEDGER = {"ledger/received": 10, "ledger/emitted": 7, "ledger/buffered": 2, "ledger/dropped": 1, "ledger/dropped/late": 1}
RUNNER = RunnerReport(
    t=T0_MS, processors=("gap", "thermal"), partitions=6, records=100, lag_records=3, lag_s=0.5, busy_pct=40.0, transactions=20,
    transactions_aborted=1, rebalances=2, restored_s=1.5, lost_by_retention=0, repeated=4, dead_letters=0,
    ledgers={"gap": LEDGER | {"machines": 5, "holes": 1}, "thermal": LEDGER | {"machines": 5}},
)  # fmt: skip
BRIDGE = BridgeReport(t=T0_MS, bridge="b", events=50, delivered=60, waiting=4, dropped=1, busy_pct=30.0)


class Plant:
    """Members that are heard as time goes by."""

    def __init__(self) -> None:
        self.members, self.at_ms = Members(PUBLISHABLE), T0_MS

    def hear(self, name: str, report: Report | None, **changed: Any) -> "Plant":
        payload = None if report is None else payload_of(replace(report, t=self.at_ms, **changed))
        self.members.hear(name, payload, self.at_ms)
        return self

    def later(self, seconds: float) -> "Plant":
        self.at_ms += round(seconds * 1000)
        return self

    @property
    def gap(self) -> dict[str, Any]:
        return self.members.of_processor("gap", self.at_ms)

    @property
    def bridges(self) -> dict[str, Any]:
        return self.members.of_bridges(self.at_ms)


def balance(told: dict[str, Any]) -> int:
    return int(told["ledger/received"] - told["ledger/emitted"] - told["ledger/buffered"] - told["ledger/dropped"])


@pytest.mark.parametrize("report", [RUNNER, replace(RUNNER, faults=2, fault="gap: no number"), BRIDGE])
def test_a_report_comes_back_as_it_was(report: Report) -> None:
    assert parsed(payload_of(report)) == report


def test_runners_of_a_processor_are_summed_and_the_worst_lag_counts() -> None:
    plant = Plant().hear("gap+thermal.r0", RUNNER).hear("gap+thermal.r1", RUNNER, lag_s=7.0, busy_pct=90.0, restored_s=0.5)
    told = plant.gap
    assert (told["runners"], told["partitions"], told["records"], told["transactions"], told["machines"]) == (2, 12, 200, 40, 10)
    assert (told["lag_s"], told["published_lag_s"], told["busy_pct"], told["restored_s"]) == (7.0, 7.0, 90.0, 1.5)
    assert (told["lag_records"], told["repeated"], told["holes"], told["runners_silent"], told["silent"]) == (6, 8, 2, 0, "")
    assert told["process"] == plant.members.of_processor("thermal", plant.at_ms)["process"] == "kafka: gap+thermal"
    assert told["ledger/received"] == 20 and balance(told) == 0


def test_a_processor_without_runners_has_none_and_no_machines() -> None:
    told = Plant().hear("thermal.r0", RUNNER, processors=("thermal",)).gap
    assert (told["runners"], told["partitions"], told["machines"], told["lag_s"], told["process"]) == (0, 0, 0, 0.0, "kafka: gap")


def test_all_that_is_told_is_a_metric_of_the_node() -> None:
    strange = RUNNER.ledgers["gap"] | {"a_later_version_counts_this": 1}
    plant = Plant().hear("gap.r0", RUNNER, ledgers={"gap": strange}).hear("bridge.b", BRIDGE)
    assert (plant.gap | plant.bridges).keys() <= set(PUBLISHABLE)


def test_who_ends_without_a_word_is_silent_and_named_and_forgotten_after_a_day() -> None:
    plant = Plant().hear("gap+thermal.r0", RUNNER).hear("bridge.b", BRIDGE).hear("bridge.c", BRIDGE)
    plant.later(GONE_S - 1).hear("bridge.b", BRIDGE).later(1)
    assert (plant.gap["runners"], plant.gap["runners_silent"], plant.gap["machines"]) == (0, 1, 0)
    assert plant.gap["silent"] == "bridge.c, gap+thermal.r0"
    assert (plant.bridges["bridges"], plant.bridges["bridges_silent"], plant.bridges["bridge_waiting"]) == (1, 1, 4)
    plant.later(FORGOTTEN_S)
    assert (plant.gap["runners_silent"], plant.bridges["bridges_silent"], plant.gap["silent"]) == (0, 0, "")


def test_who_leaves_by_intent_is_not_missed_and_its_counts_stay() -> None:
    plant = Plant().hear("gap+thermal.r0", RUNNER).hear("gap+thermal.r1", RUNNER).hear("gap+thermal.r0", None)
    told = plant.gap
    assert (told["runners"], told["runners_silent"], told["records"], told["transactions"]) == (1, 0, 200, 40)
    assert (told["machines"], told["ledger/buffered"], balance(told)) == (5, 2, 0)


def test_a_member_whose_clock_is_wrong_lives_once_it_was_heard_twice() -> None:
    plant = Plant()
    for second in range(2):
        plant.members.hear("gap.r0", payload_of(replace(RUNNER, t=T0_MS - 3_600_000 + second)), plant.at_ms)
        assert plant.gap["runners"] == second
    plant.members.hear("gap.r0", payload_of(replace(RUNNER, t=T0_MS - 3_600_000 + 1)), plant.later(GONE_S).at_ms)
    assert plant.gap["runners_silent"] == 1, "the same report again is no sign of life"


@pytest.mark.parametrize(
    "payload",
    [
        b"", b"[]", b"{", b"null", b'{"format": 1}', b"[" * 100_000,
        json.dumps(asdict(RUNNER) | {"format": 2}).encode(),
        json.dumps(asdict(RUNNER) | {"records": -1}).encode(),
        json.dumps(asdict(RUNNER) | {"lag_s": float("inf")}).encode(),
        json.dumps(asdict(RUNNER) | {"processors": []}).encode(),
        json.dumps(asdict(RUNNER) | {"ledgers": {"gap": {"ledger/received": "ten"}}}).encode(),
        json.dumps(asdict(BRIDGE) | {"waiting": None}).encode(),
    ],
)  # fmt: skip
def test_what_is_no_report_is_said_and_changes_nothing(payload: bytes, caplog: pytest.LogCaptureFixture) -> None:
    plant = Plant().hear("gap+thermal.r0", RUNNER)
    before = plant.gap, plant.bridges
    plant.members.hear("gap+thermal.r0", payload, plant.at_ms)
    assert (plant.gap, plant.bridges) == before
    assert "cannot be read" in caplog.text


def test_more_members_than_there_is_room_for_push_out_who_was_silent_longest() -> None:
    plant = Plant().hear("gap+thermal.first", RUNNER).later(1)
    for number in range(MEMBERS_MAX):
        plant.hear(f"gap+thermal.r{number}", RUNNER)
    assert (plant.gap["runners"], plant.gap["records"]) == (MEMBERS_MAX, 100 * (MEMBERS_MAX + 1))


@given(
    st.lists(
        st.tuples(st.sampled_from("abc"), st.one_of(st.just("restart"), st.just("leave"), st.integers(0, 9))),
        max_size=40,
    )
)
def test_sums_never_fall_and_count_all_that_any_life_has_counted(steps: list[tuple[str, str | int]]) -> None:
    sums, counts, expected, before = Rising(), dict.fromkeys("abc", 0), 0, 0
    for member, step in steps:
        if step == "leave":
            sums.leave(member)
            counts[member] = 0
        elif step == "restart":
            counts[member] = 0  # a life of which the first report says nothing yet
            sums.take(member, {"records": 0})
        else:
            assert isinstance(step, int)
            counts[member] += step
            expected += step
            sums.take(member, {"records": counts[member]})
        assert before <= sums.total["records"] == expected
        before = sums.total["records"]
