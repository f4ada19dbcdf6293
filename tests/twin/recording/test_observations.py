"""Lines of the recordings, whole and broken."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.recordings import recording
from twin.errors import RunLogError
from twin.recording.observations import last_values, read_observations


@pytest.mark.parametrize(
    "broken", ["2017", "20175", "2017-02-01T13:59:35.1Z|Block_Number|", "yesterday|Feed_Rate|1", "|||", "a|b|c"]
)
def test_a_line_that_is_cut_off_or_has_no_value_is_dropped_and_counted(broken: str) -> None:
    read = read_observations(f"2017-02-01T13:59:35.1093750Z|Block_Number|12\n{broken}\n")
    assert (len(read.rows), read.dropped) == (1, 1)


def test_times_have_any_number_of_digits_and_come_in_order() -> None:
    read = read_observations("1970-01-01T00:00:02.1234567Z|b|2\n1970-01-01T00:00:01Z|a|1\n1970-01-01T00:00:01.5Z|a|3\n")
    assert [row.t_s for row in read.rows] == pytest.approx([1.0, 1.5, 2.1234567])
    assert last_values(read.rows) == {"a": "3", "b": "2"}


def test_what_holds_no_observation_is_refused_by_name() -> None:
    with pytest.raises(RunLogError, match=r"plate\.txt"):
        read_observations("2017\n\n", "plate.txt")


@given(st.lists(st.text(alphabet=st.characters(blacklist_categories=("Cs",)), max_size=40), max_size=10))
def test_no_text_is_too_broken_to_be_read(lines: list[str]) -> None:
    sound = "2017-02-01T13:59:35Z|Feed_Rate|1"
    assert len(read_observations("\n".join([*lines, "", sound])).rows) >= 1


def test_each_plate_but_the_first_has_one_truncated_line() -> None:
    first, second = (read_observations(recording(f"nist/plate/Plate-Hurco04-{n}of20.txt").read_text()) for n in ("01", "13"))
    assert first.dropped == 0
    assert second.dropped == 2  # and one value that is missing
