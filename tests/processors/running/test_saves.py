"""The order in which units are saved, and the times."""

from itertools import pairwise

from processors.running.saves import BYTES_A_SECOND, BYTES_AT_ONCE, Saves

SIZE = 2000


def run(saves: Saves, units: list[str], seconds: int) -> list[tuple[float, str]]:
    """All units change all the time; when which was saved."""
    log = []
    for tenth in range(seconds * 10):
        now_s = 1000.0 + tenth / 10
        if tenth % 10 == 0:
            saves.changed(units, now_s)
        for unit in saves.due(now_s):
            saves.saved(unit, SIZE)
            log.append((tenth / 10, unit))
    return log


def test_few_units_are_saved_every_two_seconds() -> None:
    log = run(Saves(), ["a", "b"], 20)
    times = [at_s for at_s, unit in log if unit == "a"]
    assert len(times) == 10
    assert {round(later - earlier, 6) for earlier, later in pairwise(times)} == {2.0}


def test_of_many_units_each_has_its_turn_and_so_many_bytes_a_second_are_saved() -> None:
    units = [f"machine {number}" for number in range(200)]
    seconds = 60
    log = run(Saves(), units, seconds)
    assert seconds * BYTES_A_SECOND * 0.9 <= len(log) * SIZE <= seconds * BYTES_A_SECOND + BYTES_AT_ONCE + SIZE
    ages_s = [later - earlier for unit in units for earlier, later in pairwise([at_s for at_s, name in log if name == unit])]
    assert max(ages_s) <= len(units) * SIZE / BYTES_A_SECOND + 2.0


def test_a_unit_that_is_larger_than_all_that_may_be_saved_at_once_is_saved_all_the_same_and_waits_longer() -> None:
    saves, times = Saves(), []
    for second in range(120):
        saves.changed(["cell"], float(second))
        for unit in saves.due(float(second)):
            saves.saved(unit, 5 * BYTES_AT_ONCE)
            times.append(second)
    assert {later - earlier for earlier, later in pairwise(times)} <= {13, 14, 15, 16}
    assert len(times) >= 7


def test_what_presses_comes_first_and_at_once() -> None:
    saves = Saves()
    saves.changed([f"machine {number}" for number in range(500)], 0.0)
    for unit in saves.due(100.0):
        saves.saved(unit, SIZE)
    saves.press("alarmed", 100.5)
    assert next(saves.due(100.5)) == "alarmed"


def test_what_could_not_be_saved_is_due_again_and_its_age_is_known() -> None:
    saves = Saves()
    saves.changed(["a"], 10.0)
    assert (list(saves.due(12.0)), list(saves.due(13.0)), saves.age_s(13.0)) == (["a"], ["a"], 3.0)
    saves.saved("a", SIZE)
    assert (list(saves.due(14.0)), saves.age_s(14.0), saves.is_saved("a")) == ([], 0.0, True)
    saves.forget("a")
    assert not saves.is_saved("a")


def test_at_the_end_everything_is_saved() -> None:
    saves = Saves()
    units = [f"machine {number}" for number in range(500)]
    saves.changed(units, 0.0)
    assert saves.all() == units
