"""What may be said of what a stage has found: the constants that moved, names beside a remainder, the sentence."""
