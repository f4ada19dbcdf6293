"""i3X 1.0, CESMII's common interface for objects, values, history and subscriptions: the reading part (docs/reference/i3x.md)."""
