"""A machine whose tools wear, as cut records of its parts, with everything known; it shares no code with the wear model.

Forces and meter are those of the reference machine of the blind check (cnctwin/standins/reference_machine).
"""
