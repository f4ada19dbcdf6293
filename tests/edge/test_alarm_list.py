"""Alarms as a JSON list that always fits."""

import json

from hypothesis import given
from hypothesis import strategies as st

from edge.alarm_list import ListedAlarm, alarms_text
from edge.reading import TEXT_LENGTH_MAX
from twin.vocabulary.signals import ALARM_FIELDS

_TEXTS = st.none() | st.text(max_size=600)
_ALARMS = st.lists(
    st.builds(ListedAlarm, code=_TEXTS, text=_TEXTS, severity=_TEXTS | st.integers(1, 1000), since=_TEXTS), max_size=40
)


@given(_ALARMS, st.booleans())
def test_any_alarms_make_a_list_of_all_fields_that_fits(alarms: list[ListedAlarm], newest_last: bool) -> None:
    text = alarms_text(alarms, newest_last=newest_last)
    rows = json.loads(text)
    assert len(text) <= TEXT_LENGTH_MAX
    assert all(tuple(row) == ALARM_FIELDS for row in rows)


def test_what_has_no_room_is_counted_and_the_newest_of_a_history_stay() -> None:
    alarms = [ListedAlarm(str(number), "x" * 400) for number in range(40)]
    active, history = json.loads(alarms_text(alarms)), json.loads(alarms_text(alarms, newest_last=True))
    assert (active[0]["code"], history[-1]["code"]) == ("0", "39")
    assert active[-1]["text"] == f"{40 - len(active) + 1} more, for which there is no room"
    assert history[0]["text"] == f"{40 - len(history) + 1} more, for which there is no room"
