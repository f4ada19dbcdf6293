"""The work of each kind of job; each writes its files into `bench.out` and gives back a summary of a few lines.

Loaded in the process of one job only: it needs all that the twin needs.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cnctwin.jobs.files_root import FilesRoot

if TYPE_CHECKING:
    from cnctwin.jobs.kinds import CaseParameters, IdentifyParameters, OptimiseParameters

STEPS = 12
"""Said of themselves by an identification or a diagnosis, about; how far they are cannot be known better."""


@dataclass(frozen=True, slots=True)
class Bench:
    """The means that a job is given.

    files: below which lie those that it names; folder: its own; out: empty, for its result
    checkpoint: a file that outlives an attempt; progress: 0…1, and what is being done; workers, dask: as `spread_over` takes them
    """

    files: FilesRoot
    folder: Path
    out: Path
    checkpoint: Path
    progress: Callable[[float, str], None]
    workers: int = 1
    dask: str | None = None

    def as_taken(self, name: str, read: Callable[[], str]) -> str:
        """A text as the first attempt found it: another one that goes on from a checkpoint goes on with the same."""
        kept = self.folder / "inputs" / name
        if not kept.is_file():
            text = read()
            kept.parent.mkdir(exist_ok=True)
            beside = kept.with_name(f".{name}.new")
            beside.write_text(text, encoding="utf-8", newline="")
            beside.replace(kept)
        with kept.open(encoding="utf-8", newline="") as source:
            return source.read()

    def steps(self) -> Callable[[str], None]:
        """Progress of one who says what is being done and not how far it is: half of the rest at each turn of a few."""
        done = 0.0

        def say(doing: str) -> None:
            nonlocal done
            done += (0.95 - done) / STEPS
            self.progress(done, doing)

        return say


def optimise(parameters: "OptimiseParameters", bench: Bench) -> dict[str, Any]:
    """As `cnctwin optimise`: optimised.nc, optimisation.json, report.html."""
    from cnctwin.batch.optimisation import OptimiseRequest, optimise_request  # noqa: PLC0415  with all of the twin
    from cnctwin.jobs.dask_cluster import DaskCluster  # noqa: PLC0415
    from cnctwin.jobs.spread import spread_over  # noqa: PLC0415

    asked = parameters.model_dump(exclude={"program", "program_text", "encoding", "name", "machine", "machine_toml"})
    program = bench.as_taken("program.nc", lambda: parameters.program_of(bench.files))
    encoding = bench.as_taken("program.encoding", lambda: parameters.encoding_of(bench.files))
    machine = bench.as_taken("machine.toml", lambda: parameters.toml_of(bench.files))
    name = parameters.name or ("program.nc" if parameters.program is None else Path(parameters.program).name)
    request = OptimiseRequest(name=name, program_text=program, machine_toml=machine, encoding=encoding, **asked)
    cluster = None if bench.dask is None else DaskCluster.from_text(bench.dask)
    with spread_over(bench.workers, cluster) as spread:
        found = optimise_request(request, bench.out, progress=bench.progress, spread=spread, checkpoint=bench.checkpoint)
    before, after = ({"seconds": one.seconds, "cost": one.cost} for one in (found.before, found.after))
    wrong = {"lines_over": found.after.over, "collisions": list(found.collisions)}
    return {"sentence": f"{name}: {found.sentence}", "before": before, "after": after, "distance": found.bound.distance, **wrong}


def identify(parameters: "IdentifyParameters", bench: Bench) -> dict[str, Any]:
    """As `cnctwin identify`: machine.toml, identification.json."""
    from cnctwin.batch.identification import identification_json  # noqa: PLC0415  with all of the twin
    from twin.case import read_case  # noqa: PLC0415
    from twin.identification.identify import identify as identified  # noqa: PLC0415
    from twin.machine_toml import machine_to_toml  # noqa: PLC0415

    case = read_case(bench.files.case(parameters.case, "case")[0])
    found = identified(case, free_gains=parameters.free_gains, progress=bench.steps())
    (bench.out / "machine.toml").write_text(machine_to_toml(found.machine), encoding="utf-8")
    (bench.out / "identification.json").write_text(json.dumps(identification_json(found)), encoding="utf-8")
    known = sum(estimate.identifiable for estimate in found.estimates)
    sentence = f"{known} of {len(found.estimates)} constants of {found.machine.machine.name} are known by the recordings"
    if found.misfits:
        sentence += "; one signal does not fit" if len(found.misfits) == 1 else f"; {len(found.misfits)} signals do not fit"
    counts = {"constants": len(found.estimates), "identifiable": known, "misfits": len(found.misfits)}
    return {"sentence": sentence, **counts, "not_identifiable": len(found.unknown)}


def diagnose(parameters: "CaseParameters", bench: Bench) -> dict[str, Any]:
    """As `cnctwin gap diagnose`: diagnosis.json, report.html, twin.toml."""
    from cnctwin.batch.diagnosis import diagnosis_files, in_threads, write_files  # noqa: PLC0415  with all of the twin
    from twin.case import read_case  # noqa: PLC0415

    case = read_case(bench.files.case(parameters.case, "case")[0])
    found = in_threads(case, bench.steps())
    write_files(diagnosis_files(found, case.name), bench.out)
    told = found.diagnosis
    causes = [f"{cause.effect} on {cause.on}" for cause in told.causes[:10]]
    gap = {"before": told.gap.before, "after": told.gap.after}
    return {"sentence": told.sentence, "verdict": str(told.verdict), "gap": gap, "causes": causes}
