"""A machine's description on a real broker: a file changes, and processors that run take it up."""

import json
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from processors.config import Configuration
from processors.discovery import AnyProcessor
from processors.running.runtime import runner_of
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from tests.processors.alerts.courier.office import until
from tests.processors.describing import DESCRIBING, SUM, VERSION, description, toml
from tests.processors.running.test_runtime import Reader, broker, edge, reader, say

__all__ = ["broker", "edge", "reader"]
LIVE, FAULT = "cnctwin/description/okuma/live", "cnctwin/description/okuma/fault"
Start = Callable[..., Callable[[], None]]


@pytest.fixture
def start(broker: BrokerAddress, tmp_path: Path) -> Iterator[Start]:
    """Start a process of processors that looks at a folder; the call that ends it."""
    ends: list[Callable[[], None]] = []

    def begin(processor: AnyProcessor = DESCRIBING, machines: Path | None = tmp_path / "machines") -> Callable[[], None]:
        runner = runner_of(
            [(processor, Configuration(processor.config))], broker, session_dir=tmp_path / "sessions", machines=machines
        )
        stop = threading.Event()
        thread = threading.Thread(target=runner.run, args=(stop,))
        thread.start()

        def end() -> None:
            stop.set()
            thread.join()

        ends.append(end)
        return end

    yield begin
    for end in ends:
        end()


def write(folder: Path, text: str, name: str = "okuma.toml") -> None:
    """Write a description as an editor does that replaces the file as a whole."""
    path = folder / "machines" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    (path.parent / ".new").write_text(text)
    (path.parent / ".new").replace(path)
    long_ago_s = path.stat().st_mtime - 10.0
    os.utime(path, (long_ago_s, long_ago_s))


def version(reader: Reader) -> object:
    """The version by which the processor computes, as it says."""
    told = reader.twin(VERSION, "describing")
    return None if told is None else told.value


def runs(edge: EdgeNode, began_s: float = 0.0) -> Callable[[], None]:
    """A machine that goes on saying something: each call is a message."""
    at_s = [began_s]

    def go_on() -> None:
        at_s[0] += 0.01
        say(edge, at_s[0], spindle_rpm=1000.0 + at_s[0])

    return go_on


@pytest.mark.broker
def test_a_file_that_changes_is_taken_up_without_a_restart_and_the_state_goes_on(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode, start: Start, tmp_path: Path
) -> None:
    write(tmp_path, toml(2.0))
    start()
    go_on = runs(edge)

    def computes_with(power_kw: float) -> Callable[[], bool]:
        def is_so() -> bool:
            go_on()
            return version(reader) == description(power_kw).version

        return is_so

    until(computes_with(2.0), "the file")
    before = reader.twin(SUM, "describing")
    write(tmp_path, toml(3.0))
    until(computes_with(3.0), "the file that has changed")
    after = reader.twin(SUM, "describing")
    assert before is not None and after is not None
    assert float(after.value) > float(before.value) > 0.0  # type: ignore[arg-type]
    told = json.loads(reader.plain[LIVE])
    assert (told["version"], told["toml"], told["by"]) == (description(3.0).version, toml(3.0), "file")


@pytest.mark.broker
def test_a_wrong_file_leaves_the_one_before_live_and_is_told(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode, start: Start, tmp_path: Path
) -> None:
    write(tmp_path, toml(2.0))
    start()
    go_on = runs(edge)
    until(lambda: (go_on(), version(reader) == description(2.0).version)[1], "the file")
    write(tmp_path, toml(-3.0))
    until(lambda: reader.plain.get(FAULT), "the fault")
    assert "okuma.toml: spindle.rated_power_kw = -3.0: must be above 0" in json.loads(reader.plain[FAULT])["text"]
    go_on()
    assert version(reader) == description(2.0).version
    assert json.loads(reader.plain[LIVE])["version"] == description(2.0).version
    write(tmp_path, toml(2.0))
    until(lambda: reader.plain[FAULT] == b"", "the fault to go")


@pytest.mark.broker
def test_a_process_without_a_folder_takes_up_what_the_broker_retains(
    broker: BrokerAddress, reader: Reader, edge: EdgeNode, start: Start, tmp_path: Path
) -> None:
    write(tmp_path, toml(2.0))
    end = start()
    until(lambda: reader.plain.get(LIVE), "the description")
    end()
    start(machines=None)
    go_on = runs(edge)
    until(lambda: (go_on(), version(reader) == description(2.0).version)[1], "what was retained")
