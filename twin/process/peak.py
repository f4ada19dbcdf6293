"""The text of the search for the peak of the resultant: the best of a few turns of the tool, followed by parabolas.

With straight edges, the teeth in the cut are one more until the first one leaves (side 0) and one less from there on (side 1). In
a slot with an even number of teeth one leaves as another enters; what both would bear at that instant is not a peak.
"""

AT = (
    "turn_rad, standing, shift, lane, lag_rad, teeth, advance_mm, spindle_rpm, speed_mm_s, axial_depth_mm, "
    "entry_rad, width_rad, constants, radius_steps_mm"
)
EVENTS = [
    "for event_rad in (lag_rad, lag_rad + width_rad):",
    "    turn_rad = event_rad - pitch_rad * floor(event_rad / pitch_rad)",
    f"    value = resultant_at({AT})",
    "    greatest = value if lag_rad > 0.0 and value > greatest else greatest",
]
PEAK = """{kernel}
def peak(cuts, teeth, constants, radius_steps_mm, spindle_rpm_in, speed_mm_s_in, axial_depth_mm_in, entry_angle_rad,
         exit_angle_rad, outputs, first, stride):
    pitch_rad = 6.283185307179586 / teeth
    for cut in range(cuts):
        spindle_rpm = spindle_rpm_in[cut]
        speed_mm_s = speed_mm_s_in[cut]
        axial_depth_mm = axial_depth_mm_in[cut]
        entry_rad = entry_angle_rad[cut]
        width_rad = exit_angle_rad[cut] - entry_rad
        width_rad = width_rad + 6.283185307179586 if width_rad < 0.0 else width_rad
        if spindle_rpm > 0.0 and speed_mm_s > 0.0 and axial_depth_mm > 0.0 and width_rad >= 0.0:
            advance_mm = speed_mm_s * 60.0 / (teeth * spindle_rpm)
            standing_least = int(width_rad / pitch_rad)
            leaves_rad = width_rad - standing_least * pitch_rad
{lag}
            for lane in range({width}):
                greatest = 0.0
                for shift in range({turns}):
                    for side in range(2):
                        standing = min(standing_least + 1 - side, teeth)
                        begin_rad = leaves_rad if side else 0.0
                        end_rad = pitch_rad if side else leaves_rad
                        steps = int((end_rad - begin_rad) / (0.03 if lag_rad > 0.0 else 0.4)) + 2
                        step_rad = (end_rad - begin_rad) / steps
                        best_rad = low_rad = high_rad = begin_rad
                        best = low = high = value = -1.0
                        for probe in range(steps + 13 if end_rad - begin_rad > 1e-9 else 0):
                            finer = (probe - steps - 1) % 4 if probe > steps else 4
                            if finer == 0:
                                low_rad = best_rad - step_rad if best_rad - step_rad > begin_rad else begin_rad
                                high_rad = best_rad + step_rad if best_rad + step_rad < end_rad else end_rad
                                turn_rad = low_rad
                            elif finer == 1:
                                low, turn_rad = value, high_rad
                            elif finer == 2:
                                high, turn_rad = value, 0.5 * (low_rad + high_rad)
                            elif finer == 3:
                                bend = low - 2.0 * value + high
                                off = 0.25 * (low - high) / bend if bend < 0.0 else 0.0
                                turn_rad = turn_rad + (high_rad - low_rad) * (off if -0.5 < off < 0.5 else 0.0)
                                step_rad = 0.125 * step_rad
                            else:
                                turn_rad = begin_rad + probe * step_rad
                            value = resultant_at({at})
                            best_rad = turn_rad if value > best else best_rad
                            best = value if value > best else best
                        greatest = best if best > greatest else greatest
{events}
                outputs[cut * stride + first + lane] = sqrt(greatest) * axial_depth_mm
"""
