"""MQTT below the sessions: connections that are kept alive, many of them in one loop. Knows nothing of Sparkplug's payloads."""
