"""An MTConnect agent that replays a recording: for the demo, for tests, and for trying a client without a machine."""

from cnctwin.standins.mtconnect_agent.errors import DeviceModelError, RecordingError, ReplayError
from cnctwin.standins.mtconnect_agent.ledger import ReplayLedger
from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent

__all__ = ["DeviceModelError", "RecordingError", "ReplayAgent", "ReplayError", "ReplayLedger"]
