"""Two rectangles: separating axes, and the contact by clipping. Pure geometry."""

from __future__ import annotations

from pbd.jit import device

PREFERENCE = 1e-3
"""A face of the second box must separate better by this share of the boxes' size to be the reference face: of two
faces that are nearly as good, the same is taken in every step."""


@device
def box_box(a, b, margin, points):
    """Contact of boxes a and b, each (x, y, cos, sin, half width, half height), of gap at most ``margin``.

    points (>= 2, 4) receives x, y of the midpoints between the surfaces, the gap, and a feature number that stays while
    the same features touch. Returns (count, normal x, normal y, 0 or 1: the box whose face the normal belongs to); the
    normal points from a to b.
    """
    ax, ay, ac, as_, aw, ah = a
    bx, by, bc, bs, bw, bh = b
    dx, dy = bx - ax, by - ay
    # b's centre in a's frame, a's in b's, and the cosines between the axes
    px, py = ac * dx + as_ * dy, -as_ * dx + ac * dy
    qx, qy = -bc * dx - bs * dy, bs * dx - bc * dy
    c, s = abs(ac * bc + as_ * bs), abs(ac * bs - as_ * bc)
    on_ax, on_ay = abs(px) - aw - c * bw - s * bh, abs(py) - ah - s * bw - c * bh
    on_bx, on_by = abs(qx) - bw - c * aw - s * ah, abs(qy) - bh - s * aw - c * ah
    best_a, best_b = max(on_ax, on_ay), max(on_bx, on_by)
    if max(best_a, best_b) > margin:
        return 0, 0.0, 0.0, 0
    if best_b > best_a + PREFERENCE * (aw + ah):
        count, nx, ny = clip(b, a, (qx, qy), on_bx > on_by, margin, points)
        return count, -nx, -ny, 1
    count, nx, ny = clip(a, b, (px, py), on_ax > on_ay, margin, points)
    return count, nx, ny, 0


@device
def clip(reference, incident, centre, along_x, margin, points):
    """Clip the incident box's face against the reference face: (count, outward normal of the reference face)."""
    rx, ry, rc, rs, rw, rh = reference
    ix, iy, ic, is_, iw, ih = incident
    # outward normal and the tangent of the reference face
    if along_x:
        side = 1.0 if centre[0] >= 0.0 else -1.0
        nx, ny, height, width = side * rc, side * rs, rw, rh
    else:
        side = 1.0 if centre[1] >= 0.0 else -1.0
        nx, ny, height, width = -side * rs, side * rc, rh, rw
    tx, ty = -ny, nx
    # the incident face is the one most opposed to the normal; from its centre to its end
    u, v = nx * ic + ny * is_, -nx * is_ + ny * ic
    if abs(u) > abs(v):
        sign = -1.0 if u > 0.0 else 1.0
        mx, my, ex, ey = sign * iw * ic, sign * iw * is_, -is_ * ih, ic * ih
        face = 0 if u > 0.0 else 1
    else:
        sign = -1.0 if v > 0.0 else 1.0
        mx, my, ex, ey = -sign * ih * is_, sign * ih * ic, ic * iw, is_ * iw
        face = 2 if v > 0.0 else 3
    mx, my = ix + mx - rx, iy + my - ry
    middle_t, middle_n = mx * tx + my * ty, mx * nx + my * ny - height
    end_t, end_n = ex * tx + ey * ty, ex * nx + ey * ny
    count = 0
    for k in range(2):
        # where on the incident edge, from -1 to 1, the reference face ends
        at = -1.0 if k == 0 else 1.0
        if abs(middle_t + at * end_t) > width and abs(end_t) > 0.0:
            limit = width if middle_t + at * end_t > 0.0 else -width
            at = (limit - middle_t) / end_t
            if abs(at) > 1.0:
                continue
        gap = middle_n + at * end_n
        if gap <= margin:
            px, py = mx + at * ex - 0.5 * gap * nx, my + at * ey - 0.5 * gap * ny
            points[count, 0] = rx + px
            points[count, 1] = ry + py
            points[count, 2] = gap
            points[count, 3] = 2.0 * face + k
            count += 1
    return count, nx, ny
