// The page of each effect, with a live picture whose parameters can be dragged.
import { ask } from "./api.js";
import { el, table, command, facts, panel } from "./dom.js";
import { between, quantity, text as tidy, unit } from "./numbers.js";
import { ownPart } from "./own.js";
import { loopPlot, timePlot, COLOURS } from "./plots.js";

let catalogue = null;
export async function effects() {
  catalogue = catalogue || await ask("effects");
  return catalogue;
}

/** An effect's name as words. */
export const effectName = (text) => text.replaceAll("-", " ").replace("first order", "first-order");

/** A slider's place for a value: logarithmic where the range spans decades. */
function scale(p) {
  const low = Math.max(p.min, p.max * 1e-3);
  const log = p.min >= 0 && p.max / low >= 100 && p.max > 0;
  return log
    ? { to: (v) => (v <= low ? 0 : Math.log(v / low) / Math.log(p.max / low)), from: (t) => (t <= 0 ? p.min : low * (p.max / low) ** t) }
    : { to: (v) => (v - p.min) / (p.max - p.min || 1), from: (t) => p.min + t * (p.max - p.min) };
}

async function livePicture(lab, effect) {
  const step = lab.state.current;
  const host = el("div", { class: "plot", id: "effect-shown" });
  const sliders = el("div", { class: "sliders" });
  const played = el("p", { class: "hint" });
  const frequency = el("input", { id: "frequency", type: "number", min: "0.001", max: "100000", step: "any", change: () => draw([]) });
  const tone = el("p", { hidden: true }, el("label", { for: "frequency" }, "Frequency, Hz "), frequency);
  const fault = el("p", { class: "refused", role: "status" });
  const anew = el("button", { type: "button", class: "small", click: () => draw([]) }, "Back to where it shows");
  const box = panel("In your model", el("div", { class: "live" }, el("div", {}, played, host), el("div", {}, tone, sliders, anew)), fault);
  let chart = null;
  let turn = 0;
  async function draw(values) {
    const mine = ++turn;
    let found;
    try {
      found = await ask("effect", { step, name: effect.name, ...(frequency.value ? { frequency: frequency.value } : {}), ...(values.length ? { values: values.join(",") } : {}) });
    } catch (error) {
      fault.textContent = error.message;
      anew.hidden = !chart;
      return;
    }
    if (mine !== turn) return;
    fault.textContent = "";
    anew.hidden = false;
    played.textContent = `${found.played}; the position without it and with it.`;
    tone.hidden = found.frequency_hz === null;
    if (found.frequency_hz !== null && !frequency.value) frequency.value = found.frequency_hz;
    const curves = [{ label: "without it", colour: COLOURS.measured }, { label: "with it", colour: COLOURS.model }];
    if (found.loops) {
      if (chart) chart.renew(found.loops);
      else chart = loopPlot(host, curves.map((curve, index) => ({ ...curve, path: found.loops[index] })), "voltage, V", "position, µm", 360, `${effect.name} loop`);
    } else if (chart) chart.renew(found.points);
    else chart = timePlot(host, found.points, curves.map((curve) => ({ ...curve, label: `${curve.label}, µm`, scale: "y" })), () => null, { title: "position, µm", height: 340, name: `${effect.name} over time` });
    if (!values.length) sliders.replaceChildren(...found.parameters.map((p, index) => slider(p, index, found.parameters, draw)));
  }
  box.addEventListener("shown", () => draw([]));
  return box;
}

/** A parameter that is dragged; `draw` gets the values of all. */
export function slider(p, index, all, draw, prefix = "parameter") {
  const by = scale(p);
  const id = `${prefix}-${index}`;
  const shown = el("output", { for: id }, quantity(p.value, p.unit));
  const input = el("input", { id, type: "range", min: "0", max: "1", step: "0.001", value: by.to(p.value), disabled: p.min === p.max, "aria-valuetext": shown.textContent, input: () => {
    p.value = by.from(Number(input.value));
    shown.textContent = quantity(p.value, p.unit);
    input.setAttribute("aria-valuetext", shown.textContent);
    draw(all.map((one) => one.value));
  } });
  return el("div", { class: "slider" }, el("label", { for: id }, p.label || p.name.replaceAll("_", " ")), shown, input, el("span", { class: "hint" }, `${tidy(p.what)} (${p.min === p.max ? "fixed" : between(p.min, p.max, p.unit)})`));
}

/** The page of each effect, and of one's own. */
export async function effectPage(lab) {
  const known = await effects();
  const wanted = location.hash.split("/")[1] || known[0].name;
  const effect = known.find((k) => k.name === wanted) || known[0];
  const own = wanted === "own";
  const text = own ? await ownPart(lab) : await cataloguePart(lab, effect);
  const link = (name, title, here) => el("li", {}, el("a", { href: `#effects/${name}`, "aria-current": here ? "page" : null }, title));
  const page = el("div", { class: "effects" },
    el("nav", { "aria-label": "Effects" }, el("ul", {}, link("own", "one of your own", own), known.map((k) => link(k.name, effectName(k.name), !own && k === effect)))), text);
  page.addEventListener("shown", () => text.dispatchEvent(new CustomEvent("shown")));
  return page;
}

async function cataloguePart(lab, effect) {
  const name = effectName(effect.name);
  const text = el("div", { class: "effect" },
    el("h2", {}, name.charAt(0).toUpperCase() + name.slice(1)), el("p", { class: "lead" }, tidy(effect.summary)), el("p", {}, el("code", { class: "equation" }, tidy(effect.equation))));
  if (lab.state.current === null) text.append(el("p", { class: "notice" }, "Fit a model to see the effect in it, with the parameters to drag."));
  else {
    const live = await livePicture(lab, effect);
    text.append(live, el("p", {}, el("button", { type: "button", id: `add-${effect.name}`, disabled: lab.state.job.running, click: () => lab.act({ what: "add", effect: effect.name }, "ladder") }, `Add ${name} to the model`)));
    text.addEventListener("shown", () => live.dispatchEvent(new CustomEvent("shown")));
  }
  text.append(
    facts([["Place in the chain", effect.place], ["How it shows", effect.shows], ["Mistaken for", effect.mistaken_for], ["Separated by", effect.separated_by], ["Compensated by", effect.compensated_by], ["Source", effect.source]].map(([k, v]) => [k, tidy(v)])),
    effect.parameters.length ? table("Parameters", ["Parameter", "Unit", "What it is"], effect.parameters.map((p) => [p.name.replaceAll("_", " "), unit(p.unit) || "–", tidy(p.what)])) : "",
    command(`hysteron explain ${effect.name}`));
  return text;
}
