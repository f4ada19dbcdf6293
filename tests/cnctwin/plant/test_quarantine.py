"""Doctor and the page name what is refused."""

from cnctwin.plant.quarantine import refused_lines
from processors.running.quarantine import quarantine_health
from sparkplug.admission.refusal import Quarantined, Refusal
from sparkplug.topics import NodeId
from sparkplug.values import Value

ROW = Quarantined(NodeId("cnc", "edge-1"), "mill", Refusal.NAME, "metric 'a\\x01' holds a control character", 0, 1, True)


def test_what_the_session_and_the_processors_refuse_is_one_line_each() -> None:
    told = quarantine_health([ROW, ROW._replace(device=None, text="more than 1000 messages a second")])["quarantine"]
    values: dict[str, Value] = {"health/quarantine": told}
    lines = refused_lines([ROW], [("twin-mirror", values), ("twin-thermal", values), ("twin-alerts", {})])
    assert lines == [
        "cnc/edge-1: refused: more than 1000 messages a second",
        f"mill of cnc/edge-1: refused: {ROW.text}",
    ]


def test_a_table_of_another_shape_says_nothing() -> None:
    for told in ("", "{", "[1]", "{}", '[{"node": 1}]', "[" * 100_000, None, 7):
        assert refused_lines([], [("twin-mirror", {"health/quarantine": told})]) == []
