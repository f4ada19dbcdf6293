r"""Tool and workpiece: axial depth, entry and exit angle along a path, from the geometry alone.

It depends on neither feed nor speed, so it is computed once for a path. The tool is a cylindrical flat end mill, its flutes as
long as need be; holder and shank are not looked at. The stock is a box; what is left of it is carried on from tool to tool:

    left, engaged = cut(Workpiece.of(stock, cell_mm=0.4), points_mm, 6.0)
    left, next_engaged = cut(left, other_points_mm, 3.0)

Angles are those of the cutting formula (formats, section 4): along the feed −F_t cos φ − F_r sin φ, across it, to the left,
F_t sin φ − F_r cos φ. F_r points from the tooth to the axis; at φ = 0 that is to the right, so the tooth is on the LEFT of the
heading; at φ = π/2 it is in front, at φ = π on the right. F_t is against the motion of the tooth; at φ = 0 that is backwards, so
the tooth moves forwards there, from the left to the front: clockwise seen from above, M3.

                 heading u
                     ^
                π/2  |  in front
                  .--+--.                      tooth:  p + R (sin φ u + cos φ l),  l to the left of u
                .'   |   '.
      left     /     |     \     right
      φ = 0 ---+-----p-----+--- φ = π          turns clockwise, φ grows with time
               \           /
                '.       .'
                  '-----'                      the half behind cuts nothing on a level move

    material on the left of the heading  = up-milling:    entry 0,                      exit arccos(1 − a_e / R)
    material on the right                = down-milling:  entry π − arccos(1 − a_e / R), exit π
    slot                                                  entry 0,                      exit π

For M4 the picture is mirrored: φ → π − φ. An angle is relative to the heading, so the rows hold for every heading.

One row holds one depth and one arc, as the run log does. Where the rim meets several arcs or steps, the row holds the rectangle
with the same mean power and, as far as there is one, the same mean force vector; a tooth's peak is lost (rectangle.py says how
much). `exact` says where a row is the geometry itself.
On a level or ramping move the front half of the rim counts. The end face of a ramp or plunge has no place in the cutting formula:
it is reported as an area (`end_face_mm2`) and a volume, and a plunge has depth 0. Rapids remove what they meet, and are reported.

How exact it is: the surface is that of the exact sweeps (cells.py), so angles are those of the given polyline to 1e-6 rad
whatever the cells. What is left is the path itself. Chords of length c on an arc of radius ρ put a wall off by c² / 8ρ; a chord
should be no longer than `resolution_mm`, for a chord that is cut into several rows has its own heading in all of them, which is
off by up to c / 2ρ at its ends. `benchmarks/engagement.py` prints the largest errors, in degrees (R = 3 mm, arcs of 10 mm):

    chords = rows, mm   slot, line or arc   shoulder   way in from air   concave wall   depth, mm
    1.0                 0                   2e-7       5e-7              0.33           0
    0.5                 0                   2e-7       5e-7              0.09           0
    0.2                 0                   2e-7       5e-7              0.014          0
    0.1                 0                   2e-7       5e-7              0.003          0
    0.05                0                   2e-7       5e-7              0.001          0

The front half is looked at in steps of 1°: material narrower than that on the rim may be missed, chips narrower than 1 µm across
the feed are none. The end face of a ramp or plunge is sampled at 256 points (about 1 % of its area).
"""

from twin.engagement.engaged import Collision, Engagement
from twin.engagement.removal import cut
from twin.engagement.workpiece import Workpiece
from twin.errors import EngagementError

__all__ = ["Collision", "Engagement", "EngagementError", "Workpiece", "cut"]
