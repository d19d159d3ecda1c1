// Order of the results of the search: pages for users come before decisions, logs and the history. The scores below
// `score` are Sphinx's own, which a scorer must repeat.
var Scorer = {
  score: ([page, , , , score]) =>
    score - (/^(decisions|measured)\/(?!index)|^changelog/.test(page) ? 50 : 0) + (/^how-to\//.test(page) ? 8 : 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
