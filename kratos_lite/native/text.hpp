// Numbers in text: rows of words between blanks, one row a line.

#pragma once
#include <atomic>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "threads.hpp"

namespace kl {

constexpr int64_t TEXT_GRAIN = 1 << 18;  // bytes of one task

inline bool is_digit(char c) { return static_cast<unsigned char>(c - '0') < 10; }
inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
inline bool ends_word(const char* p, const char* end) { return p == end || is_blank(*p) || *p == '\n'; }

// A whole number of at most 18 digits, which is below 2^63.
inline bool read_whole(const char*& p, const char* end, int64_t& value) {
    const char* start = p;
    value = 0;
    for (; p < end && is_digit(*p); ++p) {
        if (p - start == 18) return false;
        value = 10 * value + (*p - '0');
    }
    return p > start;
}

// A number whose exponent Fortran wrote with a D.
inline bool read_fortran(const char*& p, const char* end, const char* start, double& value) {
    char copy[64];
    size_t size = 0;
    for (p = start; !ends_word(p, end); ++p) {
        if (size == sizeof copy) return false;
        copy[size++] = *p == 'd' || *p == 'D' ? 'e' : *p;
    }
    const auto found = std::from_chars(copy, copy + size, value);
    return found.ec == std::errc() && found.ptr == copy + size;
}

// A decimal number, rounded correctly as Python does; no "inf", no "nan", nothing out of range.
inline bool read_real(const char*& p, const char* end, double& value) {
    const char* start = p + (*p == '+');
    const char* first = p + (*p == '+' || *p == '-');
    if (first == end || !(is_digit(*first) || *first == '.')) return false;
    const auto found = std::from_chars(start, end, value);
    p = found.ptr;
    if (found.ec != std::errc()) return false;
    return p == end || (*p != 'd' && *p != 'D') || read_fortran(p, end, start, value);
}

// Offsets of a word that stands between blanks or line ends.
inline std::vector<int64_t> find_word(const char* text, int64_t size, const std::string& word) {
    std::vector<int64_t> found;
    const int64_t n = static_cast<int64_t>(word.size());
    for (const char *p = text, *end = text + size; p + n <= end; ++p) {
        p = static_cast<const char*>(std::memchr(p, word[0], end - n - p + 1));
        if (!p) break;
        const bool starts = p == text || is_blank(p[-1]) || p[-1] == '\n';
        if (starts && std::memcmp(p, word.data(), n) == 0 && ends_word(p + n, end)) found.push_back(p - text);
    }
    return found;
}

// The columns of a row: i id, p id that may be 0, b 0 or 1, r real.
struct Columns {
    std::string kinds;
    int64_t ints = 0, reals = 0;

    explicit Columns(const std::string& letters) : kinds(letters) {
        for (char kind : kinds) ++(kind == 'r' ? reals : ints);
    }
};

struct Table {
    int64_t* ints;
    double* reals;
    int32_t* lines;
};

// A piece of the text that ends with a line, and what stands before it.
struct Piece {
    const char* begin;
    const char* end;
    int64_t lines = 0, rows = 0;
    int64_t first_line = 0, first_row = 0;
};

inline std::vector<Piece> pieces(const char* begin, const char* end) {
    std::vector<Piece> found;
    while (begin < end) {
        const char* stop = begin + TEXT_GRAIN < end ? begin + TEXT_GRAIN : end;
        const void* line = stop < end ? std::memchr(stop, '\n', end - stop) : nullptr;
        stop = line ? static_cast<const char*>(line) + 1 : end;
        found.push_back({begin, stop});
        begin = stop;
    }
    return found;
}

inline const char* skip_blanks(const char* p, const char* end) {
    while (p < end && is_blank(*p)) ++p;
    return p;
}

inline void count(Piece& piece) {
    for (const char* p = piece.begin; p < piece.end;) {
        p = skip_blanks(p, piece.end);
        const void* line = std::memchr(p, '\n', piece.end - p);
        const char* stop = line ? static_cast<const char*>(line) : piece.end;
        piece.rows += stop > p;
        piece.lines += line != nullptr;
        p = stop + 1;
    }
}

inline bool read_row(const char*& p, const char* end, const Columns& columns, int64_t* ints, double* reals) {
    for (char kind : columns.kinds) {
        p = skip_blanks(p, end);
        if (p == end) return false;
        if (kind == 'r') {
            if (!read_real(p, end, *reals++)) return false;
        } else {
            if (!read_whole(p, end, *ints)) return false;
            if ((kind == 'i' && *ints < 1) || (kind == 'b' && *ints > 1)) return false;
            ++ints;
        }
        if (!ends_word(p, end)) return false;
    }
    p = skip_blanks(p, end);
    return p == end || *p == '\n';
}

// Fill the rows of one piece; false if a line is anything but one plain row.
inline bool read_piece(const Piece& piece, const Columns& columns, const Table& table) {
    int64_t row = piece.first_row, line = piece.first_line;
    for (const char* p = piece.begin; p < piece.end; ++p, ++line) {
        p = skip_blanks(p, piece.end);
        if (p == piece.end) break;
        if (*p == '\n') continue;
        if (!read_row(p, piece.end, columns, table.ints + row * columns.ints, table.reals + row * columns.reals))
            return false;
        table.lines[row++] = static_cast<int32_t>(line);
    }
    return true;
}

// Count lines and rows, in `found`; return the number of rows.
inline int64_t measure(std::vector<Piece>& found, int64_t line) {
    parallel(static_cast<int64_t>(found.size()), [&](int64_t i) { count(found[i]); });
    int64_t row = 0;
    for (Piece& piece : found) {
        piece.first_line = line;
        piece.first_row = row;
        line += piece.lines;
        row += piece.rows;
    }
    return row;
}

inline bool read_table(const std::vector<Piece>& found, const Columns& columns, const Table& table) {
    std::atomic<bool> plain{true};
    parallel(static_cast<int64_t>(found.size()), [&](int64_t i) {
        if (plain && !read_piece(found[i], columns, table)) plain = false;
    });
    return plain;
}

}  // namespace kl
