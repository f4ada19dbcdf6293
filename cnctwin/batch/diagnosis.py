"""A diagnosis and its files: for the command line, for a job, and for Python."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from cnctwin.files.output import write
from cnctwin.reports.gap.page import report_html
from twin.case import Case
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosed
from twin.machine_toml import machine_to_toml

CORES = 2
FILES = ("diagnosis.json", "report.html", "twin.toml")


def in_threads(case: Case, progress: Callable[[str], None] = lambda _: None) -> Diagnosed:
    """The diagnosis of a case, its axes side by side: the kernels let go of the interpreter."""
    with ThreadPoolExecutor(CORES) as pool:
        return diagnose(case, clock=time.monotonic, progress=progress, side_by_side=pool.map)


def diagnosed_alone(case: Case) -> Diagnosed:
    """The diagnosis of a case by a worker of the blind check, which has one core."""
    return diagnose(case, clock=time.monotonic)


def diagnosis_files(found: Diagnosed, case: str) -> dict[str, str]:
    """Return the text of each file that is written of the diagnosis of a case."""
    return dict(zip(FILES, (found.diagnosis.to_json(), report_html(found, case), machine_to_toml(found.twin)), strict=True))


def write_files(files: Mapping[str, str], folder: Path) -> None:
    """Write these files into a folder, which is made where it is missing. Raises UsageError where that cannot be done."""
    write(lambda: folder.mkdir(parents=True, exist_ok=True), folder)
    for name, text in files.items():
        write(partial((folder / name).write_text, text, encoding="utf-8"), folder / name)
