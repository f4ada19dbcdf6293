"""A learned term in machine.toml: what is one, what is not, and back again."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import EffectError, MachineError
from twin.learned.section import LearnedSection
from twin.learned.words import LearnedSite
from twin.machine import machine_from_toml
from twin.machine_toml import machine_to_toml

HEAD = "[machine]\nname = 'a'\n[[effects]]\neffect = 'gravity'\non = 'z'\n[[effects]]\neffect = 'learned'\n"
FORCE = "site = 'axis_force'\non = 'x'\n"
TABLE = "table = { position_mm = [2.5, 0.0], value = [43.0, 1.2], low = [40.1, -0.5], high = [45.9, 2.9] }\n"
FROM_DIAGNOSIS = """
unit = "N"
depends_on = ["position"]
repeats = true
closure = 0.81
closure_low = 0.74
closure_high = 0.86
looks_like = [{ effect = "direction_friction", on = "x", why_not = "it closes 31 %" }]
sentence = "a force on X of +43 N at 2.5 mm"
"""
NUMBERS = st.floats(-1e4, 1e4).map(lambda v: float(f"{v:.6g}"))


def test_learned_terms_stand_apart_from_the_effects_of_the_catalogue() -> None:
    machine = machine_from_toml(HEAD + FORCE + TABLE)
    assert [effect.effect for effect in machine.effects] == ["gravity"]
    assert machine.learned[0].term.value.tolist() == [1.2, 43.0], "in the order of the knots, whatever the order of the rows"


def test_an_entry_of_a_diagnosis_is_kept_as_it_is() -> None:
    machine = machine_from_toml(HEAD + FORCE + FROM_DIAGNOSIS + TABLE)
    assert machine.learned[0].looks_like[0].why_not == "it closes 31 %"
    assert machine_from_toml(machine_to_toml(machine)) == machine


@given(sentence=st.text(max_size=20))
def test_any_sentence_and_run_name_comes_back_from_a_file(sentence: str) -> None:
    table = {"t_s": [0.0, 1e-7], "run": [f"runs/{sentence}", "b"], "value": [0.0, -1e22]}
    section = LearnedSection.model_validate({"site": "axis_force", "on": "x", "table": table, "sentence": sentence})
    machine = machine_from_toml("[machine]\nname = 'a'").model_copy(update={"learned": (section,)})
    assert machine_from_toml(machine_to_toml(machine)) == machine


def test_a_table_is_written_in_one_line() -> None:
    text = machine_to_toml(machine_from_toml(HEAD + FORCE + TABLE))
    assert "table = { position_mm = [2.5, 0.0], value = [43.0, 1.2], low = [40.1, -0.5], high = [45.9, 2.9] }\n" in text


@given(values=st.lists(NUMBERS, min_size=6, max_size=6), row=st.permutations(range(6)))
def test_a_table_over_two_arguments_comes_back_from_a_file(values: list[float], row: list[int]) -> None:
    at = [(position, side) for position in (0.0, 2.5, 7.0) for side in (-1.0, 1.0)]
    table = {"position_mm": [at[i][0] for i in row], "direction": [at[i][1] for i in row], "value": [values[i] for i in row]}
    section = LearnedSection.model_validate({"site": "friction", "on": "x", "table": table})
    assert section.term.value.tolist() == values
    machine = machine_from_toml("[machine]\nname = 'a'").model_copy(update={"learned": (section,)})
    again = machine_from_toml(machine_to_toml(machine))
    assert again == machine
    assert LearnedSection.of(again.learned[0].term).term.value.tolist() == values


def test_a_table_over_the_time_of_runs_is_kept_and_is_no_law() -> None:
    text = HEAD + FORCE + "table = { t_s = [0.0, 0.1, 0.0], run = ['a', 'a', 'b'], value = [0.0, 50.0, 1.0] }"
    section = machine_from_toml(text).learned[0]
    assert section.is_recording
    with pytest.raises(EffectError, match="over the time of a recording"):
        _ = section.term


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("'axis_force'", "'nowhere'", "effects.1.site = 'nowhere': must be 'controller'"),
        ("position_mm", "colour", "effects.1: the learned term at axis_force on x: .* cannot depend on 'colour'"),
        ("[2.5, 0.0]", "[2.5]", "columns of the table have position_mm 1, value 2, low 2, high 2 rows"),
        ("[2.5, 0.0]", "[2.5, nan]", "position_mm of the table is nan in row 2; it has to be a finite number"),
        ("[2.5, 0.0]", "[2.5, 2.5]", "position_mm 2.5 is in the table twice"),
        ("[43.0, 1.2]", "['a', 'b']", "value of the table is 'a' in row 1"),
        ("value = [43.0, 1.2], ", "", "the table has no column value"),
        ("position_mm = [2.5, 0.0], ", "", "the table has 0 argument columns"),
        (
            "position_mm",
            "t_s = [1.0, 2.0], direction",
            "over t_s, direction; one over t_s, the time of a run, is over nothing else",
        ),
        (
            "position_mm = [2.5, 0.0]",
            "position_mm = [2.5, 0.0], direction = [-1.0, 1.0]",
            "no row for position_mm 0, direction -1",
        ),
        ("position_mm = [2.5, 0.0]", "spindle_angle_rad = [0.0, 7.0]", "it has to be in .0, 2π."),
        ("low = [40.1, -0.5]", "run = ['a', 'b']", "a column run, which goes with t_s only"),
        ("table", "depends_on = ['velocity']\ntable", "says that it depends on velocity; its table is over position_mm"),
        ("table", "unit = 'kN'\ntable", "is in kN; a term there is in N"),
        ("table", "colour = 1\ntable", "effects.1.colour is not known"),
    ],
)
def test_what_is_no_learned_term_is_refused_in_one_line(old: str, new: str, complaint: str) -> None:
    with pytest.raises(MachineError, match=complaint) as refused:
        machine_from_toml(HEAD + (FORCE + TABLE).replace(old, new))
    assert "\n" not in str(refused.value)


def test_learned_terms_have_one_place_in_a_file() -> None:
    with pytest.raises(MachineError, match=r'one of \[\[effects\]\], with effect = "learned"'):
        machine_from_toml("[machine]\nname = 'a'\n[[learned]]\n" + FORCE + TABLE)


def test_every_site_has_a_unit_and_a_place() -> None:
    for site in LearnedSite:
        table = {"time_since_start_s": [0.0], "value": [1.0]}
        assert LearnedSection.of(LearnedSection.model_validate({"site": site, "table": table}).term).unit
