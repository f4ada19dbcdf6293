"""Weaving: physics as it stands, with effects, with recordings in place of quantities."""

import pytest

from twin.effects.effect import Effect, On, Parameter
from twin.errors import EffectError
from twin.kernels.generated import in_python
from twin.kernels.weave import quantities, weave
from twin.sites import Site, at


def spring(position_mm: float, stiffness_n_per_mm: float) -> float:
    """A spring."""
    stiffness_n_per_mm = at(Site.MECHANICS, stiffness_n_per_mm)
    force_n = at(Site.DRIVE_FORCE, -stiffness_n_per_mm * position_mm)
    return force_n  # noqa: RET504 - quantities have names


def stiffer(stiffness_n_per_mm: float, factor: float) -> float:
    """As much stiffer."""
    return stiffness_n_per_mm * factor


def counted(force_n: float, calls: float) -> tuple[float, float]:
    """Counts its calls."""
    return force_n, calls + 1.0


def effect(name: str, quantity: str, change: object, states: dict[str, float | str] | None = None) -> Effect:
    """An effect of one parameter."""
    parameter = Parameter("factor", "", 1.0, 0.0, 10.0, 2.0, "of the stiffness")
    changes = {quantity: change}
    return Effect(name, Site.MECHANICS, On.AXIS, (parameter,), changes, ("{a}_torque_a",), "", "", states or {}, says=name)  # type: ignore[arg-type]


def run(woven_body: str, functions: tuple[str, ...], **values: float) -> dict[str, object]:
    """The statements, with these values before them."""
    head = "\n".join(f"{name} = {value!r}" for name, value in values.items())
    return in_python("\n\n".join([*functions, head, woven_body]))


def test_marks_are_found_with_their_sites() -> None:
    assert quantities([spring]) == {"stiffness_n_per_mm": "MECHANICS", "force_n": "DRIVE_FORCE"}


def test_bare_physics_is_the_function_itself() -> None:
    woven = weave([spring])
    assert set(woven.takes) == {"stiffness_n_per_mm", "position_mm"}
    assert "at(" not in woven.body
    assert run(woven.body, (), position_mm=2.0, stiffness_n_per_mm=3.0)["force_n"] == spring(2.0, 3.0)


def test_an_effect_changes_its_quantity_and_brings_its_names_along() -> None:
    woven = weave([spring], [effect("hard", "stiffness_n_per_mm", stiffer)])
    assert "hard__factor" in woven.takes
    assert run(woven.body, woven.functions, position_mm=2.0, stiffness_n_per_mm=3.0, hard__factor=10.0)["force_n"] == -60.0


def test_a_state_of_an_effect_is_set_as_well_as_taken() -> None:
    woven = weave([spring], [effect("count", "force_n", counted, {"calls": 0.0})])
    assert run(woven.body, woven.functions, position_mm=2.0, stiffness_n_per_mm=3.0, count__calls=4.0)["count__calls"] == 5.0


def test_a_replaced_quantity_needs_nothing_upstream_and_takes_no_effect() -> None:
    woven = weave([spring], [effect("count", "force_n", counted, {"calls": 0.0})], ["force_n"])
    assert run(woven.body, (), position_mm=0.0, stiffness_n_per_mm=0.0, recorded__force_n=7.0)["force_n"] == 7.0


def test_a_quantity_that_is_not_marked_cannot_be_replaced() -> None:
    with pytest.raises(EffectError, match="position_mm"):
        weave([spring], replaced=["position_mm"])
