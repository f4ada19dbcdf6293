"""Scores that compare a cut with the same cut of earlier parts, and with a twin that knows the force."""
