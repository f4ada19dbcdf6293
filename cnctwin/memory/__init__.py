"""The memory: the store, replay over it, as-built records of parts."""
