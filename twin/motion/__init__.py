"""Path and time: canonical moves become a path, a look-ahead plans its speed, sampling gives the reference of every servo tick.

`path_from_moves` (path) → `plan` (plan, with `limits` as the control states them) → `Plan.sample` (motion).
"""
