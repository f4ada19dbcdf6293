"""The folder of descriptions: what is filed, promoted, taken back, and what a kill between any two writes leaves."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.machines import disk
from cnctwin.machines.change import Change, Done, RefusedError, changing
from cnctwin.machines.evidence import Card, Score, Shadow, why_not
from cnctwin.machines.folder import MachineFolder, described
from cnctwin.machines.step_log import StepKind, lives
from cnctwin.machines.told import told
from processors.description import version_of
from twin.errors import MachineError

T0_MS = 1_795_327_200_000
BETTER = Card(sentence="coolant cools", gap_before=3.1, gap_after=1.1, score=Score(live=3.1, challenger=1.1, runs=2))


@pytest.fixture(scope="module", autouse=True)
def _no_power_cuts() -> Iterator[None]:
    """A process is killed here, not the machine: what was written is there, and to force it to the disk would only take long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


class KilledError(BaseException):
    """The process is gone."""


def text(load_kw: float) -> str:
    return f'[machine]\nname = "vmc"\n[spindle]\nrated_power_kw = {load_kw}\nefficiency = 0.85\n'


A, B, C = (text(kw) for kw in (11.0, 12.0, 13.0))
VA, VB, VC = map(version_of, (A, B, C))


@pytest.fixture
def own(tmp_path: Path) -> MachineFolder:
    """A machine with a live description."""
    return plant(tmp_path)


def plant(folder: Path) -> MachineFolder:
    folder.mkdir(exist_ok=True)
    (folder / "vmc.toml").write_text(A)
    return MachineFolder(folder, "vmc")


def did(own: MachineFolder, make: Callable[[Change], Done], at_s: int = 0) -> Done:
    with changing(own, T0_MS + 1000 * at_s) as change:
        return make(change)


def filed(own: MachineFolder, description: str, card: Card = BETTER) -> Done:
    return did(own, lambda change: change.file(description, card, "loop", "coolant cools"))


def test_a_challenger_is_promoted_with_what_speaks_for_it_and_taken_back(own: MachineFolder) -> None:
    filed(own, B)
    assert (own.live_version(), own.challenger_version()) == (VA, VB)
    assert told(own)["may_promote"] and told(own)["challenger"]["gap_before"] == 3.1
    step = did(own, lambda change: change.promote("anna", "it cools")).step
    assert step is not None and (step.by, step.before, step.version) == ("anna", VA, VB)
    assert (own.live_version(), own.challenger_version()) == (VB, "")
    assert own.live_file.read_text() == B
    did(own, lambda change: change.back("anna", "worse"))
    assert own.live_file.read_text() == A
    assert [one.step for one in own.steps()] == ["described", "filed", "promoted", "back"]


def test_to_go_back_again_leads_one_further_and_then_says_that_there_is_no_more(own: MachineFolder) -> None:
    for description in (B, C):
        filed(own, description)
        did(own, lambda change: change.promote("anna", ""))
    assert "before it was" in did(own, lambda change: change.back("anna", "")).text
    assert own.live_version() == VB
    did(own, lambda change: change.back("anna", ""))
    assert own.live_version() == VA
    with pytest.raises(RefusedError, match="nothing to go back to"):
        did(own, lambda change: change.back("anna", ""))
    assert own.live_version() == VA


def test_what_was_taken_back_can_be_taken_up_again_by_its_version(own: MachineFolder) -> None:
    filed(own, B)
    did(own, lambda change: change.promote("anna", ""))
    did(own, lambda change: change.back("anna", ""))
    did(own, lambda change: change.promote("anna", "", VB[:5]))
    assert own.live_version() == VB


@pytest.mark.parametrize(
    ("again", "says"),
    [
        (lambda change: change.promote("bert", "", VB), "live description of vmc already"),
        (lambda change: change.back("bert", "", VA), "is not live any more"),
        (lambda change: change.withdraw("bert", "", VB), "does not wait"),
        (lambda change: change.file(B, BETTER, "loop", ""), "live description of vmc already"),
    ],
)
def test_what_is_done_already_is_not_done_again_and_says_so(
    own: MachineFolder, again: Callable[[Change], Done], says: str
) -> None:
    filed(own, B)
    did(own, lambda change: change.promote("anna", ""))
    before = own.log.read_text()
    done = did(own, again)
    assert done.step is None and says in done.text
    assert own.log.read_text() == before


def test_nothing_is_promoted_on_the_data_that_it_was_fitted_to(own: MachineFolder) -> None:
    filed(own, B, Card(sentence="coolant cools", gap_before=3.1, gap_after=1.0))
    with pytest.raises(RefusedError, match="no score on runs that it was not fitted to"):
        did(own, lambda change: change.promote("anna", ""))
    assert own.live_version() == VA
    did(own, lambda change: change.promote("anna", "the pump is new", is_forced=True))
    assert own.live_version() == VB
    assert "not fitted to" in own.steps()[-1].document["forced"]


@pytest.mark.parametrize(
    ("shadow", "reason"),
    [
        (Shadow(version=VB, against=VA, seconds=901.0, live={"l": 3.0}, challenger={"l": 1.0}), None),
        (Shadow(version=VB, against=VA, seconds=899.0, live={"l": 3.0}, challenger={"l": 1.0}), "899 of 900 s"),
        (Shadow(version=VB, against=VA, seconds=901.0, live={"l": 1.0}, challenger={"l": 3.0}), "standing gap is 3.00"),
        (Shadow(version=VB, against=VA, seconds=901.0, live={"l": 3.0}, challenger={"t": 1.0}), "no standing gap is known"),
        (Shadow(version=VB, against=VC, seconds=901.0, live={"l": 3.0}, challenger={"l": 1.0}), "has not watched it"),
    ],
)
def test_a_shadow_speaks_for_a_challenger_after_its_time(shadow: Shadow, reason: str | None) -> None:
    found = why_not(VB, VA, None, shadow)
    assert found is None if reason is None else found is not None and reason in found


def test_a_score_that_is_worse_stands_against_any_shadow() -> None:
    shadow = Shadow(version=VB, against=VA, seconds=9000.0, live={"l": 3.0}, challenger={"l": 1.0})
    assert "on 1 run" in (why_not(VB, VA, Card(score=Score(live=1.0, challenger=2.0, runs=1)), shadow) or "")


def test_another_challenger_has_to_wait(own: MachineFolder) -> None:
    filed(own, B)
    with pytest.raises(RefusedError, match="promote or withdraw it first"):
        filed(own, C)


def test_a_file_that_was_written_by_hand_is_noted_and_can_be_taken_back(own: MachineFolder) -> None:
    did(own, lambda change: change.withdraw("", ""))
    own.live_file.write_text(B)
    did(own, lambda change: change.back("anna", ""))
    assert own.live_file.read_text() == A
    assert [(one.step, one.by) for one in own.steps()] == [("described", "file"), ("described", "file"), ("back", "anna")]


def test_a_description_that_is_none_is_not_filed(own: MachineFolder) -> None:
    with pytest.raises(MachineError, match="efficiency"):
        filed(own, A.replace("0.85", "85.0"))
    assert own.challenger_version() == "" and not own.pending_file.exists()


def test_a_wrong_file_is_told_and_hinders_nothing_else(own: MachineFolder) -> None:
    own.live_file.write_text("[machine]\nnome = 'vmc'")
    assert "nome is not known" in told(own)["faults"][0]
    filed(own, B)
    did(own, lambda change: change.promote("anna", ""))
    assert told(own)["faults"] == []


def test_back_leads_out_of_a_wrong_file_to_what_processors_go_on_with(own: MachineFolder) -> None:
    filed(own, B)
    did(own, lambda change: change.promote("anna", ""))
    own.live_file.write_text("[machine]")
    did(own, lambda change: change.back("anna", ""))
    assert own.live_file.read_text() == B
    did(own, lambda change: change.back("anna", ""))
    assert own.live_file.read_text() == A


def test_half_a_line_of_a_power_cut_costs_that_line_alone(own: MachineFolder) -> None:
    filed(own, B)
    with own.log.open("a") as log:
        log.write('{"t": 1795, "st')
    did(own, lambda change: change.promote("anna", ""))
    assert [one.step for one in own.steps()] == ["described", "filed", "promoted"]


def test_machines_that_are_described_are_known_by_their_files(tmp_path: Path) -> None:
    plant(tmp_path)
    (tmp_path / "challengers").mkdir()
    (tmp_path / "challengers" / "okuma.toml").write_text(B)
    (tmp_path / ".vmc.toml.new").write_text("")
    assert described(tmp_path) == ("okuma", "vmc")


CHANGES: dict[str, Callable[[Change], Done]] = {
    "file": lambda change: change.file(C, BETTER, "loop", "two"),
    "promote": lambda change: change.promote("anna", ""),
    "back": lambda change: change.back("anna", "", VB),
    "withdraw": lambda change: change.withdraw("anna", ""),
}


def begun(folder: Path, name: str) -> MachineFolder:
    """A machine for which the change `name` makes sense: it has had A, then B."""
    own = plant(folder)
    filed(own, B)
    did(own, lambda change: change.promote("anna", ""))
    if name in ("promote", "withdraw"):
        filed(own, C)
    return own


def state(own: MachineFolder) -> tuple[str, str, tuple[str, ...]]:
    return own.live_version(), own.challenger_version(), lives(own.steps())


def killed_at(patch: pytest.MonkeyPatch, number: int) -> None:
    """The process is killed when it is about to write for the `number`th time."""
    left = number

    def dying(write: Callable[..., None]) -> Callable[..., None]:
        def one(*arguments: Any) -> None:
            nonlocal left
            left -= 1
            if left < 0:
                raise KilledError
            write(*arguments)

        return one

    for name in ("put", "remove", "append"):
        patch.setattr(disk, name, dying(getattr(disk, name)))


@pytest.mark.parametrize("name", CHANGES)
def test_a_kill_between_any_two_writes_leaves_before_or_after_and_the_next_change_mends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    whole = begun(tmp_path / "whole", name)
    before, kinds = state(whole), len(whole.steps())
    did(whole, CHANGES[name], 1)
    after = state(whole)
    assert after != before
    for number in range(20):
        own = begun(tmp_path / str(number), name)
        with monkeypatch.context() as patch:
            killed_at(patch, number)
            try:
                did(own, CHANGES[name], 1)
                is_through = True
            except KilledError:
                is_through = False
        with changing(own, T0_MS + 2000):
            assert state(own) in (before, after)
        if state(own) == before:
            did(own, CHANGES[name], 3)
        assert state(own) == after
        assert len(own.steps()) == kinds + 1
        assert not own.pending_file.exists()
        if is_through:
            assert number > 2
            return
    pytest.fail("it writes more often than that")


@given(
    st.lists(
        st.tuples(st.sampled_from(["file B", "file C", "promote", "back", "withdraw", "write A", "write C"]), st.integers(0, 8)),
        max_size=8,
    )
)
def test_the_log_and_the_files_agree_whatever_was_done_and_wherever_it_was_killed(
    tmp_path_factory: pytest.TempPathFactory, deeds: list[tuple[str, int]]
) -> None:
    own = plant(tmp_path_factory.mktemp("machines"))
    texts = {"A": A, "B": B, "C": C}
    for at_s, (deed, number) in enumerate(deeds):
        word, _, which = deed.partition(" ")
        if word == "write":
            own.live_file.write_text(texts[which])
            continue
        with pytest.MonkeyPatch.context() as patch:
            killed_at(patch, number)
            try:
                with changing(own, T0_MS + 1000 * at_s) as change:
                    done: dict[str, Callable[[], Done]] = {
                        "file": lambda change=change, which=which: change.file(texts[which], BETTER, "loop", ""),
                        "promote": lambda change=change: change.promote("anna", ""),
                        "back": lambda change=change: change.back("anna", ""),
                        "withdraw": lambda change=change: change.withdraw("anna", ""),
                    }
                    done[word]()
            except (KilledError, RefusedError):
                pass
    with changing(own, T0_MS + 100_000):
        pass
    assert lives(own.steps())[-1] == own.live_version()
    assert not own.pending_file.exists()
    for step in own.steps():
        if step.step is StepKind.PROMOTED:
            assert step.by == "anna" and step.version != step.before
    for version in {step.version for step in own.steps()}:
        assert version_of(own.version_file(version).read_text()) == version
