"""Sparkplug B 3.0.0 (ISO/IEC 20237) for edge nodes and host applications.

The protocol is sans-I/O: `EdgeNodeSession` and `HostSession` take messages, time and chance as arguments and hand back what
is to be sent. `EdgeNode` and `HostApplication` put paho-mqtt under them. Nothing here knows what a machine tool is.
"""
