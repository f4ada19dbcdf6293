"""Spindle speed: where in a program it may change, and what changes it together."""
