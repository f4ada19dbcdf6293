"""A challenger against the champion of a machine, on data that neither has seen and on the golden week."""
