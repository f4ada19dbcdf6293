"""A case as files: case.toml, machine.toml and the runs, in a folder that appears when it is complete."""

import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from cnctwin.composing.composed import ComposedRun
from cnctwin.errors import UsageError

RUNS, CASE_FILE, MACHINE_FILE = "runs", "case.toml", "machine.toml"


@contextmanager
def complete_or_absent(out: Path) -> Iterator[Path]:
    """Yield a folder to write into, which becomes `out` at the end, in place of a case that was there. Raises UsageError."""
    if out.exists() and not _is_replaceable(out):
        raise UsageError(f"{out}: is there and is no case; give the name of a folder that may be written")
    passing: Path | None = None
    try:
        out.absolute().parent.mkdir(parents=True, exist_ok=True)
        passing = Path(mkdtemp(prefix=f".{out.name}-", dir=out.absolute().parent))
        (passing / RUNS).mkdir()
        passing.chmod(0o755)
        yield passing
        if out.exists():
            old = Path(mkdtemp(prefix=f".{out.name}-", dir=out.absolute().parent))
            out.replace(old / "old")
            passing.replace(out)
            shutil.rmtree(old, ignore_errors=True)
        else:
            passing.replace(out)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from None
    finally:
        if passing is not None and passing.exists():
            shutil.rmtree(passing, ignore_errors=True)


def _is_replaceable(out: Path) -> bool:
    return out.is_dir() and ((out / CASE_FILE).is_file() or not any(out.iterdir()))


def case_toml(name: str, runs: Sequence[ComposedRun], notes: Sequence[str] = (), assumed: Sequence[str] = ()) -> str:
    """Return the text of case.toml.

    >>> from twin.case import RunKind
    >>> run = ComposedRun("runs/a.parquet", RunKind.WARMUP, "fit", "warm-up", 10, 60.0)
    >>> print(case_toml("vmc", [run]), end="")
    [case]
    name = "vmc"
    machine = "machine.toml"
    <BLANKLINE>
    [[runs]]                     # warm-up
    file = "runs/a.parquet"
    kind = "warmup"
    role = "fit"
    """
    lines = [f"# {' '.join(note.split())}" for note in notes]
    lines += ["[case]", f"name = {_text(name)}", f'machine = "{MACHINE_FILE}"']
    lines += [f"assumed = [{', '.join(map(_text, assumed))}]"] if assumed else []
    for run in runs:
        lines += ["", f"[[runs]]                     # {' '.join(run.what.split())}", f"file = {_text(run.file)}"]
        lines += [f'kind = "{run.kind.value}"', f'role = "{run.role}"']
        lines += [f"program = {_text(run.program)}"] if run.program else []
        lines += [f"repeats = {_text(run.repeats)}"] if run.repeats else []
        lines += ["healthy = true"] if run.healthy else []
    return "\n".join(lines) + "\n"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
