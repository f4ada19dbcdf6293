"""Bounds that no spindle reaches: a figure beyond them is not a speed or a load, whatever its quality says.

Wider than the canonical signals' own limits (`signals.py`), since an edge of somebody else's may publish without them.
"""

SPINDLE_RPM_MAX = 200_000.0
SPINDLE_LOAD_PCT_MAX = 1000.0
