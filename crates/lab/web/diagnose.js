// Which effect is missing: candidates as cards; and the page of each effect with a parameter to drag.
import { ask, download } from "./api.js";
import { el, table, command, percent, num, panel, unit } from "./dom.js";
import { loopPlot, COLOURS } from "./plots.js";

let catalogue = null;
export async function effects() {
  catalogue = catalogue || await ask("effects");
  return catalogue;
}

const name = (text) => text.replaceAll("-", " ").replace("first order", "first-order");

function card(lab, effect, words, rank) {
  const rows = effect.parameters.map((p) => [p.name.replaceAll("_", " "), p.value, unit(p.unit)]);
  const has = lab.state.steps[lab.state.current] && words;
  return el("article", { class: effect.significant ? "card counts" : "card", id: `card-${effect.effect}` },
    el("h3", {}, `${rank}. ${name(effect.effect)}`),
    el("p", {}, effect.significant ? "Significant, and large enough to matter." : "Does not count: it fails a test, or another explains the same better."),
    el("dl", { class: "facts" },
      ...[["Takes of the squared error", percent(100 * effect.share)], ["Error with it, records not fitted to", percent(effect.validate_percent)], ["Error with it, records fitted to", percent(effect.identify_percent)],
        ["Statistic", `${num(effect.statistic)}, must exceed ${num(effect.threshold)}`], ["Independent samples", num(effect.effective_samples)], ["Kind", effect.level === "physical" ? "physical" : "a matter of the loops' shape"]]
        .map(([k, v]) => el("div", {}, el("dt", {}, k), el("dd", {}, v)))),
    rows.length ? table(`Parameters of ${name(effect.effect)}`, ["Parameter", "Value", "Unit"], rows) : null,
    words ? el("details", {}, el("summary", {}, `What ${name(effect.effect)} is`),
      el("p", {}, words.summary), el("p", {}, el("code", {}, words.equation)), el("p", {}, `How it shows: ${words.shows}`), el("p", {}, `Mistaken for: ${words.mistaken_for}`), el("p", {}, `Separated by: ${words.separated_by}`), el("p", {}, `Compensated by: ${words.compensated_by}`)) : null,
    el("p", {}, has ? el("button", { type: "button", id: `add-${effect.effect}`, disabled: lab.state.job.running, click: () => lab.act({ what: "add", effect: effect.effect }, "ladder") }, `Add ${name(effect.effect)}`) : null,
      " ", words ? el("a", { href: `#effects/${effect.effect}` }, "See it in your loops") : null));
}

export async function diagnosePage(lab) {
  const step = lab.state.current;
  const [known, words] = await Promise.all([effects(), ask("words", { step })]);
  const page = el("div", {}, el("h2", {}, `Which effect is missing from ${lab.state.steps[step].title}?`));
  const run = (title) => el("button", { type: "button", class: "main", id: "diagnose", disabled: lab.state.job.running, click: () => lab.act({ what: "diagnose" }) }, title);
  if (!lab.state.diagnosed[step]) {
    page.append(el("p", {}, "Every effect of the catalogue is fitted in its place, together with everything else, and judged on records it was not fitted to. It takes some seconds and can be stopped."), run("Diagnose"), command(words.diagnose_command));
    return page;
  }
  const { numbers, verdict, lines } = await ask("diagnosis", { step });
  page.append(
    el("p", { class: "lead", id: "verdict" }, verdict),
    ...lines.map((line) => el("p", { class: "notice" }, line)),
    el("p", {}, "The verdict is not calibrated yet: take it as a hint."),
    numbers.next_record ? el("p", {}, el("a", { class: "button", href: download("next", step), download: true, id: "next-record" }, "Download the record to take next")) : "",
    el("dl", { class: "tiles" }, ...[["The model", numbers.before.validate_percent], ["A hysteresis of free shape instead", numbers.free_shape.validate_percent], ["Left unexplained", numbers.unexplained.percent], ["Of this, noise", numbers.unexplained.noise_percent]]
      .map(([label, value]) => el("div", {}, el("dt", {}, label), el("dd", { class: "value" }, percent(value)), el("dd", { class: "note" }, "of peak to peak")))),
    command(words.diagnose_command),
    el("div", { class: "cards" }, numbers.ranking.map((effect, index) => card(lab, effect, known.find((k) => k.name === effect.effect), index + 1))),
    run("Diagnose again"));
  return page;
}

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
  const host = el("div", { class: "plot" });
  const sliders = el("div", { class: "sliders" });
  const frequency = el("input", { id: "frequency", type: "number", min: "0.001", max: "100000", step: "any", value: "100", change: () => draw([], true) });
  const fault = el("p", { class: "refused", role: "status" });
  const box = panel("In your model's own loop", host, el("p", {}, el("label", { for: "frequency" }, "Triangle of "), frequency, " Hz"), sliders, fault);
  let chart = null;
  let turn = 0;
  async function draw(values, anew) {
    const mine = ++turn;
    let found;
    try {
      found = await ask("effect", { step, name: effect.name, frequency: frequency.value, ...(values.length ? { values: values.join(",") } : {}) });
    } catch (error) { fault.textContent = error.message; return; }
    if (mine !== turn) return;
    fault.textContent = "";
    const paths = [{ x: found.voltage_v, y: found.without }, { x: found.voltage_v, y: found.with }];
    if (chart) chart.renew(paths);
    else chart = loopPlot(host, [{ label: "without it", colour: COLOURS.measured, path: paths[0] }, { label: "with it", colour: COLOURS.model, path: paths[1] }], "voltage, V", "position, µm", 340);
    if (anew) sliders.replaceChildren(...found.parameters.map((p, index) => slider(p, index, found.parameters, draw)));
  }
  box.addEventListener("shown", () => draw([], true));
  return box;
}

function slider(p, index, all, draw) {
  const by = scale(p);
  const id = `parameter-${index}`;
  const shown = el("output", { for: id }, `${num(p.value)} ${unit(p.unit)}`);
  const input = el("input", { id, type: "range", min: "0", max: "1", step: "0.001", value: by.to(p.value), disabled: p.min === p.max, "aria-valuetext": shown.textContent, input: () => {
    p.value = by.from(Number(input.value));
    shown.textContent = `${num(p.value)} ${unit(p.unit)}`;
    input.setAttribute("aria-valuetext", shown.textContent);
    draw(all.map((one) => one.value), false);
  } });
  return el("p", {}, el("label", { for: id }, `${p.name.replaceAll("_", " ")} (${num(p.min)} to ${num(p.max)} ${unit(p.unit)}): `), shown, el("br"), input, el("br"), el("span", { class: "hint" }, p.what));
}

/** The page of each effect. */
export async function effectPage(lab) {
  const known = await effects();
  const wanted = location.hash.split("/")[1] || known[0].name;
  const effect = known.find((k) => k.name === wanted) || known[0];
  const facts = [["Place in the chain", effect.place], ["How it shows", effect.shows], ["Mistaken for", effect.mistaken_for], ["Separated by", effect.separated_by], ["Compensated by", effect.compensated_by], ["Source", effect.source]];
  const text = el("div", {},
    el("h2", {}, name(effect.name)), el("p", { class: "lead" }, effect.summary), el("p", {}, el("code", {}, effect.equation)),
    el("dl", { class: "facts" }, facts.map(([k, v]) => el("div", {}, el("dt", {}, k), el("dd", {}, v)))),
    effect.parameters.length ? table("Parameters", ["Parameter", "Unit", "What it is"], effect.parameters.map((p) => [p.name.replaceAll("_", " "), unit(p.unit), p.what])) : "",
    command(`hysteron explain ${effect.name}`));
  const page = el("div", {},
    el("nav", { "aria-label": "Effects", class: "effects" }, el("ul", {}, known.map((k) => el("li", {}, el("a", { href: `#effects/${k.name}`, "aria-current": k === effect ? "page" : null }, name(k.name)))))), text);
  if (lab.state.current === null) text.append(el("p", { class: "notice" }, "Fit a model to see the effect in its loops, with the parameters to drag."));
  else {
    const live = await livePicture(lab, effect);
    text.append(live, el("p", {}, el("button", { type: "button", id: `add-${effect.name}`, disabled: lab.state.job.running, click: () => lab.act({ what: "add", effect: effect.name }, "ladder") }, `Add ${name(effect.name)} to the model`)));
    page.addEventListener("shown", () => live.dispatchEvent(new CustomEvent("shown")));
  }
  return page;
}
