"""Which points of a mesh a camera sees."""
import numpy as np


def surface(verts, faces, steps):
    """Points all over the mesh, so many steps along two edges of each face."""
    a, b, c = (verts[faces[:, k]] for k in range(3))
    return np.concatenate([a + u * (b - a) + v * (c - a)
                           for i, u in enumerate(steps)
                           for v in steps[:len(steps) - i]])


def project(points, cam, size):
    """Pixel of size x size that each point falls in, or the nearest of the border;
    whether it is inside; and the point in the camera's frame."""
    p = points @ cam[:, :3].T + cam[:, 3]
    at = np.floor(size / 2 + 6 * size * p[:, :2] / p[:, 2:]).astype(int)
    inside = ((at >= 0) & (at < size)).all(1)
    at = at.clip(0, size - 1)
    return at[:, 1] * size + at[:, 0], inside, p


def nearest(cell, depth, cells):
    """Depth of the nearest point of each cell, and which it is (-1: none); a point's
    cell may be -1, too."""
    order = np.argsort(-depth)
    order = order[cell[order] >= 0]
    near, which = np.full(cells, np.inf), np.full(cells, -1)
    near[cell[order]] = depth[order]
    which[cell[order]] = order
    return near, which
