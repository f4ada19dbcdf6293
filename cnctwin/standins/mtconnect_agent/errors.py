"""The errors of a replay.

ReplayError
 ├─ RecordingError     the recording can't be opened or no device of the model fits it
 └─ DeviceModelError   the Devices.xml can't be used

Bad lines inside a recording are no errors: they are counted by reason in the ledger.
"""


class ReplayError(Exception):
    """Anything that keeps a recording from being replayed."""


class RecordingError(ReplayError):
    """The recording can't be opened, or it isn't clear which device it belongs to."""


class DeviceModelError(ReplayError):
    """The device model can't be used: not XML, no device, or a document type declaration in it."""
