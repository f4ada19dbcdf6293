"""Who may write and read which topic: the same for every broker that deploy/ has files for."""

USERS = ("edge-okuma", "edge-other", "edge-mill", "processors", "viewer", "operator")
EDGE_NODES = ("edge-okuma", "edge-other", "edge-mill")
NODES = (*EDGE_NODES, "twin-mirror", "twin-jobs", "viewer", "operator", "processors")
NODE_VERBS, DEVICE_VERBS = ("NBIRTH", "NDATA", "NDEATH"), ("DBIRTH", "DDATA", "DDEATH")
STATES = ("spBv1.0/STATE/twin-mirror", "spBv1.0/STATE/scada")
SNAPSHOT, LETTER, MARKER = "cnctwin/snapshot/mirror/okuma", "cnctwin/deadletter/mirror/okuma", "cnctwin/marker/mirror"
LAG = "cnctwin/lag/mirror"
OUTBOX = tuple(f"cnctwin/alerts/{kind}/a1" for kind in ("outbox", "claim", "delivery", "receipt"))
ALERTS_STATE = "cnctwin/alerts/state"
COMMANDS = tuple(f"cnctwin/alerts/command/{name}" for name in ("ack", "silence", "unsilence", "test"))
MIRROR = ("cnc/okuma/spindle_rpm", "cnc/okuma/twin/raw_score")
HOME_ASSISTANT = "homeassistant/device/cnctwin/okuma/config"
ASK_FOR_JOBS = ("cnc/jobs/request", "cnc/jobs/cancel")
JOB = "cnc/jobs/night-7/state"
JOBS = ("cnc/jobs/state", "cnc/jobs/reply/night-7")
DESCRIPTIONS = tuple(f"cnctwin/description/okuma/{end}" for end in ("live", "challenger", "fault", "fault/gap/live"))
LOOP = "cnctwin/loop/okuma"
ASK_THE_LOOP = tuple(f"cnctwin/loop/request/{word}" for word in ("diagnose", "promote", "back", "withdraw"))
VERDICT = "cnctwin/verdict/okuma"
ELSEWHERE = (
    "anything",
    "spBv1.0/other/NDATA/edge-okuma",
    "spBv1.0/cnc/NBIRTH/edge-okuma/okuma/deeper",
    "cnctwin/other",
    "$SYS/x",
    "homeassistant/device/other/okuma/config",
    "homeassistant/device/cnctwin/okuma/set",
    "homeassistant/status",
)


def said_by(node: str) -> frozenset[str]:
    """Return what a node tells of itself and its device."""
    own = {f"spBv1.0/cnc/{verb}/{node}" for verb in NODE_VERBS}
    return frozenset(own | {f"spBv1.0/cnc/{verb}/{node}/okuma" for verb in DEVICE_VERBS})


def told(node: str) -> frozenset[str]:
    """Return what a node and its device are commanded by."""
    return frozenset({f"spBv1.0/cnc/NCMD/{node}", f"spBv1.0/cnc/DCMD/{node}/okuma"})


def barrier(node: str) -> str:
    return f"cnctwin/barrier/cnc/{node}"


ASK_FOR_BIRTHS = frozenset(f"spBv1.0/cnc/NCMD/{node}" for node in NODES)
RECEIPTS = frozenset(f"spBv1.0/cnc/DCMD/{node}/okuma" for node in NODES)
SPARKPLUG = frozenset().union(*(said_by(node) | told(node) for node in NODES))
ALL = sorted(
    {
        *SPARKPLUG,
        *map(barrier, NODES),
        *STATES,
        SNAPSHOT,
        LETTER,
        MARKER,
        LAG,
        *OUTBOX,
        ALERTS_STATE,
        *COMMANDS,
        *MIRROR,
        HOME_ASSISTANT,
        *ASK_FOR_JOBS,
        JOB,
    }
    | {*JOBS, *DESCRIPTIONS, LOOP, *ASK_THE_LOOP, VERDICT, *ELSEWHERE}
)

MAY_WRITE: dict[str, frozenset[str]] = {
    **{edge: said_by(edge) | {barrier(edge)} for edge in EDGE_NODES},
    "processors": said_by("twin-mirror")
    | said_by("twin-jobs")
    | ASK_FOR_BIRTHS
    | RECEIPTS
    | {STATES[0], SNAPSHOT, LETTER, MARKER, LAG, *OUTBOX, ALERTS_STATE, COMMANDS[0], *MIRROR, HOME_ASSISTANT}
    | {*ASK_FOR_JOBS, JOB, *JOBS, *DESCRIPTIONS, LOOP},
    "viewer": frozenset(),
    "operator": ASK_FOR_BIRTHS | set(COMMANDS) | set(ASK_FOR_JOBS) | set(ASK_THE_LOOP) | {VERDICT},
}
READERS = SPARKPLUG | {
    *STATES,
    ALERTS_STATE,
    LETTER,
    *MIRROR,
    *ASK_FOR_JOBS,
    JOB,
    *JOBS,
    *DESCRIPTIONS,
    LOOP,
    VERDICT,
    ELSEWHERE[2],
}
MAY_READ: dict[str, frozenset[str]] = {
    **{edge: told(edge) | set(STATES) for edge in EDGE_NODES},
    "processors": SPARKPLUG
    | {*STATES, SNAPSHOT, LETTER, MARKER, LAG, *OUTBOX, ALERTS_STATE, *COMMANDS, *ASK_FOR_JOBS, JOB, JOBS[1], ELSEWHERE[2]}
    | {*DESCRIPTIONS, LOOP, *ASK_THE_LOOP, VERDICT},
    "viewer": READERS,
    "operator": READERS,
}
