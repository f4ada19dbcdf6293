"""The folder of a check: its seal, and what was given to each question, so that it goes on where it stopped.

    check.json              seed, salt, drafts; the digest of each answer as it is drawn
    METHOD/case_001.json    what was given, and the answer, which opens once it is given

An answer is in no file before its case is diagnosed.
"""

import json
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cnctwin.blind_check.answer import answers_from_json, answers_json
from cnctwin.blind_check.given import given_of
from cnctwin.blind_check.piece import draft_text
from cnctwin.blind_check.question import Draft
from cnctwin.blind_check.scoring import Judged
from cnctwin.errors import UsageError
from cnctwin.files.sealed import Seal, opened, seal

CHECK = "check.json"
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Kept:
    """A check in its folder. drawn: name of a case → `redraws`, `said`, `digest`, as they are drawn"""

    folder: Path
    seed: int
    salt: str
    drafts: tuple[str, ...]
    drawn: dict[str, Json]

    @property
    def names(self) -> tuple[str, ...]:
        """The cases."""
        return tuple(json.loads(draft)["name"] for draft in self.drafts)

    @property
    def asked(self) -> tuple[str, ...]:
        """The cases that could be drawn."""
        return tuple(name for name in self.names if name in self.drawn and self.drawn[name]["redraws"] is not None)

    @property
    def seal(self) -> str:
        """The digest of the digests of all answers, in the order of the cases; empty until all are drawn."""
        if len(self.drawn) < len(self.drafts):
            return ""
        return seal("\n".join(self.drawn[name]["digest"] for name in self.names), self.salt).seal.digest

    def missing(self, methods: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Yield each case that was drawn, with the methods that have not diagnosed it."""
        for name in self.asked:
            left = tuple(method for method in methods if not self._file(method, name).is_file())
            if left:
                yield name, left

    def keep_drawn(self, name: str, found: Json) -> None:
        """Keep how a question was drawn."""
        self.drawn[name] = found
        self.save()

    def keep_given(self, name: str, answer: Json, given: Mapping[str, Json]) -> None:
        """Keep what was given to a question, by method, with its answer."""
        for method, one in given.items():
            _write(self._file(method, name), {"given": one, "answer": answer})

    def save(self) -> None:
        """Write seed, salt, drafts and what was drawn."""
        whole = {"seed": self.seed, "salt": self.salt, "drafts": self.drafts, "drawn": self.drawn, "seal": self.seal}
        _write(self.folder / CHECK, whole)

    def judged(self, method: str) -> tuple[tuple[Judged, ...], frozenset[str]]:
        """Return the cases that a method has diagnosed, and the states of the program that did.

        Raises SealError where an answer is not the one that was sealed.
        """
        cases, programs = [], set()
        for name in self.asked:
            path = self._file(method, name)
            if path.is_file():
                found = json.loads(path.read_text(encoding="utf-8"))
                (answer,) = answers_from_json(json.dumps(found["answer"]))
                opened(Seal(self.drawn[name]["digest"]), self.salt, answers_json([answer]))
                programs.add(str(found["given"]["program"]))
                cases.append(Judged(answer, given_of(found["given"])))
        return tuple(cases), frozenset(programs)

    def _file(self, method: str, name: str) -> Path:
        return self.folder / method / f"{name}.json"


def begun(folder: Path, seed: int, drafts: Sequence[Draft]) -> Kept:
    """Return the check of these drafts in `folder`, begun there or gone on with. Raises UsageError where it holds another one."""
    texts = tuple(draft_text(draft) for draft in drafts)
    if not (folder / CHECK).is_file():
        kept = Kept(folder, seed, secrets.token_hex(32), texts, {})
        kept.save()
        return kept
    kept = read_kept(folder)
    if (kept.seed, kept.drafts) != (seed, texts):
        there = f"{len(kept.drafts)} cases with seed {kept.seed}"
        raise UsageError(f"{folder}: holds another check, of {there}; name another folder, or ask for that one")
    return kept


def read_kept(folder: Path) -> Kept:
    """Return the check in a folder. Raises UsageError where there is none."""
    try:
        told = json.loads((folder / CHECK).read_text(encoding="utf-8"))
        return Kept(folder, told["seed"], told["salt"], tuple(told["drafts"]), dict(told["drawn"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{folder / CHECK}: holds no blind check: {error}; name the folder of one") from None


def _write(path: Path, content: Json) -> None:
    """Write a file whole, or not at all."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None
