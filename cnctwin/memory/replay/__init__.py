"""History through the very same folds again: what the processors give now, beside what they published then.

Nothing is published, sent or stored: actions are looked at and dropped.
"""

from cnctwin.memory.replay.result import Difference, MetricCompared, ProcessorReplayed, Replayed, ReplayRefusedError
from cnctwin.memory.replay.run import replay

__all__ = ["Difference", "MetricCompared", "ProcessorReplayed", "ReplayRefusedError", "Replayed", "replay"]
