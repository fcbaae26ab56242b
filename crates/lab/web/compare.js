// The model beside the measurement: linked views, and what the error in a selection is.
import { ask } from "./api.js";
import { el, table, command, panel, right, tiles } from "./dom.js";
import { count, num, percent, quantity, unit } from "./numbers.js";
import { timePlot, loopPlot, spectrumPlot, COLOURS } from "./plots.js";
import { errorMap } from "./map.js";
import { effectName } from "./effects.js";
import { staleNotice } from "./stale.js";

/** The record that was chosen, by its file; before that the one that tells most. */
let chosen = null;

/** Where to look first: the largest error in percent among the records not fitted to, where one of them moves; else among all. */
export function worst(records) {
  const moving = records.map((record, index) => ({ ...record, index })).filter((record) => record.nrmse_percent !== null);
  const judged = moving.filter((record) => record.role === "validate");
  const most = (judged.length ? judged : moving).reduce((a, b) => (b.nrmse_percent > a.nrmse_percent ? b : a), { index: 0, nrmse_percent: -1 });
  return most.index;
}

const WORDS = {
  offset: "a constant offset", speed: "the speed of the motion", acceleration: "the acceleration", position: "the position",
  curvature: "the square of the position", time: "time",
};

/** The error in a selection, in words. */
function regionText(region, outputUnit) {
  const told = region.goes_with.filter((g) => g.share_percent >= 10);
  const lines = [el("p", {}, `Here the error is ${quantity(region.rms, outputUnit)} rms, ${num(region.noise_ratio)} times the noise floor: ${percent(region.share_percent)} of the record's squared error in ${percent(region.samples_percent)} of its samples. The largest is ${quantity(region.max, outputUnit)}.`)];
  if (region.noise_ratio < 1.2) lines.push(el("p", {}, "That is the noise; there is nothing to explain here."));
  else if (told.length === 0) lines.push(el("p", {}, "It goes with none of offset, position, speed, acceleration or time: look at the spectrum for a tone, or diagnose."));
  else lines.push(el("ul", {}, told.map((g) => el("li", {}, `${percent(g.share_percent)} of it goes with ${WORDS[g.quantity]}: `, ...g.effects.flatMap((name, i) => [i ? ", " : "", el("a", { href: `#effects/${name}` }, effectName(name))]), " could make it."))));
  return lines;
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
/** A finding as a sentence; the name of a file stays as it is. */
const sentence = (text) => `${/^\S+\.\S/.test(text) ? unit(text) : capital(unit(text))}${/[.:]$/.test(text) ? "" : "."}`;

export async function comparePage(lab) {
  const step = lab.state.current;
  const [comparison, words, spectrum] = await Promise.all([ask("compare", { step }), ask("words", { step }), ask("spectrum", { step })]);
  const raw = comparison.output_unit;
  const outputUnit = unit(raw);
  const inverse = raw === "V";
  const before = comparison.records.findIndex((r) => r.file === chosen);
  let shown = before < 0 ? worst(comparison.records) : before;
  const select = el("select", { id: "record", change: () => { shown = Number(select.value); chosen = comparison.records[shown].file; show(); } },
    comparison.records.map((r, index) => el("option", { value: index, selected: index === shown }, `${r.file} (${r.role}, ${percent(r.nrmse_percent)})`)));
  const hosts = { overlay: el("div", { class: "plot", id: "overlay" }), residual: el("div", { class: "plot", id: "residual" }), loop: el("div", { class: "plot", id: "loop" }), spectrum: el("div", { class: "plot" }) };
  const hint = () => el("p", { class: "hint" }, "Drag over the error, or press Enter on it, to ask what it is there and which effects could make it.");
  const selection = el("div", { id: "selection", role: "status" }, hint());
  const pooled = (p) => (p ? `of peak to peak; ${quantity(p.rms_um, raw)} rms, ${p.records} records` : "no such record");
  const rows = comparison.records.map((r) => [r.file, r.role, right(percent(r.nrmse_percent)), right(percent(r.fit_percent)), right(quantity(r.rms_um, raw)), right(quantity(r.max_um, raw)), r.noise_ratio, right(count(r.samples)), r.initial_state]);
  const { error_map: byRate, swing_map: bySwing } = comparison;
  const output = inverse ? "voltage" : "position";
  const page = el("div", {},
    staleNotice(lab),
    el("h2", {}, `Beside the measurement: ${lab.state.steps[step].title}`),
    ...words.headline.map((line, index) => el("p", { class: index ? "" : "lead" }, line)),
    tiles([
      ["Error, records not fitted to", comparison.validate ? percent(comparison.validate.nrmse_percent) : "–", pooled(comparison.validate)],
      ["Error, records fitted to", comparison.identify ? percent(comparison.identify.nrmse_percent) : "–", pooled(comparison.identify)],
      ["Noise floor", quantity(comparison.noise_rms_um, raw), `rms, ${comparison.noise.words}`]]),
    ...comparison.notices.map((line) => el("p", { class: "notice" }, sentence(line))),
    el("p", {}, el("label", { for: "record" }, "Look at "), select,
      el("span", { class: "hint" }, " Wheel zooms, Shift and wheel pans, double click shows all; by keyboard: arrows, plus, minus, 0.")),
    el("div", { class: "wide-narrow" },
      el("section", { class: "panel" }, el("h3", {}, "Measured and modelled"), hosts.overlay, el("h3", {}, "Error: measured minus modelled"), hosts.residual, selection),
      panel("Loop", hosts.loop)),
    el("div", { class: "pair" },
      panel("Error by frequency and amplitude of the swing", errorMap("Error by frequency and amplitude", { name: "frequency", unit: "Hz", edges: bySwing.frequency_edges_hz }, { name: "amplitude", unit: raw, edges: bySwing.amplitude_edges_um }, bySwing.rms_um, raw)),
      panel(`Error by ${output} and rate`, errorMap(`Error by ${output} and rate`, { name: output, unit: raw, edges: byRate.position_edges_um }, { name: "rate", unit: `${raw}/s`, edges: byRate.rate_edges_um_per_s }, byRate.rms_um, raw))),
    el("div", { class: "pair" },
      panel("Spectrum of the error over the noise floor", hosts.spectrum),
      panel("Where the error is", el("ul", { class: "findings" }, comparison.where.map((b) => el("li", {}, sentence(b.finding)))))),
    table("All records", ["Record", "Role", "Error (of p-p)", "Fit", "rms", "Largest", "Times noise", "Samples", "Start"], rows),
    el("p", {}, el("a", { class: "button", href: "#diagnose" }, "Which effect is missing?")),
    command(words.compare_command));

  let charts = [];
  let at = null;
  const points = (range) => ask("series", { step, record: shown, width: 1200, ...range });
  /** The cursor of the views over time, in the loop. */
  const cursor = (index) => {
    if (!charts[2]) return;
    if (index === null || index === undefined || at.input[index] === undefined) charts[2].mark();
    else charts[2].mark(at.input[index], [at.measured[index], at.modelled[index]]);
  };
  async function finer(from, to) {
    const record = shown;
    const more = await points({ from, to });
    if (record !== shown) return;
    at = more.at;
    charts[0].renew(more.points, (y) => y.slice(0, 2));
    charts[1].renew(more.points, (y) => y.slice(2));
    charts[2].renew([more.measured_loop, more.modelled_loop]);
  }
  async function region(from, to) {
    try {
      const found = await ask("region", { step, record: shown, from, to });
      selection.replaceChildren(el("p", {}, el("strong", {}, `${num(from)} to ${num(to)} s`)), ...regionText(found, raw));
    } catch (error) { selection.replaceChildren(el("p", { class: "refused" }, error.message)); }
  }
  async function show() {
    const all = await points({});
    at = all.at;
    for (const host of [hosts.overlay, hosts.residual, hosts.loop]) host.replaceChildren();
    selection.replaceChildren(hint());
    const follow = { sync: "compare", follow: () => charts.slice(0, 2), at: cursor };
    const [measured, modelled, error] = all.points.y;
    charts = [
      timePlot(hosts.overlay, { x: all.points.x, y: [measured, modelled] }, [{ label: `measured, ${outputUnit}`, colour: COLOURS.measured, scale: "y" }, { label: `model, ${outputUnit}`, colour: COLOURS.model, scale: "y" }], finer, { ...follow, title: `${output}, ${outputUnit}` }),
      timePlot(hosts.residual, { x: all.points.x, y: [error] }, [{ label: `error, ${outputUnit}`, colour: COLOURS.residual, scale: "y" }], finer, { ...follow, height: 200, select: region }),
      loopPlot(hosts.loop, [{ label: "measured", colour: COLOURS.measured, path: all.measured_loop }, { label: "model", colour: COLOURS.model, path: all.modelled_loop }], inverse ? "position, µm" : "voltage, V", `${output}, ${outputUnit}`, 480),
    ];
  }
  page.addEventListener("shown", () => { show(); spectrumPlot(hosts.spectrum, spectrum, outputUnit); });
  return page;
}
