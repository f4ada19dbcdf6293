"""HEIDENHAIN controls over LSV2: what is asked for and what it means, PLC addresses, tool calls in the program, read-only."""
