"""The outcome of the demo's loop is what the loop told, and what was hidden; what did not come before the end is null."""

import json
from pathlib import Path
from typing import Any

import pytest

from cnctwin.demo.by_itself import ByItself
from cnctwin.demo.loop_outcome import LoopOutcome, LoopWatch
from cnctwin.demo.parts import Demo, DemoOptions
from cnctwin.errors import UsageError
from cnctwin.loop.config import Diagnose, Promote, loop_configuration
from cnctwin.standins.simulated_machine.hidden_effect import choice_of, hidden_effects, sealed_effect
from processors.description import Description
from sparkplug.host import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.cnctwin.page.loop_document import loop


def of(step: str, **more: Any) -> dict[str, Any]:
    return loop("vmc", step, **more)


@pytest.fixture
def sealed(tmp_path: Path) -> Path:
    file = tmp_path / "sealed.json"
    sealed_effect(choice_of(hidden_effects()[0].name), 1, file)
    return file


def test_a_gap_that_closed_is_told_with_the_time_that_it_took(sealed: Path) -> None:
    watch = LoopWatch("vmc", 100.0)
    for at_s, step in ((130.0, "watching"), (200.0, "diagnosing"), (240.0, "shadow"), (270.0, "promoted"), (280.0, "promoted")):
        watch.take(of(step), at_s)
    assert watch.outcome(sealed) == LoopOutcome(
        effect="coolant_cooling",
        on="",
        named=("coolant_cooling",),
        not_told_from=("second_thermal_mass",),
        gap_before=6.1,
        gap_after=1.1,
        promoted=True,
        seconds=170.0,
    )


def test_a_gap_that_is_still_open_after_the_promotion_has_no_seconds(sealed: Path) -> None:
    watch = LoopWatch("vmc", 0.0)
    watch.take(of("shadow"), 10.0)
    watch.take(of("promoted", last={"text": "", "before": 6.1, "after": 1.31, "since": 0}), 20.0)
    found = watch.outcome(sealed)
    assert (found.promoted, found.gap_after, found.seconds) == (True, 1.31, None)


def test_a_promotion_that_was_taken_back_is_none(sealed: Path) -> None:
    watch = LoopWatch("vmc", started_s=0.0)
    watch.take(of("promoted", last={"text": "", "before": 6.1, "after": 0.9, "since": 0}), 20.0)
    watch.take(of("watching", last=None), 30.0)
    outcome = watch.outcome(sealed)
    assert (outcome.promoted, outcome.gap_before, outcome.gap_after, outcome.seconds) == (False, None, None, None)


def test_a_demo_that_ended_before_has_named_nothing(sealed: Path) -> None:
    watch = LoopWatch("vmc", 0.0)
    watch.take(of("watching"), 10.0)
    assert watch.outcome(sealed) == LoopOutcome(effect="coolant_cooling", on="")
    assert watch.outcome(sealed.with_name("nothing.json")) == LoopOutcome()


def test_only_the_machine_of_the_demo_is_listened_to() -> None:
    watch = LoopWatch("vmc", 0.0)
    for machine in ("mill", "vmc/of/another"):
        payload = json.dumps(of("promoted")).encode()
        event = HostEvent(EventKind.PLAIN, NodeId("", ""), None, 0, (), topic=f"cnctwin/loop/{machine}", payload=payload)
        watch.see([event])
    assert watch.text == ""


@pytest.mark.parametrize("diagnose", list(ByItself))
@pytest.mark.parametrize("promote", list(ByItself))
def test_the_loop_is_told_who_goes_on(tmp_path: Path, diagnose: ByItself, promote: ByItself) -> None:
    demo = Demo(DemoOptions(diagnose=diagnose, promote=promote), tmp_path)
    config = tmp_path / "processors.toml"
    config.write_text(demo.settings())
    found = loop_configuration(config).of("vmc")
    assert (found.diagnose is Diagnose.BY_ITSELF) is (diagnose is ByItself.BY_ITSELF)
    assert (found.promote is Promote.BY_RULE) is (promote is ByItself.BY_ITSELF)


@pytest.mark.parametrize("recording", [False, True])
def test_what_the_twin_is_told_can_be_read_and_says_what_is_assumed(tmp_path: Path, recording: bool) -> None:
    file = tmp_path / "rec.txt"
    file.write_text("")
    demo = Demo(DemoOptions(recording=file if recording else None, machine="vmc"), tmp_path)
    demo.describe()
    found = Description.from_toml((tmp_path / "machines" / "vmc.toml").read_text())
    assert bool(found.assumed) is recording
    assert demo.hides is not recording


def test_an_effect_that_does_not_show_is_refused_before_anything_starts(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not show within minutes"):
        Demo(DemoOptions(effect="backlash"), tmp_path)
    assert not Demo(DemoOptions(effect="none"), tmp_path).hides
