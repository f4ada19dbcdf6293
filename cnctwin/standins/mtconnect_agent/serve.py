"""`cnctwin simulate-control mtconnect`: the replay agent as a program of its own."""

from pathlib import Path
from threading import Event
from typing import Any

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.processes.state_file import STATE_S, keep
from cnctwin.standins.mtconnect_agent.errors import ReplayError
from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent

STYLES = ("2.3", "1.4")


def replay(
    recording: Path,
    devices: Path | None,
    stop: Event,
    *,
    device: str | None = None,
    speed: float = 1.0,
    port: int = 0,
    style: str = "2.3",
    loop: bool = False,
    wait: bool = False,
    state_file: Path | None = None,
) -> None:
    """Serve until stopped; says where, and keeps `state_file` up to date for a program that started us."""
    for path in (recording, devices):
        if path is not None and not path.is_file():
            raise UsageError(f"{path}: no such file; give the recording, and its device model with --devices")
    if style not in STYLES:
        raise UsageError(f"--style {style!r} is no generation of the agent; there are {' and '.join(STYLES)}")
    try:
        agent = ReplayAgent(
            recording, devices, speed=speed, device=device, port=port, style=style, loop=loop, wait_for_client=wait
        )
        agent.start()
    except (OSError, ValueError, ReplayError) as error:
        raise ApplicationError(f"{recording}: cannot be replayed: {error}") from error
    try:
        print(f"{agent.url} serves {recording.name} as {agent.device_name}; Ctrl-C ends it", flush=True)
        while not stop.wait(STATE_S if state_file is not None else None):
            keep(state_file, _state(agent))
        keep(state_file, _state(agent))
    finally:
        agent.stop()
    counts = agent.ledger.as_dict()
    print(", ".join(f"{name} {count}" for name, count in counts.items()), flush=True)


def _state(agent: ReplayAgent) -> dict[str, Any]:
    return {"url": agent.url, "device": agent.device_name, "finished": agent.finished, "ledger": agent.ledger.as_dict()}
