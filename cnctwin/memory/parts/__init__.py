"""The as-built records of parts: read from a store, listed, exported, and delivered to an MES or a PLM."""
