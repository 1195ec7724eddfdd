// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0
// @ts-check
"use strict";

// What the page of `fluxlock live` shows beside its panels: graph of states, dial, planes, cursors, and the PNG of all.

const NODES = { init: [40, 25], ready: [130, 25], starting: [230, 25], running: [340, 25], stopping: [230, 100], fault: [60, 100] };
const EDGES = [["init", "ready"], ["ready", "starting"], ["starting", "running"], ["running", "stopping"], ["stopping", "ready"], ["fault", "init"]];
const GOOD = "#2a7d46", BAD = "#c62828", BUSY = "#1565c0", PALE = "#8886";

/** @param {string} id @returns {any} */
const place = (id) => document.getElementById(id);

/** @param {string} name @param {Record<string, string|number>} attributes @param {string} text */
function svg(name, attributes, text = "") {
  // A name, no address: in parts, for the test that the page asks for nothing elsewhere looks for addresses.
  const element = document.createElementNS("http:" + "/" + "/www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.textContent = text;
  return element;
}

let shownStates = "";

/** The drive's states; the one in which it failed is red. @param {string} state @param {string} failed @param {string} fault */
function stateGraph(state, failed, fault) {
  const key = [state, failed, fault].join();
  if (key === shownStates) return;
  shownStates = key;
  const parts = EDGES.map(([from, to]) => {
    const [a, b] = [NODES[from], NODES[to]];
    return svg("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1], stroke: PALE, "stroke-width": 2 });
  });
  if (failed) parts.push(svg("line", { x1: NODES[failed][0], y1: NODES[failed][1], x2: NODES.fault[0], y2: NODES.fault[1], stroke: BAD, "stroke-width": 2, "stroke-dasharray": "5 3" }));
  for (const [name, [x, y]] of Object.entries(NODES)) {
    const red = name === failed || (name === "fault" && state === "fault");
    const fill = red ? BAD : name === state ? (state === "running" ? GOOD : BUSY) : "Canvas";
    parts.push(svg("rect", { x: x - 36, y: y - 13, width: 72, height: 26, rx: 8, fill, stroke: PALE, "data-state": name, "data-failed": name === failed ? 1 : 0 }));
    parts.push(svg("text", { x, y: y + 4, "text-anchor": "middle", "font-size": 12, fill: fill === "Canvas" ? "CanvasText" : "#fff" }, name));
  }
  place("states").replaceChildren(...parts);
  place("reason").textContent = state === "fault" ? `${failed ? `failed while ${failed}: ` : ""}${fault}` : "state of the drive";
}

/** @param {string} id @returns {{pen: CanvasRenderingContext2D, size: number, ink: string}} */
function fresh(id) {
  const canvas = place(id), pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  return { pen, size: canvas.width, ink: getComputedStyle(canvas).color };
}

/** A hand of the dial. @param {CanvasRenderingContext2D} pen @param {number} size @param {number} deg @param {string} colour */
function hand(pen, size, deg, colour) {
  const rad = deg * Math.PI / 180, half = size / 2, long = half - 8;
  pen.strokeStyle = colour;
  pen.lineWidth = 3;
  pen.beginPath();
  pen.moveTo(half, half);
  pen.lineTo(half + long * Math.cos(rad), half - long * Math.sin(rad));
  pen.stroke();
}

/** @param {string} id @param {string} label @param {number[]} x @param {number[]} y */
function plane(id, label, x, y) {
  const { pen, size, ink } = fresh(id);
  const most = Math.max(1e-3, ...x.map(Math.abs), ...y.map(Math.abs));
  const scale = 10 ** Math.floor(Math.log10(most)), round = Math.ceil(most / scale) * scale, half = size / 2;
  pen.strokeStyle = PALE;
  pen.lineWidth = 1;
  pen.strokeRect(0.5, 0.5, size - 1, size - 1);
  pen.beginPath();
  pen.moveTo(half, 0); pen.lineTo(half, size); pen.moveTo(0, half); pen.lineTo(size, half);
  pen.stroke();
  pen.fillStyle = ink;
  for (let k = 0; k < x.length; k++) pen.fillRect(half + x[k] / round * half - 1, half - y[k] / round * half - 1, 2, 2);
  place(label).textContent = `± ${Number(round.toPrecision(2))} A`;
}

/** Dial and planes. @param {any} message */
function vectors(message) {
  plane("plane-ab", "size-ab", message.alpha, message.beta);
  plane("plane-dq", "size-dq", message.id, message.iq);
  const { pen, size } = fresh("dial");
  pen.strokeStyle = PALE;
  pen.lineWidth = 1;
  pen.beginPath();
  pen.arc(size / 2, size / 2, size / 2 - 2, 0, 2 * Math.PI);
  pen.stroke();
  const [theta, error] = [message.theta_deg, message.error_deg];
  if (theta !== null) hand(pen, size, theta, GOOD);
  if (theta !== null && error !== null) hand(pen, size, theta + error, BUSY);
  const known = error === null ? "unknown" : `${error.toFixed(1)}°`;
  place("angles").textContent = theta === null ? "angle" : `true ${theta.toFixed(0)}° (green), error ${known}`;
}

/** @type {Record<string, number>} */
let cursors = {};

/** @param {KeyboardEvent} event @param {any[]} panels */
function setCursor(event, panels) {
  if (/INPUT|SELECT/.test(document.activeElement ? document.activeElement.tagName : "")) return;
  if (event.key === "Escape") cursors = {};
  else if (event.key !== "a" && event.key !== "b") return;
  else {
    const panel = panels.find((one) => one.plot.cursor.left >= 0);
    if (panel === undefined) return;
    cursors[event.key] = panel.plot.posToVal(panel.plot.cursor.left, "x");
  }
  for (const panel of panels) panel.plot.redraw(false);
  tellCursors(panels);
}

/** @param {any} plot */
function drawCursors(plot) {
  for (const [name, time] of Object.entries(cursors)) {
    const x = plot.valToPos(time, "x", true);
    if (x < plot.bbox.left || x > plot.bbox.left + plot.bbox.width) continue;
    plot.ctx.fillStyle = name === "a" ? BAD : BUSY;
    plot.ctx.fillRect(x, plot.bbox.top, 1.5, plot.bbox.height);
  }
}

/** Times of the cursors, their difference, and the difference of each trace. @param {any[]} panels */
function tellCursors(panels) {
  const { a, b } = cursors, parts = [];
  if (a !== undefined) parts.push(`a ${a.toFixed(6)} s`);
  if (b !== undefined) parts.push(`b ${b.toFixed(6)} s`);
  if (a !== undefined && b !== undefined) {
    parts.push(`b - a ${(1e3 * (b - a)).toFixed(4)} ms (${b === a ? "-" : (1 / Math.abs(b - a)).toPrecision(5)} Hz)`);
    for (const { names, plot } of panels) {
      const times = plot.data[0];
      if (!times.length || Math.min(a, b) < times[0] || Math.max(a, b) > times[times.length - 1]) continue;  // not in the picture
      const [from, to] = [nearest(a, times), nearest(b, times)];
      names.forEach((name, k) => {
        const [first, second] = [plot.data[k + 1][from], plot.data[k + 1][to]];
        if (first !== null && second !== null) parts.push(`${name} ${(second - first).toPrecision(4)}`);
      });
    }
  }
  place("cursors").textContent = parts.join("   ");
}

/** Index of the time that is nearest. @param {number} time @param {ArrayLike<number>} times */
function nearest(time, times) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle; else high = middle;
  }
  return time - times[low] < times[high] - time ? low : high;
}

/** The panels as one picture. @param {any[]} panels @param {string} name */
function savePng(panels, name) {
  const parts = panels.map((panel) => panel.plot.ctx.canvas);
  const whole = document.createElement("canvas");
  whole.width = Math.max(1, ...parts.map((part) => part.width));
  whole.height = parts.reduce((sum, part) => sum + part.height + 18, 24);
  const pen = /** @type {CanvasRenderingContext2D} */ (whole.getContext("2d"));
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, whole.width, whole.height);
  pen.fillStyle = "#000";
  pen.font = "14px sans-serif";
  pen.fillText(`${document.title}, ${place("clock").textContent}`, 8, 16);
  let top = 24;
  panels.forEach((panel, k) => {
    pen.fillText(`${panel.names.join(", ")} / ${panel.unit}`, 8, top + 13);
    pen.drawImage(parts[k], 0, top + 18);
    top += parts[k].height + 18;
  });
  const link = document.createElement("a");
  link.download = `${name}.png`;
  link.href = whole.toDataURL("image/png");
  link.click();
}
