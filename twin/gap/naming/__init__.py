"""Decides what is said of a stage's findings: the constants that moved, names beside a remainder, the sentence."""
