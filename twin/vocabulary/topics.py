"""The plain topics, beside Sparkplug's. One that ends in a slash is a prefix; what follows is in its comment.

>>> state_of_job("night-7"), edge_barrier("cnc", "edge-okuma")
('cnc/jobs/night-7/state', 'cnctwin/barrier/cnc/edge-okuma')
"""

OWN = "cnctwin/"
"""The prefix of topics that only our own processes and commands write."""

ALERTS = f"{OWN}alerts/"
ALERT_STATE = f"{ALERTS}state"
"""Retained JSON: all alerts, silences and outcomes of commands."""
ALERT_COMMAND = f"{ALERTS}command/"
"""ack, silence, unsilence or test: JSON from a person."""
ALERT_ACK = f"{ALERT_COMMAND}ack"
# Followed by the id of a notification, retained (processors/alerts/courier/__init__.py).
ALERT_OUTBOX = f"{ALERTS}outbox/"
ALERT_CLAIM = f"{ALERTS}claim/"
ALERT_DELIVERY = f"{ALERTS}delivery/"
ALERT_RECEIPT = f"{ALERTS}receipt/"

LAG = f"{OWN}lag/"
"""Processor, not retained: how far it is behind, once a second while it is (processors/lag_report.py)."""

SNAPSHOT = f"{OWN}snapshot/"
"""Processor and unit, retained: the state of a fold."""
_DEAD_LETTER = f"{OWN}deadletter/"
_MARKER = f"{OWN}marker/"
_BARRIER = f"{OWN}barrier/"
VALIDATION = f"{OWN}validation/"
"""Machine, retained: how well the twin did at night."""
DESCRIPTION = f"{OWN}description/"
"""Machine and role (live, challenger), retained: what a machine is (processors/description.py)."""
LOOP = f"{OWN}loop/"
"""Machine, retained: the step of the loop that diagnoses its gap and corrects its description (cnctwin/loop)."""
LOOP_REQUEST = f"{LOOP}request/"
"""diagnose, promote, back or withdraw: JSON from a person, {"machine": …, "by": …, "version": …}."""
VERDICT = f"{OWN}verdict/"
"""Machine, retained: a person's verdict on one of its anomaly alarms (twin/anomaly/parts/alarms/verdict.py)."""
VALIDATION_BARRIER = f"{OWN}validation-barrier"

MIRROR = "cnc/"
"""Machine and signal, retained: what the mirror publishes for clients that speak no Sparkplug."""

HOME_ASSISTANT = "homeassistant/device/cnctwin/"
"""Machine and `config`, retained, where the mirror is asked for it (processors/home_assistant.py)."""

JOBS = f"{MIRROR}jobs/"
"""Beside the metrics of the node `twin-jobs`."""
RESERVED_MACHINES = (JOBS.removeprefix(MIRROR).rstrip("/"),)
"""The names that no machine may have: the mirror would write where others do."""
JOB_REQUEST = f"{JOBS}request"
"""JSON: a request (cnctwin/jobs/request.py)."""
JOB_CANCEL = f"{JOBS}cancel"
"""JSON: {"id": …, "reply_to": …}."""
JOB_REPLY = f"{JOBS}reply/"
"""Id of a job: where answers go if nothing else is asked for."""
JOBS_STATE = f"{JOBS}state"
"""Retained JSON: all jobs in short."""


def snapshots_of(processor: str) -> str:
    """Return the prefix of a processor's snapshots; the unit follows."""
    return f"{SNAPSHOT}{processor}/"


def dead_letters_of(processor: str) -> str:
    """Return the prefix of what a processor could not take; the machine follows."""
    return f"{_DEAD_LETTER}{processor}/"


def marker_of(reader: str) -> str:
    """Return the topic on which a reader publishes to itself: when it comes back, all that is retained has come."""
    return f"{_MARKER}{reader}"


def edge_barrier(group: str, node: str) -> str:
    """Return the topic of an edge node's barriers, QoS 1; nobody has to read them."""
    return f"{_BARRIER}{group}/{node}"


def state_of_job(job_id: str) -> str:
    """Return the topic that shows one job in full, retained; of the id "+" the filter of all, of a group the expression."""
    return f"{JOBS}{job_id}/state"
