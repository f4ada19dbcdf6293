"""Pieces of the check: a question drawn, and a question diagnosed. JSON text in and out, as `cnctwin.jobs.spread` takes them.

Drawing is deterministic, so the answer to a question is drawn again where its case is diagnosed, and held against its seal.
"""

import hashlib
import importlib
import json
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import twin
from cnctwin.blind_check.answer import Answer, answers_json
from cnctwin.blind_check.case_folder import answer_of, check_runs, write_case
from cnctwin.blind_check.question import Draft, Question, Sort, question_of
from cnctwin.blind_check.unseen import closure_on_unseen
from cnctwin.files.sealed import Seal, opened, seal
from twin.case import Case, read_case
from twin.gap.diagnosis import Diagnosed
from twin.machine import machine_from_toml
from twin.machine_toml import machine_to_toml

Diagnose = Callable[[Case], Diagnosed]
REDRAWS_MAX = 5
KEPT = ("verdict", "sentence", "causes", "gap", "subsystems", "constants", "learned", "not_identifiable")
"""The keys of a `diagnosis.json` that are kept: those that are scored, and the sentence."""


def draft_text(draft: Draft) -> str:
    """Return a draft as JSON."""
    return json.dumps(asdict(draft), sort_keys=True)


def draft_of(text: str) -> Draft:
    """Return the draft of a JSON text.

    >>> draft_of(draft_text(Draft("case_001", Sort.SINGLE, 5, "backlash"))).sort
    <Sort.SINGLE: 'single'>
    """
    told = json.loads(text)
    return Draft(**{**told, "sort": Sort(told["sort"])})


def drawn(text: str) -> str:
    """Draw the question of a draft, again with a later seed where it cannot be drawn or recorded.

    text: `draft`, `salt`. The answer: `redraws`, null where none could be drawn; `said`, why each of them could not; `digest`.
    """
    told = json.loads(text)
    draft, said = draft_of(told["draft"]), list[str]()
    for redraws in range(REDRAWS_MAX + 1):
        question = question_of(draft, redraws)
        try:
            answer = answer_of(question)
            check_runs(question, answer)
        except Exception as error:
            said.append(_in_one_line(error))
            continue
        digest = seal(answers_json([answer]), told["salt"]).seal.digest
        return json.dumps({"redraws": redraws, "said": said, "digest": digest})
    return json.dumps({"redraws": None, "said": said, "digest": ""})


def judged(text: str) -> str:
    """Write the case of a question, have it diagnosed, and measure each twin on runs that no diagnosis had.

    text: `draft`, `redraws`, `salt`, `digest`, `methods` (name → `module:function` of a case). The answer: that to the question,
    and what was given by method. Raises SealError where the answer is not the one that was sealed.
    """
    told = json.loads(text)
    question = question_of(draft_of(told["draft"]), told["redraws"])
    answer = answer_of(question)
    sealed = opened(Seal(told["digest"]), told["salt"], answers_json([answer]))
    with tempfile.TemporaryDirectory(prefix="blind-check-") as root:
        folder = Path(root) / question.name
        write_case(folder, question, answer)
        given = {name: _given(folder, named(method), question, answer) for name, method in told["methods"].items()}
    return json.dumps({"answer": json.loads(sealed), "given": given})


def named(method: str) -> Diagnose:
    """Return the function `module:function`."""
    module, _, function = method.partition(":")
    found: Diagnose = getattr(importlib.import_module(module), function)
    return found


def diagnosed(folder: Path, diagnose: Diagnose) -> tuple[dict[str, Any], str]:
    """Return what is kept of the diagnosis of a folder, and its twin as TOML; empty where it failed."""
    begin = time.perf_counter()
    try:
        found = diagnose(read_case(folder))
        said = json.loads(found.diagnosis.to_json())
        twin_text = machine_to_toml(found.twin)
    except Exception as error:
        return {"failed": _in_one_line(error), "seconds": time.perf_counter() - begin, "diagnosis": {}}, ""
    kept = {key: said[key] for key in KEPT if key in said}
    return {"failed": "", "seconds": time.perf_counter() - begin, "diagnosis": kept}, twin_text


def _given(folder: Path, diagnose: Diagnose, question: Question, answer: Answer) -> Mapping[str, Any]:
    given, twin_text = diagnosed(folder, diagnose)
    return given | {"closure_unseen": _closure(question, answer, twin_text), "program": program()}


def _closure(question: Question, answer: Answer, twin_text: str) -> float | None:
    """Return the closure on the runs that no diagnosis had; 0 where the twin cannot even run them, None where none was asked."""
    if not twin_text or not answer.effects:
        return None
    try:
        return closure_on_unseen(question, answer, machine_from_toml(twin_text))
    except Exception:
        return 0.0


@cache
def program() -> str:
    """Return eight digits that stand for the source of the twin: cases that another state of it diagnosed are told apart."""
    root = Path(str(twin.__file__)).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:8]


def _in_one_line(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
