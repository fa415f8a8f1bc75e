// Connections of a mesh: sets of nodes that occur more than once, and connected parts.

#include <vector>

#include "arrays.hpp"

namespace {

using namespace kl;

constexpr int64_t GRAIN = 4096;  // cells of one task

// The numbers of a set are mixed and added up, so that their order does not matter (SplitMix64,
// Steele, Lea and Flood 2014): two sets of a mesh that differ have the same key with a chance of 2^-64.
uint64_t mixed(uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

struct Cells {
    const int32_t* nodes;  // (m, k)
    int64_t m, k;
    const int32_t* picks;  // (p, w), columns of the nodes that make up one set; -1 is no node
    int64_t p, w;
};

void add_keys(const Cells& cells, uint64_t* key) {
    parallel_ranges(cells.m, GRAIN, [&](int64_t first, int64_t last) {
        for (int64_t p = 0; p < cells.p; ++p) {
            const int32_t* pick = cells.picks + p * cells.w;
            for (int64_t cell = first; cell < last; ++cell) {
                uint64_t sum = 0;
                for (int64_t i = 0; i < cells.w; ++i)
                    if (pick[i] >= 0) sum += mixed(static_cast<uint64_t>(cells.nodes[cell * cells.k + pick[i]]));
                key[p * cells.m + cell] = sum;
            }
        }
    });
}

// For each key the position of the next equal one, or -1: keys are dealt into buckets by their last
// bits, about one to a bucket, and keep their order there.
std::vector<int32_t> next_equal(const std::vector<uint64_t>& key) {
    const size_t n = key.size();
    size_t buckets = 1;
    while (buckets < n) buckets *= 2;
    std::vector<int32_t> last(buckets, -1), before(n), next(n, -1);
    for (size_t i = 0; i < n; ++i) {
        if (i % MANY == 0) look();
        int32_t& head = last[key[i] & (buckets - 1)];
        int32_t other = head;
        while (other >= 0 && key[other] != key[i]) other = before[other];
        if (other >= 0) next[other] = static_cast<int32_t>(i);
        before[i] = head;
        head = static_cast<int32_t>(i);
    }
    return next;
}

auto equal_sets(const std::vector<Array<int32_t>>& nodes, const std::vector<Array<int32_t>>& picks) {
    require(nodes.size() == picks.size(), "nodes and picks must come in pairs");
    std::vector<Cells> groups;
    int64_t total = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
        require(nodes[i].ndim() == 2 && picks[i].ndim() == 2, "nodes and picks must be matrices");
        const Cells cells{nodes[i].data(),  nodes[i].shape(0), nodes[i].shape(1),
                          picks[i].data(), picks[i].shape(0), picks[i].shape(1)};
        for (int64_t j = 0; j < picks[i].size(); ++j)
            require(cells.picks[j] < cells.k, "picks must be columns of the nodes");
        total += cells.m * cells.p;
        groups.push_back(cells);
    }
    require(total < INT32_MAX, "there are too many sets");
    std::vector<int32_t> next;
    int64_t pairs = 0;
    {
        GilReleased release;
        std::vector<uint64_t> key(total);
        uint64_t* start = key.data();
        for (const Cells& cells : groups) {
            add_keys(cells, start);
            start += cells.m * cells.p;
        }
        next = next_equal(key);
        for (int32_t other : next) pairs += other >= 0;
    }
    Array<int64_t> one(pairs), other(pairs);
    int64_t *a = one.mutable_data(), *b = other.mutable_data();
    for (int64_t i = 0; i < total; ++i)
        if (next[i] >= 0) *a++ = i, *b++ = next[i];
    return std::make_tuple(one, other);
}

int64_t root(int64_t* parent, int64_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

// The smaller root becomes the parent, so that the root of a part is its smallest member.
Array<int64_t> components(int64_t n, Array<int64_t> pairs) {
    require(pairs.ndim() == 2 && pairs.shape(1) == 2, "pairs must be (p, 2)");
    const int64_t* ends = pairs.data();
    for (int64_t i = 0; i < pairs.size(); ++i)
        require(0 <= ends[i] && ends[i] < n, "pairs must name members");
    Array<int64_t> labels(n);
    int64_t* parent = labels.mutable_data();
    GilReleased release;
    for (int64_t i = 0; i < n; ++i) parent[i] = i;
    for (int64_t i = 0; i < pairs.shape(0); ++i) {
        if (i % MANY == 0) look();
        const int64_t a = root(parent, ends[2 * i]), b = root(parent, ends[2 * i + 1]);
        parent[a < b ? b : a] = a < b ? a : b;
    }
    for (int64_t i = 0; i < n; ++i) parent[i] = parent[parent[i]];  // members before i are labeled
    return labels;
}

}  // namespace

KL_MODULE(_mesh, m) {
    define<&equal_sets>(m, "equal_sets", "pairs of sets that have the same nodes", {"nodes", "picks"});
    define<&components>(m, "components", "smallest member of the part of each of n members", {"n", "pairs"});
}
