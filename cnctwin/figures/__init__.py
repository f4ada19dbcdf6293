"""Production figures out of a store: the fold over history, tables by machine, shift, part and program, CSV."""
