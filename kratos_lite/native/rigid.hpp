// One step of rigid bodies: Koziara & Bicanic, Int. J. Numer. Meth. Eng. 81 (2010) 1073-1092.
//
// A body: q = rotation R (column-wise) and center x, u = referential angular velocity W and velocity v.
// A load is conjugate to u: referential torque, then force.

#pragma once
#include "body_group.hpp"

namespace kl {

enum RigidIntegrator { RIGID_POSITIVE, RIGID_NEGATIVE, RIGID_IMPLICIT };

struct alignas(sizeof(Pack)) RigidGroup {
    Pack q[12], u[6], qh[12], load[6], inertia[9], inverse[9], mass[1];
    Pack acceleration[3], spatial[6], convected[6];  // of loads that stay constant
    Pack work[1], flaw[1];                           // work of the loads; not 0 where the step failed
    double h, tolerance;
    int count, integrator;
};

constexpr int NEWTON_STEPS = 50;
constexpr double ROUND_OFF = 4e-16;  // relative change of a velocity that is none

template <class D>
KL_INLINE void load_rotation(const Pack* q, int at, D* R) {
    for (int k = 0; k < 9; ++k) R[3 * (k % 3) + k / 3] = *reinterpret_cast<const D*>(q[k] + at);
}

template <class D>
KL_INLINE void store_rotation(const D* R, int at, Pack* q) {
    for (int k = 0; k < 9; ++k) *reinterpret_cast<D*>(q[k] + at) = R[3 * (k % 3) + k / 3];
}

// Not a number or infinite anywhere: the sum is not a number.
template <int K, class D>
KL_INLINE void add_flaw(const D* x, D& flaw) {
    for (int k = 0; k < K; ++k) flaw += x[k] - x[k];
}

// Rh = R exp(h/2 W), xh = x + h/2 v
template <int V>
KL_INLINE void rigid_half_body(RigidGroup& g) {
    typedef typename lanes_of<V>::type D;
    const double half = g.h / 2;
    for (int at = 0; at < g.count; at += V) {
        D R[9], E[9], Rh[9], u[6], x[3];
        load_rotation(g.q, at, R);
        load<6>(g.u, at, u);
        load<3>(g.q + 9, at, x);
        rotation(u, half, E);
        product(R, E, Rh);
        for (int i = 0; i < 3; ++i) x[i] += half * u[3 + i];
        store_rotation(Rh, at, g.qh);
        store<3>(x, at, g.qh + 9);
    }
}

// The load at mid-step of an acceleration, a spatial torque and force, a referential torque and a convected force.
template <int V>
KL_INLINE void rigid_load_body(RigidGroup& g) {
    typedef typename lanes_of<V>::type D;
    for (int at = 0; at < g.count; at += V) {
        D R[9], a[3], spatial[6], convected[6], m, total[6];
        load_rotation(g.qh, at, R);
        load<3>(g.acceleration, at, a);
        load<6>(g.spatial, at, spatial);
        load<6>(g.convected, at, convected);
        load<1>(g.mass, at, &m);
        apply_transposed(R, spatial, total);
        apply(R, convected + 3, total + 3);
        for (int i = 0; i < 3; ++i) {
            total[i] += convected[i];
            total[3 + i] += m * a[i] + spatial[3 + i];
        }
        store<6>(total, at, g.load);
    }
}

// W of exp(h/2 W) J W = A by Newton's method on J W - exp(-h/2 W) A = 0; lanes stop one by one.
template <class D>
KL_INLINE void implicit_velocity(const D* J, const D* A, double h, double tolerance, D* W, D& flaw) {
    D size = {}, t2, a, b, c;
    for (int i = 0; i < 3; ++i) {
        const D magnitude = A[i] < 0 ? -A[i] : A[i];
        size = magnitude > size ? magnitude : size;
    }
    auto active = size == size;
    for (int step = 0; step < NEWTON_STEPS && any(active); ++step) {
        D E[9], JW[3], r[3], d[3], rr, dd, ww, H[9], HH[9], tangent[9], change[9];
        const D psi[3] = {h / 2 * W[0], h / 2 * W[1], h / 2 * W[2]};
        dot<3>(psi, psi, t2);
        coefficients(t2, a, b, c);
        rotation(psi, t2, a, b, E);
        apply(J, W, JW);
        apply_transposed(E, A, r);
        for (int i = 0; i < 3; ++i) r[i] -= JW[i];
        dot<3>(r, r, rr);
        active &= !(rr <= tolerance * tolerance * size * size);
        if (!any(active)) break;
        // tangent J - h/2 hat(J W) T, where T = 1 - b hat(ψ) + c hat(ψ)² is the right Jacobian
        const D zero = {};
        const D hat_psi[9] = {zero, -psi[2], psi[1], psi[2], zero, -psi[0], -psi[1], psi[0], zero};
        const D hat_JW[9] = {zero, -JW[2], JW[1], JW[2], zero, -JW[0], -JW[1], JW[0], zero};
        product(hat_psi, hat_psi, HH);
        for (int k = 0; k < 9; ++k) H[k] = c * HH[k] - b * hat_psi[k] + (k % 4 ? 0.0 : 1.0);
        product(hat_JW, H, change);
        for (int k = 0; k < 9; ++k) tangent[k] = J[k] - h / 2 * change[k];
        solve3(tangent, r, d);
        for (int i = 0; i < 3; ++i) W[i] = active ? W[i] + d[i] : W[i];
        dot<3>(d, d, dd);
        dot<3>(W, W, ww);
        active &= !(dd <= ROUND_OFF * ROUND_OFF * ww);
    }
    flaw = active ? 1.0 : flaw;
}

template <int V>
KL_INLINE void rigid_finish_body(RigidGroup& g) {
    typedef typename lanes_of<V>::type D;
    const double h = g.h;
    for (int at = 0; at < g.count; at += V) {
        D Rh[9], R[9], J[9], inverse[9], u[6], next[6], load_[6], m, x[3], work, flaw = {};
        D E[9], JW[3], p[3], A[3], Wh[3], JWh[3], rate[3], part[3];
        load_rotation(g.qh, at, Rh);
        load<6>(g.u, at, u);
        load<6>(g.load, at, load_);
        load<9>(g.inertia, at, J);
        load<9>(g.inverse, at, inverse);
        load<1>(g.mass, at, &m);
        load<3>(g.qh + 9, at, x);
        load<1>(g.work, at, &work);
        rotation(u, h / 2, E);
        apply(J, u, JW);
        apply_transposed(E, JW, p);
        // half a step of momentum gives the velocity there, and that the whole step
        for (int i = 0; i < 3; ++i) part[i] = p[i] + h / 2 * load_[i];
        apply(inverse, part, Wh);
        apply(J, Wh, JWh);
        cross(Wh, JWh, part);
        for (int i = 0; i < 3; ++i) part[i] = load_[i] - part[i];
        apply(inverse, part, rate);
        for (int i = 0; i < 3; ++i) {
            next[i] = u[i] + h * rate[i];
            next[3 + i] = u[3 + i] + h * load_[3 + i] / m;
            A[i] = p[i] + h * load_[i];
            x[i] += h / 2 * next[3 + i];
        }
        if (g.integrator == RIGID_IMPLICIT) implicit_velocity(J, A, h, g.tolerance, next, flaw);
        rotation(next, h / 2, E);
        product(Rh, E, R);
        if (g.integrator == RIGID_NEGATIVE) {
            apply_transposed(E, A, part);
            apply(inverse, part, next);
        }
        for (int k = 0; k < 6; ++k) work += h / 2 * ((u[k] + next[k]) * load_[k]);
        add_flaw<6>(next, flaw);
        store_rotation(R, at, g.q);
        store<3>(x, at, g.q + 9);
        store<6>(next, at, g.u);
        store<1>(&work, at, g.work);
        store<1>(&flaw, at, g.flaw);
    }
}

KL_DISPATCH(rigid_half, rigid_half_body, RigidGroup&)
KL_DISPATCH(rigid_load, rigid_load_body, RigidGroup&)
KL_DISPATCH(rigid_finish, rigid_finish_body, RigidGroup&)

}  // namespace kl
