"""The figures that plans rest on. Each was measured; `MEASURED` names the day, the computer and the commands.

CPU time is in µs a message of a machine, with 11 changing values. `each_us` is what a processor adds to a process, on top of
`shared_us`, which a process spends once, however many processors it runs: receive, decode, hand on.

    python -m benchmarks.fleet --machines 20 --each          # shared_us, each_us, memory
    python -m benchmarks.fleet --machines 20                 # broker_us, broker_mirror_us
    cnctwin plan fleet --machines 1 --measure --json         # calibration_us
"""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Measured:
    """The figures. `calibration_us` is what the run of `--measure` took on the same computer.

    broker_us: Mosquitto's CPU time to take a message and to give it to one process
    broker_mirror_us: the same to take all that the mirror publishes of it, retained, with no reader
    grows_share: how much of a processor's cost goes with the number of changing values; the rest is paid for each message
    process_mb: memory of a process without machines; machine_mb: of each machine in all processors
    """

    date: str
    computer: str
    values: int
    shared_us: float
    each_us: Mapping[str, float]
    broker_us: float
    broker_mirror_us: float
    grows_share: float
    process_mb: float
    machine_mb: float
    calibration_us: float


MEASURED = Measured(
    date="2026-11-22",
    computer="AMD EPYC, 2 cores",
    values=11,
    shared_us=120.0,
    each_us={
        "alerts": 20.0,
        "cutting_force": 60.0,
        "events": 60.0,
        "gap": 50.0,
        "historian": 200.0,
        "joint_anomaly": 50.0,
        "mirror": 250.0,
        "residual": 50.0,
        "rules": 80.0,
        "thermal": 60.0,
        "tool_change_detector": 60.0,
        "vibration": 30.0,
    },
    broker_us=30.0,
    broker_mirror_us=250.0,
    grows_share=0.6,
    process_mb=110.0,
    machine_mb=1.0,
    calibration_us=450.0,
)
