"""The commands of a page, run as a reader runs them, and what they print compared with what the page shows.

A fenced block `console` holds lines `$ command`, each followed by what it prints, where `…` is anything in a line, and alone in a
line any number of lines. A comment in front of a block, which no reader sees, says what is not plain:

    <!-- keeps running -->      it is another terminal's, ends with the page, and has printed so far what is shown
    <!-- until shown -->        run again until it prints what is shown
    <!-- exit 1 -->             ends with this code; `until shown, exit 1` is both
    <!-- file NAME -->          the block of any language is what the reader writes into a file
"""

import os
import re
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"(?:<!-- ([^\n]*?) -->\n+)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PORTS = ("1883", "5000", "8080")
"""Ports that pages use; a run takes free ones, so that runs can be side by side."""
PATIENCE_S = 570.0


@dataclass(frozen=True)
class Step:
    """A command of a page, or a file that its reader writes."""

    text: str
    shown: str = ""
    note: str = ""

    @property
    def file(self) -> str:
        """The name of the file that this writes; empty for a command."""
        return self.note.removeprefix("file ") if self.note.startswith("file ") else ""


def steps(page: str) -> list[Step]:
    """Return what the reader of a page does, in order."""
    found = []
    for note, language, body in BLOCK.findall(page):
        if note.startswith("file "):
            found.append(Step(body, note=note))
        elif language == "console":
            for command, shown in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", body, re.MULTILINE):
                found.append(Step(command, shown, note))
    return found


def fits(shown: str, printed: str, *, so_far: bool = False) -> bool:
    """Return True where a command printed what a page shows; `so_far`: it may have printed more after that."""
    pattern = ""
    for line in shown.strip().splitlines():
        if line.strip() == "…":
            pattern += r"(?:.*\n)*?"
        else:
            pattern += re.escape(" ".join(line.split())).replace("…", ".*?") + r"\n"
    plain = "".join(" ".join(line.split()) + "\n" for line in printed.strip().splitlines())
    return re.match(pattern + ("" if so_far else r"\Z"), plain) is not None


class Terminals:
    """A reader's terminals in one folder: the one in which commands end, and one for each that keeps running."""

    def __init__(self, folder: Path, environment: dict[str, str], ports: dict[str, str]) -> None:
        self._folder, self._environment, self._ports = folder, {**os.environ, **environment}, ports
        self._running: list[subprocess.Popen[bytes]] = []

    def do(self, step: Step) -> None:
        """Do a step; an AssertionError where it prints something else."""
        text, shown = self._here(step.text), self._here(step.shown)
        if step.file:
            (self._folder / step.file).write_text(text, encoding="utf-8")
        elif step.note == "keeps running":
            self._keep(text, shown)
        else:
            deadline = time.monotonic() + PATIENCE_S
            code = int(found[1]) if (found := re.search(r"exit (\d+)", step.note)) else 0
            again = step.note.startswith("until shown")
            while not (same := self._end(text, shown, code)) and again and time.monotonic() < deadline:
                time.sleep(1.0)
            assert same, f"$ {text}\n{self.printed}\ninstead of\n{shown}"

    def close(self) -> None:
        """Press Ctrl-C in each terminal that is still busy."""
        running = [process for process in self._running if process.poll() is None]
        for process in reversed(running):
            os.killpg(process.pid, signal.SIGINT)
        for process in running:
            try:
                process.wait(30.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def _here(self, text: str) -> str:
        for port, free in self._ports.items():
            text = re.sub(rf"\b{port}\b", free, text)
        return text

    def _end(self, command: str, shown: str, code: int) -> bool:
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self._folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        self.printed = f"{done.stdout}{done.stderr}(exit {done.returncode})"
        return done.returncode == code and fits(shown, done.stdout + done.stderr)

    def _keep(self, command: str, shown: str) -> None:
        said = self._folder / f".terminal-{len(self._running)}"
        with said.open("wb") as out:
            process = subprocess.Popen(
                ["bash", "-c", command],
                cwd=self._folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._running.append(process)
        deadline = time.monotonic() + PATIENCE_S
        while not fits(shown, said.read_text(), so_far=True):
            assert process.poll() is None, f"$ {command}\nended with\n{said.read_text()}"
            assert time.monotonic() < deadline, f"$ {command}\n{said.read_text()}\ninstead of\n{shown}"
            time.sleep(0.2)
