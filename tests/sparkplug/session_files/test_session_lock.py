"""One process is a node: a second one is told who is there, and a killed one leaves nothing that has to be waited for."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import AnotherRunsError, SparkplugError
from sparkplug.metric import NodeId
from sparkplug.session_files.session_lock import SessionLock

HOLD = """
import sys, time
from pathlib import Path
from sparkplug.session_files.session_lock import SessionLock
lock = SessionLock(Path(sys.argv[1]), "cnc/twin-mirror")
print("held", flush=True)
sys.stdin.read()
"""


class Other:
    """Another process that holds the lock."""

    def __init__(self, session_file: Path) -> None:
        command = [sys.executable, "-c", HOLD, str(session_file)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "held\n"

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


def test_the_second_is_told_who_is_there_and_the_way_out(tmp_path: Path) -> None:
    file = tmp_path / "state" / "twin-mirror.json"
    other = Other(file)
    try:
        with pytest.raises(AnotherRunsError) as refused:
            EdgeNode(BrokerAddress(), NodeId("cnc", "twin-mirror"), session_file=file)
        text = str(refused.value)
        assert text.startswith("another one runs: process ")
        assert f":{other.process.pid} (-c" in text
        assert f"is the node cnc/twin-mirror already, with {file}; end that one first" in text
        assert "\n" not in text
    finally:
        other.kill()
    SessionLock(file, "cnc/twin-mirror").release()  # at once: the lock went with the process that was killed


def test_a_node_that_stopped_lets_go_and_one_process_may_follow_itself(tmp_path: Path) -> None:
    file = tmp_path / "edge.json"
    first = EdgeNode(BrokerAddress(), NodeId("cnc", "edge"), session_file=file)
    second = EdgeNode(BrokerAddress(), NodeId("cnc", "edge"), session_file=file)
    first.stop()
    first.stop()
    with pytest.raises(subprocess.CalledProcessError):
        subprocess.run([sys.executable, "-c", HOLD, str(file)], check=True, stdin=subprocess.DEVNULL, capture_output=True)
    second.stop()
    subprocess.run([sys.executable, "-c", HOLD, str(file)], check=True, stdin=subprocess.DEVNULL, capture_output=True)


@pytest.mark.parametrize("text", ["", "{", "[]", json.dumps({"host": "h"})])
def test_a_lock_that_does_not_say_whose_it_is_holds_all_the_same(text: str, tmp_path: Path) -> None:
    file = tmp_path / "edge.json"
    other = Other(file)
    try:
        file.with_name("edge.json.lock").write_text(text)
        with pytest.raises(AnotherRunsError, match="another one runs: another process is the node cnc/edge"):
            SessionLock(file, "cnc/edge")
    finally:
        other.kill()


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    with pytest.raises(SparkplugError, match=r"cannot be written: .*; name another folder for the state"):
        SessionLock(tmp_path / "state" / "edge.json", "cnc/edge")
