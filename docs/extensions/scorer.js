// The order of hits: Sphinx's own scores, but the page of words before those that have the words in their text alone.
var Scorer = {
  score: ([page, , , , score]) => score + (page === "reference/words" ? 6 : 0),
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
};
