"""machine.toml: what describes a machine, and what does not."""

from pathlib import Path

import pytest

from tests.twin.axes import AXIS
from twin.case import read_case
from twin.effects.added import check_effects
from twin.errors import CaseError, MachineError
from twin.machine import machine_from_toml, read_machine
from twin.machine_toml import machine_to_toml
from twin.programs import IntegerWords, Settings, ToolOffset

HEAD = "[machine]\nname = 'a'\n"
WHOLE = (
    HEAD
    + AXIS.format(letter="x", mass=320.0, lead=12.0, gain=0.3)
    + """
[tool]
diameter_mm = 20.0
teeth = 4
tangential_coefficient_n_per_mm2 = 900.0
radial_ratio = 0.4
[uncertainty]
relative = 0.03
"axes.x.mass_kg" = 0.1
[noise]
position_mm = 0.0003
[[effects]]
effect = "gravity"
on = "z"
parameters = { force_n = -310.0 }
"""
)


def test_writing_and_reading_gives_the_same_machine() -> None:
    machine = machine_from_toml(WHOLE)
    assert machine_from_toml(machine_to_toml(machine)) == machine


def test_the_force_of_an_ampere_comes_from_the_screw_or_is_stated() -> None:
    axis = machine_from_toml(WHOLE).axes["x"]
    assert axis.newton_per_command == pytest.approx(1.2 * 2 * 3.141592653589793 / 0.012)
    stated = WHOLE.replace("screw_lead_mm = 12.0\ntorque_constant_nm_per_a = 1.2", "force_per_command_n = 35.15")
    assert machine_from_toml(stated).axes["x"].newton_per_command == 35.15


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "machine is missing"),
        ("[machine", "is not TOML"),
        (HEAD + "[spindle]\nrated_power_kw = -1.0\nefficiency = 0.9", "spindle.rated_power_kw = -1.0: must be above 0"),
        (HEAD + "[spindle]\nrated_power_kw = 1.0\nefficiency = 90.0", "spindle.efficiency = 90.0: must be 1 or less"),
        (WHOLE.replace("mass_kg = 320.0", "mass_kg = nan"), "axes.x.mass_kg"),
        (
            HEAD + "[spindle]\nrated_power_kw = 9.0\nefficiency = 0.9\nidle_power_w = 300.0",
            "spindle.idle_power_w is not known; did",
        ),
        (WHOLE.replace("static_n = 520.0", "static_n = 100.0"), "static_n 100.0 is below coulomb_n 380.0"),
        (WHOLE.replace("screw_lead_mm = 12.0\n", ""), "state either force_per_command_n, or screw_lead_mm"),
        (HEAD + "[control]\nwork_offsets_mm = { G53 = [0.0, 0.0, 0.0] }", "work offset 'G53' is not known"),
        (HEAD + "[control]\nbuilder_m_codes = [13, 3]", "control: builder_m_codes has 3: every control has M3"),
        (HEAD + "[control]\nbuilder_m_code = [13]", "control.builder_m_code is not known"),
        (HEAD + '[control]\ndialect = "mazatrol"', "control: dialect 'mazatrol' is not known; known are .*fanuc"),
        (HEAD + '[control]\ndialect = "fanuc"\nbuilder_m_codes = [29]', "every control has M29"),
        (HEAD + "[control]\nparameters = { V1 = 1.0 }", "parameter 'V1' is not known; names are such as Q1"),
        (HEAD + "[stock]\nmin_mm = [0, 0, 5]\nmax_mm = [1, 1, 5]", "is not below max_mm 5.0 in z"),
    ],
)
def test_a_wrong_description_gets_one_line_with_key_and_value(text: str, complaint: str) -> None:
    with pytest.raises(MachineError, match=complaint) as error:
        machine_from_toml(text, "vmc.toml")
    assert str(error.value).startswith("vmc.toml: ")
    assert "\n" not in str(error.value).removeprefix("vmc.toml: ").strip() or "TOML" in str(error.value)


def test_all_that_is_wrong_is_told_at_once_with_the_nearest_right_name() -> None:
    text = WHOLE.replace("mass_kg = 320.0", "mass_k = 320.0").replace("static_n = 520.0", 'static_n = "much"')
    with pytest.raises(MachineError) as error:
        machine_from_toml(text + "\n[spindel]\n", "vmc.toml")
    head, *lines = str(error.value).split("\n  ")
    assert head == f"vmc.toml: {len(lines)} faults; see docs/reference/machine.md"
    assert lines[:2] == ["axes.x.mass_k is not known; did you mean mass_kg?", "spindel is not known; did you mean spindle?"]
    assert "axes.x.mass_kg is missing" not in lines
    assert [line for line in lines if "static_n" in line] == [
        "axes.x.friction.static_n = 'much': is no number; write one without quotes"
    ]
    assert any(line.startswith("axes.x.friction.static_n") for line in lines)


def test_the_example_of_the_page_is_a_machine() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "machine.md").read_text(encoding="utf-8")
    machine = machine_from_toml(page.split("```toml\n")[1].split("```")[0])
    check_effects(machine)
    assert set(type(machine).model_fields) == machine.model_fields_set, "a section is missing in the example"


def test_a_missing_file_is_named() -> None:
    with pytest.raises(MachineError, match=r"nowhere\.toml: cannot be read"):
        read_machine(Path("nowhere.toml"))


def test_a_case_whose_run_is_missing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(WHOLE)
    case = "[case]\nname = 'c'\nmachine = 'machine.toml'\n[[runs]]\nfile = 'runs/a.parquet'\nkind = 'air'\nrole = 'fit'\n"
    (tmp_path / "case.toml").write_text(case)
    with pytest.raises(CaseError, match=r"runs/a\.parquet is not there"):
        read_case(tmp_path)
    (tmp_path / "case.toml").write_text(case.replace("'air'", "'water'"))
    with pytest.raises(CaseError, match=r"runs\.0\.kind"):
        read_case(tmp_path)


def test_a_folder_without_a_case_says_what_a_case_is(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"a case is a folder with a case\.toml"):
        read_case(tmp_path)


def test_a_control_is_told_in_the_words_of_the_interpreter() -> None:
    """[control] has every setting but the axes, texts beside the program, and the bounds."""
    text = """
[control]
start_mm = [0.0, 0.0, 400.0]
inch = true
work_offsets_mm = { G55 = [1.0, 2.0, 3.0] }
references_mm = [[0.0, 0.0, 400.0]]
integer_words = "increments"
builder_m_codes = [13]
dialect = "fanuc"
parameters = { Q1 = 5.0, R10 = 2.0 }
tool_numbers = { "MILL D10" = 5 }
variables = { 500 = 2.5 }
block_skip = [1]
tool_offsets = { 7 = { length_mm = 100.0, length_wear_mm = -0.1 } }
"""
    machine = machine_from_toml(HEAD + text)
    assert machine.settings == Settings(
        start_mm=(0.0, 0.0, 400.0),
        inch=True,
        work_offsets_mm={"G55": (1.0, 2.0, 3.0)},
        references_mm=((0.0, 0.0, 400.0),),
        integer_words=IntegerWords.INCREMENTS,
        builder_m_codes=frozenset({13}),
        dialect="fanuc",
        parameters={"Q1": 5.0, "R10": 2.0},
        tool_numbers={"MILL D10": 5},
        variables={500: 2.5},
        block_skip=frozenset({1}),
        tool_offsets={7: ToolOffset(length_mm=100.0, length_wear_mm=-0.1)},
    )
    assert machine_from_toml(machine_to_toml(machine)) == machine
    without = {"axes", "programs", "subprograms"} | {name for name in Settings.__dataclass_fields__ if name.endswith("s_max")}
    without |= {"call_depth_max", "bracket_depth_max"}
    assert set(type(machine.control).model_fields) == set(Settings.__dataclass_fields__) - without


def test_a_machine_without_a_control_reads_as_the_interpreter_does_by_itself() -> None:
    assert machine_from_toml(HEAD).settings == Settings()
