"""What a viewer makes of the nodes on a broker, and how it shows it."""

import io
from typing import Any

import pytest
from rich.console import Console

from cnctwin.plant.screen import ledger_table, line, screen
from cnctwin.plant.view import StageLedger, health, ledgers, machines, text
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.cnctwin.plant.pictures import Pictures, balance, owner


def plant() -> Pictures:
    stale = Reading("spindle_rpm", 3000.0, 1_000, Quality.STALE, "rev/min", None, False)
    machine = {"exec_state": "ACTIVE", "tool_change_active": True, "a_signal_of_its_own": 1, "Device Control/Receipt": None}
    return (
        Pictures()
        .add("twin-thermal", owner(balance(9, 9)), {"vmc": owner({"twin/spindle_temp_c": 24.5})})
        .add("edge-vmc", owner(balance(10, 7, {"unmapped": 3}) | {"health/holes": 2}), {"vmc": owner(machine)})
        .add("edge-old", owner({}, online=False), {"lathe": owner({"spindle_rpm": stale}, online=False)})
    )


def shown(what: Any) -> str:
    console = Console(file=io.StringIO(), width=140)
    console.print(what)
    return str(console.file.getvalue())  # type: ignore[attr-defined]


def test_measured_and_modelled_values_of_a_machine_stand_together_without_what_it_is_commanded_by() -> None:
    lathe, vmc = machines(plant())
    assert (vmc.name, vmc.online) == ("vmc", True)
    assert set(vmc.measured) == {"exec_state", "tool_change_active", "a_signal_of_its_own"}
    assert vmc.twin["twin/spindle_temp_c"].value == 24.5
    assert (lathe.name, lathe.online) == ("lathe", False)


def test_a_machine_is_online_when_its_edge_says_so_whatever_its_twin_says() -> None:
    dead = Pictures().add("edge-vmc", owner({}), {"vmc": owner({"spindle_rpm": 1.0}, online=False)})
    dead.add("twin-thermal", owner({}), {"vmc": owner({"twin/spindle_temp_c": 24.5})})
    assert [machine.online for machine in machines(dead)] == [False]
    alone = Pictures().add("twin-thermal", owner({}), {"vmc": owner({"twin/spindle_temp_c": 24.5})})
    assert [machine.online for machine in machines(alone)] == [False]


def test_only_nodes_with_a_ledger_are_stages_and_edges_come_first() -> None:
    assert [ledger.node for ledger in ledgers(plant())] == ["edge-vmc", "twin-thermal"]
    assert ledgers(plant())[0].reasons == {"unmapped": 3}
    assert health(plant())["edge-vmc"]["holes"].value == 2


BALANCES = {
    "all emitted": (balance(5, 5), True, 0),
    "dropped with a reason": (balance(5, 3, {"late": 2}), True, 0),
    "still held back": (balance(5, 3, buffered=2), True, 0),
    "two are missing": (balance(5, 3), False, 2),
    "one too many": (balance(5, 6), False, -1),
    "dropped without a reason": (balance(5, 3) | {"ledger/dropped": 2}, False, 0),
    "the reasons say more": (balance(5, 3, {"late": 3}) | {"ledger/dropped": 2}, False, 0),
    "a null counts as nothing": (balance(0, 0) | {"ledger/emitted": None}, True, 0),
}


@pytest.mark.parametrize("case", BALANCES)
def test_a_ledger_balances_when_everything_is_accounted_for(case: str) -> None:
    metrics, balances, missing = BALANCES[case]
    (ledger,) = ledgers(Pictures().add("edge-vmc", owner(metrics)))
    assert ledger.balances is balances
    assert ledger.missing == missing


TEXTS = {
    "37.25 %": Reading("load", 37.25001, 0, Quality.GOOD, "%", None, False),
    "yes": Reading("flag", True, 0, Quality.GOOD, None, None, False),
    "no": Reading("flag", False, 0, Quality.GOOD, None, None, False),
    "7": Reading("tool", 7, 0, Quality.GOOD, None, None, False),
    "– (empty)": Reading("tool", None, 0, Quality.BAD, "%", "empty", False),
    "– (bad)": Reading("tool", None, 0, Quality.BAD, None, None, False),
    "12 mm (stale)": Reading("x", 12.0, 0, Quality.STALE, "mm", "the edge is gone", False),
}


@pytest.mark.parametrize("expected", TEXTS)
def test_a_value_is_shown_with_its_unit_and_with_what_is_wrong_with_it(expected: str) -> None:
    assert text(TEXTS[expected]) == expected


def test_the_screen_shows_every_machine_its_twin_and_the_ledgers() -> None:
    view = shown(screen(machines(plant()), ledgers(plant()), "Ctrl-C ends the demo"))
    for expected in ("vmc", "online", "ACTIVE", "spindle_temp_c", "24.5", "lathe", "offline", "stale", "unmapped 3", "Ctrl-C"):
        assert expected in view, expected
    assert view.index("exec_state") < view.index("a_signal_of_its_own"), "the most telling signals come first"


def crowded() -> Pictures:
    own = {f"signal_{number:02d}": number for number in range(40)} | {"exec_state": "ACTIVE", "alarms": "[]"}
    twin = {"twin/stops": '{"no data":{"s":9}}', "twin/basis": "told " * 9, "twin/shift": "early", "twin/spindle_temp_c": None}
    pictures = Pictures().add("edge-vmc", owner(balance(9, 9)), {"vmc": owner(own)})
    for number in range(11):
        pictures.add(f"twin-{number}", owner(balance(9, 5, {"unchanged": 3, "superseded": 1})), {"vmc": owner(twin)})
    return pictures


def test_on_a_terminal_of_forty_rows_the_ledger_of_every_stage_stays_in_sight() -> None:
    rows = shown(screen(machines(crowded()), ledgers(crowded()), "Ctrl-C ends the demo", 40)).rstrip("\n").splitlines()
    assert len(rows) <= 40
    whole = "\n".join(rows)
    for expected in ("exec_state", "edge-vmc", "twin-10", "Ctrl-C", "more signals in a taller terminal"):
        assert expected in whole, expected


def test_values_that_people_read_come_first_and_json_is_left_to_programs() -> None:
    view = shown(screen(machines(crowded()), ledgers(crowded()), "", None))
    assert "no data" not in view and "alarms" not in view
    assert view.index("spindle_temp_c") < view.index("shift") < view.index("basis")


def test_a_name_with_brackets_is_text_and_no_markup() -> None:
    odd = Pictures().add("edge-[/]", owner(balance(1, 1)), {"[/red]": owner({"exec_state": "[/bold]", "[/x]": 1})})
    view = shown(screen(machines(odd), ledgers(odd), "[/note]"))
    for name in ("edge-[/]", "[/red]", "[/bold]", "[/x]", "[/note]"):
        assert name in view


def test_an_empty_plant_says_that_it_waits() -> None:
    assert "waiting for a machine" in shown(screen([], [], ""))
    assert line([], []) == "no machine yet"


def test_a_line_tells_of_the_machine_its_twin_and_what_went_through() -> None:
    told = line(machines(plant()), ledgers(plant()))
    assert "vmc: exec_state ACTIVE, twin/spindle_temp_c 24.5, TOOL CHANGE" in told
    assert told.endswith("[edge-vmc 10, twin-thermal 9]")
    assert "\n" not in told


def test_a_ledger_that_does_not_balance_shows_by_how_much() -> None:
    view = shown(ledger_table([StageLedger("edge-vmc", False, 5, 3, 0, 0, {})]))
    assert "no, +2" in view
    assert "(offline)" in view
