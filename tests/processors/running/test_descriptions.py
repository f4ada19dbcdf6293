"""Descriptions in a process: heard from the broker, published out of its folder, refused where they are wrong."""

import json
import logging
import os
from pathlib import Path

import pytest

from processors.description import Role, topic_of
from processors.description_folder import DescriptionFolder
from processors.running.runner import Runner
from processors.running.worker import Worker
from tests.processors.describing import DESCRIBING, SUM, VERSION, description, message, toml
from tests.processors.recorder import RECORDER
from tests.processors.running.test_worker import FakeEdge, FakeHost
from tests.processors.streams import birth, data

LIVE, CHALLENGER = topic_of("okuma", Role.LIVE), topic_of("okuma", Role.CHALLENGER)
FAULT = "cnctwin/description/okuma/fault"


def begun(host: FakeHost, folder: Path | None = None) -> tuple[Runner, FakeEdge]:
    """A runner that has taken all that is retained, and whatever its host had."""
    edge = FakeEdge()
    worker = Worker(DESCRIBING, DESCRIBING.configured({}), host, edge)
    runner = Runner(host, [worker], None if folder is None else DescriptionFolder(folder))
    runner.run(host.until_empty())
    return runner, edge


def look(runner: Runner) -> None:
    """A second has passed."""
    runner._report_due(0.0)


def write(path: Path, text: str, at_s: float = 1_700_000_000.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    os.utime(path, (at_s, at_s))


def sent(host: FakeHost) -> list[tuple[str, str]]:
    """Return the messages retained below cnctwin/description, by topic: the version, or the fault."""
    told = [(topic, payload) for topic, payload, retain in host.plain if topic.startswith("cnctwin/description/") and retain]
    return [
        (topic, "" if not payload else json.loads(payload).get("version") or json.loads(payload)["text"])
        for topic, payload in told
    ]


def published(edge: FakeEdge, name: str) -> list[object]:
    """The values of a metric, those of births first."""
    return [change.value for device, changes in edge.published if device for change in changes if change.name == name]


def test_what_is_retained_is_known_before_anything_is_folded() -> None:
    host = FakeHost(birth(0.5, spindle_rpm=2.0), retained={LIVE: message(4.0).payload})
    _, edge = begun(host)
    assert published(edge, SUM) == [8.0]
    assert host.subscriptions[0] == "cnctwin/description/#"


def test_one_that_comes_while_snapshots_are_awaited_waits_for_its_place() -> None:
    """It is behind the birth in the broker's order, so the birth is folded with the one that was retained."""
    host = FakeHost(retained={LIVE: message(4.0).payload})
    host.give(message(4.0), birth(0.5, spindle_rpm=2.0), message(5.0), data(0.6, spindle_rpm=3.0), data(0.7, spindle_rpm=4.0))
    _, edge = begun(host)
    assert published(edge, SUM) == [8.0, 20.0, 40.0]


def test_a_change_is_taken_up_in_the_order_of_messages() -> None:
    host = FakeHost(retained={LIVE: message(1.0).payload})
    runner, edge = begun(host)
    host.give(birth(0.0, spindle_rpm=1.0), *(data(0.1 * n, spindle_rpm=1.0 + n / 100) for n in range(1, 4)))
    runner.turn()
    host.give(message(2.0), data(0.5, spindle_rpm=2.0), data(0.6, spindle_rpm=3.0))
    runner.turn()
    assert published(edge, VERSION)[-1] == description(2.0).version
    assert published(edge, SUM)[-1] == pytest.approx(1.0 + 1.01 + 1.02 + 1.03 + 2.0 + 6.0)


def test_the_same_again_is_no_news(caplog: pytest.LogCaptureFixture) -> None:
    host = FakeHost(retained={LIVE: message(1.0).payload})
    runner, _ = begun(host)
    with caplog.at_level(logging.INFO):
        host.give(message(1.0))
        runner.turn()
    assert "description" not in caplog.text


def test_a_message_that_describes_nothing_changes_nothing(caplog: pytest.LogCaptureFixture) -> None:
    host = FakeHost(birth(0.0, spindle_rpm=2.0), retained={LIVE: message(3.0).payload})
    runner, edge = begun(host)
    for payload in (b"{", b"[]", b'{"version": "x", "toml": "[machine"}'):
        host.give(message(1.0)._replace(payload=payload))
    host.give(data(0.1, spindle_rpm=4.0), data(0.2, spindle_rpm=5.0))
    runner.turn()
    assert published(edge, SUM) == [6.0, 18.0, 33.0]
    assert caplog.text.count("is not taken up") == 3


def test_the_folder_is_published_where_the_broker_says_otherwise(tmp_path: Path) -> None:
    write(tmp_path / "okuma.toml", toml(2.0))
    host = FakeHost(retained={LIVE: message(1.0).payload})
    runner, _ = begun(host, tmp_path)
    look(runner)
    look(runner)
    assert sent(host) == [(LIVE, description(2.0).version)]
    host.give(message(2.0))
    runner.turn()
    look(runner)
    assert len(sent(host)) == 1
    write(tmp_path / "okuma.toml", toml(5.0), 1_700_000_001.0)
    look(runner)
    assert sent(host)[1:] == [(LIVE, description(5.0).version)]


def test_a_file_that_stands_unchanged_is_not_published_against_another_folder(tmp_path: Path) -> None:
    write(tmp_path / "okuma.toml", toml(2.0))
    runner, _ = begun(host := FakeHost(), tmp_path)
    look(runner)
    host.give(message(2.0), message(9.0))
    runner.turn()
    look(runner)
    assert sent(host) == [(LIVE, description(2.0).version)]


def test_what_goes_out_waits_for_the_broker(tmp_path: Path) -> None:
    runner, _ = begun(host := FakeHost(), tmp_path)
    host.online = False
    write(tmp_path / "okuma.toml", toml(2.0))
    look(runner)
    assert sent(host) == []
    host.online = True
    look(runner)
    assert sent(host) == [(LIVE, description(2.0).version)]


def test_a_broker_that_has_forgotten_is_told_again_one_that_remembers_is_not(tmp_path: Path) -> None:
    write(tmp_path / "okuma.toml", toml(2.0))
    write(tmp_path / "challengers" / "okuma.toml", toml(3.0))
    runner, _ = begun(host := FakeHost(), tmp_path)
    host.give(message(2.0), message(3.0, Role.CHALLENGER))
    runner.turn()
    host.plain.clear()
    host.reconnects = 1
    look(runner)
    host.give(message(2.0))
    runner.turn()
    look(runner)
    assert sent(host) == [(CHALLENGER, description(3.0).version)]


def test_a_challenger_that_goes_is_taken_back_also_where_nobody_looked(tmp_path: Path) -> None:
    write(tmp_path / "okuma.toml", toml(2.0))
    write(tmp_path / "challengers" / "okuma.toml", toml(3.0))
    retained = {LIVE: message(2.0).payload, CHALLENGER: message(3.0).payload}
    runner, _ = begun(host := FakeHost(retained=retained), tmp_path)
    (tmp_path / "challengers" / "okuma.toml").unlink()
    look(runner)
    assert sent(host) == [(CHALLENGER, "")]
    runner, _ = begun(host := FakeHost(retained=retained), tmp_path)
    look(runner)
    assert sent(host) == [(CHALLENGER, "")]


def test_a_folder_does_not_speak_for_a_machine_that_it_says_nothing_about(tmp_path: Path) -> None:
    write(tmp_path / "mazak.toml", toml(2.0))
    host = FakeHost(retained={LIVE: message(2.0).payload, CHALLENGER: message(3.0).payload, FAULT: b'{"t": 1, "text": "-"}'})
    runner, _ = begun(host, tmp_path)
    look(runner)
    assert [topic for topic, _ in sent(host)] == [topic_of("mazak", Role.LIVE)]


def test_a_wrong_file_changes_nothing_and_says_why_until_it_is_mended(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(tmp_path / "okuma.toml", toml(2.0))
    runner, _ = begun(host := FakeHost(retained={LIVE: message(2.0).payload}), tmp_path)
    write(tmp_path / "okuma.toml", toml(2.0, "rated = 3"), 1_700_000_001.0)
    look(runner)
    ((topic, text),) = sent(host)
    assert topic == FAULT
    assert "okuma.toml: machine.rated is not known" in text
    assert "stays what it was" in caplog.text
    write(tmp_path / "okuma.toml", toml(2.0), 1_700_000_002.0)
    look(runner)
    assert sent(host)[1:] == [(FAULT, "")]


def test_a_fault_that_was_mended_while_nobody_looked_is_taken_back(tmp_path: Path) -> None:
    write(tmp_path / "okuma.toml", toml(2.0))
    host = FakeHost(retained={LIVE: message(2.0).payload, FAULT: b'{"t": 1, "text": "wrong"}'})
    runner, _ = begun(host, tmp_path)
    look(runner)
    assert sent(host) == [(FAULT, "")]


def test_a_description_that_a_processor_refuses_is_its_fault_alone() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=2.0), retained={LIVE: message(3.0).payload})
    runner, edge = begun(host)
    host.give(message(13.0), data(0.1, spindle_rpm=4.0), data(0.2, spindle_rpm=5.0))
    runner.turn()
    look(runner)
    assert published(edge, SUM) == [6.0, 18.0, 33.0]
    ((topic, text),) = sent(host)
    assert topic == f"{FAULT}/describing/live"
    assert text == f"describing cannot take up the live description {description(13.0).version}: ValueError: thirteen is refused"
    host.give(message(14.0))
    runner.turn()
    look(runner)
    assert sent(host)[1:] == [(topic, "")]


def test_a_twin_device_is_born_again_with_the_metrics_of_a_challenger_and_without() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=2.0), retained={LIVE: message(3.0).payload})
    runner, edge = begun(host)
    assert not [spec for spec in edge.devices["okuma"] if spec.name.startswith("twin/challenger/")]
    host.give(message(4.0, Role.CHALLENGER), data(0.1, spindle_rpm=4.0), data(0.2, spindle_rpm=5.0))
    runner.turn()
    (own,) = (spec for spec in edge.devices["okuma"] if spec.name == "twin/challenger/sum")
    assert own.properties is not None
    assert own.properties["meaning"] == "by the challenger: speed times factor"
    assert published(edge, "twin/challenger/sum") == [16.0, 36.0]
    host.give(message(None, Role.CHALLENGER), data(0.3, spindle_rpm=4.0))
    runner.turn()
    assert not [spec for spec in edge.devices["okuma"] if spec.name.startswith("twin/challenger/")]


def test_who_asks_for_no_description_hears_none() -> None:
    host = FakeHost()
    Runner(host, [Worker(RECORDER, RECORDER.configured({}), host, FakeEdge())]).run(host.until_empty())
    assert not any(topic.startswith("cnctwin/description") for topic in host.subscriptions)
