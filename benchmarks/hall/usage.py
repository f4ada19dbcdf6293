"""The use that a process makes of the computer, as the kernel counts it in /proc: time, memory, threads, switches."""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
_PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Usage:
    """CPU time since the start, of all threads, children too; and what the process holds now."""

    cpu_s: float
    rss_mb: float
    threads: int
    switches: int


def family(pid: int) -> list[int]:
    """Return a process and its descendants."""
    found = [pid]
    for one in found:
        with suppress(OSError):
            for task in (_PROC / str(one) / "task").iterdir():
                found += [int(child) for child in (task / "children").read_text().split()]
    return found


def usage_of(pid: int) -> Usage:
    """Return the use of a process with its descendants."""
    cpu_s = rss_mb = 0.0
    threads = switches = 0
    for one in family(pid):
        with suppress(OSError):
            fields = (_PROC / str(one) / "stat").read_text().rpartition(")")[2].split()
            cpu_s += (int(fields[11]) + int(fields[12])) * TICK_S
            for task in (_PROC / str(one) / "task").iterdir():
                status = dict(line.partition(":")[::2] for line in (task / "status").read_text().splitlines())
                switches += int(status["voluntary_ctxt_switches"])
                threads += 1
            rss_mb += int(status.get("VmRSS", "0").split()[0]) * 1024 / 1e6
    return Usage(cpu_s, rss_mb, threads, switches)


def pss_mb(pid: int) -> float:
    """Return the proportional set size: pages that several processes share are counted once."""
    total = 0.0
    for one in family(pid):
        with suppress(OSError):
            for line in (_PROC / str(one) / "smaps_rollup").read_text().splitlines():
                if line.startswith("Pss:"):
                    total += int(line.split()[1]) * 1024 / 1e6
    return total


def busy_s() -> float:
    """Return the CPU time that all processes of the computer have used since it started."""
    user, nice, system, _, _, hard, soft, *_ = (int(field) for field in (_PROC / "stat").read_text().splitlines()[0].split()[1:])
    return (user + nice + system + hard + soft) * TICK_S
