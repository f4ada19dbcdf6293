"""A change of what belongs to one machine: file a challenger, promote it, go back, withdraw it.

One at a time changes it, under a lock that goes with its process. A change is first written down whole, in `pending.json` of the
machine's history, and then carried out, its last part the removal of that file: who is killed in between leaves the state before,
or one that the next change finishes first. What is done already is not done again: the answer says so, and has no step.
"""

import fcntl
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from cnctwin.errors import UsageError
from cnctwin.files.synced import make_folder
from cnctwin.machines import disk
from cnctwin.machines.disk import FolderError
from cnctwin.machines.evidence import Card, why_not
from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.step_log import Step, StepKind, lives
from processors.description import Description, version_of
from twin.errors import MachineError

BY_HAND = "file"
KEPT = "keep"
"""A mark in a plan: this file stays what it is."""
LOCK_S_MAX = 10.0
_LOOK_S = 0.02


class RefusedError(UsageError):
    """A change that is not to be made, with the reason."""


class Done(NamedTuple):
    """The outcome of a change: the step, None where there was nothing to do, and a sentence."""

    step: Step | None
    text: str


class Change:
    """The changes that whoever holds the lock may make; `changing` hands it out."""

    def __init__(self, of: MachineFolder, now_ms: int) -> None:
        self._of, self._now_ms = of, now_ms

    def file(self, text: str, card: Card, by: str, why: str) -> Done:
        """File a description as the challenger. Raises MachineError where it is none, RefusedError where another one waits."""
        of = self._of
        Description.from_toml(text, f"challenger of {of.machine}")
        version, live, waits = version_of(text), of.live_version(), of.challenger_version()
        if version == live:
            return Done(None, f"{version} is the live description of {of.machine} already")
        if version == waits:
            return Done(None, f"{version} is the challenger of {of.machine} already")
        if waits:
            raise RefusedError(f"{waits} waits as the challenger of {of.machine}; promote or withdraw it first")
        self._keep(version, text)
        disk.put(of.history / f"{version}.json", json.dumps(card.model_dump(mode="json"), ensure_ascii=False, indent=1) + "\n")
        return self._carried_out(self._step(StepKind.FILED, version, by, why), challenger=version)

    def promote(self, by: str, why: str, version: str = "", *, is_forced: bool = False) -> Done:
        """Make the challenger live, or a version of the history. Raises RefusedError where nothing speaks for it but its fit.

        version: which is meant; the challenger where it is empty. is_forced: whatever speaks against it, which the log says
        """
        of = self._of
        live, waits = of.live_version(), of.challenger_version()
        if version and live.startswith(version):
            return Done(None, f"{live} is the live description of {of.machine} already")
        if not version and not waits:
            raise RefusedError(f"{of.machine} has no challenger; name a version of its history, or diagnose its gap")
        wanted = waits if waits.startswith(version) else of.named(version)
        is_challenger = wanted == waits
        description = of.challenger() if is_challenger else Description.from_toml(self._kept(wanted), wanted)
        assert description is not None
        reason = why_not(wanted, live, of.card(wanted), of.shadow())
        if wanted in lives(of.steps()):
            reason = None  # it was live before: a person knows it
        if reason is not None and not is_forced:
            raise RefusedError(f"{wanted} of {of.machine} is not promoted: {reason}; --force with --why does it all the same")
        if is_challenger:
            self._keep(wanted, disk.text_of(of.challenger_file) or "")
        extra = {} if reason is None else {"forced": reason}
        step = self._step(StepKind.PROMOTED, wanted, by, why, **extra, **self._gaps(wanted))
        self._carried_out(step, live=wanted, challenger="" if is_challenger else KEPT)
        return Done(step, f"{wanted} is the live description of {of.machine} now; before it was {live or 'not described'}")

    def back(self, by: str, why: str, version: str = "") -> Done:
        """Make the description before the live one live again; again, the one before that. Raises RefusedError where none was.

        version: the live one that is to go; where another one is live by now, nothing is done
        """
        of = self._of
        live, through = of.live_version(), lives(of.steps())
        if through and live != through[-1]:  # the file is wrong, and processors go on with what they had
            through = (*through, live)
        if version and not live.startswith(version):
            return Done(None, f"{version} is not live any more: {of.machine} has {live or 'no description'}")
        if len(through) < 2:
            raise RefusedError(f"{of.machine} has no description before {live or 'this one'}; there is nothing to go back to")
        target = through[-2]
        Description.from_toml(self._kept(target), target)
        step = self._carried_out(self._step(StepKind.BACK, target, by, why), live=target).step
        more = f"; before it was {through[-3]}" if len(through) > 2 else ", the first that was ever live"
        return Done(step, f"{of.machine} is back at {target}{more}; {live} stays in the history, promote --version takes it up")

    def withdraw(self, by: str, why: str, version: str = "") -> Done:
        """Take the challenger away; it stays in the history. `version`: the one that is meant."""
        of = self._of
        waits = of.challenger_version()
        if not waits or (version and not waits.startswith(version)):
            return Done(None, f"{version or 'no challenger'} does not wait: {of.machine} has {waits or 'no challenger'}")
        self._keep(waits, disk.text_of(of.challenger_file) or "")
        self._carried_out(self._step(StepKind.WITHDRAWN, waits, by, why), challenger="")
        return Done(self._of.steps()[-1], f"{waits} is not the challenger of {of.machine} any more; it stays in the history")

    def note(self, kind: StepKind, version: str, by: str, why: str, **extra: Any) -> Step:
        """Add a step of the loop, which changes no description; the same one is not added twice in a row."""
        step = self._step(kind, version, by, why, **extra)
        last = self._of.steps()[-1:]
        if last and (last[0].step, last[0].version, last[0].why) == (step.step, step.version, step.why):
            return last[0]
        disk.append(self._of.log, step.line)
        return step

    # What makes it whole.

    def finish(self) -> None:
        """Carry out what is written down and was not finished."""
        plan = disk.json_of(self._of.pending_file)
        if plan is not None:
            self._carry_out(plan)

    def note_what_was_written_by_hand(self) -> None:
        """Keep files that somebody has written without us, and note which description they have made live."""
        of = self._of
        through = lives(of.steps())
        live = of.live_version()
        if live and (not through or through[-1] != live) and _is_right(of.live):
            self._keep(live, disk.text_of(of.live_file) or "")
            at_ms = round(of.live_file.stat().st_mtime * 1000)
            why = "the file was written" if through else "the first description"
            step = Step(
                t=at_ms, step=StepKind.DESCRIBED, version=live, by=BY_HAND, why=why, before=through[-1] if through else ""
            )
            disk.append(of.log, step.line)
        if (waits := of.challenger_version()) and not of.version_file(waits).is_file():
            self._keep(waits, disk.text_of(of.challenger_file) or "")
            disk.append(of.log, self._step(StepKind.FILED, waits, BY_HAND, "the file was written").line)

    def _carried_out(self, step: Step, live: str = KEPT, challenger: str = KEPT) -> Done:
        plan = {"step": step.document, "live": live, "from": self._of.live_version(), "challenger": challenger}
        disk.put(self._of.pending_file, json.dumps(plan, ensure_ascii=False))
        self._carry_out(plan)
        return Done(step, f"{step.version} {step.step} for {self._of.machine}")

    def _carry_out(self, plan: dict[str, Any]) -> None:
        """Each part may have been done before. The live file comes before the challenger's: for a moment both are the same, and
        never is there none of what was filed."""
        of = self._of
        step = Step.model_validate(plan["step"])
        if step not in of.steps():
            disk.append(of.log, step.line)
        live, challenger = plan["live"], plan["challenger"]
        if live != KEPT and of.live_version() == plan["from"]:  # else somebody has written it by hand meanwhile
            disk.put(of.live_file, self._kept(live))
        if challenger == "":
            disk.remove(of.challenger_file)
        elif challenger != KEPT and of.challenger_version() != challenger:
            disk.put(of.challenger_file, self._kept(challenger))
        disk.remove(of.pending_file)

    def _step(self, kind: StepKind, version: str, by: str, why: str, **extra: Any) -> Step:
        by, why = _line(by, 200), _line(why, 2000)
        return Step(t=self._now_ms, step=kind, version=version, by=by, why=why, before=self._of.live_version(), **extra)

    def _gaps(self, version: str) -> dict[str, float]:
        card = self._of.card(version)
        told = {} if card is None else {"gap_before": card.gap_before, "gap_after": card.gap_after}
        return {name: gap for name, gap in told.items() if gap is not None}

    def _keep(self, version: str, text: str) -> None:
        file = self._of.version_file(version)
        if not file.is_file():
            disk.put(file, text)

    def _kept(self, version: str) -> str:
        text = disk.text_of(self._of.version_file(version))
        if text is None or version_of(text) != version:
            raise FolderError(f"{self._of.version_file(version)}: is not there, or not what it was; put it back")
        return text


def _is_right(read: Callable[[], object]) -> bool:
    try:
        read()
    except MachineError:
        return False
    return True


@contextmanager
def changing(of: MachineFolder, now_ms: int) -> Iterator[Change]:
    """Hold a machine's lock; finish first what somebody was killed at, and note what was written by hand.

    Raises FolderError where another process stays in it.
    """
    try:
        make_folder(of.history)
        lock = (of.history / "lock").open("ab")
    except OSError as error:
        raise FolderError(f"{of.history}: cannot be written: {error.strerror or error}") from None
    with lock:
        _wait_for(lock.fileno(), of)
        change = Change(of, now_ms)
        change.finish()
        change.note_what_was_written_by_hand()
        yield change


def _wait_for(descriptor: int, of: MachineFolder) -> None:
    deadline_s = time.monotonic() + LOCK_S_MAX
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            if time.monotonic() > deadline_s:
                raise FolderError(f"{of.history}: another process has held it for {LOCK_S_MAX:g} s; try again") from None
            time.sleep(_LOOK_S)
        else:
            return


def _line(text: str, length: int) -> str:
    """Return a text in one line, cut, without what a terminal would obey."""
    return "".join(sign if sign.isprintable() else " " for sign in text)[:length].strip()
