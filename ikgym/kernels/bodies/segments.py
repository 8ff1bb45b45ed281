"""Kernels: signed distances of segments from segments, boxes and planes, with the direction in which they grow.

Spheres and capsules are segments with a radius around them. Each kernel gives the distance of the cores, the unit
vector from the second to the first one, and the point of the first that is nearest.
"""

from __future__ import annotations

import math

from ikgym.kernels.jit import inlined, uncounted

# Below this distance in [m] two cores meet, and the direction from one to the other is not defined by them.
MEETING = 1e-12


@inlined
def _clamp(value):
    return min(max(value, 0.0), 1.0)


@inlined
def between_segments(ax, ay, az, ux, uy, uz, bx, by, bz, vx, vy, vz):
    """The parameters in [0, 1] of the nearest points of the segments a + s u and b + t v (Ericson 2005, 5.1.9).

    His determinant a c - b² and its numerator are products of u × v here: the differences lose half of the digits
    where the segments are nearly parallel.
    """
    wx, wy, wz = ax - bx, ay - by, az - bz
    a, b, c = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    d, e = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    if a == 0.0:
        return 0.0, _clamp(e / c) if c > 0.0 else 0.0
    if c == 0.0:
        return _clamp(-d / a), 0.0
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    mx, my, mz = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
    determinant = nx * nx + ny * ny + nz * nz
    s = _clamp((nx * mx + ny * my + nz * mz) / determinant) if determinant > 0.0 else 0.0
    t = (b * s + e) / c
    if t < 0.0:
        return _clamp(-d / a), 0.0
    if t > 1.0:
        return _clamp((b - d) / a), 1.0
    return s, t


@uncounted
def segment_segment(first, second):
    """Two segments, each given by start and end, of shape (6,) or more, in [m].

    Returns:
        The distance, the unit vector from the second to the first, and the nearest point of the first. Where they cross
        the vector is perpendicular to both.
    """
    ax, ay, az = first[0], first[1], first[2]
    ux, uy, uz = first[3] - ax, first[4] - ay, first[5] - az
    bx, by, bz = second[0], second[1], second[2]
    vx, vy, vz = second[3] - bx, second[4] - by, second[5] - bz
    s, t = between_segments(ax, ay, az, ux, uy, uz, bx, by, bz, vx, vy, vz)
    x, y, z = ax + s * ux, ay + s * uy, az + s * uz
    nx, ny, nz = x - bx - t * vx, y - by - t * vy, z - bz - t * vz
    distance = math.sqrt(nx * nx + ny * ny + nz * nz)
    if distance > MEETING:
        return distance, nx / distance, ny / distance, nz / distance, x, y, z
    nx, ny, nz = _perpendicular(ux, uy, uz, vx, vy, vz)
    return distance, nx, ny, nz, x, y, z


@inlined
def _perpendicular(ux, uy, uz, vx, vy, vz):
    """A unit vector perpendicular to two others, of which one or both may vanish or which may be parallel."""
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < MEETING:
        if ux * ux + uy * uy + uz * uz == 0.0:
            ux, uy, uz = vx, vy, vz
        nx, ny, nz = (uy, -ux, 0.0) if abs(uz) < max(abs(ux), abs(uy)) else (0.0, uz, -uy)
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if length == 0.0:  # two points
            return 0.0, 0.0, 1.0
    return nx / length, ny / length, nz / length


@inlined
def _outside(value, half):
    """How far a coordinate is outside of a box, with its sign."""
    return value - min(max(value, -half), half)


@inlined
def _slope(t, px, py, pz, dx, dy, dz, hx, hy, hz):
    """Half the derivative of the squared distance of p + t d from a box."""
    along = dx * _outside(px + t * dx, hx) + dy * _outside(py + t * dy, hy)
    return along + dz * _outside(pz + t * dz, hz)


@inlined
def _narrow(low, high, at_low, at_high, p, d, bound, ray, half):
    """The interval that has the minimum, cut where the segment passes a face: the slope is linear in between."""
    if d == 0.0:
        return low, high, at_low, at_high
    t = (bound - p) / d
    if not low < t < high:
        return low, high, at_low, at_high
    slope = _slope(t, ray[0], ray[1], ray[2], ray[3], ray[4], ray[5], half[0], half[1], half[2])
    if slope <= 0.0:
        return t, high, slope, at_high
    return low, t, at_low, slope


@inlined
def _nearest_to_box(px, py, pz, dx, dy, dz, hx, hy, hz):
    """The parameter in [0, 1] at which the segment p + t d is nearest to a box."""
    ray, half = (px, py, pz, dx, dy, dz), (hx, hy, hz)
    at_low = _slope(0.0, px, py, pz, dx, dy, dz, hx, hy, hz)
    at_high = _slope(1.0, px, py, pz, dx, dy, dz, hx, hy, hz)
    if at_low >= 0.0:
        return 0.0
    if at_high <= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    for sign in (-1.0, 1.0):
        low, high, at_low, at_high = _narrow(low, high, at_low, at_high, px, dx, sign * hx, ray, half)
        low, high, at_low, at_high = _narrow(low, high, at_low, at_high, py, dy, sign * hy, ray, half)
        low, high, at_low, at_high = _narrow(low, high, at_low, at_high, pz, dz, sign * hz, ray, half)
    return low - at_low * (high - low) / (at_high - at_low)


@uncounted
def segment_box(segment, box):
    """A segment and a box.

    Args:
        segment: Start and end in [m]. Shape (6,) or more.
        box: Rotation, row by row, position in [m] and half the edge lengths in [m]. Shape (15,) or more.

    Returns:
        The distance, the unit vector from the box to the segment and its nearest point. Where they meet, the distance
        is minus the least length by which they have to be moved apart, and the vector the direction of that.
    """
    px, py, pz = into_box(box, segment[0], segment[1], segment[2])
    ex, ey, ez = into_box(box, segment[3], segment[4], segment[5])
    dx, dy, dz = ex - px, ey - py, ez - pz
    hx, hy, hz = box[12], box[13], box[14]
    t = _nearest_to_box(px, py, pz, dx, dy, dz, hx, hy, hz)
    x, y, z = px + t * dx, py + t * dy, pz + t * dz
    nx, ny, nz = _outside(x, hx), _outside(y, hy), _outside(z, hz)
    distance = math.sqrt(nx * nx + ny * ny + nz * nz)
    if distance > MEETING:
        nx, ny, nz = nx / distance, ny / distance, nz / distance
    else:
        distance, nx, ny, nz, t = _inside(px, py, pz, dx, dy, dz, hx, hy, hz)
    mx = box[0] * nx + box[1] * ny + box[2] * nz
    my = box[3] * nx + box[4] * ny + box[5] * nz
    mz = box[6] * nx + box[7] * ny + box[8] * nz
    ux, uy, uz = segment[3] - segment[0], segment[4] - segment[1], segment[5] - segment[2]
    return distance, mx, my, mz, segment[0] + t * ux, segment[1] + t * uy, segment[2] + t * uz


@inlined
def into_box(box, x, y, z):
    """A point in the frame of a box; see :func:`segment_box`."""
    x, y, z = x - box[9], y - box[10], z - box[11]
    return (
        box[0] * x + box[3] * y + box[6] * z,
        box[1] * x + box[4] * y + box[7] * z,
        box[2] * x + box[5] * y + box[8] * z,
    )


@inlined
def _push(best, nx, ny, nz, ray, half):
    """The shortest way apart, where a direction and its opposite are looked at, too.

    ``best`` holds the signed distance, the direction, and the parameter of the point that is deepest.
    """
    px, py, pz, dx, dy, dz = ray
    size = abs(nx) * half[0] + abs(ny) * half[1] + abs(nz) * half[2]
    start = nx * px + ny * py + nz * pz
    along = nx * dx + ny * dy + nz * dz
    low, high = start + min(along, 0.0), start + max(along, 0.0)
    if low - size > best[0]:
        best = low - size, nx, ny, nz, 1.0 if along < 0.0 else 0.0
    if -high - size > best[0]:
        best = -high - size, -nx, -ny, -nz, 1.0 if along > 0.0 else 0.0
    return best


@inlined
def _pushed_across(best, ex, ey, ez, ray, half):
    """The same perpendicular to the segment and to an edge of the box; the nearest points are on both."""
    px, py, pz, dx, dy, dz = ray
    nx, ny, nz = ey * dz - ez * dy, ez * dx - ex * dz, ex * dy - ey * dx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < MEETING:
        return best
    before = best[0]
    best = _push(best, nx / length, ny / length, nz / length, ray, half)
    if best[0] > before:
        # The edge is on the side that the segment is pushed to.
        cx, cy, cz = math.copysign(half[0], best[1]), math.copysign(half[1], best[2]), math.copysign(half[2], best[3])
        lx, ly, lz = ex * half[0], ey * half[1], ez * half[2]
        cx, cy, cz = cx * (1.0 - ex) - lx, cy * (1.0 - ey) - ly, cz * (1.0 - ez) - lz
        t, _ = between_segments(px, py, pz, dx, dy, dz, cx, cy, cz, 2.0 * lx, 2.0 * ly, 2.0 * lz)
        best = best[0], best[1], best[2], best[3], t
    return best


@inlined
def _inside(px, py, pz, dx, dy, dz, hx, hy, hz):
    """Signed distance, direction and parameter of a segment that meets a box, by all faces of their difference."""
    ray, half = (px, py, pz, dx, dy, dz), (hx, hy, hz)
    best = (-math.inf, 0.0, 0.0, 1.0, 0.0)
    best = _push(best, 1.0, 0.0, 0.0, ray, half)
    best = _push(best, 0.0, 1.0, 0.0, ray, half)
    best = _push(best, 0.0, 0.0, 1.0, ray, half)
    best = _pushed_across(best, 1.0, 0.0, 0.0, ray, half)
    best = _pushed_across(best, 0.0, 1.0, 0.0, ray, half)
    return _pushed_across(best, 0.0, 0.0, 1.0, ray, half)


@uncounted
def segment_plane(segment, plane):
    """A segment and a half-space, whose rotation's third column points out of it and whose position is on its face.

    Returns:
        The signed distance of the lower end, the normal, and that end.
    """
    nx, ny, nz = plane[2], plane[5], plane[8]
    start = nx * (segment[0] - plane[9]) + ny * (segment[1] - plane[10]) + nz * (segment[2] - plane[11])
    end = nx * (segment[3] - plane[9]) + ny * (segment[4] - plane[10]) + nz * (segment[5] - plane[11])
    if start <= end:
        return start, nx, ny, nz, segment[0], segment[1], segment[2]
    return end, nx, ny, nz, segment[3], segment[4], segment[5]
