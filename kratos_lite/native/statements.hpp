// Statements of .elem files: literal words and values in a fixed order, one statement after the other.

#pragma once
#include <cstring>
#include <string>
#include <unordered_map>
#include <vector>

#include "text.hpp"

namespace kl {

inline bool is_name_start(char c) { return is_letter(c) || c == '_'; }
inline bool is_space(char c) { return is_blank(c) || c == '\n' || c == '\r'; }

// What a word of a form stands for; `text` is the word itself where it is literal.
enum class Word { literal, id, number, real, name, ids, next };

struct Value {
    Word word;
    std::string text;
    std::vector<int64_t> ints;       // id, number, ids: the values; name: its place in `names`
    std::vector<int64_t> counts;     // ids: how many in each statement
    std::vector<double> reals;
    std::vector<std::string> names;  // each name once
    std::unordered_map<std::string, int64_t> places;  // where each stands among them

    void cut(size_t statements) {
        if (word == Word::real) {
            reals.resize(statements);
        } else if (word == Word::ids) {
            counts.resize(statements);
            size_t total = 0;
            for (int64_t count : counts) total += count;
            ints.resize(total);
        } else if (word != Word::literal && word != Word::next) {
            ints.resize(statements);
        }
    }

    void add_name(const char* begin, const char* end) {
        const std::string found(begin, end);
        if (!ints.empty() && names[ints.back()] == found) {  // most repeat the one before
            ints.push_back(ints.back());
            return;
        }
        const auto [place, is_new] = places.try_emplace(found, names.size());
        if (is_new) names.push_back(found);
        ints.push_back(place->second);
    }
};

// A reader that goes along the text; it stops at anything it does not know, for Python to decide.
struct Reader {
    const char* p;
    const char* end;

    void spaces() {
        while (p < end && is_space(*p)) ++p;
    }

    bool is(char c) {
        if (p == end || *p != c) return false;
        ++p;
        spaces();
        return true;
    }

    bool literal(const std::string& text) {
        const size_t n = text.size();
        if (static_cast<size_t>(end - p) < n || std::memcmp(p, text.data(), n) != 0) return false;
        if (is_name(text.back()) && p + n < end && is_name(p[n])) return false;
        p += n;
        spaces();
        return true;
    }

    bool integer(std::vector<int64_t>& to, int64_t least) {
        int64_t value;
        if (!read_whole(p, end, value) || value < least || (p < end && goes_on(*p))) return false;
        to.push_back(value);
        spaces();
        return true;
    }

    bool real(std::vector<double>& to) {
        double value;
        if (p == end || !read_real(p, end, value) || (p < end && goes_on(*p))) return false;
        to.push_back(value);
        spaces();
        return true;
    }

    bool name(Value& to) {
        const char* start = p;
        if (p == end || !is_name_start(*p)) return false;
        while (p < end && is_name(*p)) ++p;
        to.add_name(start, p);
        spaces();
        return true;
    }

    // No ids at all, or some with commas between and perhaps one behind.
    bool ids(Value& to) {
        const size_t before = to.ints.size();
        while (p < end && is_digit(*p)) {
            if (!integer(to.ints, 1)) return false;
            if (!is(',')) break;
        }
        to.counts.push_back(to.ints.size() - before);
        return true;
    }

    bool value(Value& to) {
        switch (to.word) {
            case Word::literal: return literal(to.text);
            case Word::id: return integer(to.ints, 1);
            case Word::number: return integer(to.ints, 0);
            case Word::real: return real(to.reals);
            case Word::name: return name(to);
            case Word::ids: return ids(to);
            default: return is(',') || (p < end && *p == ']');
        }
    }
};

// Read statements as long as they follow each other; return their offsets and the end of the last one.
inline std::vector<int64_t> read_statements(const char* text, int64_t size, std::vector<Value>& form,
                                            bool semicolons, int64_t& position) {
    std::vector<int64_t> starts;
    for (Reader at{text + position, text + size}; at.p < at.end; position = at.p - text) {
        for (Value& word : form) {
            if (at.value(word)) continue;
            for (Value& other : form) other.cut(starts.size());
            return starts;
        }
        while (semicolons && at.p < at.end && (is_space(*at.p) || *at.p == ';')) ++at.p;
        starts.push_back(position);
    }
    return starts;
}

}  // namespace kl
