// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0
// @ts-check
"use strict";

// The page of `fluxlock live`. It asks for one picture at a time, draws it and asks for the next one.

/** @typedef {{name: string, kind: string, text: string, choices: string[], unit: string, decimals: number,
 *   low: number|null, high: number|null, permitted: string, value: string}} Setting */
/** @typedef {{traces: [string, string, string][], settings: Setting[], name: string, source: string, method: string,
 *   max_speed_rpm: number, supply_v: number, supply_most_v: number, rated_torque_nm: number, faults: {name: string, text: string, order: object|null, why: string}[],
 *   without: string[], marks: string[], steps?: [string, number, string][],
 *   wizard?: {steps: [string, string][], note: string}}} Hello */

const LANE = 1.25, LANE_PX = 16;  // height of a logic lane, of which a level takes 1; and on the screen
const AXIS_PX = 76, EDGE_PX = 28;  // left and right of the panels
const MARK_COLOURS = ["#9467bd", "#2ca02c", "#ff7f0e", "#c62828", "#1565c0", "#c62828", "#00838f"], TRIGGER_COLOUR = "#d81b60";
const SHOWN = ["speed_rpm", "measured_rpm", "reference_rpm", "ia", "ib", "ic", "idc", "iq", "motor_a", "vdc", "torque_nm",
  "current_d", "current_e", "angle_error_deg", "margin_deg", "state"];
const COLOURS = ["#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2"];
const AGAIN_MS = 1000, PLANES_MS = 200, DROPPED_MS = 100;

/** @param {string} id @returns {any} */
const at = (id) => document.getElementById(id);

/** @type {WebSocket|null} */
let socket = null;
/** @type {Hello|null} */
let hello = null;
/** @type {any} */
let told = {};
/** @type {{unit: string, names: string[], plot: any}[]} */
let panels = [];
/** @type {number|null} */
let heldTo = null;
/** @type {number|null} span of a part that was chosen with the mouse */
let heldSpan = null;
let last = { from: 0, to: 0, newest: 0 };
/** times of drawing, ms, and times of DROPPED_MS without a new picture; read by tests */
const drawn = { count: 0, /** @type {number[]} */ times: [], dropped: 0, newest: performance.now() };
Object.assign(window, { fluxlockDrawn: drawn });

/** @param {object} message */
function send(message) {
  if (socket !== null && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

/** @param {string} text @param {boolean} again whether a button begins the source anew */
function banner(text, again = false) {
  const place = at("banner");
  place.hidden = text === "";
  place.textContent = text;
  if (again) {
    const button = document.createElement("button");
    button.textContent = "Start it again";
    button.id = "again";
    button.onclick = () => send({ kind: "restart" });
    place.append(button);
  }
}

function connect() {
  const url = new URL("socket" + location.search, location.href);
  url.protocol = url.protocol.replace("http", "ws");
  socket = new WebSocket(url);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => banner("");
  socket.onmessage = (event) => (event.data instanceof ArrayBuffer ? draw(event.data) : receive(JSON.parse(event.data)));
  socket.onclose = (event) => {
    banner(event.code === 4403 || event.code === 1006 && hello === null
      ? "The server refuses this page: its address needs the token that `fluxlock live` printed. Trying again."
      : "The connection is lost: `fluxlock live` has ended or is not reachable. Trying again.");
    setTimeout(connect, AGAIN_MS);
  };
}

/** @param {any} message */
function receive(message) {
  if (message.kind === "hello") build(message);
  else if (message.kind === "status") report(message);
  else if (message.kind === "said") journal(`${message.t_s.toFixed(4)} s  ${message.text}  ${message.answer}`, /error/.test(message.answer));
  else if (message.kind === "error") journal(message.text, true);
  else if (message.kind === "files") files(message);
  else if (message.kind === "planes") vectors(message);
  else if (message.kind === "died") banner(`The source has died: ${message.text}.`, true);
}

/** @param {string} text @param {boolean} refused */
function journal(text, refused) {
  const entry = document.createElement("li");
  entry.textContent = text;
  entry.className = refused ? "refused" : "";
  at("said").prepend(entry);
  while (at("said").children.length > 200) at("said").lastChild.remove();
}

/** @param {{names: string[], scenario?: string, folder: string}} message */
function files(message) {
  if (hello && hello.wizard) showPlots(message.names);
  at("files").replaceChildren(...message.names.map((name) => {
    const link = document.createElement("a");
    link.href = `files/${name}${location.search}`;
    link.textContent = name;
    link.style.marginRight = "0.6em";
    return link;
  }));
  const command = hello && hello.source === "chip" ? "run" : "native";
  const text = message.scenario ? `fluxlock ${command} ${message.folder}/${message.scenario}${command === "run" ? "" : " --play"}` : `in ${message.folder}`;
  at("files").append(Object.assign(document.createElement("code"), { textContent: text }));
}

/** @param {any} message */
function report(message) {
  told = message;
  if (message.state === undefined) return;
  at("state").textContent = message.state + (message.phase !== "none" && message.state === "starting" ? `: ${message.phase}` : "");
  at("state").className = `badge ${message.state === "running" ? "good" : message.state === "fault" ? "bad" : ""}`;
  at("fault").textContent = message.fault === "none" ? "" : message.fault;
  at("fault").className = "badge bad";
  stateGraph(message.state, message.failed_in || "", message.fault);
  at("limit").textContent = message.limit === "none" ? "" : `limit: ${message.limit}`;
  at("clock").textContent = `${message.t_s.toFixed(3)} s`;
  at("pace").textContent = message.wanted === 0 ? "paused" : `time × ${message.reached < 1e-6 ? 0 : Number(message.reached.toPrecision(2))} (wanted ${message.wanted})`;
  at("load-core").textContent = message.core_load == null ? "" : `core ${message.core_load.toFixed(0)} %`;
  at("load-bus").textContent = message.bus_load == null ? "" : `bus ${message.bus_load.toFixed(1)} %`;
  at("viewers").textContent = message.viewers > 1 ? `${message.viewers} viewers share this source` : "";
  at("pause").textContent = message.wanted === 0 ? "Run" : "Pause";
  for (const [id, value, unit] of [["speed", message.target_rpm, "r/min"], ["load", message.load_factor, "×"], ["supply", message.supply_v, "V"]]) {
    if (document.activeElement !== at(id)) at(id).value = value;
    at(`${id}-out`).textContent = `${Number(value).toLocaleString("en")} ${unit}`;
  }
  if (message.wizard) showSteps(message.wizard);
  for (const [name, value] of Object.entries(message.values)) {
    const input = at(`set-${name}`);
    if (input && document.activeElement !== input) input.value = value;
  }
}

/** @param {Setting} setting */
function knob(setting) {
  const label = document.createElement("label");
  const range = setting.low !== null && setting.high !== null ? `${setting.low} to ${setting.high}` : setting.permitted;
  label.title = `${setting.text}${range ? ` Permitted: ${range}` : ""}`;
  /** @type {any} */
  let input;
  if (setting.kind === "number") {
    input = document.createElement("input");
    input.type = "number";
    input.step = setting.decimals ? 10 ** -setting.decimals : 1;
    if (setting.low !== null) input.min = setting.low;
    if (setting.high !== null) input.max = setting.high;
  } else {
    input = document.createElement("select");
    const words = setting.kind === "switch" ? ["0", "1"] : setting.choices;
    input.append(...words.map((word) => new Option(setting.kind === "switch" ? (word === "1" ? "on" : "off") : word, word)));
  }
  input.id = `set-${setting.name}`;
  input.value = setting.value;
  input.onchange = () => send({ kind: "set", name: setting.name, value: String(input.value) });
  const name = Object.assign(document.createElement("small"), { textContent: setting.name });
  const unit = Object.assign(document.createElement("small"), { textContent: setting.unit });
  label.append(name, input, unit);
  return label;
}

/** @param {Hello} message */
function build(message) {
  const again = hello !== null && hello.name === message.name;
  hello = message;
  banner("");
  at("said").replaceChildren();
  at("name").textContent = `${message.name} — ${message.source}${message.method ? `, ${message.method}` : ""}`;
  document.title = `${message.name} — Fluxlock live`;
  if (told.state === undefined) at("state").textContent = "the source begins";
  const [drive, model] = [!["recording", "first start"].includes(message.source), ["twin", "chip"].includes(message.source)];
  at("wizard").hidden = !message.wizard;
  at("time").hidden = Boolean(message.wizard);
  document.body.classList.toggle("first-start", Boolean(message.wizard));
  if (message.wizard) beginSteps(message.wizard);
  for (const id of ["knobs", "breaks", "table"]) at(id).hidden = !drive;
  at("export").hidden = !model;
  for (const id of ["load", "supply"]) at(id).disabled = !model;
  Object.assign(at("speed"), { min: -message.max_speed_rpm, max: message.max_speed_rpm });
  at("supply").max = Math.max(message.supply_most_v, message.supply_v);
  at("settings").replaceChildren(...message.settings.map(knob));
  at("faults").replaceChildren(...message.faults.map((fault) => {
    const button = document.createElement("button");
    button.textContent = fault.name;
    button.title = fault.why || fault.text;
    button.className = fault.order === null ? "without" : "";
    button.onclick = () => (fault.order === null ? journal(`${fault.name}: ${fault.why}`, true) : send(fault.order));
    return button;
  }));
  if (again) return;
  at("traces").replaceChildren(...message.traces.map(([name, unit, text]) => {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", value: name, checked: (SHOWN.includes(name) || unit === "level" || Boolean(message.wizard)) && !message.without.includes(name) });
    box.onchange = layout;
    label.title = text;
    label.append(box, ` ${name} / ${unit}`);
    return label;
  }));
  at("trigger").replaceChildren(new Option("none", ""), ...message.marks.map((name) => new Option(name, `!${name}`)), ...message.traces.map(([name]) => new Option(name, name)));
  legend(message.marks);
  if (message.wizard) at("span").value = "10";
  if (message.steps) {
    at("step-by").replaceChildren(...message.steps.map(([name, seconds, until]) => new Option(name, `${seconds} ${until}`)), ...at("step-by").children);
    at("span").value = "0.005";
  }
  layout();
}

/** @returns {string[]} */
const chosen = () => [...document.querySelectorAll("#traces input:checked")].map((box) => /** @type {any} */ (box).value);

/** A panel per unit for the traces that are chosen. */
function layout() {
  for (const panel of panels) panel.plot.destroy();
  const wanted = hello ? hello.traces.filter(([name]) => chosen().includes(name)) : [];
  const units = [...new Set(wanted.map(([, unit]) => unit))].sort((a, b) => Number(b === "level") - Number(a === "level"));
  const width = at("plots").clientWidth;
  const height = Math.max(110, (window.innerHeight - 320) / Math.max(units.length, 1) - 30);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const ink = dark ? "#ddd" : "#333", grid = dark ? "#8883" : "#8884";
  panels = units.map((unit, k) => {
    const names = wanted.filter(([, u]) => u === unit).map(([name]) => name);
    const lowest = k === units.length - 1;
    const lanes = unit === "level";
    const axis = { stroke: ink, grid: { stroke: grid }, ticks: { stroke: grid } };
    const options = {
      width, height: lanes ? Math.max(height, LANE_PX * names.length) : height,
      cursor: { sync: { key: "scope" }, drag: { x: true, y: false, setScale: false } },
      hooks: { setSelect: [choose], draw: [drawMarks, drawCursors] },
      scales: { x: { time: false }, y: { range: lanes ? [-0.1, LANE * names.length] : ranged } },
      padding: [8, EDGE_PX, 0, 0],
      axes: [lowest ? { ...axis, label: "time / s", size: 32, labelSize: 16, values: inSteps } : { ...axis, size: 4, values: () => [] },
        { ...axis, label: unit, size: AXIS_PX, labelSize: 18, space: 22, values: inSteps, ...(lanes ? laneAxis(names) : {}) }],
      series: [{ label: "t / s" }, ...names.map((name, n) => ({ label: name, stroke: COLOURS[n % COLOURS.length], width: 1, paths: lines, points: { show: false }, ...(lanes ? { value: (/** @type {any} */ _, /** @type {number|null} */ v) => (v === null ? "-" : String(Math.round(v - LANE * (names.length - 1 - n)))) } : {}) }))],
    };
    // @ts-ignore: uPlot comes from its own file
    return { unit, names, plot: new uPlot(options, [[], ...names.map(() => [])], at("plots")) };
  });
}

/** Labels with as many digits as tell them apart. @param {any} _ @param {number[]} splits @param {number} __ @param {number} ___ @param {number} step */
const inSteps = (_, splits, __, ___, step) => {
  let digits = 0;
  while (digits < 9 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits++;
  return splits.map((value) => value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }));
};

/** Range of a panel; one without a value has one too, or its grid would stay behind. @param {any} _ @param {number|null} low @param {number|null} high */
// @ts-ignore: uPlot comes from its own file
const ranged = (_, low, high) => (low === null || high === null ? [0, 1] : uPlot.rangeNum(low, high, 0.1, true));

/** Axis of logic lanes: their names, the first on top. @param {string[]} names */
const laneAxis = (names) => ({
  splits: () => names.map((_, k) => LANE * (names.length - 1 - k) + 0.5),
  values: () => names.map((name) => name.replace("gate_", "").replace("compare_", "cmp ")),
  grid: { show: false },
});

/** What the colours of the marks mean. @param {string[]} names */
function legend(names) {
  at("marks").replaceChildren(...names.map((name, k) => {
    const entry = Object.assign(document.createElement("span"), { textContent: `| ${name} ` });
    entry.style.color = MARK_COLOURS[k];
    return entry;
  }));
}

/** Hold the part that was chosen with the mouse. @param {any} plot */
function choose(plot) {
  if (plot.select.width < 3) return;
  const from = plot.posToVal(plot.select.left, "x");
  heldTo = plot.posToVal(plot.select.left + plot.select.width, "x");
  heldSpan = Math.max(1e-4, heldTo - from);
  at("hold").textContent = "Go on";
  plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
}

/** Ask for the next picture; `draw` does so again. */
function ask() {
  const traces = panels.flatMap((panel) => panel.names);
  if (traces.length === 0 || socket === null || socket.readyState !== WebSocket.OPEN) {
    setTimeout(ask, 100);
    return;
  }
  const trigger = at("trigger").value;
  const edge = at("edge").value;
  const level = Math.max(-1e9, Math.min(1e9, Number(at("level").value)));
  send({
    kind: "view", traces, width: Math.max(16, Math.min(8192, at("plots").clientWidth - AXIS_PX - EDGE_PX)), span_s: heldSpan === null ? Number(at("span").value) : heldSpan,
    ...(heldTo === null ? {} : { to_s: heldTo }),
    ...(trigger === "" || heldTo !== null ? {} : { trigger: { ...(marked() ? { mark: trigger.slice(1) } : { trace: trigger, level, rising: edge !== "down", size: edge === "size" }),
      before: Number(at("before").value), after_s: armed } }),
  });
  waiting = setTimeout(ask, 2000);  // an answer that never comes
}
let waiting = 0;
let armed = -1;  // triggers at or before this time are passed by
/** @type {{times: Float64Array, kinds: Float64Array, trigger: number}} */
let marks = { times: new Float64Array(0), kinds: new Float64Array(0), trigger: NaN };

/** Whether the trigger is an instant. @returns {boolean} */
const marked = () => at("trigger").value.startsWith("!");

/** Freeze the picture that ends there; null: go on. @param {number|null} to */
function hold(to) {
  heldTo = to;
  heldSpan = null;
  at("hold").textContent = to === null ? "Hold" : "Go on";
}

/** Look for the next trigger only, where one is looked for. */
function arm() {
  armed = at("mode").value === "auto" ? -1 : last.newest;
  at("triggered").textContent = "";
  for (const id of ["edge", "level"]) at(id).disabled = marked();
  hold(null);
}

/** Marks of the instants in a panel, and the trigger. @param {any} plot */
function drawMarks(plot) {
  const { left, width, top, height } = plot.bbox;
  const line = (/** @type {number} */ time, /** @type {string} */ colour, /** @type {number} */ wide) => {
    const x = plot.valToPos(time, "x", true);
    if (x < left || x > left + width) return;
    plot.ctx.fillStyle = colour;
    plot.ctx.fillRect(x, top, wide, height);
  };
  plot.ctx.save();
  plot.ctx.globalAlpha = 0.6;
  marks.times.forEach((time, k) => line(time, MARK_COLOURS[marks.kinds[k]], 1));
  if (!Number.isNaN(marks.trigger)) line(marks.trigger, TRIGGER_COLOUR, 2);
  plot.ctx.restore();
}

/** @param {ArrayBuffer} data as `server.picture` lays it out */
function draw(data) {
  clearTimeout(waiting);
  const begin = performance.now();
  const view = new DataView(data);
  const [count, points, number] = [0, 4, 8].map((place) => view.getUint32(place, true));
  const [from, to, trigger, newest] = [16, 24, 32, 40].map((place) => view.getFloat64(place, true));
  const body = 48 + 16 * number;
  const times = new Float64Array(data, body, points);
  const names = panels.flatMap((panel) => panel.names);
  const searching = at("trigger").value !== "" && heldTo === null;
  const stays = searching && Number.isNaN(trigger) && at("mode").value !== "auto";
  last = stays ? { ...last, newest } : { from, to, newest };
  if (count === names.length && !stays) {
    marks = { times: new Float64Array(data, 48, number), kinds: new Float64Array(data, 48 + 8 * number, number), trigger: heldTo === null ? trigger : marks.trigger };
    let row = 0;
    for (const panel of panels) {
      let lane = 0;
      const rows = panel.names.map(() => {
        const values = new Float32Array(data, body + 8 * points + 4 * points * row++, points);
        if (panel.unit === "level") {
          const foot = LANE * (panel.names.length - 1 - lane++);
          return values.map((value) => value + foot);
        }
        return values.some(Number.isNaN) ? Array.from(values, (v) => (Number.isNaN(v) ? null : v)) : values;
      });
      panel.plot.batch(() => {
        panel.plot.setData([times, ...rows], false);
        panel.plot.setScale("x", { min: from, max: to });
      });
    }
    tellCursors(panels);
  }
  if (searching) at("triggered").textContent = Number.isNaN(trigger) ? "waiting" : `at ${trigger.toFixed(5)} s`;
  if (searching && !Number.isNaN(trigger) && at("mode").value === "single") hold(Math.min(to, newest));
  requestAnimationFrame(() => {
    ask();
    setTimeout(() => {  // once this frame is painted
      const now = performance.now();
      drawn.count += 1;
      drawn.times.push(now - begin);
      drawn.dropped += Math.floor((now - drawn.newest) / DROPPED_MS);
      drawn.newest = now;
      if (drawn.times.length > 500) drawn.times.shift();
    });
  });
}

function wire() {
  for (const button of document.querySelectorAll("[data-do]")) {
    /** @type {any} */ (button).onclick = () => send({ kind: "drive", do: /** @type {any} */ (button).dataset.do });
  }
  at("speed").onchange = () => send({ kind: "set", name: "speed_rpm", value: String(Math.round(at("speed").value)) });
  at("load").onchange = () => send({ kind: "load", factor: Number(at("load").value) });
  at("supply").onchange = () => send({ kind: "supply", volt: Number(at("supply").value), ramp_s: 0.01 });
  const pace = () => send({ kind: "pace", factor: Number(at("factor").value) });
  at("pause").onclick = () => (told.wanted === 0 ? pace() : send({ kind: "pace", factor: 0 }));
  at("factor").onchange = pace;
  at("step").onclick = () => {
    const [seconds, until] = at("step-by").value.split(" ");
    send({ kind: "step", seconds: Number(seconds), ...(until ? { until } : {}) });
  };
  at("restart").onclick = () => send({ kind: "restart" });
  at("export").onclick = () => send({ kind: "export", name: at("file").value });
  for (const kind of ["csv", "parquet"]) {
    at(kind).onclick = () => send({
      kind, name: at("file").value, traces: chosen(), from_s: Math.max(0, last.from), to_s: Math.max(0, last.to),
    });
  }
  at("png").onclick = () => savePng(panels, at("file").value);
  window.onkeydown = (event) => setCursor(event, panels);
  setInterval(() => {
    if (hello !== null && !document.hidden) send({ kind: "planes", span_s: Math.min(1, heldSpan || Number(at("span").value)), ...(heldTo === null ? {} : { to_s: heldTo }) });
  }, PLANES_MS);
  at("hold").onclick = () => (heldTo === null ? hold(Math.min(last.to, last.newest)) : arm());
  for (const id of ["trigger", "mode"]) at(id).onchange = arm;
  window.onresize = layout;
}

wire();
wireSteps();
connect();
ask();
