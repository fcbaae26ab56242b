// The model beside the measurement: linked views, and what the error in a selection is.
import { ask } from "./api.js";
import { el, table, command, panel, right, tiles } from "./dom.js";
import { count, num, percent, quantity, unit } from "./numbers.js";
import { timePlot, loopPlot, spectrumPlot, correlationPlot, COLOURS } from "./plots.js";
import { errorMap } from "./map.js";
import { effectName } from "./effects.js";
import { byHand, openByHand } from "./hand.js";
import { smallPictures } from "./small.js";
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

/** The steps that are drawn beside the one looked at, by their numbers, in the order they were chosen. */
let beside = [];

/** What the correlations say, each in a sentence. */
function correlationText({ own, with_drive: withDrive, memory_s: memory, longest }) {
  const { times, lag_s: lag } = withDrive.largest;
  return [
    memory === 0 ? "The error remembers nothing of itself from one sample to the next: it is white." : `The error remembers itself for ${longest ? "more than " : ""}${quantity(memory, "s")}; behind, the band is that of an error with this memory. Noise of a colour of its own does so as well.`,
    times > 1 ? `Look here: the error goes with the drive, most at a lag of ${quantity(lag, "s")}, by ${num(times)} times what chance allows. A model could have that.` : "Pass: the error goes with the drive at no lag by more than chance allows, its own colour reckoned with.",
    own.lag_s.length ? `Lags up to ${quantity(own.lag_s.at(-1), "s")}. An error that is noise stays within the band at all lags in 95 of 100 records.` : "",
  ];
}

export async function comparePage(lab) {
  const step = lab.state.current;
  const [comparison, words] = await Promise.all([ask("compare", { step }), ask("words", { step })]);
  const raw = comparison.output_unit;
  const outputUnit = unit(raw);
  const inverse = raw === "V";
  const before = comparison.records.findIndex((r) => r.file === chosen);
  let shown = before < 0 ? worst(comparison.records) : before;
  const select = el("select", { id: "record", change: () => look(Number(select.value)) },
    comparison.records.map((r, index) => el("option", { value: index, selected: index === shown }, `${r.file} (${r.role}, ${percent(r.nrmse_percent)})`)));
  /** Shows a record; the strip and the choice follow. */
  const look = (index) => {
    shown = index;
    chosen = comparison.records[shown].file;
    select.value = String(shown);
    strip.mark(shown);
    return show();
  };
  const strip = smallPictures({ step }, "All records, what was measured and the error before it", (index) => { const r = comparison.records[index]; return `${percent(r.nrmse_percent)} ${r.file}`; }, () => shown, look);
  /** The stretch of a record, as near as can be seen. */
  async function open({ file, from_s: from, to_s: to }) {
    await look(comparison.records.findIndex((r) => r.file === file));
    const room = Math.max(2 * (to - from), 20 * (charts[0].data[0][1] - charts[0].data[0][0]));
    charts[0].setView(from - room, to + room);
    region(from, to);
    hosts.overlay.scrollIntoView({ block: "center" });
  }
  const host = (id) => el("div", { class: "plot", id });
  const hosts = { overlay: host("overlay"), residual: host("residual"), loop: host("loop"), spectrum: host("spectrum"), own: host("own"), drive: host("with-drive") };
  const pooledSpectrum = el("select", { id: "spectrum-of", change: () => drawSpectrum() }, el("option", { value: "one" }, "the record that is looked at"), el("option", { value: "all" }, "all records that move, pooled"));
  const correlated = el("div", { id: "correlated" });
  const { steps } = lab.state;
  const others = steps.map((_, k) => k).filter((k) => k !== step && !steps[k].removed);
  beside = beside.filter((k) => others.includes(k));
  const choice = others.length ? el("fieldset", { class: "beside", id: "beside" }, el("legend", {}, "Steps beside it"), others.map((k) => el("label", {}, el("input", { type: "checkbox", id: `beside-${k}`, checked: beside.includes(k), disabled: !beside.includes(k) && beside.length >= COLOURS.others.length, change: (event) => {
    beside = event.target.checked ? [...beside, k] : beside.filter((one) => one !== k);
    for (const input of choice.querySelectorAll("input")) input.disabled = !input.checked && beside.length >= COLOURS.others.length;
    show();
  } }), ` ${k + 1}: ${steps[k].title}`))) : null;
  const hint = () => el("p", { class: "hint" }, "Drag over the error, or press Enter on it, to ask what it is there and which effects could make it.");
  const selection = el("div", { id: "selection", role: "status" }, hint());
  const pooled = (p) => (p ? `of peak to peak; ${quantity(p.rms_um, raw)} rms, ${p.records} records` : "no such record");
  const rows = comparison.records.map((r) => [r.file, r.role, right(percent(r.nrmse_percent)), right(percent(r.fit_percent)), right(quantity(r.rms_um, raw)), right(quantity(r.max_um, raw)), r.noise_ratio, right(count(r.samples)), r.initial_state]);
  if (location.hash.endsWith("/by-hand")) openByHand();
  const hand = byHand(lab, inverse ? "voltage" : "position", outputUnit);
  const { error_map: byRate, swing_map: bySwing } = comparison;
  const output = inverse ? "voltage" : "position";
  const page = el("div", { class: "full" },
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
    strip,
    el("div", { class: "wide-narrow" },
      el("section", { class: "panel" }, el("h3", {}, "Measured and modelled"), choice, hosts.overlay, el("h3", {}, "Error: measured minus modelled"), hosts.residual, selection),
      panel("Loop", hosts.loop)),
    hand.part,
    el("div", { class: "pair" },
      panel("Error by frequency and amplitude of the swing", errorMap("Error by frequency and amplitude", { name: "frequency", unit: "Hz", edges: bySwing.frequency_edges_hz }, { name: "amplitude", unit: raw, edges: bySwing.amplitude_edges_um }, bySwing.rms_um, raw, bySwing.worst, open)),
      panel(`Error by ${output} and rate`, errorMap(`Error by ${output} and rate`, { name: output, unit: raw, edges: byRate.position_edges_um }, { name: "rate", unit: `${raw}/s`, edges: byRate.rate_edges_um_per_s }, byRate.rms_um, raw, byRate.worst, open))),
    el("div", { class: "pair" },
      el("section", { class: "panel" }, el("h3", {}, "The error and itself"), hosts.own),
      el("section", { class: "panel" }, el("h3", {}, "The error and the drive"), hosts.drive)),
    correlated,
    el("div", { class: "pair" },
      panel("Spectrum of the error over the noise floor", el("p", {}, el("label", { for: "spectrum-of" }, "Of\u00a0"), pooledSpectrum), hosts.spectrum),
      panel("Where the error is", el("ul", { class: "findings" }, comparison.where.map((b) => el("li", {}, sentence(b.finding)))))),
    table("All records", ["Record", "Role", "Error (of p-p)", "Fit", "rms", "Largest", "Times noise", "Samples", "Start"], rows),
    el("p", {}, el("a", { class: "button", href: "#diagnose" }, "Which effect is missing?")),
    command(words.compare_command));

  let charts = [];
  let at = null;
  /** A record of another step by its file; nothing where that step has none of it. */
  const placeIn = (k) => steps[k].records.findIndex(([file]) => file === comparison.records[shown].file);
  /** What is drawn: this step, then those beside it. */
  async function points(range) {
    const [main, ...more] = await Promise.all([[step, shown], ...beside.map((k) => [k, placeIn(k)])].map(([k, record]) => (record < 0 ? null : ask("series", { step: k, record, width: 1200, ...range }))));
    const there = more.map((one) => one && one.points.x.length === main.points.x.length && one.points);
    return { ...main, y: [main.points.y[0], main.points.y[1], ...there.map((p) => (p ? p.y[1] : main.points.x.map(() => null))), main.points.y[2], ...there.map((p) => (p ? p.y[2] : main.points.x.map(() => null)))] };
  }
  /** The cursor of the views over time, in the loop. */
  const cursor = (index) => {
    if (!charts[2]) return;
    if (index === null || index === undefined || at.input[index] === undefined) charts[2].mark();
    else charts[2].mark(at.input[index], [at.measured[index], at.modelled[index]]);
  };
  let turn = 0;
  async function finer(from, to) {
    const mine = turn;
    const count = 2 + beside.length;
    const more = await points({ from, to });
    if (mine !== turn) return;
    at = more.at;
    charts[0].renew({ x: more.points.x, y: more.y }, (y) => y.slice(0, count));
    charts[1].renew({ x: more.points.x, y: more.y }, (y) => y.slice(count));
    charts[2].renew([more.measured_loop, more.modelled_loop]);
  }
  async function region(from, to) {
    try {
      const found = await ask("region", { step, record: shown, from, to });
      selection.replaceChildren(el("p", {}, el("strong", {}, `${num(from)} to ${num(to)} s`)), ...regionText(found, raw));
    } catch (error) { selection.replaceChildren(el("p", { class: "refused" }, error.message)); }
  }
  /** Of the record that is looked at, or of all. */
  async function drawSpectrum() {
    const one = pooledSpectrum.value === "one";
    const mine = turn;
    const spectrum = await ask("spectrum", { step, ...(one ? { record: shown } : {}) });
    if (mine !== turn) return;
    hosts.spectrum.replaceChildren();
    if (spectrum.frequency_hz.length) spectrumPlot(hosts.spectrum, spectrum, outputUnit, 300, one ? `spectrum ${comparison.records[shown].file}` : "spectrum");
    else hosts.spectrum.append(el("p", { class: "hint" }, "This record has none: it stands still, or has fewer than 64 samples."));
  }
  async function show() {
    const mine = ++turn;
    drawSpectrum();
    const [all, correlation] = await Promise.all([points({}), ask("correlation", { step, record: shown })]);
    if (mine !== turn) return;
    at = all.at;
    for (const one of [hosts.overlay, hosts.residual, hosts.loop, hosts.own, hosts.drive]) one.replaceChildren();
    selection.replaceChildren(hint());
    hand.look(shown, comparison.records[shown].file);
    const { file } = comparison.records[shown];
    const follow = { sync: "compare", follow: () => charts.slice(0, 2), at: cursor };
    const count = 2 + beside.length;
    const further = (what) => beside.map((k, index) => ({ label: `${what} ${k + 1}, ${outputUnit}`, colour: COLOURS.others[index], scale: "y" }));
    const band = { half: 2 * comparison.noise_rms_um, label: "noise, ±2 rms" };
    charts = [
      timePlot(hosts.overlay, { x: all.points.x, y: all.y.slice(0, count) }, [{ label: `measured, ${outputUnit}`, colour: COLOURS.measured, scale: "y" }, { label: `model, ${outputUnit}`, colour: COLOURS.model, scale: "y" }, ...further("step")], finer, { ...follow, title: `${output}, ${outputUnit}`, name: `model ${file}` }),
      timePlot(hosts.residual, { x: all.points.x, y: all.y.slice(count) }, [{ label: `error, ${outputUnit}`, colour: COLOURS.residual, scale: "y" }, ...further("error of step")], finer, { ...follow, height: 200, select: region, band, name: `error ${file}` }),
      loopPlot(hosts.loop, [{ label: "measured", colour: COLOURS.measured, path: all.measured_loop }, { label: "model", colour: COLOURS.model, path: all.modelled_loop }], inverse ? "position, µm" : "voltage, V", `${output}, ${outputUnit}`, 480, `loop ${file}`),
    ];
    if (!correlation) {
      correlated.replaceChildren(el("p", { class: "hint" }, "Of this record there is no correlation: it has fewer than 100 samples, or error or drive stand still."));
      return;
    }
    correlated.replaceChildren(...correlationText(correlation).map((line) => el("p", {}, line)));
    correlationPlot(hosts.own, correlation.own, "error with itself", { name: `error with itself ${file}` });
    correlationPlot(hosts.drive, correlation.with_drive, "error with the drive", { name: `error with drive ${file}` });
  }
  page.addEventListener("shown", () => { if (location.hash.endsWith("/by-hand")) hand.part.scrollIntoView(); strip.dispatchEvent(new CustomEvent("fill")); show(); });
  return page;
}
