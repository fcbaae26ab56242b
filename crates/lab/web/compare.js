// The model beside the measurement: linked views, and what the error in a selection is.
import { ask } from "./api.js";
import { el, table, command, percent, num, panel, unit } from "./dom.js";
import { timePlot, loopPlot, spectrumPlot, COLOURS } from "./plots.js";
import { errorMap } from "./map.js";

let chosen = 0;

const WORDS = {
  offset: "a constant offset", speed: "the speed of the motion", acceleration: "the acceleration", position: "the position",
  curvature: "the square of the position", time: "time",
};

/** The error in a selection, in words. */
function regionText(region, outputUnit) {
  const told = region.goes_with.filter((g) => g.share_percent >= 10);
  const lines = [el("p", {}, `Here the error is ${num(region.rms)} ${outputUnit} rms, ${num(region.noise_ratio)} times the noise floor: ${num(region.share_percent)} % of the record's squared error in ${num(region.samples_percent)} % of its samples.`)];
  if (region.noise_ratio < 1.2) lines.push(el("p", {}, "That is the noise; there is nothing to explain here."));
  else if (told.length === 0) lines.push(el("p", {}, "It goes with none of offset, position, speed, acceleration or time: look at the spectrum for a tone, or diagnose."));
  else lines.push(el("ul", {}, told.map((g) => el("li", {}, `${num(g.share_percent, 2)} % of it goes with ${WORDS[g.quantity]}: `, ...g.effects.flatMap((name, i) => [i ? ", " : "", el("a", { href: `#effects/${name}` }, name)]), " could make it."))));
  return lines;
}

export async function comparePage(lab) {
  const step = lab.state.current;
  const [comparison, words, spectrum] = await Promise.all([ask("compare", { step }), ask("words", { step }), ask("spectrum", { step })]);
  const outputUnit = unit(comparison.output_unit);
  chosen = Math.min(chosen, comparison.records.length - 1);
  const select = el("select", { id: "record", change: () => { chosen = Number(select.value); show(); } },
    comparison.records.map((r, index) => el("option", { value: index, selected: index === chosen }, `${r.file} (${r.role}, ${percent(r.nrmse_percent)})`)));
  const hosts = { overlay: el("div", { class: "plot", id: "overlay" }), residual: el("div", { class: "plot", id: "residual" }), loop: el("div", { class: "plot" }), spectrum: el("div", { class: "plot" }) };
  const selection = el("div", { id: "selection", role: "status" }, el("p", {}, "Drag over the error to ask what it is there."));
  const tile = (label, value, note) => el("div", {}, el("dt", {}, label), el("dd", { class: "value" }, value), el("dd", { class: "note" }, note));
  const pooled = (p) => (p ? `of peak to peak; ${num(p.rms_um)} ${outputUnit} rms, ${p.records} records` : "no such record");
  const rows = comparison.records.map((r) => [r.file, r.role, r.nrmse_percent, r.fit_percent, r.rms_um, r.max_um, r.noise_ratio, r.samples]);
  const page = el("div", {},
    el("h2", {}, `Beside the measurement: ${lab.state.steps[step].title}`),
    ...words.headline.map((line, index) => el("p", { class: index ? "" : "lead" }, line)),
    el("dl", { class: "tiles" },
      tile("Error, records not fitted to", comparison.validate ? percent(comparison.validate.nrmse_percent) : "–", pooled(comparison.validate)),
      tile("Error, records fitted to", comparison.identify ? percent(comparison.identify.nrmse_percent) : "–", pooled(comparison.identify)),
      tile("Noise floor", `${num(comparison.noise_rms_um)} ${outputUnit}`, `rms, ${comparison.noise_source}`)),
    ...comparison.notices.map((line) => el("p", { class: "notice" }, line)),
    el("p", {}, el("label", { for: "record" }, "Record "), select,
      el("span", { class: "hint" }, " Wheel zooms, Shift and wheel pans, double click shows all; by keyboard: arrows, plus, minus, 0.")),
    el("div", { class: "wide-narrow" },
      el("div", {}, panel("Measured and modelled", hosts.overlay), panel("Error: measured minus modelled", hosts.residual), selection),
      el("div", {}, panel("Loop", hosts.loop))),
    el("div", { class: "pair" },
      panel("Error by position and rate", errorMap(comparison.error_map, outputUnit)),
      panel("Spectrum of the error over the noise floor", hosts.spectrum)),
    panel("Where the error is", el("ul", {}, comparison.where.map((b) => el("li", {}, `By ${b.by}: ${unit(b.finding)}`)))),
    table("All records", ["Record", "Role", "Error, % p-p", "Fit, %", `rms, ${outputUnit}`, `Largest, ${outputUnit}`, "Over noise", "Samples"], rows),
    command(words.compare_command),
    el("p", {}, el("a", { class: "button", href: "#diagnose" }, "Which effect is missing?")));

  let charts = [];
  const points = (range) => ask("series", { step, record: chosen, width: 1200, ...range });
  async function finer(from, to) {
    const record = chosen;
    const more = await points({ from, to });
    if (record !== chosen) return;
    charts[0].renew(more.points, (y) => y.slice(0, 2));
    charts[1].renew(more.points, (y) => y.slice(2));
    charts[2].renew([more.measured_loop, more.modelled_loop]);
  }
  async function region(from, to) {
    try {
      const found = await ask("region", { step, record: chosen, from, to });
      selection.replaceChildren(el("p", {}, el("strong", {}, `${num(from, 4)} to ${num(to, 4)} s`)), ...regionText(found, outputUnit));
    } catch (error) { selection.replaceChildren(el("p", { class: "refused" }, error.message)); }
  }
  async function show() {
    const all = await points({});
    for (const host of [hosts.overlay, hosts.residual, hosts.loop]) host.replaceChildren();
    const follow = { sync: "compare", follow: () => charts.slice(0, 2) };
    const [measured, modelled, error] = all.points.y;
    charts = [
      timePlot(hosts.overlay, { x: all.points.x, y: [measured, modelled] }, [{ label: `measured, ${outputUnit}`, colour: COLOURS.measured, scale: "y" }, { label: `model, ${outputUnit}`, colour: COLOURS.model, scale: "y" }], finer, follow),
      timePlot(hosts.residual, { x: all.points.x, y: [error] }, [{ label: `error, ${outputUnit}`, colour: COLOURS.residual, scale: "y" }], finer, { ...follow, height: 190, select: region }),
      loopPlot(hosts.loop, [{ label: "measured", colour: COLOURS.measured, path: all.measured_loop }, { label: "model", colour: COLOURS.model, path: all.modelled_loop }], "input", outputUnit, 380),
    ];
  }
  page.addEventListener("shown", () => { show(); spectrumPlot(hosts.spectrum, spectrum, outputUnit); });
  return page;
}
