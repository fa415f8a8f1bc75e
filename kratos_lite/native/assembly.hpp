// Assembly: which thread adds which elements to a matrix over a node graph, and where.
//
// Elements are cut into chunks, chunks into subdomains of consecutive ones.  A row of the matrix belongs
// to the subdomain with the first element at its node; only the owner of a row adds to it, and it
// computes the chunks of later subdomains that reach into its rows as well.  So every row sums its
// elements in ascending order, whatever the number of subdomains and of threads.

#pragma once
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>
#include <vector>

#include "isa.hpp"
#include "pattern.hpp"
#include "threads.hpp"

namespace kl {

class Subdomains {
public:
    Subdomains(int64_t rows, const Connectivity& mesh, int width, int threads) : mesh(mesh), width(width) {
        const int64_t chunks = (mesh.count + width - 1) / width;
        const int64_t wanted = threads > 1 ? std::min<int64_t>(2 * threads, chunks / 8) : 1;
        cut(rows, chunks, std::max<int64_t>(1, wanted));
        int64_t computed = 0;
        for (const auto& subdomain : subdomains) computed += static_cast<int64_t>(subdomain.size());
        if (computed > threads * chunks) cut(rows, chunks, 1);  // scattered: sharing costs more than it saves
    }

    size_t size() const { return subdomains.size(); }
    const std::vector<int32_t>& chunks(int64_t subdomain) const { return subdomains[subdomain]; }
    bool owns(int64_t subdomain, int32_t node) const { return owner[node] == subdomain; }

private:
    void cut(int64_t rows, int64_t chunks, int64_t count) {
        owner.assign(rows, 0);
        subdomains.assign(count, {});
        const int64_t each = (chunks + count - 1) / count;
        const int64_t nodes = each * width * mesh.k;  // of one subdomain
        for (int64_t s = count - 1; s >= 0; --s)      // backwards, so that the first subdomain stays
            for (int64_t i = s * nodes; i < std::min(mesh.count * mesh.k, (s + 1) * nodes); ++i)
                owner[mesh.nodes[i]] = static_cast<int32_t>(s);
        for (int64_t s = 0; s < count; ++s)
            for (int64_t g = s * each; g < std::min(chunks, (s + 1) * each); ++g)
                subdomains[s].push_back(static_cast<int32_t>(g));
        if (count > 1) add_neighbors(chunks, each);
    }

    void add_neighbors(int64_t chunks, int64_t each) {
        for (int64_t g = 0; g < chunks; ++g) {
            const int64_t own = g / each, end = std::min(mesh.count, (g + 1) * width) * mesh.k;
            for (int64_t i = g * width * mesh.k; i < end; ++i) {
                auto& subdomain = subdomains[owner[mesh.nodes[i]]];
                if (owner[mesh.nodes[i]] != own && subdomain.back() != g)
                    subdomain.push_back(static_cast<int32_t>(g));
            }
        }
    }

    Connectivity mesh;
    int width;
    std::vector<int32_t> owner;
    std::vector<std::vector<int32_t>> subdomains;
};

// Positions in the matrix of the node pairs of a few elements at a time, found row by row without searching.
class AssemblyMap {
public:
    AssemblyMap(const Graph& graph, const Connectivity& mesh, const Subdomains& subdomains, int64_t subdomain,
                int64_t most)
        : graph(graph), mesh(mesh), subdomains(subdomains), subdomain(subdomain), first(zeros(graph.rows)),
          column(zeros(graph.rows)), next(most * mesh.k), position(most * mesh.k * mesh.k) {}

    // position[(e k + a) k + b] for `count` elements; -1 in rows of others and in elements beyond the last.
    const int32_t* find(const int64_t* elements, int64_t count) {
        touched.clear();
        for (int64_t e = 0, at = 0; e < count; ++e)
            for (int a = 0; a < mesh.k; ++a, ++at) link(elements[e], a, static_cast<int32_t>(at));
        for (const int32_t node : touched) fill(node, elements);
        return position.data();
    }

private:
    void link(int64_t element, int a, int32_t at) {
        const int32_t node = element < mesh.count ? mesh.nodes[element * mesh.k + a] : -1;
        if (node < 0 || !subdomains.owns(subdomain, node)) {
            std::fill_n(position.begin() + static_cast<int64_t>(at) * mesh.k, mesh.k, -1);
            return;
        }
        if (!first[node]) touched.push_back(node);
        next[at] = first[node] - 1;
        first[node] = at + 1;
    }

    void fill(int32_t node, const int64_t* elements) {
        const int32_t begin = graph.indptr[node], end = graph.indptr[node + 1];
        if (!in_range(graph.indices + begin, end - begin, graph.rows))
            throw std::invalid_argument("the sparsity pattern has a column that is not there");
        for (int32_t p = begin; p < end; ++p) column[graph.indices[p]] = p + 1;
        bool missing = false;
        for (int32_t at = first[node] - 1; at >= 0; at = next[at]) {
            const int32_t* nodes = mesh.nodes + elements[at / mesh.k] * mesh.k;
            int32_t* out = position.data() + static_cast<int64_t>(at) * mesh.k;
            for (int b = 0; b < mesh.k; ++b) {
                out[b] = column[nodes[b]] - 1;
                missing |= out[b] < begin || out[b] >= end;
            }
        }
        first[node] = 0;
        if (missing) throw std::invalid_argument("the sparsity pattern misses nodes that share an element");
    }

    // For all nodes, of which a subdomain touches few: the system clears a page when it is used.
    using Numbers = std::unique_ptr<int32_t[], decltype(&std::free)>;
    static Numbers zeros(int64_t n) {
        Numbers made(static_cast<int32_t*>(std::calloc(n, sizeof(int32_t))), &std::free);
        if (!made && n) throw std::bad_alloc();
        return made;
    }

    Graph graph;
    Connectivity mesh;
    const Subdomains& subdomains;
    int64_t subdomain;
    Numbers first, column;  // of each node, from 1 on
    std::vector<int32_t> next, touched, position;
};

constexpr int64_t BLOCK_PAIRS = 4096;  // node pairs whose positions are looked up together

// V elements from `first` on, and the positions of their node pairs.
struct Chunk {
    int64_t first;
    const int32_t* position;  // (V, k, k), -1 where nothing is to be added
    int64_t ahead;            // from there to the positions of the next chunk
    double* work;
};

// f(chunk) for all elements, V at a time, by all threads; each has `work` numbers of room.
template <class F>
void for_chunks(const Connectivity& mesh, const Graph& graph, int V, int64_t work, const F& f) {
    if (!mesh.count) return;
    const Subdomains subdomains(graph.rows, mesh, V, wanted_threads());
    const int64_t pairs = static_cast<int64_t>(V) * mesh.k * mesh.k;  // of a chunk
    const int64_t block = std::max<int64_t>(8, BLOCK_PAIRS / pairs);
    parallel(static_cast<int64_t>(subdomains.size()), [&](int64_t subdomain) {
        AssemblyMap map(graph, mesh, subdomains, subdomain, block * V);
        Workspace space(work);
        std::vector<int64_t> elements(block * V);
        const auto& chunks = subdomains.chunks(subdomain);
        const int64_t total = static_cast<int64_t>(chunks.size());
        for (int64_t from = 0; from < total; from += block) {
            look();
            const int64_t count = std::min(block, total - from);
            for (int64_t i = 0; i < count * V; ++i)
                elements[i] = static_cast<int64_t>(chunks[from + i / V]) * V + i % V;
            const int32_t* position = map.find(elements.data(), count * V);
            for (int64_t i = 0; i < count; ++i, position += pairs)
                f(Chunk{elements[i * V], position, i + 1 < count ? pairs : 0, space.data()});
        }
    });
}

// r[l][e] = v[e][l]
KL_INLINE void transpose(const vec<double, 2>* v, vec<double, 2>* r) {
    pick<double, 2, 0, 2>(r[0], v[0], v[1]);
    pick<double, 2, 1, 3>(r[1], v[0], v[1]);
}

KL_INLINE void transpose(const vec<double, 4>* v, vec<double, 4>* r) {
    vec<double, 4> t[4];
    for (int i = 0; i < 2; ++i) {
        pick<double, 4, 0, 4, 2, 6>(t[2 * i], v[2 * i], v[2 * i + 1]);
        pick<double, 4, 1, 5, 3, 7>(t[2 * i + 1], v[2 * i], v[2 * i + 1]);
    }
    for (int i = 0; i < 2; ++i) {
        pick<double, 4, 0, 1, 4, 5>(r[i], t[i], t[2 + i]);
        pick<double, 4, 2, 3, 6, 7>(r[2 + i], t[i], t[2 + i]);
    }
}

KL_INLINE void transpose(const vec<double, 8>* v, vec<double, 8>* r) {
    vec<double, 8> t[8], s[8];
    for (int i = 0; i < 4; ++i) {
        pick<double, 8, 0, 8, 2, 10, 4, 12, 6, 14>(t[2 * i], v[2 * i], v[2 * i + 1]);
        pick<double, 8, 1, 9, 3, 11, 5, 13, 7, 15>(t[2 * i + 1], v[2 * i], v[2 * i + 1]);
    }
    for (int i = 0; i < 8; i += 4)
        for (int j = 0; j < 2; ++j) {
            pick<double, 8, 0, 1, 8, 9, 4, 5, 12, 13>(s[i + j], t[i + j], t[i + 2 + j]);
            pick<double, 8, 2, 3, 10, 11, 6, 7, 14, 15>(s[i + 2 + j], t[i + j], t[i + 2 + j]);
        }
    for (int j = 0; j < 4; ++j) {
        pick<double, 8, 0, 1, 2, 3, 8, 9, 10, 11>(r[j], s[j], s[4 + j]);
        pick<double, 8, 4, 5, 6, 7, 12, 13, 14, 15>(r[4 + j], s[j], s[4 + j]);
    }
}

// Add V blocks, one of each element, to the matrix at `position`, and fetch those of the next chunk.
template <int V>
KL_INLINE void add_blocks(double* data, const int32_t* position, int64_t stride, int64_t ahead,
                          const vec<double, V>* K) {
    vec<double, V> rows[8];
    for (int i = 0; i < 8 / V; ++i) transpose(K + i * V, rows + i * V);
    for (int l = 0; l < V; ++l) {
        const int64_t p = position[l * stride];
        __builtin_prefetch(data + 9 * static_cast<int64_t>(position[l * stride + ahead]), 1);
        if (p < 0) continue;
        double* block = data + 9 * p;
        for (int i = 0; i < 8 / V; ++i) *reinterpret_cast<vec<double, V>*>(block + i * V) += rows[i * V + l];
        block[8] += K[8][l];
    }
}

// Add the block of the nodes a, b, and its mirror image of b, a where the matrix is symmetric.
template <int V>
KL_INLINE void add_pair(double* data, const Chunk& chunk, int k, int a, int b, bool symmetric,
                        const vec<double, V>* K) {
    add_blocks<V>(data, chunk.position + a * k + b, k * k, chunk.ahead, K);
    if (!symmetric || a == b) return;
    const vec<double, V> mirror[9] = {K[0], K[3], K[6], K[1], K[4], K[7], K[2], K[5], K[8]};
    add_blocks<V>(data, chunk.position + b * k + a, k * k, chunk.ahead, mirror);
}

}  // namespace kl
