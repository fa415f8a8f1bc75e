// Tables of numbers in the text of input files.

#include "text.hpp"

#include <pybind11/stl.h>

#include "arrays.hpp"

namespace {

using kl::Array;
namespace py = pybind11;

struct View {
    char* data = nullptr;
    py::ssize_t size = 0;

    explicit View(const py::bytes& text) {
        kl::require(PyBytes_AsStringAndSize(text.ptr(), &data, &size) == 0, "text must be bytes");
    }
};

std::vector<int64_t> find_word(const py::bytes& text, const std::string& word) {
    const View view(text);
    kl::require(!word.empty(), "the word must not be empty");
    py::gil_scoped_release release;
    return kl::find_word(view.data, view.size, word);
}

// The rows of text[begin:end] as (integers, reals, lines), or None if any line is not one plain row.
py::object rows(const py::bytes& text, int64_t begin, int64_t end, const std::string& kinds, int64_t line) {
    const View view(text);
    kl::require(0 <= begin && begin <= end && end <= view.size, "the piece must lie in the text");
    const kl::Columns columns(kinds);
    auto found = kl::pieces(view.data + begin, view.data + end);
    int64_t m = 0;
    {
        py::gil_scoped_release release;
        m = kl::measure(found, line);
    }
    Array<int64_t> ints({m, columns.ints});
    Array<double> reals({m, columns.reals});
    Array<int32_t> lines(m);
    const kl::Table table{ints.mutable_data(), reals.mutable_data(), lines.mutable_data()};
    bool plain = false;
    {
        py::gil_scoped_release release;
        plain = kl::read_table(found, columns, table);
    }
    return plain ? py::object(py::make_tuple(ints, reals, lines)) : py::none();
}

}  // namespace

PYBIND11_MODULE(_text, m) {
    kl::common(m);
    m.def("find_word", &find_word, "offsets of a word between blanks",
          py::arg("text"), py::arg("word"));
    m.def("rows", &rows, "columns of text[begin:end], one row a line", py::arg("text"), py::arg("begin"),
          py::arg("end"), py::arg("kinds"), py::arg("line"));
}
