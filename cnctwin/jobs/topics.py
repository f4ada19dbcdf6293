"""The plain topics of jobs, beside the metrics of the node `twin-jobs`."""

REQUEST = "cnc/jobs/request"
"""JSON: a request (cnctwin/jobs/request.py)."""
CANCEL = "cnc/jobs/cancel"
"""JSON: {"id": …, "reply_to": …}."""
REPLY = "cnc/jobs/reply/"
"""And the id: where answers go if nothing else is asked for."""
STATE = "cnc/jobs/state"
"""Retained JSON: all jobs in short."""
STATES = "cnc/jobs/+/state"


def state_topic(job_id: str) -> str:
    """Return the retained topic that shows one job in full.

    >>> state_topic("night-7")
    'cnc/jobs/night-7/state'
    """
    return f"cnc/jobs/{job_id}/state"
