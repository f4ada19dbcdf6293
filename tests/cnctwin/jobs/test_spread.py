"""Pieces of a job give one answer, in this process, in others, and on a Dask cluster; also where workers are killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cnctwin.errors import SpreadError, UsageError
from cnctwin.jobs import spread as spreading
from cnctwin.jobs.piece import name_of, opened, run_piece
from cnctwin.jobs.spread import spread_over
from tests.cnctwin.jobs import pieces
from tests.cnctwin.program import is_alive, until
from tests.recordings import PROJECT
from twin.errors import TwinError

TESTS = ("tests",)


def squares(answers: list[str]) -> list[int]:
    return [json.loads(answer)["square"] for answer in answers]


def processes(answers: list[str]) -> set[int]:
    return {json.loads(answer)["process"] for answer in answers}


def test_in_this_process_and_in_two_others_the_answers_are_the_same_and_in_order(tmp_path: Path) -> None:
    texts = [json.dumps([number, str(tmp_path), 0.02]) for number in range(8)]
    with spread_over() as spread:
        here = list(spread(pieces.squared, texts))
    (tmp_path / "there").mkdir()
    texts = [json.dumps([number, str(tmp_path / "there"), 0.02, 2]) for number in range(8)]
    with spread_over(workers=2, packages=TESTS) as spread:
        there = list(spread(pieces.squared, texts))
        assert list(spread(pieces.squared, [])) == []
    assert squares(here) == squares(there) == [number**2 for number in range(8)]
    assert len(processes(here)) == 1
    assert len(processes(there)) == 2
    assert processes(here).isdisjoint(processes(there))


def test_a_process_that_is_killed_costs_time_and_no_answer(tmp_path: Path) -> None:
    with spread_over(workers=2, packages=TESTS) as spread:
        answers = [json.loads(one) for one in spread(pieces.deadly, [json.dumps([str(tmp_path), 2])] * 3)]
    assert answers == [2, 2, 2]


def test_a_piece_that_kills_each_process_is_given_up_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spreading, "DEATHS_MAX", 1)
    lost = r"piece 1 of 1 was lost 2 times, since worker processes were killed; is the memory enough for 2 workers\?"
    with spread_over(workers=2, packages=TESTS) as spread, pytest.raises(SpreadError, match=lost):
        list(spread(pieces.deadly, [json.dumps([str(tmp_path), 99])]))


def test_processes_do_not_outlive_who_is_killed(tmp_path: Path) -> None:
    program = (
        "import json; from tests.cnctwin.jobs import pieces; from cnctwin.jobs.spread import spread_over\n"
        f"texts = [json.dumps([number, {str(tmp_path)!r}, 30.0]) for number in range(2)]\n"
        "with spread_over(workers=2, packages=('tests',)) as spread: list(spread(pieces.squared, texts))"
    )
    starter = subprocess.Popen([sys.executable, "-c", program], cwd=PROJECT, stderr=subprocess.DEVNULL)
    until(lambda: len(list(tmp_path.iterdir())) == 2, "both have begun")
    begun = {int(mark.name.partition("-")[2]) for mark in tmp_path.iterdir()}
    for process in begun:
        os.kill(process, signal.SIGINT)  # as Ctrl-C in a terminal does
    time.sleep(0.1)
    assert all(map(is_alive, begun)), "what Ctrl-C does is for the one that started them to say"
    starter.kill()
    starter.wait()
    until(lambda: not any(map(is_alive, begun)), "both have ended")


@pytest.mark.parametrize("function", [pieces.refused, pieces.unknown_machine])
def test_what_is_wrong_with_the_input_is_said_as_it_would_be_here(function: object) -> None:
    assert callable(function)
    with pytest.raises(TwinError) as here:
        function('"I and J"')
    with pytest.raises(TwinError) as there:
        opened(run_piece(name_of(function, TESTS), '"I and J"'), 1)
    assert str(there.value) == str(here.value)


def test_an_error_comes_back_from_another_process_and_the_next_pieces_run() -> None:
    with spread_over(workers=2, packages=TESTS) as spread:
        with pytest.raises(TwinError, match="line 7: G2: a bow without I and J"):
            list(spread(pieces.refused, ['"I and J"', '"K"']))
        with pytest.raises(SpreadError, match=r"piece 2 failed: ZeroDivisionError: division by zero \(.*pieces.py:\d+\)"):
            list(spread(pieces.broken, ["[1]", "[]"]))
        first = iter(spread(pieces.squared, [f"[{number}]" for number in range(9)]))
        assert squares([next(first)]) == [0]
        del first  # nobody wants the others
        assert squares(list(spread(pieces.squared, ["[3]"]))) == [9]


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda text: text, "only functions of sparkplug, twin, edge, processors, cnctwin are"),
        (json.dumps, "json:dumps cannot be spread: only functions of"),
        (pieces.squared, "tests.cnctwin.jobs.pieces:squared cannot be spread: only functions of"),
    ],
)
def test_only_what_any_process_finds_again_is_sent(function: object, said: str) -> None:
    assert callable(function)
    with spread_over(workers=2) as spread, pytest.raises(SpreadError, match=said):
        list(spread(function, ["1"]))


def test_an_answer_of_another_version_is_none() -> None:
    envelope = json.loads(run_piece("tests.cnctwin.jobs.pieces:squared", "[2]")) | {"version": "0.0.9"}
    with pytest.raises(
        SpreadError, match=r"piece 4 was computed by cnctwin 0\.0\.9, and this is .*; install the same everywhere"
    ):
        opened(json.dumps(envelope), 4)


def test_no_workers_are_refused() -> None:
    with pytest.raises(UsageError, match="0 workers compute nothing"), spread_over(workers=0):
        pass
