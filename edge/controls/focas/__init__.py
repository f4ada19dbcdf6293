"""FANUC controls by FOCAS: one interface, two ways to the control, both read-only."""
