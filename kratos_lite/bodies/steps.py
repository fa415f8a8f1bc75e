"""temp."""

import numpy as np

from kratos_lite.bodies.rigid import rotation_of
from kratos_lite.rotations import exp, hat, right_jacobian


def cols(R):
    return np.swapaxes(R, -1, -2).reshape(*R.shape[:-2], 9)


def mv(A, b):
    return (A @ b[..., None])[..., 0]


def rigid_half(q, u, h):
    out = q.copy()
    R = rotation_of(q) @ exp(h / 2 * u[..., :3])
    out[..., :9] = cols(R)
    out[..., 9:] += h / 2 * u[..., 3:]
    return out


def rigid_finish(q, u, qh, load, J, m, h, scheme, tol):
    Rh = rotation_of(qh)
    W = u[..., :3].copy()
    T = load[..., :3]
    E1 = exp(h / 2 * W)
    p = mv(np.swapaxes(E1, -1, -2), mv(J, W))
    Wh = np.linalg.solve(J, (p + h / 2 * T)[..., None])[..., 0]
    W1 = W + h * np.linalg.solve(J, (T - np.cross(Wh, mv(J, Wh)))[..., None])[..., 0]
    A = p + h * T
    if scheme == "RIG_POS":
        R = Rh @ exp(h / 2 * W1)
        Wn = W1
    elif scheme == "RIG_NEG":
        E2 = exp(h / 2 * W1)
        R = Rh @ E2
        Wn = np.linalg.solve(J, mv(np.swapaxes(E2, -1, -2), A)[..., None])[..., 0]
    else:
        Wn = W1.copy()
        for _ in range(50):
            e = exp(h / 2 * Wn)
            b = mv(J, Wn)
            r = mv(e, b) - A
            K = e @ J - h / 2 * e @ hat(b) @ right_jacobian(h / 2 * Wn)
            d = -np.linalg.solve(K, r[..., None])[..., 0]
            Wn = Wn + d
            if abs(d).max() <= 4e-16 * abs(Wn).max():
                break
        R = Rh @ exp(h / 2 * Wn)
    v = u[..., 3:] + h * load[..., 3:] / np.asarray(m)[..., None]
    q[..., :9] = cols(R)
    q[..., 9:] = qh[..., 9:] + h / 2 * v
    u[..., :3] = Wn
    u[..., 3:] = v


def advance(body, h, count):
    from kratos_lite.bodies.schemes import SCHEMES

    for _ in range(count):
        b = body.u.copy()
        l = SCHEMES[body.scheme](body, h)
        body.external_work = body.external_work + h / 2 * ((b + body.u) * l).sum(-1)


def drift(body, h):
    body.q = rigid_half(body.q, body.u, 2 * h)
