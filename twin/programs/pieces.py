"""Canonical motions seen in a plane as lines and arcs, and put back."""

from twin.programs.arcs import Point
from twin.programs.canonical import Arc, Linear, Motion, Position, Rapid
from twin.programs.planar import Piece
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError


def in_plane(position: Position, plane: int) -> Point:
    """The two coordinates of a position in G17, G18 or G19."""
    first, second, _ = PLANES[plane]
    return (position[first], position[second])


def placed(position: Position, point: Point, plane: int) -> Position:
    """`position` with its coordinates in the plane replaced."""
    first, second, _ = PLANES[plane]
    moved = list(position)
    moved[first], moved[second] = point
    return tuple(moved)


def piece(start: Position, move: Motion, plane: int) -> Piece:
    """Return the line or arc that a motion is in the plane. RefusedError for an arc of another plane."""
    a, b = in_plane(start, plane), in_plane(move.end_mm, plane)
    if isinstance(move, Arc):
        if move.plane != plane:
            raise RefusedError("", f"an arc of G{move.plane} cannot be worked on in G{plane}", (move.line, move.program))
        return Piece(a, b, in_plane(move.centre_mm, plane), move.sweep_rad)
    return Piece(a, b)


def rebuilt(move: Motion, start: Position, changed: Piece, plane: int) -> Motion:
    """The motion that goes along the changed piece from `start`; out of the plane it stays as it was."""
    end = placed(move.end_mm, changed.end, plane)
    if isinstance(move, Arc) and changed.centre is not None:
        full = placed(start[:3], changed.centre, plane)
        return move._replace(end_mm=end, centre_mm=(full[0], full[1], full[2]), sweep_rad=changed.sweep_rad)
    return move._replace(end_mm=end)


def straight(like: Motion, end: Position) -> Rapid | Linear:
    """A straight motion of the same line, feed and kind."""
    if isinstance(like, Rapid):
        return like._replace(end_mm=end)
    return Linear(like.line, end, like.feed_mm_min, like.feed_per_rev_mm, like.program)


def rounded(like: Motion, start: Position, arc: Piece, plane: int) -> Arc:
    """An arc of the same line and feed; a rapid has none."""
    assert arc.centre is not None and not isinstance(like, Rapid)
    full = placed(start[:3], arc.centre, plane)
    end = placed(start, arc.end, plane)
    centre = (full[0], full[1], full[2])
    return Arc(like.line, end, centre, plane, arc.sweep_rad, like.feed_mm_min, like.feed_per_rev_mm, like.program)
