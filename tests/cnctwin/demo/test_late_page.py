"""A page that is not up when the demo begins: where it will be, and that it is found when it comes."""

import shutil
import sys
from pathlib import Path

import pytest

from cnctwin.demo import parts
from cnctwin.demo.demo import page_line
from cnctwin.demo.parts import Demo, DemoOptions, page_trouble
from cnctwin.processes.child import Child
from tests.cnctwin.program import until
from tests.wire.mosquitto import free_port


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["sleep", "60", "8080"], "not up after 15 s; it will be at http://127.0.0.1:8080"),
        (["sleep", "60", "0"], "not up after 15 s; its address is printed here once it is up"),
        (["true", "8080"], "does not start: it ended without a word; it is started again"),
        (["cat", "/no/such/file"], "does not start: cat: /no/such/file: No such file or directory; it is started again"),
    ],
)
def test_a_page_that_is_not_up_yet_says_where_it_will_be(tmp_path: Path, command: list[str], said: str) -> None:
    page = Child("page", command, tmp_path / "page.log")
    page.start()
    if command[0] != "sleep":
        until(lambda: not page.running, "it to end")
    found = page_trouble(page)
    page.stop()
    assert found == said


@pytest.mark.broker
@pytest.mark.usefixtures("mosquitto_program")
def test_a_page_that_comes_late_is_found_and_keeps_its_port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "START_S_MAX", 0.0)
    monkeypatch.setattr(sys, "executable", shutil.which("true"))
    demo = Demo(DemoOptions(port=free_port()), tmp_path)
    demo.broker.start()
    demo._serve([])
    page = demo.children[-1]
    assert (demo.page_url, demo.page_trouble != "") == ("", True)
    (tmp_path / "page.json").write_text('{"url": "http://127.0.0.1:8765"}')
    demo.watch()
    assert (page_line(demo), page.command[-1]) == ("page:      http://127.0.0.1:8765/#/gap/vmc", "8765")
    demo.stop()
