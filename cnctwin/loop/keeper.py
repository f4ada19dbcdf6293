"""The keeper of one machine's loop: it looks at the world, takes a step, does what is to be done, and keeps the state.

In that order: what is noted in the log first, then the state, so that a kill in between costs nothing but a second look.
"""

import json
import time
from dataclasses import dataclass
from typing import Any

from cnctwin.errors import ApplicationError
from cnctwin.loop.config import LoopConfig
from cnctwin.loop.cycle import shadow_of, stepped
from cnctwin.loop.document import document_of
from cnctwin.loop.request import Request
from cnctwin.loop.standing import Standing
from cnctwin.loop.state import Answer, State, StepName, read_state
from cnctwin.loop.workshop import Workshop
from cnctwin.loop.world import NOTHING_HEARD, Back, Deed, File, Promote, World
from cnctwin.machines import disk
from cnctwin.machines.change import Change, changing
from cnctwin.machines.evidence import Shadow
from cnctwin.machines.folder import MachineFolder
from cnctwin.machines.planned import keep_planned
from cnctwin.machines.step_log import StepKind, lives
from cnctwin.machines.told import told
from processors.description import version_of
from twin.errors import TwinError

BY = "loop"
KEPT_S = 60.0
"""Between two writes of a state in which nothing but a figure has changed."""
SHADOW_S = 30.0
"""Between two that are kept of a shadow."""
_NOTED = {StepName.COMPOSING: StepKind.COMPOSING, StepName.DIAGNOSING: StepKind.DIAGNOSING, StepName.REFUSED: StepKind.REFUSED}


@dataclass(frozen=True, slots=True)
class Heard:
    """The news of a machine: its standing gap, and its own time by now."""

    standing: Standing = NOTHING_HEARD
    at_ms: int = 0


class Keeper:
    """See the module. `look` raises nothing that concerns one machine only: it says it in the document."""

    def __init__(self, folder: MachineFolder, config: LoopConfig, workshop: Workshop) -> None:
        self._folder, self._config, self._workshop = folder, config, workshop
        self._file = folder.history / "loop.json"
        self.state = read_state(disk.json_of(self._file))
        self._kept_s = 0.0
        self._shadow: Shadow | None = None
        self._seen: tuple[Any, ...] = ()

    def look(self, now_ms: int, heard: Heard, request: Request | None = None) -> dict[str, Any]:
        """Take a step; return the document to be published."""
        own, before = self._folder, self.state
        self._note_what_was_written_by_hand(now_ms)
        world = self._world(now_ms, heard, request)
        state, deed = stepped(self._config, before, world)
        if state.case and state.case != before.case:
            self._workshop.begin(own.machine, state.case)
            self._workshop.tidy(own.machine, state.case, self._config.cases_max)
        if before.case and state.case != before.case:
            self._workshop.leave(before.case)
        self._note(before, state, now_ms)
        if deed is not None:
            state = self._done(deed, state, request, now_ms)
        self._keep(state.now(at_ms=world.at_ms))
        self._keep_shadow(shadow_of(self._config, state, world))
        return document_of(told(own), self.state, heard.standing, world.work)

    def _world(self, now_ms: int, heard: Heard, request: Request | None) -> World:
        own, state = self._folder, self.state
        live, fault = own.live_version(), ""
        steps = own.steps()
        try:
            own.live()
        except TwinError as error:
            live, fault = state.live, str(error)
        step = next((one for one in reversed(steps) if one.makes_live and one.version == live), None)
        waits = own.challenger_version()
        text = disk.text_of(own.version_file(state.of)) or "" if state.case else ""
        return World(
            machine=own.machine,
            now_ms=now_ms,
            at_ms=heard.at_ms or state.at_ms,
            live=live,
            challenger=waits,
            card=own.card(waits),
            live_card=own.card(live),
            live_since_ms=0 if step is None else step.t,
            live_said="" if step is None else f"{step.step} by {step.by}" + (f": {step.why}" if step.why else ""),
            is_first=len(lives(steps)) <= 1,
            fault=fault,
            healthy_until_ms=(self._workshop.healthy_ms(own.machine) or (0, 0))[1],
            standing=heard.standing,
            work=self._workshop.look(own.machine, state, text, self._config),
            request=request,
        )

    def _note_what_was_written_by_hand(self, now_ms: int) -> None:
        """Take the lock only where a file is another one than it was."""
        own = self._folder
        seen = (own.live_version(), own.challenger_version(), own.pending_file.exists())
        if seen != self._seen:
            with changing(own, now_ms):
                pass
            self._seen = (own.live_version(), own.challenger_version(), own.pending_file.exists())

    def _note(self, before: State, state: State, now_ms: int) -> None:
        kind = _NOTED.get(state.step)
        if kind is None or (state.step, state.case) == (before.step, before.case):
            return
        with changing(self._folder, now_ms) as change:
            change.note(kind, "", state.asked_by or BY, state.text, of=state.live, case=state.case or before.case)

    def _done(self, deed: Deed, state: State, request: Request | None, now_ms: int) -> State:
        """Change the folder; return the state with the answer to whoever has asked."""
        try:
            with changing(self._folder, now_ms) as change:
                text, is_done = self._carried_out(deed, change), True
        except (ApplicationError, TwinError) as error:
            text, is_done = str(error), False
        if request is None:
            return state if is_done else state.now(text=text)
        answer = Answer(id=request.id, request=request.word, done=is_done, text=text, t=now_ms)
        return state.answered(answer) if request.id else state

    def _carried_out(self, deed: Deed, change: Change) -> str:
        if isinstance(deed, File):
            finding = deed.finding
            if finding.programs:  # before it is a challenger: the processors take both up together
                keep_planned(self._folder, version_of(finding.toml), {name: tuple(s) for name, s in finding.programs.items()})
            return change.file(finding.toml, finding.card, BY, finding.card.sentence).text
        if isinstance(deed, Promote):
            self._keep_shadow(deed.shadow)
            return change.promote(deed.by, deed.why, deed.version).text
        if isinstance(deed, Back):
            return change.back(deed.by, deed.why, deed.version).text
        return change.withdraw(deed.by, deed.why, deed.version).text

    def _keep(self, state: State) -> None:
        """Write the state down where it is another one; figures alone now and then."""
        names = ("standing", "last", "text", "at_ms")
        figures = {name: getattr(self.state, name) for name in names}
        is_the_same = state.model_copy(update=figures) == self.state
        self.state = state
        now_s = time.monotonic()
        if not is_the_same or now_s - self._kept_s >= KEPT_S:
            self._kept_s = now_s
            disk.put(self._file, json.dumps(state.model_dump(mode="json"), ensure_ascii=False))

    def _keep_shadow(self, shadow: Shadow | None) -> None:
        if shadow is not None and _rounded(shadow) != self._shadow:
            self._shadow = _rounded(shadow)
            disk.put(self._folder.shadow_file, json.dumps(shadow.model_dump(mode="json"), ensure_ascii=False))


def _rounded(shadow: Shadow) -> Shadow:
    """Return a shadow whose time moves seldom, and never short of the least that is wanted."""
    is_enough = shadow.seconds >= shadow.seconds_min
    steps = SHADOW_S * (shadow.seconds // SHADOW_S)
    return shadow.model_copy(update={"seconds": max(steps, shadow.seconds_min) if is_enough else min(steps, shadow.seconds)})
