"""The ledger that every node publishes of what it takes in: received = emitted + dropped + buffered."""

LEDGER_PREFIX = "ledger/"
RECEIVED = f"{LEDGER_PREFIX}received"
EMITTED = f"{LEDGER_PREFIX}emitted"
BUFFERED = f"{LEDGER_PREFIX}buffered"
DROPPED = f"{LEDGER_PREFIX}dropped"
DROPPED_PREFIX = f"{DROPPED}/"
"""Followed by a reason: so many of the dropped."""
