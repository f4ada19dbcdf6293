"""Transients in a drive signal: learned from a few captures, found again in a stream at a stated rate of false ones."""
