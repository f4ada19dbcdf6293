"""Samples as lines, stamps, and what a server without texts keeps of them."""

from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.memory.store.contract import Appended, Message
from cnctwin.memory.store.influx.codes import CODES
from cnctwin.memory.store.influx.intake import Intake
from cnctwin.memory.store.influx.line_protocol import UnfitTextError, fields, influx_line, tag, tags, victoria_line
from cnctwin.memory.store.influx.pins import Pins
from cnctwin.memory.store.influx.sample_row import SampleRow, SeriesKey
from cnctwin.memory.store.influx.spool import RingLimits, Spool
from cnctwin.memory.store.influx.stamps import AGE_MS, Stamps, digest
from cnctwin.memory.store.influx.vocabulary import TEXTS_MAX, Vocabulary
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.influx.suite import BAD, GOOD, STALE, reading, told

KEY = SeriesKey("m", "cnc/hall", "exec_state")


def row(value: bool | float | str | None, t_us: int = 1_000_000, quality: object = GOOD, reason: str | None = None) -> SampleRow:
    assert quality in {GOOD, STALE, BAD}
    return SampleRow(KEY, None, t_us, value, quality, reason)  # type: ignore[arg-type]


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    spool = Spool(tmp_path, RingLimits(free_bytes_min=0), wall_ms=count(1_000_000).__next__)
    yield spool
    spool.close()


@pytest.mark.parametrize(
    ("sample", "line"),
    [
        (row(0.1), "value=0.1,quality=0"),
        (row(1e22), "value=1e+22,quality=0"),
        (row(5.0, quality=STALE), "held=5.0,quality=1"),
        (row(None, quality=BAD, reason="why"), 'quality=2,reason="why"'),
        (row(False), "value=0.0,flag=false,quality=0"),
        (row(False, quality=STALE), "flag=false,quality=1"),
        (row("FEED_HOLD"), 'value=3.0,text="FEED_HOLD",quality=0'),
        (row("FEED_HOLD", quality=STALE), 'text="FEED_HOLD",quality=1'),
        (row('a "b" \\ c\nd'), 'text="a \\"b\\" \\\\ c\nd",quality=0'),
    ],
)
def test_the_fields_of_a_sample(sample: SampleRow, line: str) -> None:
    assert fields(sample) == line


def test_the_n_th_sample_of_a_millisecond_has_its_own_stamp() -> None:
    second = row(2.0, t_us=1_795_000_000_123_001)
    series = tags(KEY, "mm")
    assert influx_line(series, second, fields(second)) == f"{series} value=2.0,quality=0 1795000000123001000\n"
    assert victoria_line(series, second) == f"{series},nth=1 value=2.0,quality=0 1795000000123000000\n"


def test_texts_flags_and_reasons_are_labels_where_the_server_knows_no_texts() -> None:
    series = tags(KEY, None)
    assert victoria_line(series, row("ACTIVE", reason="")).splitlines() == [
        f"{series} value=0.0,quality=0 1000000000",
        f"{series},text=ACTIVE text=1 1000000000",
        f"{series},reason='' reason=0 1000000000",
    ]
    assert victoria_line(series, row(True)).splitlines()[1] == f"{series},flag=true flag=1 1000000000"


@pytest.mark.parametrize("text", ["", "a\\b", "a\nb", "x" * 501])
def test_what_cannot_be_a_tag_is_said(text: str) -> None:
    with pytest.raises(UnfitTextError, match="cannot be a tag"):
        tag(text)


def test_the_codes_of_texts_stay_what_they_are() -> None:
    assert CODES["exec_state"].index("PROGRAM_COMPLETED") == 7 and CODES["twin/severity"] == ("none", "low", "medium", "high")
    assert CODES["controller_mode"][4] == "EDIT" and CODES["tool_change_source"][1] == "detector"


@settings(max_examples=25)
@given(samples=st.lists(st.tuples(st.integers(0, 40), st.integers(0, 3)), max_size=80), cut=st.integers(0, 80))
def test_stamps_are_the_same_whenever_and_however_often_something_is_told(
    samples: list[tuple[int, int]], cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    spool = Spool(tmp_path_factory.mktemp("ring"), RingLimits(free_bytes_min=0), wall_ms=lambda: 0)
    stamps, numbers = Stamps(spool), dict[tuple[int, int], int]()
    for n, (t_ms, value) in enumerate([*samples, *samples]):
        if n == cut:  # a restart, after a commit
            spool.put([], stamps.take_changed())
            stamps = Stamps(spool)
        given = stamps.number(KEY, t_ms, digest(str(value)), is_stale=False, is_live=False)
        assert (given is None) == ((t_ms, value) in numbers)
        if given is not None:
            numbers[t_ms, value] = given
    for t_ms in {t_ms for t_ms, _ in samples}:
        assert sorted(n for (t, _), n in numbers.items() if t == t_ms) == list(range(len({v for t, v in samples if t == t_ms})))
    spool.close()


def test_old_stamps_go_but_not_the_newest_and_not_the_numbered_ones(spool: Spool) -> None:
    stamps = Stamps(spool)
    for t_ms, value in ((0, "a"), (1, "b"), (1, "c"), (AGE_MS + 10, "d")):
        stamps.number(KEY, t_ms, digest(value), is_stale=False, is_live=False)
    spool.put([], stamps.take_changed())
    stamps.prune()
    assert spool.ask("SELECT ms FROM stamps ORDER BY ms") == [(1,), (AGE_MS + 10,)]


def intake(spool: Spool, *, knows_texts: bool) -> tuple[Intake, list[str]]:
    complaints: list[str] = []
    return Intake(spool, Pins(spool), None if knows_texts else Vocabulary(spool), complaints.append), complaints


def test_few_short_texts_are_kept_as_labels_and_many_are_not(spool: Spool) -> None:
    taking, complaints = intake(spool, knows_texts=False)
    states = [told("m", reading("exec_state", "READY" if n % 2 else "ACTIVE", n)) for n in range(10)]
    assert taking.append(states) == Appended(10, 0, 0)
    assert taking.append([told("m", reading("nc_block", "G1 X1", 0))]) == Appended(0, 0, 1)
    names = [told("m", reading("program", f"O{n}", n)) for n in range(TEXTS_MAX + 10)]
    assert taking.append(names) == Appended(TEXTS_MAX + 1, 0, 9)
    assert "nc_block says too many different ones" in complaints[0]
    again, _ = intake(spool, knows_texts=False)  # a restart does not begin a new vocabulary
    assert again.append([told("m", reading("program", "O1", 99_999))]) == Appended(0, 0, 1)


def test_an_append_that_cannot_be_kept_leaves_nothing_behind(spool: Spool, monkeypatch: pytest.MonkeyPatch) -> None:
    taking, _ = intake(spool, knows_texts=True)
    message = told("m", reading("spindle_rpm", 1, 0))

    def fail(*_: object) -> None:
        raise OSError("no disk")

    with monkeypatch.context() as patch, pytest.raises(OSError, match="no disk"):
        patch.setattr(spool, "put", fail)
        taking.append([message])
    assert taking.append([message]) == Appended(1, 0, 0), "it was never kept, so it is not a repetition"


def test_a_batch_holds_at_most_so_many_samples(spool: Spool) -> None:
    taking, _ = intake(spool, knows_texts=True)
    taking.append([told("m", *(reading("spindle_rpm", n, n) for n in range(12_000)))])
    assert [samples for (samples,) in spool.ask("SELECT samples FROM rows")] == [5000, 5000, 2000]


@settings(max_examples=25)
@given(value=st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=30), st.binary(max_size=4)))
def test_whatever_a_reading_holds_it_is_kept_or_counted(value: object, tmp_path_factory: pytest.TempPathFactory) -> None:
    spool = Spool(tmp_path_factory.mktemp("ring"), RingLimits(free_bytes_min=0), wall_ms=lambda: 0)
    for knows_texts in (True, False):
        taking, _ = intake(spool, knows_texts=knows_texts)
        message: Message = told(f"m{knows_texts}", reading("alarm", value, 0), reading("spindle_rpm", 1, 0), kind=EventKind.BIRTH)
        appended = taking.append([message])
        assert sum(appended) == 2 and appended.stored >= 1
    spool.close()
