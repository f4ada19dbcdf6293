"""Tool life from the cut records of parts, and the drift of the machine that all tools share."""
