"""Many edges in one process, with edges that a test makes run, crash and hang; the clock is the test's own."""

import logging
import re
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from edge.config import EdgeConfig
from edge.errors import ConfigError
from edge.running.gateway import Gateway
from edge.running.ledger import Ledger
from edge.running.runtime import EdgeRuntime


class Edge:
    """Runs until stopped, or does what `fate` says."""

    def __init__(self, config: EdgeConfig[Any], fate: Callable[[], None] | None) -> None:
        self.config, self.stop, self.ledger = config, threading.Event(), Ledger()
        self._fate = fate

    def run(self) -> None:
        self.ledger.queue(1)
        if self._fate is not None:
            self._fate()
        self.stop.wait(20)


class Works:
    """A folder of machines, and a gateway over it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.now_s = folder, 0.0
        self.fates: dict[str, Callable[[], None]] = {}
        self.begun: Counter[str] = Counter()
        self.restarts: list[int] = []
        self.edges: list[Edge] = []
        self.gateway = self.over(folder)

    def over(self, path: Path) -> Gateway:
        return Gateway(path, self._begin, clock=lambda: self.now_s, look_s=0.01, end_s_max=0.2)

    def _begin(self, config: EdgeConfig[Any], restarts: int) -> EdgeRuntime:
        self.begun[config.machine.name] += 1
        self.restarts.append(restarts)
        edge = Edge(config, self.fates.get(config.machine.name))
        self.edges.append(edge)
        return cast(EdgeRuntime, edge)

    def write(self, name: str, text: str = "", file: str = "") -> Path:
        path = self.folder / f"{file or name}.toml"
        path.write_text(f'[machine]\nname = "{name}"\n{text}', encoding="utf-8")
        return path

    def look(self, until: Callable[[], bool] = lambda: True) -> None:
        for _ in range(6000):
            self.gateway.look()
            if until():
                return
            time.sleep(0.01)
        raise AssertionError("it never came so")

    @property
    def running(self) -> list[str]:
        return sorted(self.gateway.runtimes)


@pytest.fixture
def works(tmp_path: Path) -> Iterator[Works]:
    made = Works(tmp_path)
    yield made
    for edge in made.edges:
        edge.stop.set()
    stop = threading.Event()
    stop.set()
    if made.gateway._edges:
        made.gateway.run(stop)


def test_each_file_of_the_folder_is_an_edge_and_they_end_together(works: Works) -> None:
    for name in "abc":
        works.write(name)
    works.look(lambda: works.running == ["a", "b", "c"])
    stop = threading.Event()
    stop.set()
    assert works.gateway.run(stop)["ledger/received"] == 3
    assert works.running == []


def test_one_that_crashes_is_begun_again_later_each_time_and_the_others_do_not_notice(
    works: Works, caplog: pytest.LogCaptureFixture
) -> None:
    def crash() -> None:
        raise ValueError("a bug")

    works.fates["b"] = crash
    for name in "abc":
        works.write(name)
    works.look(lambda: works.running == ["a", "c"] and works.gateway._edges[works.folder / "b.toml"].due_s > 0)
    assert works.gateway._edges[works.folder / "b.toml"].due_s == 2.0
    works.look()
    assert works.begun == {"a": 1, "b": 1, "c": 1}, "not before it is due"
    works.now_s = 2.0
    works.look(lambda: works.gateway._edges[works.folder / "b.toml"].due_s == 6.0)
    del works.fates["b"]
    works.now_s = 6.0
    works.look(lambda: works.running == ["a", "b", "c"])
    assert works.begun == {"a": 1, "b": 3, "c": 1}
    assert max(works.restarts) == 2
    assert "the edge of b has ended: ValueError('a bug'); it is begun again" in caplog.text


def test_a_file_that_changes_is_taken_up_and_one_that_only_looks_new_is_not(works: Works) -> None:
    file = works.write("a")
    works.look(lambda: works.running == ["a"])
    file.write_text(file.read_text() + "\n# a remark\n")
    works.look()
    assert works.begun["a"] == 1
    works.write("a", "lost_after_s = 5\n")
    works.look(lambda: works.begun["a"] == 2 and works.running == ["a"])
    assert works.edges[0].stop.is_set()
    assert works.edges[-1].config.machine.lost_after_s == 5.0


def test_machines_come_and_go_while_others_run(works: Works) -> None:
    works.write("a")
    works.look(lambda: works.running == ["a"])
    added = works.write("b")
    works.look(lambda: works.running == ["a", "b"])
    added.unlink()
    works.look(lambda: works.running == ["a"])
    assert works.begun["a"] == 1


def test_a_file_that_goes_and_comes_back_as_it_was_runs_again(works: Works, tmp_path: Path) -> None:
    works.write("b")
    file = works.write("a")
    works.look(lambda: works.running == ["a", "b"])
    aside = tmp_path / "aside"
    file.rename(aside)
    works.look(lambda: works.running == ["b"])
    aside.rename(file)
    works.look(lambda: works.running == ["a", "b"])
    assert works.begun == {"a": 2, "b": 1}


def test_a_file_with_a_mistake_changes_nothing_and_is_told_once(works: Works, caplog: pytest.LogCaptureFixture) -> None:
    works.write("a")
    works.look(lambda: works.running == ["a"])
    with caplog.at_level(logging.WARNING):
        works.write("a", "lost_after = 5\n")
        for _ in range(3):
            works.look()
    assert works.running == ["a"]
    assert caplog.text.count("machine.lost_after is not known") == 1
    assert "the edge goes on as it was" in caplog.text


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("b", '[broker]\nnode = "edge-a"\n', r"b\.toml: node 'cnc/edge-a' is that of .*a\.toml too"),
        ("A", '[broker]\nnode = "other"\n', r"b\.toml: machine 'cnc/a' is that of"),
    ],
)
def test_two_files_may_not_be_the_same_machine(
    works: Works, caplog: pytest.LogCaptureFixture, name: str, text: str, message: str
) -> None:
    works.write("a")
    works.write(name, text, file="b")
    works.look(lambda: works.running == ["a"])
    assert re.search(message, caplog.text)
    assert works.begun["a"] == 1


def test_one_that_does_not_end_is_left_behind_and_holds_nobody_up(works: Works, caplog: pytest.LogCaptureFixture) -> None:
    hang = threading.Event()
    works.fates["a"] = lambda: cast(None, hang.wait(60))
    works.write("a")
    works.write("b")
    works.look(lambda: works.running == ["a", "b"])
    (works.folder / "a.toml").unlink()
    works.look(lambda: works.running == ["b"])
    assert "the edge of a does not end; it is left behind" in caplog.text
    hang.set()


def test_a_single_file_that_cannot_be_used_ends_with_its_error(works: Works) -> None:
    file = works.write("a", "lost_after = 5\n")
    with pytest.raises(ConfigError, match=r"machine\.lost_after is not known"):
        works.over(file).run(threading.Event())
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        works.over(works.folder / "none.toml").run(threading.Event())
    empty = works.folder / "empty"
    empty.mkdir()
    with pytest.raises(ConfigError, match=r"holds no \*\.toml"):
        works.over(empty).run(threading.Event())


def test_a_single_file_whose_control_cannot_serve_it_ends_with_that_error(works: Works) -> None:
    def refuse() -> None:
        raise ConfigError("mtconnect.device = 'x': the agent has no such device")

    works.fates["a"] = refuse
    with pytest.raises(ConfigError, match="no such device"):
        works.over(works.write("a")).run(threading.Event())


def test_many_that_hang_hold_up_the_end_no_longer_than_one(works: Works) -> None:
    hang = threading.Event()
    for name in "abcdefghijklmnopqrst":
        works.fates[name] = lambda: cast(None, hang.wait(120))
        works.write(name)
    works.look(lambda: len(works.running) == 20)
    stop = threading.Event()
    stop.set()
    works.gateway._end_s_max = 2.0
    began_s = time.monotonic()
    works.gateway.run(stop)
    hang.set()
    assert time.monotonic() - began_s < 30.0, "2 s is what one may take, and there are twenty"


def test_one_that_is_told_to_end_while_it_is_being_made_ends(works: Works, monkeypatch: pytest.MonkeyPatch) -> None:
    made = threading.Event()
    begin = works._begin

    def slow(config: EdgeConfig[Any], restarts: int) -> EdgeRuntime:
        made.wait(60)
        return begin(config, restarts)

    monkeypatch.setattr(works.gateway, "_begin", slow)
    file = works.write("a")
    works.look()
    thread = works.gateway._edges[file].thread
    file.unlink()
    works.look()
    made.set()
    assert thread is not None
    thread.join(60)
    assert not thread.is_alive()


def test_a_folder_that_is_away_for_a_moment_ends_nobody(works: Works, tmp_path: Path) -> None:
    folder = works.folder = tmp_path / "machines"
    folder.mkdir()
    works.gateway = works.over(folder)
    works.write("a")
    works.look(lambda: works.running == ["a"])
    folder.rename(tmp_path / "aside")
    works.look()
    assert works.running == ["a"]
    (tmp_path / "aside").rename(folder)
    works.look()
    assert works.begun["a"] == 1


def test_one_that_was_like_another_is_taken_up_as_soon_as_the_other_is_not(
    works: Works, caplog: pytest.LogCaptureFixture
) -> None:
    works.write("a")
    works.write("a", file="b")
    for _ in range(3):
        works.look(lambda: works.running == ["a"])
    assert caplog.text.count("give each machine its own") == 1
    works.write("other", file="a")
    works.look(lambda: works.running == ["a", "other"])
