"""Recordings from elsewhere: into run logs, or into the store."""
