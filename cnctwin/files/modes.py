"""The modes of the files that the program writes: one umask, set before anything is written, and kept by its processes.

State (sessions, aliases, rings, stores, journals, jobs) is its owner's alone: 0600, folders 0700. What a person has asked for (a
report, a run log, a model) a group may read: 0640, folders 0750. Nothing is for others. A stricter umask of the caller stays,
as that of the systemd units; keys are 0600 wherever they are written.
"""

import os
from collections.abc import Sequence

STATE_UMASK, PRODUCT_UMASK = 0o077, 0o027
PRODUCT_FILE, PRODUCT_FOLDER = 0o640, 0o750  # for what is made under a temporary name, which is its owner's alone
_PRODUCTS = frozenset(
    {"gap", "identify", "import", "model", "optimise", "plan", "record", "replay", "simulate", "train", "twin"}
    | {"store export", "parts export"}
)


def umask_of(arguments: Sequence[str]) -> int:
    """Return the umask of a command.

    >>> oct(umask_of(["process", "historian"])), oct(umask_of(["gap", "diagnose"])), oct(umask_of(["store", "export", "--help"]))
    ('0o77', '0o27', '0o27')
    """
    words = {" ".join(arguments[:1]), " ".join(arguments[:2])}
    return PRODUCT_UMASK if words & _PRODUCTS else STATE_UMASK


def restrict(arguments: Sequence[str]) -> None:
    """Set the umask of a command for this process and those that it starts."""
    os.umask(os.umask(STATE_UMASK) | umask_of(arguments))
