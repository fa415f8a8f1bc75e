// The order of hits: Sphinx's own scores, but more for pages that hold the query as it is written, for the page of
// words, and most for the pages to which that page leads from the query; see search_texts.py.
const plain = (text) => text.toLowerCase().replace(/[\s–-]+/g, " ").trim();
const asked = plain(new URLSearchParams(window.location.search).get("q") || "");
var Scorer = {
  score: ([page, , , , score]) =>
    score
    + (plain(TEXTS[`./${page}.html`] || "").includes(asked) ? 3 : 0)
    + (page === "reference/words" ? 6 : 0)
    + ((WORDS[asked] || []).includes(page) ? 20 : 0),
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
};
