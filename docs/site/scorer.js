// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Order of the search's results: a setting first, then other headings, last the long tables of the verification.
var Scorer = {
  score: ([page, title, anchor, description, score]) => {
    if (page === "reference/settings" && anchor) return score + 60;
    if (page.startsWith("verification/")) return score - 8;
    return score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
