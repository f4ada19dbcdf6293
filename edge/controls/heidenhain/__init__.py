"""The parts of the edge for HEIDENHAIN controls over LSV2."""
