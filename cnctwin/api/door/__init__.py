"""The door: connections with deadlines and limits, users with roles, and the record of who did what."""
