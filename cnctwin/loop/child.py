"""The heavy parts of the loop, each in a process that may be killed: `python -m cnctwin.loop.child`, its order on stdin.

compose: writes the case, and what it is made of beside it; judge: writes what a diagnosis has led to, and files it for the page.
What comes out is there as a whole or not at all; what is there already is not made again.
"""

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.files.synced import make_folder
from cnctwin.jobs.durable import write_json
from cnctwin.loop.workshop import Paths
from twin.errors import TwinError

FILED = ("diagnosis.json", "report.html")


def compose(order: Mapping[str, Any], paths: Paths) -> None:
    """Write the case of a stretch of history. Raises ApplicationError, TwinError."""
    from cnctwin.composing.compose import compose as composed  # noqa: PLC0415  with all of the twin
    from cnctwin.memory.store.opening import open_store  # noqa: PLC0415

    if not (paths.case / "case.toml").is_file():
        store = open_store(order["store"])
        try:
            programs, healthy = order.get("programs"), order.get("healthy_ms")
            done = composed(
                store,
                order["machine"],
                order["description"],
                paths.case,
                span_ms=(order["from_ms"], order["to_ms"]),
                healthy_ms=None if healthy is None else (healthy[0], healthy[1]),
                programs=None if programs is None else Path(programs),
                ambient_c=order.get("surroundings_c"),
            )
        finally:
            store.close()
        write_json(paths.composed, done.as_json())


def judge(order: Mapping[str, Any], paths: Paths) -> None:
    """Write what a diagnosis has led to. Raises ApplicationError, TwinError."""
    from cnctwin.jobs.durable import read_json  # noqa: PLC0415
    from cnctwin.loop.judging import judged  # noqa: PLC0415  with all of the twin

    result = Path(order["result"])
    found = judged(paths.case, result, order["description"], read_json(paths.composed))
    if order.get("diagnoses"):
        _file(result, Path(order["diagnoses"]) / order["machine"])
    card = found.card.model_copy(update={"case": order["case"], "job": order["case"]})
    programs = _planned(found.toml, order.get("programs")) if found.is_better else {}
    write_json(paths.finding, asdict(found) | {"card": card.model_dump(mode="json"), "programs": programs})


def _planned(toml: str, folder: str | None) -> Mapping[str, Sequence[float]]:
    """The programs as a corrected description plans them; none where the plant has none, or it states no [program]."""
    from cnctwin.machines.planned import planned  # noqa: PLC0415  with all of the twin
    from twin.machine import machine_from_toml  # noqa: PLC0415

    machine = machine_from_toml(toml, "twin.toml")
    return {} if folder is None or machine.program is None else planned(machine, Path(folder))[0]


def _file(result: Path, folder: Path) -> None:
    """Have the page find the diagnosis."""
    try:
        make_folder(folder)
        for name in FILED:
            beside = folder / f".{name}.new"
            shutil.copyfile(result / name, beside)
            beside.replace(folder / name)
    except OSError as error:
        raise UsageError(f"{folder}: the diagnosis cannot be filed: {error.strerror or error}") from None


def main() -> None:
    """Carry out an order; what is wrong with it is an outcome too."""
    order = json.loads(sys.stdin.read())
    paths = Paths(Path(order["folder"]), order["case"])
    try:
        {"compose": compose, "judge": judge}[order["do"]](order, paths)
    except (ApplicationError, TwinError) as error:
        write_json(paths.failed, {"text": " ".join(str(error).split())})


if __name__ == "__main__":
    main()
