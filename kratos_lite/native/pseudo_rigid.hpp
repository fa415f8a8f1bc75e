// One step of pseudo-rigid bodies, which deform homogeneously: explicit, linearly implicit, energy-momentum.
//
// A body: q = deformation gradient F (row-wise) and center x, u their rates.  A load is conjugate to u.
// Kinetic energy 1/2 tr(Fdot E0 Fdot^T), so each row of F has the mass matrix E0; St. Venant-Kirchhoff material.
// B(F) X, in Voigt order xx yy zz xy yz zx, is the strain sym(F^T X) with engineering shear.

#pragma once
#include "rigid.hpp"

namespace kl {

enum PseudoIntegrator { EXPLICIT, LINEARLY_IMPLICIT, ENERGY_MOMENTUM };

struct alignas(sizeof(Pack)) PseudoGroup {
    Pack q[12], u[12], load[12], euler[9], mass[1], volume[1], C[36], damping[1];
    Pack acceleration[3], spatial[12];  // of loads that stay constant
    Pack work[1], flaw[1];
    double h, tolerance;
    int count, integrator;
};

constexpr int VOIGT[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};

template <class D>
KL_INLINE void strain_rate(const D* F, const D* X, D* e) {
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3;
        e[a] = F[a] * X[a] + F[3 + a] * X[3 + a] + F[6 + a] * X[6 + a];
        e[3 + a] = F[a] * X[b] + F[3 + a] * X[3 + b] + F[6 + a] * X[6 + b];
        e[3 + a] += F[b] * X[a] + F[3 + b] * X[3 + a] + F[6 + b] * X[6 + a];
    }
}

// E = (F^T F - 1)/2
template <class D>
KL_INLINE void green_strain(const D* F, D* E) {
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3;
        E[a] = (F[a] * F[a] + F[3 + a] * F[3 + a] + F[6 + a] * F[6 + a] - 1.0) * 0.5;
        E[3 + a] = F[a] * F[b] + F[3 + a] * F[3 + b] + F[6 + a] * F[6 + b];
    }
}

template <class D>
KL_INLINE void stress(const Pack* C, int at, const D* E, D* S) {
    for (int a = 0; a < 6; ++a) {
        D row[6];
        load<6>(C + 6 * a, at, row);
        dot<6>(row, E, S[a]);
    }
}

// F S = B(F)^T S
template <class D>
KL_INLINE void first_stress(const D* F, const D* S, D* P) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            P[3 * i + j] = F[3 * i] * S[VOIGT[0][j]] + F[3 * i + 1] * S[VOIGT[1][j]] + F[3 * i + 2] * S[VOIGT[2][j]];
}

// A (9, 9): to each row of F the symmetric block (9) given, and B(left)^T (factor C) B(right).
template <class D>
KL_INLINE void tangent(const D* block, const D& factor, const D* left, const Pack* C, int at, const D* right, D* A) {
    for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l) {
            D S[6], column[9];
            for (int a = 0; a < 6; ++a) {
                S[a] = D{};
                for (int m = 0; m < 3; ++m)
                    S[a] += *reinterpret_cast<const D*>(C[6 * a + VOIGT[l][m]] + at) * right[3 * k + m];
                S[a] *= factor;
            }
            first_stress(left, S, column);
            for (int j = 0; j < 3; ++j) column[3 * k + j] += block[3 * j + l];
            for (int n = 0; n < 9; ++n) A[9 * n + 3 * k + l] = column[n];
        }
}

// E0 + factor S as a matrix
template <class D>
KL_INLINE void row_block(const D* euler, const D& factor, const D* S, D* block) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) block[3 * i + j] = euler[3 * i + j] + factor * S[VOIGT[i][j]];
}

// The change of Fdot in an explicit or linearly implicit step: forces at mid-step, taken to be constant or linear.
template <class D>
KL_INLINE void linear_step(const PseudoGroup& g, int at, const D* F, const D* U, const D* f, D* change) {
    const double h = g.h;
    D Fh[9], E[6], S[6], P[9], rate[6], rate_stress[6], damping[9], euler[9], volume, eta;
    load<9>(g.euler, at, euler);
    load<1>(g.volume, at, &volume);
    load<1>(g.damping, at, &eta);
    for (int k = 0; k < 9; ++k) Fh[k] = F[k] + h / 2 * U[k];
    green_strain(Fh, E);
    stress(g.C, at, E, S);
    strain_rate(Fh, U, rate);
    stress(g.C, at, rate, rate_stress);
    // K U = V (U S + B^T C B U)
    for (int a = 0; a < 6; ++a) rate_stress[a] = S[a] + eta * rate_stress[a];
    first_stress(Fh, rate_stress, P);
    first_stress(U, S, damping);
    for (int k = 0; k < 9; ++k) change[k] = h * (f[k] - volume * (P[k] + eta * damping[k]));
    if (g.integrator == EXPLICIT) {
        for (int i = 0; i < 3; ++i) {
            const D row[3] = {change[3 * i], change[3 * i + 1], change[3 * i + 2]};
            solve3(euler, row, change + 3 * i);
        }
    } else {
        D A[81], block[9];
        const D factor = (eta * (h / 2) + h * h / 4) * volume;
        row_block(euler, factor, S, block);
        tangent(block, factor, Fh, g.C, at, Fh, A);
        solve<9>(A, change);
    }
}

// The change of Fdot that conserves energy and momentum: Simo & Tarnow, ZAMP 43 (1992) 757-792.
//
// The strain of the end is that of the start and an increment, so that stiff bodies do not lose digits.  Newton's
// method has the stress S as a second unknown, eliminated (Magisano, Leonetti & Garcea, CMAME 313 (2017) 986-1005):
// its matrix takes S as linearized in the former iteration, not the stress of the present F, which in a stiff body
// that turns is far off.
template <class D>
KL_INLINE void energy_momentum(const PseudoGroup& g, int at, const D* F, const D* U, const D* f, D* change, D& flaw) {
    const double h = g.h;
    D E[6], S[6], euler[9], volume, eta, initial, fraction;
    load<9>(g.euler, at, euler);
    load<1>(g.volume, at, &volume);
    load<1>(g.damping, at, &eta);
    green_strain(F, E);
    stress(g.C, at, E, S);
    dot<9>(U, U, initial);
    fraction = 0.5 + eta / h;  // of the increment of strain in the mean stress
    for (int k = 0; k < 9; ++k) change[k] = D{};
    auto active = volume == volume;
    for (int step = 0; step < NEWTON_STEPS && any(active); ++step) {
        D dF[9], middle[9], end[9], e[6], de[6], P[9], r[9], A[81], block[9], moved, size;
        for (int k = 0; k < 9; ++k) {
            dF[k] = h * (U[k] + 0.5 * change[k]);
            middle[k] = F[k] + 0.5 * dF[k];
            end[k] = F[k] + dF[k];
        }
        row_block(euler, h * h / 4 * volume, S, block);
        tangent(block, h * h / 2 * fraction * volume, middle, g.C, at, end, A);
        strain_rate(middle, dF, e);
        for (int a = 0; a < 6; ++a) e[a] = E[a] + fraction * e[a];
        stress(g.C, at, e, S);
        first_stress(middle, S, P);
        for (int k = 0; k < 9; k += 3) apply(euler, change + k, r + k);
        for (int k = 0; k < 9; ++k) r[k] = h * (f[k] - volume * P[k]) - r[k];
        solve<9>(A, r);
        strain_rate(end, r, de);
        for (int a = 0; a < 6; ++a) e[a] += h / 2 * fraction * de[a];
        stress(g.C, at, e, S);
        for (int k = 0; k < 9; ++k) {
            change[k] = active ? change[k] + r[k] : change[k];
            end[k] = U[k] + change[k];
        }
        dot<9>(r, r, moved);
        dot<9>(end, end, size);
        active &= !(moved <= g.tolerance * g.tolerance * (size + initial));
    }
    flaw = active ? 1.0 : flaw;
}

template <int V>
KL_INLINE void pseudo_finish_body(PseudoGroup& g) {
    typedef typename lanes_of<V>::type D;
    const double h = g.h;
    for (int at = 0; at < g.count; at += V) {
        D q[12], u[12], f[12], change[12], m, work, flaw = {};
        load<12>(g.q, at, q);
        load<12>(g.u, at, u);
        load<12>(g.load, at, f);
        load<1>(g.mass, at, &m);
        load<1>(g.work, at, &work);
        if (g.integrator == ENERGY_MOMENTUM)
            energy_momentum(g, at, q, u, f, change, flaw);
        else
            linear_step(g, at, q, u, f, change);
        for (int k = 9; k < 12; ++k) change[k] = h * f[k] / m;
        for (int k = 0; k < 12; ++k) {
            const D step = h * (u[k] + 0.5 * change[k]);
            q[k] += step;
            u[k] += change[k];
            work += step * f[k];
        }
        add_flaw<12>(u, flaw);
        store<12>(q, at, g.q);
        store<12>(u, at, g.u);
        store<1>(&work, at, g.work);
        store<1>(&flaw, at, g.flaw);
    }
}

KL_DISPATCH(pseudo_finish, pseudo_finish_body, PseudoGroup&)

}  // namespace kl
