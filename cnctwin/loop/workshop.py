"""The work of the loop: a case is composed, a job asked for, its result judged; each at most once at a time in this process.

It goes by the files that are there: whoever is started again finds what was done. The work of one machine lies below the folder
whose files the jobs' consumer may read, `<files>/loop/<machine>/`: `<case>/`, and beside it `<case>.composed.json`,
`<case>.finding.json` or `<case>.failed.json`.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cnctwin.files.synced import make_folder
from cnctwin.jobs.attempt import ONE_THREAD
from cnctwin.jobs.durable import read_json
from cnctwin.loop.config import LoopConfig
from cnctwin.loop.state import State, StepName
from cnctwin.loop.world import NO_WORK, Finding, Work
from cnctwin.machines.evidence import Card
from cnctwin.processes.child import die_with_parent
from cnctwin.processes.given_broker import PASSWORD_VARIABLE
from twin.vocabulary.topics import JOB_REPLY

CHILD = (sys.executable, "-m", "cnctwin.loop.child")
REPEAT_S = 2.0
TRIES_MAX = 3
FINDING_BYTES_MAX = 20_000_000
LOG_BYTES_SHOWN = 300
FOLDER = "loop"


@dataclass(frozen=True, slots=True)
class Paths:
    """The files of a case in the folder of its machine."""

    folder: Path
    name: str

    @property
    def case(self) -> Path:
        """The case."""
        return self.folder / self.name

    @property
    def composed(self) -> Path:
        """The account of what it was made of."""
        return self.folder / f"{self.name}.composed.json"

    @property
    def finding(self) -> Path:
        """The finding of its diagnosis."""
        return self.folder / f"{self.name}.finding.json"

    @property
    def failed(self) -> Path:
        """Why nothing came of it."""
        return self.folder / f"{self.name}.failed.json"


@dataclass(frozen=True, slots=True)
class Places:
    """The folders that the work needs.

    store: folder or address of the history; files: below which the jobs' consumer reads; jobs: where it keeps results
    diagnoses: where the page finds them; child: the command of a child
    """

    store: str
    files: Path
    jobs: Path
    diagnoses: Path
    child: Sequence[str] = CHILD


@dataclass(slots=True)
class _Running:
    key: tuple[str, str]
    process: subprocess.Popen[bytes]


@dataclass
class Workshop:
    """See the module. ask, cancel: send a request for a job, or its end, to the broker.

    healthy_ms: when somebody has stated that a machine was healthy
    """

    places: Places
    ask: Callable[[Mapping[str, Any]], bool]
    cancel: Callable[[str], bool]
    healthy_ms: Callable[[str], tuple[int, int] | None] = lambda _: None
    jobs: dict[str, dict[str, Any]] = field(default_factory=dict)
    answers: dict[str, dict[str, Any]] = field(default_factory=dict)
    _running: _Running | None = None
    _tries: dict[tuple[str, str], int] = field(default_factory=dict)
    _asked_s: dict[str, float] = field(default_factory=dict)

    def look(self, machine: str, state: State, description: str, config: LoopConfig) -> Work:
        """Return how the work of a machine's step stands, and have it go on. description: the text that the case is about."""
        if not state.case:
            return NO_WORK
        paths = Paths(self.places.files.resolve() / FOLDER / machine, state.case)
        if (failed := read_json(paths.failed)) is not None:
            return Work(failed=str(failed.get("text", "")))
        order = {"machine": machine, "case": state.case, "folder": str(paths.folder), "description": description}
        if state.step is StepName.COMPOSING:
            if (paths.case / "case.toml").is_file():
                return Work(is_done=True)
            span = {"from_ms": state.span_at_ms[0], "to_ms": state.span_at_ms[1]}
            given: dict[str, Any] = {"programs": config.programs and str(config.programs), "surroundings_c": config.ambient_c}
            healthy_ms = self.healthy_ms(machine)
            given["healthy_ms"] = healthy_ms if healthy_ms is not None and healthy_ms[1] <= state.span_at_ms[0] else None
            return self._done_by_a_child({"do": "compose", "store": self.places.store, **order, **span, **given})
        if (finding := _finding(paths)) is not None:
            return Work(finding=finding)
        return self._diagnosed(machine, state.case, order, config.programs)

    def _diagnosed(self, machine: str, case: str, order: Mapping[str, Any], programs: Path | None) -> Work:
        job = self.jobs.get(case)
        if job is None:
            return self._asked(machine, case)
        told = str(job.get("state"))
        if told == "done":
            result = str(self.places.jobs.resolve() / case / "result")
            filed = {"diagnoses": str(self.places.diagnoses), "programs": programs and str(programs)}
            return self._done_by_a_child({"do": "judge", "result": result, **filed, **order})
        if told in ("failed", "cancelled"):
            return Work(failed=str(job.get("reason") or told))
        share = float(job.get("progress_pct") or 0.0) / 100.0
        waits = f"waits, {job.get('place')}. in the queue" if told == "queued" else str(job.get("doing") or "")
        return Work(doing=waits, progress=min(max(share, 0.0), 1.0))

    def _asked(self, machine: str, case: str) -> Work:
        """Ask for the job under its own id until its state is heard: it is done once."""
        answer = self.answers.get(case) or {}
        if answer.get("answer") == "refused":
            return Work(failed=str(answer.get("reason") or "the job was refused"))
        now_s = time.monotonic()
        if now_s - self._asked_s.get(case, -REPEAT_S) >= REPEAT_S:
            self._asked_s[case] = now_s
            told = {"job": "diagnose", "id": case, "case": f"{FOLDER}/{machine}/{case}", "reply_to": JOB_REPLY + case}
            self.ask({**told, "by": "loop"})
        return Work(doing="no consumer of jobs has answered yet; is `cnctwin jobs run` running?")

    def _done_by_a_child(self, order: Mapping[str, Any]) -> Work:
        """Have a child carry out an order, one at a time for all machines."""
        key = (str(order["case"]), str(order["do"]))
        doing = "the case is composed" if order["do"] == "compose" else "the corrected description is scored on other runs"
        running = self._running
        if running is not None and running.process.poll() is None:
            return Work(doing=doing if running.key == key else "waits for another machine's")
        tries = self._tries[key] = self._tries.get(key, 0) + 1
        folder = Path(str(order["folder"]))
        if tries > TRIES_MAX:
            return Work(failed=f"it was given up after {TRIES_MAX} attempts: {_last_words(folder / 'child.log')}")
        make_folder(folder)
        environment = {**ONE_THREAD, **{name: value for name, value in os.environ.items() if name != PASSWORD_VARIABLE}}
        (folder / "order.json").write_text(json.dumps(order), encoding="utf-8")
        with (folder / "order.json").open("rb") as given, (folder / "child.log").open("wb") as log:
            process = subprocess.Popen(
                self.places.child,
                stdin=given,
                stdout=log,
                stderr=log,
                env=environment,
                preexec_fn=die_with_parent,  # noqa: PLW1509  one prctl call, and we start children from one thread
                start_new_session=True,
            )
        self._running = _Running(key, process)
        return Work(doing=doing)

    def begin(self, machine: str, case: str) -> None:
        """Have a case begun again where it led to nothing before."""
        Paths(self.places.files.resolve() / FOLDER / machine, case).failed.unlink(missing_ok=True)
        self._tries = {key: tries for key, tries in self._tries.items() if key[0] != case}

    def leave(self, case: str) -> None:
        """Have nothing more done for a case: its child ends, its job is cancelled where it waits or runs."""
        if self._running is not None and self._running.key[0] == case and self._running.process.poll() is None:
            self._running.process.kill()
            self._running.process.wait()
        if str((self.jobs.get(case) or {}).get("state")) in ("queued", "running"):
            self.cancel(case)

    def tidy(self, machine: str, kept: str, cases_max: int) -> None:
        """Delete the oldest cases of a machine; `kept`, the present one, stays."""
        folder = self.places.files.resolve() / FOLDER / machine
        cases = sorted((path for path in folder.glob("loop-*") if path.is_dir()), key=lambda path: path.stat().st_mtime)
        for path in [path for path in cases if path.name != kept][: max(len(cases) - cases_max, 0)]:
            shutil.rmtree(path, ignore_errors=True)
            for beside in folder.glob(f"{path.name}.*.json"):
                beside.unlink(missing_ok=True)

    def stop(self) -> None:
        """End the child that runs; it is begun again at the next start."""
        if self._running is not None and self._running.process.poll() is None:
            self._running.process.kill()
            self._running.process.wait()


def _finding(paths: Paths) -> Finding | None:
    told = read_json(paths.finding, FINDING_BYTES_MAX)
    try:
        return None if told is None else Finding(**{**told, "card": Card.model_validate(told["card"])})
    except (TypeError, KeyError, ValidationError):
        return None


def _last_words(log: Path) -> str:
    try:
        return " ".join(log.read_text(errors="replace").split())[-LOG_BYTES_SHOWN:] or "it was killed"
    except OSError:
        return "it was killed"
