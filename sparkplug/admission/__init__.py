"""The admission to a host session: limits, refusals, and the gate that decides once for all consumers."""
