"""Every fault of a file is one line with the nearest right name, wherever in the model it is."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, RootModel, ValidationError

from twin.vocabulary.faults import FAULTS_MAX, faults_of, report, unknown


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Axis(Strict):
    mass_kg: float = Field(gt=0.0)
    lead_mm: float | None = None
    friction_n: Annotated[float, Field(ge=0.0)] | tuple[float, float] = 0.0


class Mail(Strict):
    type: Literal["mail"]
    address: str


class Hook(Strict):
    type: Literal["hook"]
    url: str


class Plant(Strict):
    name: str = "vmc"
    from_: str = Field(default="", alias="from")
    axes: dict[str, Axis] = {}
    shifts: tuple[Axis, ...] = ()
    receivers: dict[str, Annotated[Mail | Hook, Field(discriminator="type")]] = {}
    spare: Axis | None = None


class Users(RootModel[dict[str, Mail]]):
    pass


def lines(model: type[BaseModel], value: Any, **options: Any) -> list[str]:
    with pytest.raises(ValidationError) as wrong:
        model.model_validate(value)
    return faults_of([dict(fault) for fault in wrong.value.errors()], model, **options)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({"nam": "x"}, ["nam is not known; did you mean name?"]),
        ({"fron": "x"}, ["fron is not known; did you mean from?"]),
        ({"zzz": 1}, ["zzz is not known; known are axes, from, name, receivers, shifts, spare"]),
        ({"axes": {"x": {"mass_kg": 1, "lead_m": 2}}}, ["axes.x.lead_m is not known; did you mean lead_mm?"]),
        ({"shifts": [{"mass": 1}]}, ["shifts.0.mass is not known; did you mean mass_kg?"]),
        ({"spare": {"mass_kg": 0}}, ["spare.mass_kg = 0: must be above 0"]),
        (
            {"spare": {"mass_kg": 1, "friction_n": "much"}},
            ["spare.friction_n = 'much': is no number; write one without quotes"],
        ),
        ({"spare": 3}, ["spare = 3: must be a table"]),
        ({"receivers": {"a": {"type": "hook", "ulr": "x"}}}, ["receivers.a.hook.ulr is not known; did you mean url?"]),
        ({"receivers": {"a": {"url": "x"}}}, ["receivers.a.type is missing"]),
        ({"receivers": {"a": {"type": "hok"}}}, ["receivers.a.type = 'hok' is not known; did you mean hook?"]),
    ],
)
def test_a_fault_names_its_place_and_the_nearest_right_name(value: dict[str, Any], said: list[str]) -> None:
    assert lines(Plant, value) == said


def test_a_model_around_a_mapping_knows_the_names_below_it() -> None:
    assert lines(Users, {"ada": {"type": "mail", "adress": "x"}})[0] == "ada.adress is not known; did you mean address?"


def test_values_are_shown_as_the_caller_says_or_not_at_all() -> None:
    wrong = {"axes": {"x": {"mass_kg": "secret"}}}
    assert "'secret'" in lines(Plant, wrong)[0]
    assert lines(Plant, wrong, shown=None) == ["axes.x.mass_kg: is no number; write one without quotes"]
    assert len(lines(Plant, {"axes": {"x": {"mass_kg": "s" * 5000}}})[0]) < 200


def test_a_report_is_one_line_for_one_fault_and_bounded_for_many() -> None:
    assert (
        report("a.toml", [unknown("nam", "nam", ["name"])], "docs/reference/machine.md")
        == "a.toml: nam is not known; did you mean name? See docs/reference/machine.md"
    )
    many = report("a.toml", [f"k{n} is missing" for n in range(3 * FAULTS_MAX)]).split("\n")
    assert many[0] == f"a.toml: {3 * FAULTS_MAX} faults"
    assert len(many) == FAULTS_MAX + 2 and many[-1] == f"  and {2 * FAULTS_MAX} more"
