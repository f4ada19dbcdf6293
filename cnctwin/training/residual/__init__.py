"""`cnctwin train residual`: from a store or run logs to a residual model that was judged on held-out time."""
