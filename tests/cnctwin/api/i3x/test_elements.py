"""Element ids: one for each thing, clean whatever a machine is called, and nothing else is taken for one."""

from hypothesis import given
from hypothesis import strategies as st

from cnctwin.api.i3x.elements import PLANT_ID, Place, machine_id, place_of, signal_id
from cnctwin.api.i3x.types import type_of

NAMES = st.text(min_size=1, max_size=60)


@given(NAMES, NAMES)
def test_an_id_leads_back_to_its_machine_and_signal_and_is_clean(machine: str, signal: str) -> None:
    assert place_of(machine_id(machine)) == Place(machine)
    assert place_of(signal_id(machine, signal)) == Place(machine, signal)
    for one in (machine_id(machine), signal_id(machine, signal)):
        assert one.isascii()
        assert one.isprintable()
        assert one == one.strip()


@given(st.text(max_size=60) | NAMES.map(lambda name: f"signal/{name}") | NAMES.map(lambda name: f"machine/{name}"))
def test_what_is_written_otherwise_names_nothing(text: str) -> None:
    place = place_of(text)
    if place is not None:
        ids = {signal_id(*place) if place.signal else machine_id(place.machine) if place.machine else PLANT_ID}
        assert ids == {text}


def test_a_variable_and_a_plc_address_of_any_name_have_a_type_of_their_own() -> None:
    assert [type_of(name).element_id for name in ("plc_mark", "plc_door_open", "variable_parts")] == [
        "type/plc",
        "type/plc",
        "type/variable",
    ]
