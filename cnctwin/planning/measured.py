"""The figures that plans rest on. Each was measured; `MEASURED` names the day, the computer and the commands.

CPU time is in µs a message of a machine, with 11 changing values. `each_us` is what a processor adds to a process, on top of
`shared_us`, which a process spends once, however many processors it runs: receive, decode, hand on.

    python -m benchmarks.fleet --machines 40 --each --prefer    # shared_us, each_us; broker_us, broker_mirror_us by its column
    python -m benchmarks.fleet --machines 20,100                # memory
    python -m benchmarks.fleet --machines 40 --prefer --processors mirror,expected    # less mirror alone, and so tool_wear
    python -m benchmarks.fleet --machines 40 --processors events,production    # less events alone: production, on 2026-11-28
    cnctwin plan fleet --machines 1 --measure --json            # calibration_us
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Measured:
    """The figures. `calibration_us` is what the run of `--measure` took on the same computer.

    broker_us: Mosquitto's CPU time to take a message and to give it to one process
    broker_mirror_us: the same to take what comes of it: results, and the mirror, retained, with no reader
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
    shared_us=72.7,
    each_us={
        "alerts": 10.6,
        "control_alarms": 21.0,
        "cutting_force": 52.3,
        "events": 48.1,
        "expected": 54.0,
        "gap": 39.8,
        "historian": 27.3,
        "joint_anomaly": 23.1,
        "mirror": 110.6,
        "production": 49.0,
        "residual": 6.5,
        "rules": 56.5,
        "thermal": 31.5,
        "tool_change_detector": 14.8,
        "tool_wear": 7.0,
        "vibration": 19.0,
    },
    broker_us=45.0,
    broker_mirror_us=80.0,
    grows_share=0.6,
    process_mb=85.0,
    machine_mb=0.8,
    calibration_us=134.5,
)


class Each(NamedTuple):
    """The cost of a message of a machine, of a result of a processor, and of a value of the mirror."""

    message: float
    result: float
    value: float


@dataclass(frozen=True, slots=True)
class MeasuredOnKafka:
    """Figures of the folds on Kafka, CPU µs. Messages are those of machines, with 11 changing values.

        python -m benchmarks.kafka --only bridge --prefer    # bridge_us, kafka_us, mosquitto_us, log_bytes, live_factor
        python -m benchmarks.kafka --only each               # read_us, fold_us
        python -m benchmarks.kafka --only snapshots          # state_us

    bridge_us: a result's is to publish it, and to hand it back to the log; kafka_us: with one replica and one reader
    log_bytes: on the disk after lz4, with one replica, what cells read and what comes of a result included
    read_us: a runner's to read a message; fold_us: what a processor adds, with its results; state_us: to save a state
    live_factor: what a message costs as it comes over what it costs while a log is caught up with
    results_a_machine_s: what a processor says of a machine a second, the mean of all but the mirror
    process_mb, machine_mb: memory of a runner without machines, and of a machine in all processors
    """

    date: str
    computer: str
    bridge_us: Each
    kafka_us: Each
    mosquitto_us: Each
    log_bytes: Each
    state_bytes: float
    read_us: float
    fold_us: Mapping[str, float]
    state_us: float
    live_factor: float
    results_a_machine_s: float
    process_mb: float
    machine_mb: float


# With 100 machines at 10 Hz. A result is what all but the mirror cost beyond a message, over 1.1 results a message; a value is
# what the mirror costs beyond it, over 11. `state_us` is that of cProfile, an upper bound: saving each second or each 30 s made
# no difference beyond the noise of some per cent. Up to 1.2 cores were busy elsewhere while the mirror was measured, 0.2 else.
# `production` was measured on 2026-11-28, on a busy computer, beside `events`: .82 of it. `control_alarms` is what
# `benchmarks.fleet --machines 40 --processors control_alarms` took that day less shared_us; on Kafka, the share
# that `production` has.
ON_KAFKA = MeasuredOnKafka(
    date="2026-11-24",
    computer="AMD EPYC, 2 cores, Kafka 4.3 and the load on them too",
    bridge_us=Each(83.0, 130.0, 12.0),
    kafka_us=Each(262.0, 200.0, 10.5),
    mosquitto_us=Each(26.0, 11.0, 4.5),
    log_bytes=Each(474.0, 190.0, 40.0),
    state_bytes=725.0,
    read_us=11.9,
    fold_us={
        "alerts": 0.0,
        "control_alarms": 7.5,
        "cutting_force": 49.7,
        "events": 21.5,
        "expected": 22.5,
        "gap": 19.4,
        "joint_anomaly": 12.3,
        "mirror": 122.0,
        "production": 17.6,
        "residual": 11.1,
        "rules": 24.6,
        "thermal": 19.5,
        "tool_change_detector": 12.5,
        "tool_wear": 10.0,
        "vibration": 8.7,
    },
    state_us=104.0,
    live_factor=2.0,
    results_a_machine_s=0.92,
    process_mb=100.0,
    machine_mb=0.7,
)
