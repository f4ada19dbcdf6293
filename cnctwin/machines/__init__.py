"""The folder that describes the machines of a plant: which description is live, which challenger waits, how that came about."""
