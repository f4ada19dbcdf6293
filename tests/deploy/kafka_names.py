"""The names of everything on Kafka, and who may do what with each: what the files of deploy/kafka are held against."""

PREFIX = "cnctwin.cnc."
KEPT_FOR_A_WHILE = ("readings", "cells.alerts", "cells.joint_anomaly", "results", "deadletters")
NEWEST_OF_EACH_KEY = ("births", "snapshots", "health")
TOPICS = (*KEPT_FOR_A_WHILE, *NEWEST_OF_EACH_KEY)
BRIDGE, RUNNER = "cnctwin-bridge", "cnctwin-runner"
MAY_WRITE = {
    BRIDGE: {"readings", "cells.alerts", "cells.joint_anomaly", "births", "health"},
    RUNNER: {"results", "snapshots", "deadletters", "health"},
}
MAY_READ = {
    BRIDGE: {"results", "snapshots", "births", "health"},
    RUNNER: {"readings", "cells.alerts", "cells.joint_anomaly", "snapshots", "results"},
}
GROUPS = {BRIDGE: f"{PREFIX}bridge.bridge-0", RUNNER: f"{PREFIX}mirror+rules"}
TRANSACTION = f"{PREFIX}mirror+rules.runner-physics-0"


def processors_of(command: list[str]) -> list[str]:
    """The processors that `cnctwin process …` names, whether or not this program knows all its options."""
    assert command[0] == "process"
    ends = [index for index, word in enumerate(command) if word.startswith("--")]
    return command[1 : ends[0]]


def option(command: list[str], name: str) -> str:
    """The value of an option in a command."""
    return command[command.index(name) + 1]
