"""A hidden effect is drawn from its list, shows in production signals, and stays the same when the machine is started again."""

import json
from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.hidden_effect import HiddenEffect, choice_of, hidden_effects, sealed_effect
from twin.effects.added import check_effects
from twin.effects.catalogue import effect_named

SHOWN = {"spindle_temp_c", "spindle_load_pct", "tool_number"}


@pytest.mark.parametrize("hidden", hidden_effects(), ids=lambda hidden: hidden.name)
def test_each_one_fits_the_machine_and_shows_in_production_signals(hidden: HiddenEffect) -> None:
    effect = effect_named(hidden.effect)
    assert SHOWN & {column.replace("{s}", hidden.on) for column in effect.shows_in}
    for seed in range(5):
        added = choice_of(hidden.name).added(seed)
        ((parameter, (low, high)),) = hidden.size.items()
        assert low <= added.parameters[parameter] <= high
        check_effects(machine_as_built(added))
        assert not effect.is_null(added.parameters)


def test_there_are_at_least_eight_and_a_draw_reaches_all_that_are_found_within_minutes() -> None:
    drawn = [choice_of("random").added(seed) for seed in range(300)]
    names = {(added.effect, added.on) for added in drawn}
    assert names == {(one.effect, one.on) for one in hidden_effects() if one.at_random}
    assert len(hidden_effects()) >= 8 and len(names) >= 4
    assert choice_of("random").added(7) == drawn[7], "a seed draws the same effect again"


def test_a_size_can_be_given() -> None:
    hidden = hidden_effects()[0]
    ((parameter, (low, _)),) = hidden.size.items()
    assert choice_of(f"{hidden.name}:{low}").added(None).parameters[parameter] == low


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gravity", "'gravity' does not show within minutes; choose random or one of "),
        ("", "'' does not show"),
        (f"{hidden_effects()[0].name}:much", "'much' is no size"),
        (f"{hidden_effects()[0].name}:-5", "has to be from"),
    ],
)
def test_what_cannot_be_hidden_is_refused_in_one_line(text: str, said: str) -> None:
    with pytest.raises(UsageError) as refused:
        choice_of(text)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_machine_that_is_started_again_hides_the_same_effect(tmp_path: Path) -> None:
    file = tmp_path / "sealed.json"
    first, sealed = sealed_effect(choice_of("random"), None, file)
    assert sealed_effect(choice_of("random"), None, file) == (first, sealed)
    told = json.loads(sealed.text)
    assert told["added"]["effect"] == first.effect
    assert all(parameter["meaning"] for parameter in told["parameters"].values())


def test_two_machines_with_the_same_effect_show_different_hashes() -> None:
    (_, one), (_, other) = (sealed_effect(choice_of("random"), 7, None) for _ in range(2))
    assert one.text == other.text
    assert one.seal != other.seal, "the salt is drawn, so nobody can try the hashes of all effects"
