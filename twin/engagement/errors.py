"""What can be wrong with a path or a stock that is to be cut."""

from twin.errors import TwinError


class EngagementError(TwinError):
    """A path, tool, stock or limit with which the engagement cannot be computed."""
