// The board: its last ticks as a scope shows them, what it is asked for and its answers, recordings into the data, another table.
import { ask, tell } from "./api.js";
import { el, command, panel, right, table, tiles } from "./dom.js";
import { form } from "./form.js";
import { count, num, percent } from "./numbers.js";
import { COLOURS, curvesPlot, timePlot } from "./plots.js";

const WIDTH = 900;
/** Lengths of the scope's picture, milliseconds. */
const SPANS = [2, 10, 50, 100, 500, 2000];

/** What is set on the scope, and what was pinned: a page that is drawn anew goes on with both. */
const scope = { span_ms: 100, trigger: "reference", level: "", spectrum: false, axis: 0, held: false };
const pins = [];
let shown = null;
let watching = false;

/** Asks for news for as long as a board is connected, on whatever page: without a page that asks, the board is stopped. */
async function watch(lab) {
  if (watching) return;
  watching = true;
  for (;;) {
    const view = shown && shown.root.isConnected ? shown : null;
    try {
      const said = await ask("board", view && !scope.held ? view.query() : {});
      if (!said.connected && !said.sending) { pins.length = 0; break; }
      if (view && view.root.isConnected) view.update(said);
      if (said.sending) await new Promise((done) => setTimeout(done, 300));
    } catch (error) {
      if (view) lab.say(error);
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
  watching = false;
  if (shown && shown.root.isConnected) lab.redraw();
}

async function deed(lab, what, after = () => {}) {
  lab.say(null);
  try {
    await tell("board", what);
    await after();
  } catch (error) { lab.say(error); }
}

/** A table of the project that can be sent: of the step, of the campaign. */
function tables(lab) {
  const { state } = lab;
  const own = state.current !== null && state.tables[state.current] ? [["step", `of the model ${state.steps[state.current].title}`]] : [];
  return [...own, ...(state.campaign && state.campaign.table ? [["campaign", "of the campaign's records"]] : [])];
}

function connectPage(lab, said) {
  const of = tables(lab);
  const connected = () => { watch(lab); lab.redraw(); };
  const none = el("p", { id: "no-table" }, "A simulated board runs the table of a controller. ", el("a", { href: "#controller" }, "Make a table on the page Controller"), ".");
  return el("div", {}, el("h2", {}, "Board"),
    el("p", {}, "The controller on its chip: see what it does, change it, record it into the data, give it a new table. When this page is closed, the loop is stopped and the stage goes to its safe level."),
    panel("A board of your own",
      el("p", { class: "hint" }, "The address is that of a server of the board's telemetry: the debug probe's, for channel 1 of its RTT (the tutorial of the Nucleo board says how to start it), or what ", el("code", {}, "hysteron board serve"), " prints."),
      form(lab, "connect", [["Connection", [{ name: "from", title: "HOST:PORT or udp://HOST:PORT (--from)", otherwise: "localhost:9090", words: true }]]], "Connect", ({ from }) => deed(lab, { what: "connect", from: from || "localhost:9090" }, connected))),
    panel("A simulated board",
      el("p", { class: "hint" }, "The same law, as it runs on the chip, in real time at a simulated stage; it is none of yours."),
      of.length === 0 ? none : form(lab, "simulate", [["What runs where", [
        { name: "stage", title: "Stage (--stage)", choices: said.stages.map((name) => [name, name]) },
        { name: "of", title: "Table", choices: of }]]], "Start it", ({ stage, of: whose }) => deed(lab, { what: "simulate", stage, of: whose }, connected))));
}

const SHAPES = [["sine", "sine"], ["complex-harmonic", "sine with its third harmonic"], ["triangle", "triangle"], ["steps", "staircase"], ["spiral", "spiral, cosine"], ["spiral-sine", "spiral, sine"]];

/** What was typed into the form of the reference, as the board takes it. */
async function wish(given, file) {
  const { bank, feedforward_off, feedback_off, shape, ...rest } = given;
  const trajectory = shape === "file" ? await file.files[0].text() : null;
  return { ...rest, shape: shape === "file" ? "sine" : shape, trajectory, bank: bank === null ? null : Math.round(bank), no_feedforward: feedforward_off, no_feedback: feedback_off, axis: scope.axis };
}

function referencePart(lab, said) {
  const [low, high] = said.tables.length ? said.tables[scope.axis][0].input_um : [null, null];
  const file = el("input", { type: "file", id: "reference-file", accept: ".csv,.txt", "aria-label": "File of a reference" });
  const fields = [
    ["Reference", [{ name: "shape", title: "Shape (--shape)", choices: [...SHAPES, ["file", "of a file, below"]] }, { name: "hz", title: "Frequency, Hz (--hz)", otherwise: "100" },
      { name: "low_um", title: "Lowest, µm (--low)", otherwise: low === null ? "" : `${num(low)} and 2 % of the range` }, { name: "high_um", title: "Highest, µm (--high)", otherwise: high === null ? "" : `${num(high)} less 2 % of the range` }]],
    ["Parts and length", [{ name: "bank", title: "Table of the image (--bank)", otherwise: "0" }, { name: "seconds", title: "Recording, s (--seconds)", otherwise: "1" },
      { name: "feedback_off", title: "Without feedback (--no-feedback)", tick: true }, { name: "feedforward_off", title: "Without feedforward (--no-feedforward)", tick: true }]]];
  const act = async (given, what) => {
    if (given.shape === "file" && !file.files.length) { lab.say(new Error("Choose the file of the reference: 256 positions in micrometres, one a line.")); return; }
    deed(lab, { what, wish: await wish(given, file) });
  };
  const made = form(lab, "record", fields, "Play and record", (given) => act(given, "record"));
  made.querySelector("button[type=submit]").before(el("p", {}, el("label", { for: "reference-file" }, "A reference of your own, 256 positions in µm, one a line "), file));
  const only = el("button", { type: "button", id: "play", click: () => act(made.read(), "play") }, "Set it only");
  made.append(" ", only);
  const state = el("p", { id: "recording", role: "status" });
  const bar = el("progress", { max: "1", value: "0", "aria-label": "Recorded", hidden: true });
  const keep = (role, title) => el("button", { type: "button", id: `keep-${role}`, class: role === "validate" ? "main" : "", click: () => deed(lab, { what: "keep", role }) }, title);
  const delay = el("p", { id: "came-delay" });
  const kept = el("div", { id: "came", hidden: true }, delay, el("p", { class: "row" }, keep("validate", "Add it to the data, to judge by"), keep("identify", "Add it to the data, to fit")), el("p", { class: "hint" }, "Then fit, compare or diagnose with it: the records that are there stay, and so do the models."));
  const asked = el("div", {});
  return {
    part: panel("Play and record", el("p", {}, "The reference is set at the safe level, the loop starts, and stops at the end. What was recorded can go straight into the data."), made, state, bar, kept, asked),
    update(now) {
      const { recording, came, records, fault } = now;
      bar.hidden = recording === null;
      bar.value = recording ?? 0;
      const text = fault !== null ? fault : recording !== null ? `Recording ${records ? records.words : ""}: ${Math.round(100 * Math.min(1, recording))} %` : came ? `${count(came.samples)} samples in ${num(came.seconds)} s, ${count(came.lost)} lost.` : "";
      if (state.textContent !== text) state.textContent = text;
      state.className = fault !== null ? "refused" : "";
      kept.hidden = came === null;
      const goes = came && came.delay_s !== null ? `The board's known delay, ${num(came.delay_s * 1e6)} µs, ${lab.state.takes_known ? "goes into the data with it" : "does not go into the data: they begin with other files, and know what was said of those"}.` : "";
      if (delay.textContent !== goes) delay.textContent = goes;
      if (records && asked.dataset.of !== records.command) { asked.dataset.of = records.command; asked.replaceChildren(command(records.command)); }
    },
  };
}

function scopePart(lab) {
  const hosts = { position: el("div", { class: "plot", id: "scope-position" }), error: el("div", { class: "plot", id: "scope-error" }), command: el("div", { class: "plot", id: "scope-command" }), spectrum: el("div", { class: "plot", id: "scope-spectrum" }) };
  const figures = el("p", { id: "scope-figures", class: "lead" });
  const choose = (name, title, choices) => el("label", {}, `${title} `, el("select", { id: `scope-${name}`, change: ({ target }) => { scope[name] = name === "trigger" ? target.value : Number(target.value); charts = null; } }, choices.map(([value, words]) => el("option", { value, selected: scope[name] === value }, words))));
  const level = el("input", { type: "number", step: "any", id: "scope-level", value: scope.level || null, placeholder: "middle", input: () => { scope.level = level.value; } });
  const hold = el("button", { type: "button", id: "hold", "aria-pressed": String(scope.held), click: () => { scope.held = !scope.held; hold.setAttribute("aria-pressed", String(scope.held)); hold.textContent = scope.held ? "Go on" : "Hold"; } }, scope.held ? "Go on" : "Hold");
  const pin = el("button", { type: "button", id: "pin", click: () => { if (last) { pins.push(last); drawPins(); } } }, "Pin these figures");
  const spectrum = el("input", { type: "checkbox", id: "scope-with-spectrum", checked: scope.spectrum, change: () => { scope.spectrum = spectrum.checked; charts = null; } });
  const pinned = el("div", { id: "pins" });
  let [charts, last, points] = [null, null, null];

  function drawPins() {
    pinned.replaceChildren(...(pins.length ? [table("Pinned figures", ["Tick", "rms error, nm", "Largest, nm", "Of the reference"], pins.map((p) => [count(p.tick), right(num(p.rms_um * 1e3)), right(num(p.most_um * 1e3)), right(percent(100 * p.rms_um / p.span_um))]))] : []));
  }
  /** Half-way up what the trigger looks at. */
  function middle() {
    if (!points) return 0;
    const values = points.y[{ reference: 0, position: 1, command: 3 }[scope.trigger]].filter((v) => v !== null);
    return values.length ? (Math.min(...values) + Math.max(...values)) / 2 : 0;
  }
  const hasSpectrum = (found) => Boolean(found.spectrum && found.spectrum.frequency_hz.length);
  function begin(found) {
    for (const host of Object.values(hosts)) host.replaceChildren();
    const follows = { sync: "scope", follow: () => charts.plots };
    const line = (label, colour) => ({ label, colour, scale: "y" });
    const at = (host, y, series, options) => timePlot(host, { x: found.points.x, y }, series, () => {}, { ...follows, ...options });
    const [reference, position, error, volts] = found.points.y;
    charts = { ticks: found.points.samples, plots: [] };
    charts.plots = [
      at(hosts.position, [reference, position], [line("reference, µm", COLOURS.noise), line("position, µm", COLOURS.measured)], { height: 260, title: "position, µm", name: "scope position" }),
      at(hosts.error, [error], [line("error, µm", COLOURS.residual)], { height: 180, title: "error, µm", name: "scope error" }),
      at(hosts.command, [volts], [line("command, V", COLOURS.input)], { height: 180, title: "command, V", name: "scope command" })];
    if (hasSpectrum(found)) {
      const { frequency_hz: f, position_um_per_rthz: p, error_um_per_rthz: e } = found.spectrum;
      charts.spectrum = curvesPlot(hosts.spectrum, f, [["position", COLOURS.measured, p], ["error", COLOURS.residual, e]], "µm/√Hz", { log: true, height: 260, name: "scope spectrum" });
    }
  }
  function draw(found) {
    points = found.points;
    const { x, y } = found.points;
    // An answer that was asked for before a setting changed has other series.
    if (!charts || charts.ticks !== found.points.samples || hasSpectrum(found) !== Boolean(charts.spectrum)) begin(found);
    else [[y[0], y[1]], [y[2]], [y[3]]].forEach((series, index) => charts.plots[index].renew({ x, y: series }));
    if (charts.spectrum) charts.spectrum.setData([found.spectrum.frequency_hz, found.spectrum.position_um_per_rthz, found.spectrum.error_um_per_rthz]);
    const f = found.figures;
    last = f && { ...f, tick: found.first };
    pin.disabled = !f;
    figures.textContent = f ? `Error ${num(f.rms_um * 1e3)} nm rms, ${num(f.most_um * 1e3)} nm at most${f.span_um > 0 ? `: ${percent(100 * f.rms_um / f.span_um)} of the reference in view` : ""}.` : "The loop does not run in this picture.";
    hosts.position.dataset.triggered = found.triggered;
  }
  const part = el("section", { class: "panel", id: "scope" }, el("h3", {}, "Scope"),
    el("p", { class: "row" }, choose("span_ms", "Length", SPANS.map((ms) => [ms, `${ms} ms`])), choose("trigger", "Trigger, rising", [["none", "none"], ["reference", "reference"], ["position", "position"], ["command", "command"]]), el("label", {}, "at ", level), el("label", {}, spectrum, " Spectrum"), hold, pin),
    figures, hosts.position, hosts.error, hosts.command, hosts.spectrum, pinned);
  drawPins();
  return {
    part,
    query: (rate_hz) => ({ ticks: Math.max(2, Math.round(scope.span_ms * 1e-3 * (rate_hz || 50e3))), width: WIDTH, axis: scope.axis, trigger: scope.trigger, ...(scope.trigger === "none" ? {} : { level: scope.level === "" ? middle() : Number(scope.level) }), ...(scope.spectrum ? { spectrum: 1 } : {}) }),
    update: (now) => { if (now.scope && !scope.held) draw(now.scope); },
  };
}

const answerWords = ({ what, tick, accepted }) => (accepted ? `${what}: taken at tick ${count(tick)}` : tick === null ? `${what}: no answer` : `${what}: refused at tick ${count(tick)}; the board was not at rest, or its table does not allow it`);

function statusPart(lab) {
  const facts = el("div", {});
  const answers = el("ul", { id: "answers", class: "findings" });
  const notice = el("p", { class: "notice", id: "board-notice", hidden: true });
  const button = (id, title, what, main) => el("button", { type: "button", id, class: main ? "main" : "", click: () => deed(lab, { what }) }, title);
  const [start, stop, clear] = [button("board-start", "Start the loop", "start"), button("board-stop", "Stop", "stop", true), button("board-clear", "Clear the fault", "clear")];
  const leave = el("button", { type: "button", id: "leave", click: () => deed(lab, { what: "leave" }, () => lab.redraw()) }, "Disconnect");
  const part = el("section", {}, facts, notice, el("p", { class: "row" }, stop, start, clear, leave));
  let was = "";
  return {
    part, answers,
    update(now) {
      const { axes, name, rate_hz, ended, silent_s, foreign_bytes, waits_for } = now;
      const axis = axes[scope.axis];
      const hash = axis && now.tables.length ? now.tables[scope.axis][axis.bank].table.slice(0, 8) : "–";
      const lost = axis ? axis.lost : 0;
      const text = JSON.stringify([name, axis && [axis.mode, axis.fault, lost, axis.restarts], hash, rate_hz, ended]);
      if (text !== was) {
        was = text;
        facts.replaceChildren(tiles([
          ["Board", name || "not heard yet", now.stage ? `simulated, at the stage ${now.stage}` : now.from],
          ["Loop", axis ? axis.mode : "–", axis && axis.fault ? `fault: ${axis.fault}` : "no fault"],
          ["Table", hash, rate_hz ? `${num(rate_hz / 1e3)} kHz` : ""],
          ["Lost", axis ? `${count(lost)} ticks` : "–", axis && axis.restarts ? `${axis.restarts} restarts` : "of all since it is connected"]]));
      }
      const trouble = ended !== null ? `The connection is over: ${ended}. Disconnect, look at the cable and the server, and connect again. A loop that ran may still run: its own watch stops it at a fault.` : silent_s > 1 ? `Nothing has come for ${num(silent_s)} s.` : foreign_bytes > 0 && axes.length === 0 ? "What comes is no telemetry of this version's firmware." : "";
      notice.hidden = trouble === "";
      notice.textContent = trouble;
      start.disabled = ended !== null || !axis || !axis.at_rest;
      stop.disabled = ended !== null;
      clear.disabled = !axis || !axis.fault;
      const words = [...now.answers.map(answerWords), ...(waits_for ? [`${waits_for}: asked for, not answered yet`] : [])].reverse();
      if (answers.dataset.words !== words.join("\n")) { answers.dataset.words = words.join("\n"); answers.replaceChildren(...words.map((one) => el("li", {}, one))); }
    },
  };
}

/** Every recording of this connection: before a new table and after it. */
function runsPart() {
  const host = el("div", { id: "runs" });
  return {
    part: host,
    update({ runs }) {
      if (host.dataset.count === String(runs.length)) return;
      host.dataset.count = runs.length;
      host.replaceChildren(...(runs.length === 0 ? [] : [panel("What was recorded here", table("Errors of each recording", ["Reference", "Table", "rms error, nm", "Of the reference", "Samples", "Lost"],
        runs.map((run) => [run.words, run.table, right(run.rms_um === undefined ? "–" : num(run.rms_um * 1e3)), right(run.rms_um === undefined ? "–" : percent(100 * run.rms_um / run.span_um)), right(count(run.samples)), right(count(run.lost))])),
      el("p", { class: "hint" }, "Over the later half of the ticks on which the loop ran."))]));
    },
  };
}

export async function boardPage(lab) {
  const said = await ask("board", { now: 1 });
  if (!said.connected && said.sending) {
    watch(lab);
    const root = el("div", {}, el("h2", {}, "Board"), el("p", {}, "The table is being sent; the board starts anew with it."));
    shown = { root, query: () => ({}), update: (now) => { if (now.connected) lab.redraw(); } };
    return root;
  }
  if (!said.connected) {
    shown = null;
    return connectPage(lab, said);
  }
  const [status, picture, reference, runs] = [statusPart(lab), scopePart(lab), referencePart(lab, said), runsPart()];
  const of = tables(lab);
  const root = el("div", { class: "full" }, el("h2", {}, "Board"), status.part,
    said.axes.length > 1 ? el("p", {}, el("label", {}, "Axis ", el("select", { id: "axis", change: ({ target }) => { scope.axis = Number(target.value); lab.redraw(); } }, [[0, "first"], [1, "second"]].map(([value, words]) => el("option", { value, selected: scope.axis === value }, words))))) : null,
    el("div", { class: "live" }, picture.part, el("div", {},
      reference.part,
      panel("Gains of the feedback", el("p", { class: "hint" }, "At any time, until the next start or the next table."), form(lab, "gains", [["PI controller", [{ name: "proportional_v_per_um", title: "K_p, V/µm", otherwise: "0" }, { name: "integral_v_per_um_s", title: "K_i, V/µm/s", otherwise: "0" }]]], "Change them", (given) => deed(lab, { what: "gains", axis: said.axes.length > 1 ? scope.axis + 1 : 0, proportional_v_per_um: given.proportional_v_per_um ?? 0, integral_v_per_um_s: given.integral_v_per_um_s ?? 0 }))),
      panel("Another table", of.length ? form(lab, "upload", [["Into the slot that is not in use; then the board starts anew", [{ name: "of", title: "Table", choices: of }]]], "Send it", (given) => deed(lab, { what: "upload", of: given.of })) : el("p", {}, "No table yet. ", el("a", { href: "#controller" }, "Make one on the page Controller"), ".")),
      panel("Answers of the board", status.answers))),
    runs.part);
  let [rate_hz, samples, heard] = [said.rate_hz, 0, said.tables.length > 0];
  shown = {
    root,
    query: () => ({ ...picture.query(rate_hz), samples }),
    update(now) {
      if (!now.connected) { lab.redraw(); return; }
      // What the fields say of the table is known only now.
      if (!heard && now.tables.length) { heard = true; lab.redraw(); return; }
      rate_hz = now.rate_hz;
      samples = now.axes.length ? now.axes[0].samples : 0;
      status.update(now);
      picture.update(now);
      reference.update(now);
      runs.update(now);
    },
  };
  shown.update(said);
  watch(lab);
  return root;
}
