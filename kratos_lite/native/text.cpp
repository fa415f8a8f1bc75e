// Tables of numbers in the text of input files.

#include "statements.hpp"
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

kl::Value value_of(const std::string& word) {
    static const char* const names[] = {"<id>", "<number>", "<real>", "<Name>", "<ids>", "<next>"};
    for (int i = 0; i < 6; ++i)
        if (word == names[i]) return {static_cast<kl::Word>(i + 1), "", {}, {}, {}, {}, {}};
    kl::require(!word.empty() && word[0] != '<', "this word of a form is not known");
    return {kl::Word::literal, word, {}, {}, {}, {}, {}};
}

template <class T>
Array<T> array(const std::vector<T>& values) {
    return Array<T>(values.size(), values.data());
}

py::list names(const kl::Value& value) {
    std::vector<py::bytes> known(value.names.begin(), value.names.end());
    py::list found(value.ints.size());
    for (size_t i = 0; i < value.ints.size(); ++i) found[i] = known[value.ints[i]];
    return found;
}

// Statements of one form from a position on: (starts, columns of values, end of the last statement).
py::tuple statements(const py::bytes& text, int64_t position, const std::vector<std::string>& words,
                     bool semicolons) {
    const View view(text);
    kl::require(0 <= position && position <= view.size, "the position must lie in the text");
    std::vector<kl::Value> form;
    for (const std::string& word : words) form.push_back(value_of(word));
    std::vector<int64_t> starts;
    {
        py::gil_scoped_release release;
        starts = kl::read_statements(view.data, view.size, form, semicolons, position);
    }
    py::list columns;
    for (const kl::Value& value : form) {
        if (value.word == kl::Word::real) columns.append(array(value.reals));
        if (value.word == kl::Word::id || value.word == kl::Word::number) columns.append(array(value.ints));
        if (value.word == kl::Word::name) columns.append(names(value));
        if (value.word == kl::Word::ids)
            columns.append(py::make_tuple(array(value.counts), array(value.ints)));
    }
    return py::make_tuple(array(starts), columns, position);
}

}  // namespace

PYBIND11_MODULE(_text, m) {
    kl::common(m);
    m.def("find_word", &find_word, "offsets of a word between blanks",
          py::arg("text"), py::arg("word"));
    m.def("rows", &rows, "columns of text[begin:end], one row a line", py::arg("text"), py::arg("begin"),
          py::arg("end"), py::arg("kinds"), py::arg("line"));
    m.def("statements", &statements, "values of the statements of one form that follow each other",
          py::arg("text"), py::arg("position"), py::arg("words"), py::arg("semicolons"));
}
