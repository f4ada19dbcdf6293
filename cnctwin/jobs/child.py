"""The process that does one job: `python -m cnctwin.jobs.child FOLDER --attempt N [--files DIR] [--workers N] [--dask ADDRESS]`.

It writes progress.json, what it has in result/, and at its end outcome.json: done, failed (the input is at fault, or we are), or
interrupted (memory, a cluster that is gone: worth another attempt). It ends, with all its processes, when its input closes.
"""

import argparse
import errno
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from cnctwin.errors import ApplicationError, SpreadError
from cnctwin.files.synced import sync
from cnctwin.jobs.durable import EXIT_DISK, write_json
from cnctwin.jobs.files_root import FilesRoot
from cnctwin.jobs.left_over import JOB_VARIABLE, kill, left_over
from cnctwin.jobs.request import read_request
from cnctwin.jobs.work import Bench
from twin.errors import TwinError

NICE = 5
OUT_OF_MEMORY_SCORE = 500
PROGRESS_S = 0.2
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


class Progress:
    """Writes how far it is, a few times a second, so that a reader never sees half of it."""

    def __init__(self, file: Path) -> None:
        self._file, self._told_s = file, 0.0

    def __call__(self, fraction: float, doing: str) -> None:
        """0…1, and what is being done."""
        now_s = time.monotonic()
        if now_s - self._told_s >= PROGRESS_S or fraction >= 1.0:
            self._told_s = now_s
            told = {"fraction": min(max(fraction, 0.0), 1.0), "doing": doing}
            with suppress(OSError):  # progress is not worth a job
                write_json(self._file, told, durable=False)


def attempt(folder: Path, files: FilesRoot, workers: int, dask: str | None) -> dict[str, Any]:
    """Do the job in `folder`; what became of it. Raises OSError where the disk is full."""
    beside, result = folder / "result.new", folder / "result"
    try:
        request = read_request((folder / "request.json").read_bytes())
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir()
        bench = Bench(files, folder, beside, folder / "checkpoint.json", Progress(folder / "progress.json"), workers, dask)
        module, _, function = request.kind.work.partition(":")
        told = getattr(import_module(module), function)(request.parameters, bench)
    except SpreadError as error:
        return {"state": "interrupted", "reason": str(error)}
    except (TwinError, ApplicationError) as error:
        return {"state": "failed", "reason": files.shown(str(error))}
    except MemoryError:
        return {"state": "interrupted", "reason": "the memory was not enough"}
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise
        return {"state": "failed", "reason": files.shown(f"{error.filename or 'a file'}: {error.strerror or error}")}
    except Exception as error:
        traceback.print_exc()
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return {"state": "failed", "reason": f"a fault of ours: {said}; child.log in its folder says where"}
    shutil.rmtree(result, ignore_errors=True)
    beside.rename(result)
    for file in result.iterdir():
        sync(file)
    sizes = {file.name: file.stat().st_size for file in sorted(result.iterdir())}
    return {"state": "done", "result": {**told, "files": sizes}}


def main(arguments: Sequence[str] | None = None) -> int:
    """See the module; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m cnctwin.jobs.child")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--attempt", type=int, required=True)
    parser.add_argument("--files", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--dask")
    given = parser.parse_args(arguments)
    _be_modest()
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    try:
        outcome = attempt(given.folder, FilesRoot(given.files), given.workers, given.dask)
        write_json(given.folder / "outcome.json", {"attempt": given.attempt, **outcome})
    except OSError as error:
        print(f"{given.folder}: {error.strerror or error}", file=sys.stderr)
        return EXIT_DISK
    return 0


def _be_modest() -> None:
    """Give way to what is live; where memory is short, this process is the one to go. Whoever started it says when it ends."""
    with suppress(OSError):  # a supervisor may forbid it
        os.nice(NICE)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(OUT_OF_MEMORY_SCORE), encoding="ascii")
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda _number, _frame: None)  # of a supervisor that asks a whole group to end


def _end_with_parent() -> None:
    while os.read(0, 1):
        pass
    kill(left_over(Path(os.environ.get(JOB_VARIABLE, "/"))), trackers=False)  # those end with us, and clear away
    os._exit(1)


if __name__ == "__main__":
    raise SystemExit(main())
