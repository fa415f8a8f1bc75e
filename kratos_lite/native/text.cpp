// Tables of numbers in the text of input files.

#include "text.hpp"

#include "arrays.hpp"

namespace {

using namespace kl;

struct View {
    char* data = nullptr;
    py::ssize_t size = 0;

    explicit View(const py::bytes& text) {
        require(PyBytes_AsStringAndSize(text.ptr(), &data, &size) == 0, "text must be bytes");
    }
};

std::vector<int64_t> offsets(const py::bytes& text, const std::string& word) {
    const View view(text);
    require(!word.empty(), "the word must not be empty");
    py::gil_scoped_release release;
    return find_word(view.data, view.size, word);
}

// The rows of text[begin:end] as (integers, reals, lines), or None if any line is not one plain row.
py::object rows(const py::bytes& text, int64_t begin, int64_t end, const std::string& kinds, int64_t line) {
    const View view(text);
    require(0 <= begin && begin <= end && end <= view.size, "the piece must lie in the text");
    const Columns columns(kinds);
    auto found = pieces(view.data + begin, view.data + end);
    int64_t m = 0;
    {
        py::gil_scoped_release release;
        m = measure(found, line);
    }
    Array<int64_t> ints({m, columns.ints});
    Array<double> reals({m, columns.reals});
    Array<int32_t> lines(m);
    const Table table{ints.mutable_data(), reals.mutable_data(), lines.mutable_data()};
    bool plain = false;
    {
        py::gil_scoped_release release;
        plain = read_table(found, columns, table);
    }
    return plain ? py::object(py::make_tuple(ints, reals, lines)) : py::none();
}

}  // namespace

PYBIND11_MODULE(_text, m) {
    common(m);
    m.def("find_word", offsets, "offsets of a word between blanks", py::arg("text"), py::arg("word"));
    m.def("rows", rows, "columns of text[begin:end], one row a line", py::arg("text"), py::arg("begin"),
          py::arg("end"), py::arg("kinds"), py::arg("line"));
}
