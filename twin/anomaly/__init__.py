"""Anomaly scores of machines: what a score means beside its peers, when it is let through, when it is an alarm."""
