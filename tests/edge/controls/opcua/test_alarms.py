"""Alarms, conditions and messages over a real connection to a real server."""

import json
from datetime import UTC, datetime
from typing import Any

import pytest

pytest.importorskip("asyncua")

from cnctwin.standins.opcua_server.alarms import ShownAlarm
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.opcua import event_session
from edge.controls.opcua.check import describe
from edge.controls.opcua.library import CONDITION_REFRESH, CONDITION_TYPE, ForbiddenServiceError, ReadOnlyGuard
from edge.sample import SampleSet
from tests.edge.controls.opcua.conftest import NOW_S, Bench
from tests.edge.controls.opcua.test_connection import Reader, reading

LOW = ShownAlarm("700012", "Coolant level low", 500, acknowledged=False)


def alarms(one: SampleSet) -> list[dict[str, Any]] | None:
    """The list that this frame gave last."""
    lists = [str(s.value) for s in one.samples if s.signal == "alarms" and s.value is not None]
    return json.loads(lists[-1]) if lists else None


def until_alarms(reader: Reader, *wanted: tuple[str, object]) -> SampleSet:
    def told(one: SampleSet) -> bool:
        found = alarms(one)
        return found is not None and [(alarm["code"], alarm["acknowledged"]) for alarm in found] == [*wanted]

    return reader.until(told, 20.0)


def test_alarms_are_known_at_once_then_raised_acknowledged_and_cleared(bench: Bench) -> None:
    bench.server.set_alarms(LOW)
    with reading(bench.config()) as reader:
        first = until_alarms(reader, ("700012", False))
        assert any(sample.signal == "tool_number" for sample in first.samples), "in one frame with the state as found"
        assert [s.value for s in first.samples if s.signal == "alarm"] == ["700012 Coolant level low"]
        bench.show(ControlState(alarm=(25201, "Axis X drive fault")))
        raised = until_alarms(reader, ("25201", False), ("700012", False))
        (sample,) = (s for s in raised.samples if s.signal == "alarms")
        assert not sample.is_baseline
        assert sample.timestamp_ms == round((NOW_S + bench.machine_s) * 1000)
        severest = (alarms(raised) or [])[0]
        assert (severest["severity"], severest["active"]) == (1000, True)
        bench.server.set_alarms(ShownAlarm("700012", "Coolant level low", 500, acknowledged=True))
        until_alarms(reader, ("25201", False), ("700012", True))
        bench.server.set_alarms(ShownAlarm("700012", "Coolant level low", 500, active=False, acknowledged=False))
        bench.show(ControlState())
        gone = until_alarms(reader, ("700012", False))
        assert [s.value for s in gone.samples if s.signal == "alarm"][-1] == ""
        bench.server.set_alarms()
        until_alarms(reader)


def test_an_alarm_that_ended_while_the_server_was_away_is_gone_and_one_that_came_is_there(bench: Bench) -> None:
    bench.server.set_alarms(LOW, ShownAlarm("3000", "Emergency stop"))
    with reading(bench.config()) as reader:
        until_alarms(reader, ("3000", True), ("700012", False))
        bench.server.stop()
        bench.server._more_alarms = (LOW, ShownAlarm("10203", "No reference point", 1))
        bench.server.start()
        back = until_alarms(reader, ("700012", False), ("10203", True))
        assert [gap.reason for gap in back.gaps] != []
        assert all(sample.is_baseline for sample in back.samples)


def test_a_server_that_wants_a_refresh_is_asked_for_one(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge.controls.opcua.event_session.REFRESH_APART_S_MIN", 0.1)
    with reading(bench.config()) as reader:
        until_alarms(reader)
        bench.server.require_refresh()
        again = until_alarms(reader)
        assert again.samples[-1].is_baseline


def test_events_that_the_server_lost_are_a_stated_hole_and_the_alarms_are_asked_for_again(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("edge.controls.opcua.event_session.REFRESH_APART_S_MIN", 0.1)
    with reading(bench.config()) as reader:
        until_alarms(reader)
        bench.server.lose_events()
        lost = reader.until(lambda one: bool(one.gaps))
        assert [gap.reason for gap in lost.gaps] == ["queue of the server ran over: events"]
        until_alarms(reader)


def test_a_message_of_the_program_comes_as_an_event(bench: Bench) -> None:
    with reading(bench.config()) as reader:
        until_alarms(reader)
        bench.server.say("Load pallet 2")
        reader.until_value("operator_message", "Load pallet 2")


def test_the_check_shows_severity_and_acknowledge_state_of_each_alarm(bench: Bench) -> None:
    bench.server.set_alarms(LOW, ShownAlarm("3000", "Emergency stop", active=False))
    since = datetime.fromtimestamp(NOW_S + bench.machine_s, UTC).strftime("%Y-%m-%dT%H:%M:%S.000Z")
    rows = {row.signal: row.value for row in describe(bench.config()) if row.signal.startswith("(alarm)")}
    assert rows == {
        "(alarm) 3000": "Emergency stop, severity 1000, gone, acknowledged",
        "(alarm) 700012": "Coolant level low, severity 500, active, not acknowledged, since " + since,
    }


def test_a_control_without_a_node_of_its_own_tells_its_alarms_at_the_server_object(bench: Bench) -> None:
    bench.server.set_alarms(LOW)
    (row,) = (row for row in describe(bench.config(map="cnc_40502")) if row.signal == "(alarm) 700012")
    assert row.source == "i=2253"


def test_a_branch_stays_on_the_list_beside_its_condition_until_it_is_acknowledged(bench: Bench) -> None:
    earlier = ShownAlarm("700012", "Coolant level low", 500, acknowledged=False, branch=1)
    bench.server.set_alarms(LOW, earlier)
    with reading(bench.config()) as reader:
        first = until_alarms(reader, ("700012", False), ("700012", False))
        assert [alarm["active"] for alarm in alarms(first) or []] == [True, False]
        bench.server.set_alarms(LOW)
        until_alarms(reader, ("700012", False))


def test_where_a_node_gives_no_events_that_is_said_and_no_error(bench: Bench) -> None:
    wrong = bench.config(events="nsu=SinumerikVarProvider;s=/Channel/State/actTNumber[u1,1]")
    with reading(wrong) as reader:
        first = reader.until(lambda one: any(s.signal == "alarms" for s in one.samples))
        (sample,) = (s for s in first.samples if s.signal == "alarms")
        assert sample.value is None
        assert str(sample.reason).startswith("the server offers no events (nsu=SinumerikVarProvider;s=/Channel/State/actTNumber")
        assert (reader.connection.reconnects, reader.connection.last_error) == (0, "")
    with reading(bench.config(events="none")) as reader:
        first = reader.until(lambda one: bool(one.samples))
        assert "alarms" not in {offer.signal for offer in first.offers or ()}


def test_a_server_that_refuses_the_fields_of_conditions_still_tells_messages(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    from asyncua import ua
    from asyncua.ua.status_codes import StatusCodes

    real = event_session._monitor

    async def monitor(config: Any, client: Any, node: Any, fields: Any) -> Any:
        refused = ua.StatusCode(ua.UInt32(StatusCodes.BadEventFilterInvalid))
        return refused if "Retain" in fields.names else await real(config, client, node, fields)

    monkeypatch.setattr(event_session, "_monitor", monitor)
    with reading(bench.config()) as reader:
        first = reader.until(lambda one: any(s.signal == "alarms" for s in one.samples))
        (reason,) = (str(s.reason) for s in first.samples if s.signal == "alarms")
        assert "refuses the fields of conditions" in reason
        bench.server.say("Load pallet 2")
        reader.until_value("operator_message", "Load pallet 2")


@pytest.mark.parametrize(
    ("methods", "passes"),
    [
        ([(CONDITION_TYPE, CONDITION_REFRESH)], True),
        ([(CONDITION_TYPE, CONDITION_REFRESH), (CONDITION_TYPE, 3876)], False),
        ([(CONDITION_TYPE, 9111)], False),  # Acknowledge
        ([(4711, CONDITION_REFRESH)], False),
        ([], False),
    ],
)
def test_the_one_method_that_may_be_called_is_the_one_that_has_alarms_repeated(
    methods: list[tuple[int, int]], passes: bool
) -> None:
    from asyncua import ua

    calls = [ua.CallMethodRequest(ua.NodeId(ua.Int32(a)), ua.NodeId(ua.Int32(b))) for a, b in methods]
    request = ua.CallRequest()
    request.Parameters.MethodsToCall = calls
    if passes:
        with ReadOnlyGuard().observe_request(request):
            return
    with pytest.raises(ForbiddenServiceError), ReadOnlyGuard().observe_request(request):
        pass
