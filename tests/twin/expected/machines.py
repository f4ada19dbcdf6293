"""A small machine and two programs for it."""

from twin.machine import AddedEffect, MachineFile, machine_from_toml

MACHINE = """
[machine]
name = "small"
[axes.x]
mass_kg = 100.0
screw_lead_mm = 10.0
torque_constant_nm_per_a = 1.0
position_gain_per_s = 50.0
velocity_gain_a_s_per_mm = 0.2
torque_limit_a = 30.0
[axes.x.friction]
coulomb_n = 100.0
static_n = 150.0
stribeck_velocity_mm_s = 5.0
[tool]
diameter_mm = 10.0
teeth = 2
tangential_coefficient_n_per_mm2 = 900.0
radial_ratio = 0.3
[spindle]
rated_power_kw = 2.0
efficiency = 0.8
idle_power_kw = 0.1
[program]
rapid_mm_min = 20000.0
acceleration_mm_s2 = 3000.0
spindle_acceleration_rpm_s = 8000.0
[stock]
min_mm = [0.0, 0.0, -20.0]
max_mm = [50.0, 40.0, 0.0]
"""


def plate(feed: float = 1200) -> str:
    """Return a program that cuts five lines of a plate."""
    return f"""G21 G90 G94
S4000 M3
G0 X-10. Y5.
Z5.
G4 P1000
G1 Z-2. F400.
G1 X60. F{feed:g}.
Y12.
X-10.
Y18.
X60. Y30.
G0 Z5.
M5
M30"""


PLATE = plate()
BOX = """G21 G90 G94
S4000 M3
G0 X-10. Y10.
Z5.
G1 Z-2. F1000.
M98 P20
M98 P20
M30
O20
G1 X50.
G1 X-10.
M99"""


def machine(effects: tuple[AddedEffect, ...] = ()) -> MachineFile:
    """Return the machine, with effects."""
    return machine_from_toml(MACHINE).model_copy(update={"effects": effects})
