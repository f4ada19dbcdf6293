"""The names of Sparkplug edge nodes: `edge-` of what observes a machine, `twin-` of what computes.

>>> edge_node("okuma"), twin_node("thermal")
('edge-okuma', 'twin-thermal')
"""

_EDGE_PREFIX = "edge-"
TWIN_NODE_PREFIX = "twin-"


def edge_node(machine: str) -> str:
    """Return the name of the edge node of a machine, if its configuration sets no other."""
    return f"{_EDGE_PREFIX}{machine}"


def twin_node(name: str) -> str:
    """Return the name of the edge node, and of the host application, of a processor or a service."""
    return f"{TWIN_NODE_PREFIX}{name}"


def is_twin_node(node: str) -> bool:
    """Return True if an edge node is a processor's or a service's, and no machine's."""
    return node.startswith(TWIN_NODE_PREFIX)


HISTORIAN_NODE = twin_node("historian")
JOBS_NODE = twin_node("jobs")
"""The node of the jobs consumer: what it publishes is about jobs, and no processor's input."""
VALIDATION_NODE = twin_node("validation")
"""The node of the nightly validation, which publishes its figures and ends."""
