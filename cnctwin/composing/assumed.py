"""The description of a machine that nobody has described: a spindle and its heat of a usual size, marked as assumed.

It is a start for `cnctwin identify --store`: the constants that a history shows are fitted, and are assumed no longer.
"""

import json

SPREAD = 0.5
"""One relative standard deviation of an assumed constant."""


def assumed_description(machine: str) -> str:
    """Return the text of its machine.toml.

    >>> from twin.machine import machine_from_toml
    >>> machine_from_toml(assumed_description("vmc")).machine.assumed
    ('spindle', 'thermal')
    """
    return f"""# This machine has no description yet: its constants are assumptions until something fits them.
[machine]
name = {json.dumps(machine, ensure_ascii=False)}
assumed = ["spindle", "thermal"]

[spindle]
rated_power_kw = 15.0
efficiency = 0.85
idle_power_kw = 0.3

[thermal]
alpha_w_per_pct_rpm2 = 1.8e-8
beta_w_per_rpm = 1.2e-2
resistance_k_per_w = 0.18
capacity_j_per_k = 6000.0

[uncertainty]
relative = {SPREAD}
"""
