"""Reports for people: one HTML page for a diagnosis, one for an optimisation."""
