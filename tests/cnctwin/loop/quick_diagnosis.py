"""The process of a job that diagnoses in no time, and waits where a file says so: the job's folder has `hold` above it.

Its process id is in `pid` beside that.
"""

import os
import time
from pathlib import Path
from typing import Any

from cnctwin.jobs import child
from cnctwin.jobs.kinds import KINDS, CaseParameters, Kind
from cnctwin.jobs.work import Bench


def diagnose(parameters: CaseParameters, bench: Bench) -> dict[str, Any]:
    """Find that the spindle's rated power is another one."""
    case, machine = bench.files.case(parameters.case, "case")
    (bench.folder.parent / "pid").write_text(str(os.getpid()))
    bench.progress(0.5, "comparing")
    while (bench.folder.parent / "hold").exists():
        time.sleep(0.02)
    assert Path(case).is_dir()
    (bench.out / "twin.toml").write_text(machine.replace("rated_power_kw = 11.0", "rated_power_kw = 12.0"))
    for name in ("diagnosis.json", "report.html"):
        (bench.out / name).write_text("{}")
    return {"sentence": "coolant cools"}


if __name__ == "__main__":
    KINDS["diagnose"] = Kind("diagnose", CaseParameters, "tests.cnctwin.loop.quick_diagnosis:diagnose")
    raise SystemExit(child.main())
