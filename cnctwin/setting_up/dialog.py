"""Describe who answers: a person (or what is piped in) at plain prompts, or nobody, where the answers are given already."""

import getpass
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from cnctwin.errors import UsageError


class Dialog(Protocol):
    """Asks, and tells how it goes. `is_patient`: an answer that does not work may be given again."""

    is_patient: bool

    def ask(self, question: str, default: str, option: str) -> str:
        """Return the answer; the default where there is none. option: that gives it on the command line."""

    def secret(self, question: str, variable: str) -> str:
        """Return a secret, which is not shown. variable: of the environment, that gives it to a program."""

    def tell(self, text: str) -> None:
        """Say how it goes."""


@dataclass(slots=True)
class Prompts:
    """Plain prompts: they work over ssh, and with answers that are piped in."""

    tell_line: Callable[[str], None]
    is_patient: bool = field(default_factory=sys.stdin.isatty)

    def ask(self, question: str, default: str, option: str) -> str:
        """Return the answer to a prompt."""
        shown = f" [{default}]" if default else ""
        answer = self._read(f"{question}{shown}: ", f"--yes takes what stands in brackets, and {option} gives it", input)
        return answer.strip() or default

    def secret(self, question: str, variable: str) -> str:
        """Return a secret, hidden on a terminal."""
        read = getpass.getpass if sys.stdin.isatty() else input
        return self._read(f"{question}: ", f"${variable} gives it", read).strip()

    def tell(self, text: str) -> None:
        """Print a line."""
        self.tell_line(text)

    def _read(self, prompt: str, way_out: str, read: Callable[[str], str]) -> str:
        try:
            answer = read(prompt)
        except EOFError:
            raise UsageError(f"no answer to '{prompt.rstrip(': ')}', so nothing is written; {way_out}") from None
        if not self.is_patient and read is input:
            print()  # what is piped in has no Enter on the screen
        return answer


@dataclass(slots=True)
class Given:
    """Nobody is asked: what no option says is as it was, or the default."""

    tell_line: Callable[[str], None]
    is_patient: bool = False

    def ask(self, question: str, default: str, option: str) -> str:
        """Return the default."""
        return default

    def secret(self, question: str, variable: str) -> str:
        """Refuse: a secret has no default."""
        raise UsageError(f"{question} is missing; set ${variable}")

    def tell(self, text: str) -> None:
        """Print a line."""
        self.tell_line(text)
