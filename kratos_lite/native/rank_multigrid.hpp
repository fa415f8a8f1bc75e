// Levels and transfers of a multigrid over ranks, for arrays.

#pragma once
#include <memory>

#include "arrays.hpp"
#include "rank_level.hpp"

namespace kl {

template <class T>
Prolongator prolongator_of(Indices indptr, Indices indices, const Array<T>& data, bool ascending = true) {
    check_rows(indptr, indices.size());
    const int32_t *start = indptr.data(), *column = indices.data();
    for (int64_t i = 0; ascending && i + 1 < indptr.size(); ++i)  // as Galerkin's product goes through them
        for (int32_t k = start[i] + 1; k < start[i + 1]; ++k)
            require(column[k - 1] < column[k], "the columns of each row of P must rise");
    Prolongator P;
    P.indptr.assign(indptr.data(), indptr.data() + indptr.size());
    P.indices.assign(indices.data(), indices.data() + indices.size());
    P.data.assign(data.data(), data.data() + data.size());
    P.data.resize(P.data.size() + 8);
    return P;
}

inline Bytes bytes_in(const Array<uint8_t>& a) { return {a.data(), a.data() + a.size()}; }

class SharedLevel {
public:
    SharedLevel(Array<int32_t> indptr, Array<int32_t> indices, Array<double> data, Array<uint8_t> fixed, int b)
        : indptr(std::move(indptr)), indices(std::move(indices)), data(std::move(data)) {
        require(b == 3 || b == 6, "blocks must be 3x3 or 6x6");
        require(fixed.size() % b == 0 && this->indptr.size() - 1 <= fixed.size() / b, "fixed must be that of all nodes");
        require(this->data.size() == b * b * this->indices.size(), "data must be (nnz, b, b)");
        check_rows(this->indptr, this->indices.size());
        require(are_rows(this->indices, fixed.size() / b), "indices must be nodes");
        const Graph g{this->indptr.size() - 1, this->indptr.data(), this->indices.data()};
        Bytes held = bytes_in(fixed);
        GilReleased release;
        level = std::make_unique<RankLevel>(g, this->data.data(), b, std::move(held));
    }

    SharedLevel(const MatrixFree& product, std::shared_ptr<void> keep, Array<uint8_t> fixed, int64_t own)
        : keep(std::move(keep)) {
        require(fixed.size() == 3 * product.n && own >= 0 && own <= product.n, "fixed must be that of all nodes");
        Bytes held = bytes_in(fixed);
        GilReleased release;
        level = std::make_unique<RankLevel>(product, own, std::move(held));
    }

    void step(const Array<float>& x, const Array<float>& c, Array<float> d, Array<float> to, double alpha, double beta) const {
        check({&x, &c, &d, &to});
        float *change = d.mutable_data(), *next = to.mutable_data();
        GilReleased release;
        level->step(x.data(), c.data(), change, next, static_cast<float>(alpha), static_cast<float>(beta));
    }

    void first_step(const Array<float>& c, Array<float> d, Array<float> x, double beta) const {
        check({&c, &d, &x});
        float *change = d.mutable_data(), *first = x.mutable_data();
        GilReleased release;
        level->first_step(c.data(), change, first, static_cast<float>(beta));
    }

    auto aggregates(double theta) const {
        require(level->is_whole(), "its blocks are forgotten");
        Ints of;
        int32_t count = 0;
        {
            GilReleased release;
            count = level->aggregates(theta, of);
        }
        return std::make_tuple(Array<int32_t>(of), count);
    }

    // The modes (n, b, 6) made orthonormal over each aggregate, and those of the coarse nodes (count, 6, 6).
    auto tentative(Indices of, int count, Numbers modes) const {
        require(of.size() == level->n() && modes.size() == MODES * level->b() * level->n(), "modes must be (n, b, 6)");
        const Ints group(of.data(), of.data() + of.size());
        for (int32_t one : group) require(one < count, "there is no such aggregate");
        Doubles T(modes.data(), modes.data() + modes.size()), R;
        {
            GilReleased release;
            R = level->b() == 3 ? tentative_prolongator<3>(group, count, T, 1) : tentative_prolongator<6>(group, count, T, 1);
        }
        return std::make_tuple(Array<double>(T), Array<double>(R));
    }

    auto prolongator(Indices of, Numbers T, double omega) const {
        require(level->is_whole(), "its blocks are forgotten");
        require(of.size() == level->all() && T.size() == MODES * level->b() * level->all(), "T must be (all, b, 6)");
        const Ints group(of.data(), of.data() + of.size());
        const Doubles modes(T.data(), T.data() + T.size());
        Prolongator P;
        {
            GilReleased release;
            P = level->prolongator(group, modes, omega);
        }
        P.data.resize(P.indices.size() * level->b() * MODES);
        return std::make_tuple(Array<int32_t>(P.indptr), Array<int32_t>(P.indices), Array<float>(P.data));
    }

    auto galerkin(Indices indptr, Indices indices, const Array<float>& values, int count) const {
        require(level->is_whole(), "its blocks are forgotten");
        require(indptr.size() == level->all() + 1 && values.size() == MODES * level->b() * indices.size() &&
                    are_rows(indices, count),
                "P must have rows of blocks for all nodes");
        const Prolongator P = prolongator_of(indptr, indices, values);
        CoarseMatrix C;
        {
            GilReleased release;
            C = level->galerkin(P, count);
        }
        return std::make_tuple(Array<int32_t>(C.indptr), Array<int32_t>(C.indices), Array<double>(C.data));
    }

    void forget() {
        level->forget();
        data = {};
    }

    int64_t bytes() const { return level->bytes(); }

private:
    void check(std::initializer_list<const Array<float>*> vectors) const {
        for (const Array<float>* v : vectors) require(v->size() >= level->room(), "a vector needs room for all nodes and 8");
    }

    Array<int32_t> indptr, indices;
    Array<double> data;
    std::shared_ptr<void> keep;
    std::unique_ptr<RankLevel> level;
};

// From own nodes to coarse ones, of which some are copies: blocks (b, 6), or one weight for each pair.
class SharedTransfer {
public:
    SharedTransfer(Indices indptr, Indices indices, const Array<float>& data, int b, int64_t fine, int64_t coarse,
                   const Array<uint8_t>& fine_fixed, const Array<uint8_t>& coarse_fixed)
        : b(b), own(indptr.size() - 1), fine(fine), coarse(coarse) {
        require(are_rows(indices, coarse), "indices must be coarse nodes");
        transfer.weights = data.ndim() == 1;
        require(data.size() == (transfer.weights ? 1 : b * MODES) * indices.size(),
                "data must be weights (nnz) or blocks (nnz, b, 6)");
        require((b == 3 || b == 6) && own <= fine, "blocks must be of 3 or 6 rows");
        transfer.P = prolongator_of(indptr, indices, data, !transfer.weights);
        transfer.fine_fixed = bytes_in(fine_fixed);
        transfer.coarse_fixed = bytes_in(coarse_fixed);
        require(!transfer.weights || (static_cast<int64_t>(transfer.fine_fixed.size()) >= 3 * own &&
                                      static_cast<int64_t>(transfer.coarse_fixed.size()) == 3 * coarse),
                "weights need what is fixed");
        transfer.columns = Transposed(coarse, transfer.P.indptr, transfer.P.indices);
    }

    // coarse = P^T fine, the share of own nodes
    void restrict_to(const Array<float>& from, Array<float> to) const {
        check(from, to);
        float* sums = to.mutable_data();
        GilReleased release;
        transfer.restrict_to(b, from.data(), coarse, sums);
    }

    // fine += P coarse
    void prolong(const Array<float>& from, Array<float> to) const {
        check(to, from);
        float* sums = to.mutable_data();
        GilReleased release;
        transfer.prolong(from.data(), b, own, sums);
    }

    int64_t bytes() const { return transfer.bytes(); }

private:
    void check(const Array<float>& above, const Array<float>& below) const {
        require(above.size() >= b * fine + 8 && below.size() >= (transfer.weights ? 3 : MODES) * coarse + 8,
                "a vector needs room for all nodes and 8");
    }

    int b;
    int64_t own, fine, coarse;
    Transfer transfer;
};

}  // namespace kl
