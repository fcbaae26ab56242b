// A step's parameters moved by hand: the user's own record is simulated again while a slider moves.
import { ask } from "./api.js";
import { el } from "./dom.js";
import { percent } from "./numbers.js";
import { timePlot, COLOURS } from "./plots.js";
import { effectName, slider } from "./effects.js";

const WIDTH = 1000;
/** A hand that rests this long has come to an end; milliseconds. */
const RESTS = 250;

/** Whether the part is open, and what was moved in it: a page that is drawn anew goes on with both. */
let open = false;
let held = { of: null, values: null };

/** The part of the page, and how it is told which record is looked at. */
export function byHand(lab, output, outputUnit) {
  const step = lab.state.current;
  const of = JSON.stringify([lab.state.folder, lab.state.steps[step].model, lab.state.steps[step].command]);
  const stale = Boolean(lab.state.steps[step].since);
  const hosts = { overlay: el("div", { class: "plot", id: "hand-overlay" }), error: el("div", { class: "plot", id: "hand-error" }) };
  const sliders = el("div", { class: "sliders" });
  const said = el("p", { class: "lead", id: "hand-said" });
  const heard = el("p", { class: "unseen", role: "status" });
  const fault = el("p", { class: "refused", role: "alert" });
  const back = el("button", { type: "button", id: "hand-back", disabled: true, click: () => { knobs.forEach((knob) => { knob.value = knob.fitted; }); fill(); moved(); } }, "Back to the fitted values");
  const keep = el("button", { type: "button", id: "hand-keep", class: "main", disabled: true, click: () => lab.act({ what: "keep-moved", values: values() }, "ladder") }, "Keep as a step of the ladder");
  const part = el("details", { class: "panel", id: "by-hand", open }, el("summary", {}, "Move its parameters by hand"), said, heard,
    el("div", { class: "live" }, el("div", {}, hosts.overlay, el("h3", {}, "Error: measured minus modelled"), hosts.error),
      el("div", {}, sliders, fault, el("p", { class: "row" }, back, keep),
        el("p", { class: "hint" }, stale ? "The data have grown since this step was fitted: fit it anew, then move what comes of it." : "What is kept is a step of its own; the fitted one stays."))));
  let [record, file, knobs, base, charts, range] = [null, "", [], null, [], {}];
  let [wanted, busy, timer, turn] = [null, false, 0, 0];
  const values = () => knobs.map((knob) => knob.value);
  const is = () => knobs.some((knob) => knob.value !== knob.fitted);

  function say(now) {
    const text = `${file}: fitted ${percent(base.nrmse_percent)}, moved ${percent(now)} of peak to peak.`;
    said.textContent = text;
    back.disabled = !is();
    keep.disabled = !is() || stale || lab.state.job.running;
    return text;
  }
  function fill() {
    sliders.replaceChildren(...knobs.map((knob, index) => slider(knob, index, knobs, moved, "hand")));
  }
  /** What is drawn: measured, fitted, moved over time, and both errors. */
  function draw([model, error]) {
    const [measured, fitted, fittedError] = base.y;
    charts[0].renew({ x: base.x, y: [measured, fitted, model] });
    charts[1].renew({ x: base.x, y: [fittedError, error] });
  }
  async function frame(rest) {
    const mine = turn;
    held = { of, values: values() };
    try {
      const found = await ask("by-hand", { step, record, width: WIDTH, values: values().join(","), ...range, ...(rest ? { rest: 1 } : {}) });
      if (mine !== turn) return;
      fault.textContent = "";
      draw(found.y);
      const text = say(found.nrmse_percent);
      if (rest) heard.textContent = text;
    } catch (error) { fault.textContent = error.message; }
  }
  /** One request at a time, always with the newest values. */
  async function follow(rest) {
    wanted = { rest };
    if (busy) return;
    busy = true;
    while (wanted) {
      const next = wanted;
      wanted = null;
      await frame(next.rest);
    }
    busy = false;
  }
  function moved() {
    heard.textContent = "";
    clearTimeout(timer);
    timer = setTimeout(() => follow(true), RESTS);
    follow(false);
  }
  /** The record, or a stretch of it, as it was measured and fitted. */
  const fetchBase = () => ask("by-hand", { step, record, width: WIDTH, ...range });
  async function finer(from, to) {
    range = { from, to };
    const mine = ++turn;
    const found = await fetchBase();
    if (mine !== turn) return;
    base = found;
    follow(true);
  }
  async function begin() {
    const mine = ++turn;
    range = {};
    let found;
    try { found = await fetchBase(); } catch (error) { fault.textContent = error.message; return; }
    if (mine !== turn) return;
    base = found;
    const kept = held.of === of && held.values.length === base.knobs.length ? held.values : null;
    knobs = base.knobs.map((knob, index) => ({ ...knob, fitted: knob.value, value: kept ? kept[index] : knob.value, label: `${knob.effect ? `${effectName(knob.effect)}: ` : ""}${knob.name.replaceAll("_", " ")}` }));
    for (const host of Object.values(hosts)) host.replaceChildren();
    const [measured, fitted, error] = base.y;
    const follows = { sync: "hand", follow: () => charts };
    const line = (label, colour) => ({ label: `${label}, ${outputUnit}`, colour, scale: "y" });
    charts = [
      timePlot(hosts.overlay, { x: base.x, y: [measured, fitted, fitted] }, [line("measured", COLOURS.measured), line("fitted", COLOURS.noise), line("moved", COLOURS.model)], finer, { ...follows, title: `${output}, ${outputUnit}`, name: `moved ${file}` }),
      timePlot(hosts.error, { x: base.x, y: [error, error] }, [line("error, fitted", COLOURS.noise), line("error, moved", COLOURS.residual)], finer, { ...follows, height: 200, title: `error, ${outputUnit}`, name: `error moved ${file}` }),
    ];
    fill();
    say(base.nrmse_percent);
    if (kept) follow(true);
  }
  part.addEventListener("toggle", () => {
    open = part.open;
    if (open && record !== null) begin();
  });
  return {
    part,
    /** A record is looked at. */
    look(index, name) {
      [record, file] = [index, name];
      if (part.open) begin();
    },
  };
}

/** The next page that is drawn has the part open. */
export const openByHand = () => { open = true; };
