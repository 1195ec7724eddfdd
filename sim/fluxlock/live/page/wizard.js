// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0
// @ts-check
"use strict";

// The steps of a first start: what each does at most, the question before it, what came of it, the plots at the end.

/** @typedef {{step: number, ended: Record<string, [boolean, string]>, question: string, asked: number, busy: string, verdict: string}} Steps */

let asked = 0;  // number of the question that is shown

/** The list, before anything has happened. @param {{steps: [string, string][], note: string}} wizard */
function beginSteps(wizard) {
  at("note").textContent = wizard.note;
  at("steps").replaceChildren(...wizard.steps.map(([name, limits]) => {
    const entry = document.createElement("li");
    entry.append(Object.assign(document.createElement("strong"), { textContent: name }),
      Object.assign(document.createElement("small"), { textContent: limits }), document.createElement("p"));
    return entry;
  }));
  at("plotted").replaceChildren();
}

/** @param {Steps} told */
function showSteps(told) {
  asked = told.asked;
  [...at("steps").children].forEach((entry, k) => {
    const ended = told.ended[entry.firstChild.textContent];
    const now = k + 1 === told.step && !ended;
    entry.className = ended ? (ended[0] ? "passed" : "missed") : now ? "now" : "";
    entry.lastChild.textContent = ended ? ended[1] : now ? told.busy : "";
  });
  const [asking, over] = [told.question !== "", told.verdict !== ""];
  at("question").textContent = over ? told.verdict : told.question;
  at("question").className = over ? (told.verdict.startsWith("ok") ? "passed" : "missed") : "";
  at("yes").hidden = !asking;
  at("no").hidden = over;
  at("no").textContent = asking ? "No" : "Stop";
  at("anew").hidden = !over;
}

/** Plots among the files. @param {string[]} names */
function showPlots(names) {
  at("plotted").replaceChildren(...names.filter((name) => name.endsWith(".png")).map((name) => {
    const link = Object.assign(document.createElement("a"), { href: `files/${name}${location.search}` });
    link.append(Object.assign(document.createElement("img"), { src: link.href, alt: name }));
    return link;
  }));
}

function wireSteps() {
  at("yes").onclick = () => send({ kind: "answer", asked, yes: true });
  at("no").onclick = () => send({ kind: "answer", asked, yes: false });
  at("anew").onclick = () => send({ kind: "restart" });
}
