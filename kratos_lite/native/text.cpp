// Tables of numbers in the text of input files.

#include "text.hpp"

#include "arrays.hpp"

namespace {

using namespace kl;

struct View {
    char* data = nullptr;
    Py_ssize_t size = 0;

    explicit View(const Object& text) {
        if (PyBytes_AsStringAndSize(text.get(), &data, &size)) throw PythonError{};
    }
};

std::vector<int64_t> offsets(const Object& text, const Object& word) {
    const View view(text), letters(word);
    require(letters.size > 0, "the word must not be empty");
    GilReleased release;
    return find_word(view.data, view.size, std::string(letters.data, letters.size));
}

// The rows of text[begin:end] as (integers, reals, lines), or None if any line is not one plain row.
std::optional<std::tuple<Array<int64_t>, Array<double>, Array<int32_t>>> rows(const Object& text, int64_t begin, int64_t end, const std::string& kinds, int64_t line) {
    const View view(text);
    require(0 <= begin && begin <= end && end <= view.size, "the piece must lie in the text");
    const Columns columns(kinds);
    auto found = pieces(view.data + begin, view.data + end);
    int64_t m = 0;
    {
        GilReleased release;
        m = measure(found, line);
    }
    Array<int64_t> ints({m, columns.ints});
    Array<double> reals({m, columns.reals});
    Array<int32_t> lines(m);
    const Table table{ints.mutable_data(), reals.mutable_data(), lines.mutable_data()};
    bool plain = false;
    {
        GilReleased release;
        plain = read_table(found, columns, table);
    }
    if (!plain) return {};
    return std::make_tuple(ints, reals, lines);
}

}  // namespace

KL_MODULE(_text, m) {
    define<&offsets>(m, "find_word", "offsets of a word between blanks", {"text", "word"});
    define<&rows>(m, "rows", "columns of text[begin:end], one row a line", {"text", "begin", "end", "kinds", "line"});
}
