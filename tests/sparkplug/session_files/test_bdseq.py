"""The birth/death sequence number outlives the process, and is never used twice."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest

from sparkplug.errors import SparkplugError
from sparkplug.session_files.bdseq import BdSeq

ROOT = Path(__file__).parents[2]
LOOP = """
import os, sys
from pathlib import Path
from sparkplug.session_files.bdseq import BdSeq
numbers = BdSeq(Path(sys.argv[1]))
while True:
    os.write(1, b"%d\\n" % numbers.next())
"""
KILLS = 8


def test_it_begins_at_zero_and_ends_at_255() -> None:
    numbers = BdSeq()
    assert [numbers.next() for _ in range(258)] == [*range(256), 0, 1]


def test_a_restart_goes_on_with_the_next_number(tmp_path: Path) -> None:
    file = tmp_path / "new" / "folder" / "session.json"
    seen = [BdSeq(file).next() for _ in range(258)]
    assert seen == [*range(256), 0, 1]


def test_a_number_is_on_disk_before_it_is_used(tmp_path: Path) -> None:
    file = tmp_path / "session.json"
    first = BdSeq(file)
    assert (first.next(), BdSeq(file).next(), first.next()) == (0, 1, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["session.json"]


def test_a_half_written_new_file_of_an_earlier_life_does_not_matter(tmp_path: Path) -> None:
    file = tmp_path / "session.json"
    BdSeq(file).next()
    (tmp_path / "session.json.new").write_text('{"bdS')
    assert BdSeq(file).next() == 1


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "1", '{"bdSeq": 256}', '{"bdSeq": -1}', '{"bdSeq": 1.5}', '{"bdSeq": true}', "{}"]
)
def test_a_damaged_file_is_not_guessed_at(tmp_path: Path, text: str) -> None:
    file = tmp_path / "session.json"
    file.write_text(text)
    with pytest.raises(SparkplugError, match=r"session\.json.*mend or delete"):
        BdSeq(file)


def test_a_file_of_other_bytes_is_not_guessed_at(tmp_path: Path) -> None:
    file = tmp_path / "session.json"
    file.write_bytes(b"\xff\xfe\0")
    with pytest.raises(SparkplugError, match="mend or delete"):
        BdSeq(file)


def test_kill_9_at_any_moment_never_lets_a_number_be_used_twice(tmp_path: Path) -> None:
    file = tmp_path / "session.json"
    chance = Random(20)
    last = -1
    for _ in range(KILLS):
        command = [sys.executable, "-c", LOOP, str(file)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT) as child:
            assert child.stdout is not None
            lines = [child.stdout.readline() for _ in range(chance.randint(1, 40))]
            child.kill()
            lines += child.stdout.readlines()
        numbers = [int(line) for line in lines if line.endswith(b"\n")]
        # A kill between writing and using skips one number; none comes again before the count is round.
        assert (numbers[0] - last) % 256 in (1, 2)
        assert all((b - a) % 256 == 1 for a, b in pairwise(numbers))
        last = numbers[-1]
