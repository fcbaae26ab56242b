// The controller of a step or of the campaign: designed by one button, run, taken home as it is and as the firmware's table.
import { ask, download } from "./api.js";
import { el, command, panel, printed, right, table } from "./dom.js";
import { form } from "./form.js";
import { num, text } from "./numbers.js";
import { COLOURS, curvesPlot, dotsPlot } from "./plots.js";
import { campaignPart, done } from "./campaign.js";
import { staleNotice } from "./stale.js";

const BEYOND = { name: "beyond_records", title: "Leave what the records cover (--beyond-records)", tick: true };

function designForm(lab, of, usual, made) {
  const [low, high] = usual.volts;
  // A campaign is recorded at the controller's own rate.
  const rate = { name: "rate_hz", title: "Rate, Hz (--rate-hz)", otherwise: usual.rate_hz === null ? "not in the records" : `${num(usual.rate_hz)}, of the records` };
  return form(lab, "design", [
    ["When the reference is known", [{ name: "reference", title: "Reference (--reference)", choices: [["previewed", "16 samples before it is due"], ["live", "not before it is due"]] }]],
    ["Commands", [{ name: "volts_min", title: "Lowest voltage, V (--volts)", otherwise: `${num(low)}, of the records` }, { name: "volts_max", title: "Highest voltage, V (--volts)", otherwise: `${num(high)}, of the records` },
      ...(of === "campaign" ? [] : [rate])]],
    ["Feedback", [{ name: "margin", title: "Largest peak of the sensitivity (--margin)", otherwise: num(usual.margin) }, { name: "rigid_hz", title: "No other mode below, Hz (--rigid)", otherwise: "as the records tell" },
      { name: "adapt_percent", title: "Gain learned while it runs, % (--adapt)", otherwise: "not learned" },
      { name: "open", title: "Without feedback (--open)", tick: true }, BEYOND]],
  ], made ? "Design again" : "Design the controller", (wishes) => lab.act({ what: "design", wishes, of }));
}

const SHINES = { pass: ["✓", "pass"], look: ["!", "look here"], "cannot-tell": ["?", "cannot tell"] };

/** What a design says of itself at a glance, each with its reason: what asks for a look first. */
function lightsOf(lights) {
  const order = ["look", "cannot-tell", "pass"];
  const sorted = [...lights].sort((a, b) => order.indexOf(a.shine) - order.indexOf(b.shine));
  return el("ul", { class: "lights", id: "lights" }, sorted.map(({ shine, about, why }) => {
    const [sign, words] = SHINES[shine];
    return el("li", { class: shine }, el("span", { class: "shine" }, el("span", { "aria-hidden": "true" }, sign), ` ${words}`), el("span", {}, el("strong", {}, about.charAt(0).toUpperCase() + about.slice(1)), ": ", text(why)));
  }));
}

/** What the stage answers to small signals, beside the model's linear part: how far a loop may trust it. */
function stagePart(page, found) {
  if (!found) {
    page.append(panel("The stage's answer to small signals", el("p", { id: "no-response" }, "No record of small signals: what the stage does with them is not known, and neither is up to where a loop may go. A multisine or noise of a few percent about the middle tells.")));
    return;
  }
  const [gain, phase] = ["gain", "phase"].map((what) => el("div", { class: "plot", id: `stage-${what}` }));
  const told = found.told_to_hz === null ? "nowhere over an octave does the model do what the stage does" : `the model does what the stage does up to ${num(found.told_to_hz)} Hz`;
  page.append(el("section", { class: "panel" }, el("h3", {}, "The stage's answer to small signals"),
    el("p", { class: "hint", id: "response-said" }, `Measured in ${found.record}, with the band that holds 95 of 100 such measurements; ${told}. The model is its linear part (delay, lag, modes) at the measured gain, ${num(found.of_mean)} of the mean one of the whole range: small loops are flatter.`),
    el("div", { class: "pair" }, el("div", {}, el("h4", {}, "Gain"), gain), el("div", {}, el("h4", {}, "Phase"), phase))));
  page.addEventListener("shown", () => {
    const x = found.frequency_hz;
    // 1.96 standard deviations; on a logarithmic axis no edge lies at zero.
    const edge = (sign) => found.gain.map((g, k) => g * Math.max(0.02, 1 + sign * 1.96 * found.deviation[k]));
    const turn = (sign) => found.phase_deg.map((p, k) => p + sign * Math.min(180, 1.96 * found.deviation[k] * 180 / Math.PI));
    const band = (upper, lower) => ({ label: "95 of 100", colour: COLOURS.measured, upper, lower });
    const mark = found.told_to_hz === null ? null : { x: found.told_to_hz, label: "told up to here" };
    const both = (measured, modelled) => [["measured", COLOURS.measured, measured], ["model", COLOURS.model, modelled]];
    curvesPlot(gain, x, both(found.gain, found.modelled_gain), "µm/V", { log: true, height: 260, band: band(edge(1), edge(-1)), mark, name: "stage gain" });
    curvesPlot(phase, x, both(found.phase_deg, found.modelled_phase_deg), "phase, °", { height: 260, band: band(turn(1), turn(-1)), mark, name: "stage phase" });
  });
}

/** How far the loop stays from swinging, by the model and by what the stage answered. */
function marginsOf({ curves, measured }) {
  const at = (found, words) => right(found === null ? "not that far" : `${words(found[0])} at ${num(found[1])} Hz`);
  const row = (title, part, words) => [title, at(curves.margins[part], words), ...(measured ? [at(measured.margins[part], words)] : [])];
  return el("div", { id: "margins" }, table("Margins", ["Margin", "By the model", ...(measured ? [`As measured, ${num(measured.frequency_hz[0])} to ${num(measured.frequency_hz.at(-1))} Hz`] : [])], [
    row("Phase, where the gain crosses 1", "phase_deg", (v) => `${num(v)}°`),
    row("Gain, where the phase crosses −180°", "gain_db", (v) => `${num(v)} dB`),
    row("Largest sensitivity", "sensitivity", num)]),
  measured ? null : el("p", { class: "hint" }, "No record of small signals with known lines: the margins are those of the model alone."));
}

/** Values over other frequencies, as far as these lie between them: straight over the logarithms of the frequencies. */
function resampled(from, values, to, log) {
  const [f, g] = log ? [Math.log, Math.exp] : [(v) => v, (v) => v];
  let k = 0;
  return to.map((x) => {
    while (k + 2 < from.length && from[k + 1] < x) k += 1;
    if (x < from[k] || x > from[k + 1]) return null;
    const share = Math.log(x / from[k]) / Math.log(from[k + 1] / from[k]);
    return g(f(values[k]) + share * (f(values[k + 1]) - f(values[k])));
  });
}

/** Gain and phase around the loop, and what it leaves of a disturbance. */
function loopPart(page, view) {
  const { curves, measured } = view;
  if (!curves) return;
  const hosts = [0, 1, 2].map((k) => el("div", { class: "plot", id: `loop-${["sensitivity", "gain", "phase"][k]}` }));
  const [sensitivity, gain, phase] = hosts;
  page.append(panel("How far from swinging", marginsOf(view)), el("div", { class: "pair" },
    panel("What is left of a disturbance", sensitivity, el("p", { class: "hint" }, `Below 1 feedback helps, above it adds. Worst: over modes ±10 % and loop gain 0.6 to 1.3. The peak of the design, with a mode wherever nothing is told, is ${num(view.margin)}; above ${num(view.told_to_hz)} Hz nothing is told.`)),
    el("section", { class: "panel" }, el("h3", {}, "Gain around the loop"), gain, el("h3", {}, "Its phase"), phase)));
  page.addEventListener("shown", () => {
    const x = curves.frequency_hz;
    const level = (value) => x.map(() => value);
    const mark = { x: view.told_to_hz, label: "told up to here" };
    // What follows from the model has the model's colour, what was measured the measurement's.
    const asMeasured = (part, log) => (measured ? [["as measured", COLOURS.measured, resampled(measured.frequency_hz, measured[part], x, log)]] : []);
    const ofModel = (part, words = "by the model", dash = undefined) => [words, COLOURS.model, curves[part], dash];
    curvesPlot(sensitivity, x, [ofModel("sensitivity"), ofModel("worst_sensitivity", "worst", [2, 3]), ["no feedback", COLOURS.noise, level(1), [6, 4]], ...asMeasured("sensitivity", true)], "error over disturbance", { height: 420, log: true, mark, name: "sensitivity" });
    curvesPlot(gain, x, [ofModel("gain"), ["crossover", COLOURS.noise, level(1), [6, 4]], ...asMeasured("gain", true)], "gain", { log: true, mark, name: "loop gain" });
    curvesPlot(phase, x, [ofModel("phase_deg"), ["critical", COLOURS.noise, level(-180), [6, 4]], ...asMeasured("phase_deg", false)], "phase, °", { mark, name: "loop phase" });
  });
}

/** A run: expected beside found in a picture, and what the command says. */
function ranPart(page, id, title, made) {
  if (!made) return null;
  const host = el("div", { class: "plot", id: `${id}-plot` });
  const { rows } = made;
  if (rows.length) page.addEventListener("shown", () => {
    const names = [...new Set(rows.map((row) => row.reference))];
    const of = (closed, what) => names.map((name) => (rows.find((row) => row.reference === name && row.closed === closed) || {})[what] ?? null);
    const loops = [[false, "open", COLOURS.model], [true, "closed", COLOURS.measured]].filter(([closed]) => rows.some((row) => row.closed === closed));
    const series = loops.flatMap(([closed, words, colour]) => [
      { label: `${words}, expected`, colour, values: of(closed, "expected_percent"), hollow: true },
      { label: `${words}, found`, colour, values: of(closed, "found_percent") }]);
    dotsPlot(host, names, series, "error, % of peak to peak", { name: `errors ${title}` });
  });
  return el("section", { class: "ran" }, el("h4", {}, `Expected and found ${title}`), rows.some((row) => !row.stable) ? el("p", { class: "notice" }, "A loop swings: do not run it; design it with a smaller margin, or without feedback.") : null, rows.length ? host : null, printed(id, `Expected and found ${title}`, made.said), command(made.command));
}

/** The law along the references that repeat, on the step's model or on a simulated stage. */
function trackPart(lab, page, of, view, { tracked, onStage }) {
  const otherwise = (um) => (of === "campaign" ? "as the stage goes" : `${num(um)}, on the model`);
  const choices = [...(of === "campaign" ? [] : [["", "this step's model"]]), ...view.stages.map(({ name, usual_um: [low, high] }) => [name, `the simulated stage ${name}, ${num(low)} to ${num(high)} µm`])];
  return el("section", { class: "panel" }, el("h3", {}, "Try it"),
    el("p", {}, "The law, as it runs on the chip, along seven references: what the design expects beside what comes out. A simulated stage is none of yours; it has physics of its own, noise and converters."),
    form(lab, "track", [["Where", [{ name: "stage", title: "On (--model, --stage)", choices }]],
      ["References", [{ name: "range_min_um", title: "Lowest position, µm (--range)", otherwise: otherwise(view.range_um[0]) }, { name: "range_max_um", title: "Highest position, µm (--range)", otherwise: otherwise(view.range_um[1]) }, BEYOND]]],
    tracked || onStage ? "Run it again" : "Run it", (along) => lab.act({ what: "track", along: { ...along, stage: along.stage || null }, of })),
    ranPart(page, "tracked", "on the model", tracked),
    ranPart(page, "on-stage", "on the simulated stage", onStage));
}

/** What the bench is: where it is left empty the records' own. */
const BENCH = [
  ["Reference", [{ name: "input_min_um", title: "Lowest position, µm (--input-min)", otherwise: "as far as the voltage goes" }, { name: "input_max_um", title: "Highest position, µm (--input-max)", otherwise: "as far as the voltage goes" }]],
  ["Amplifier, DAC and ADC", [
    { name: "amplifier_min_v", title: "Lowest voltage at the stack, V (--amplifier)", otherwise: "the controller's" }, { name: "amplifier_max_v", title: "Highest voltage at the stack, V (--amplifier)", otherwise: "the controller's" },
    { name: "dac_min_v", title: "DAC's lowest code, V at the stack (--dac)", otherwise: "of the records" }, { name: "dac_full_v", title: "DAC's full scale, V at the stack (--dac)", otherwise: "of the records" },
    { name: "adc_min_um", title: "ADC's lowest code, µm (--adc)", otherwise: "of the records" }, { name: "adc_full_um", title: "ADC's full scale, µm (--adc)", otherwise: "of the records" }]],
  ["Feedback and the other axis", [{ name: "feedback_up_to_hz", title: "Feedback whole up to, Hz (--feedback-up-to)", otherwise: "where it helps" }, { name: "feedback_bound_um", title: "Feedback moves at most, µm (--feedback-bound-um)", otherwise: "four times the expected error" },
    { name: "cross", title: "Of the other axis' motion, µm/µm (--cross)", otherwise: "none" }, BEYOND]],
];

function tablePart(lab, of, made, link) {
  const part = el("section", { class: "panel" }, el("h3", {}, "Table for the firmware"),
    el("p", {}, "The complete law of this controller, as the firmware's build takes it."),
    form(lab, "table", BENCH, made ? "Make it again" : "Make the table", (bench) => lab.act({ what: "table", bench, of })));
  if (made) part.append(printed("table-said", "What the table is", made.said), el("p", {}, link("table", "Download the table")), command(made.command));
  return part;
}

/** How an image goes onto a board. */
const ONTO = { "nucleo-h743zi": "probe-rs run --chip STM32H743ZITx", "nucleo-g474re": "probe-rs run --chip STM32G474RETx" };

/** The image of the table for a board: built here where the firmware's sources are at hand. */
function imagePart(lab, of, place) {
  const { images, folder, job } = lab.state;
  const there = images.there[place === "campaign" ? place : String(place + 1)] || [];
  const select = el("select", { id: "image-board" }, images.boards.map((name) => el("option", { value: name, selected: name === lab.imageBoard }, name)));
  const link = (name) => el("a", { class: "button", href: `${download("image", place)}&board=${name}`, download: true, id: `export-image-${name}` }, `Download the image for ${name}`);
  const table = place === "campaign" ? "campaign/table.toml" : `tables/${place + 1}.toml`;
  const onto = (name) => (ONTO[name] ? `${ONTO[name]} ` : `hysteron board serve --emulator ${name} --stage paper-rate --image `) + table.replace(".toml", `-${name}.elf`);
  return el("section", { class: "panel", id: "image" }, el("h3", {}, "Image for a board"),
    el("p", {}, "A running board takes the table from the page Board, without a toolchain. An image with this table compiled in is built from the firmware's sources, by Rust."),
    images.sources
      ? el("p", { class: "row" }, el("label", { for: "image-board" }, "Board "), select, el("button", { type: "button", id: "build-image", disabled: job.running, click: () => { lab.imageBoard = select.value; lab.act({ what: "image", board: select.value, of }); } }, "Build the image"))
      : el("p", { class: "hint", id: "no-sources" }, "The sources are not at hand: start `hysteron lab` with --firmware and the folder `firmware` of a checkout. There the same is built by ", el("code", {}, `cargo xtask firmware build ${folder}/${table}`), "."),
    there.map((name) => el("div", { class: "built" }, el("p", {}, link(name)), command(onto(name), ONTO[name] ? "Onto the board" : "In the emulator"))));
}

/** A controller: its design, what is known of the stage, its loop, its runs, its table. `of` is whose it is, `place` where it is asked for. */
function designParts(lab, page, { of, place, view, response, made, tracked, onStage, exported }) {
  const link = (what, title) => el("a", { class: "button", href: download(what, place), download: true, id: `export-${what}` }, title);
  page.append(el("section", { class: "panel" }, el("h3", {}, "Design"), designForm(lab, of, view.usual, made)));
  if (made) page.append(panel("What was designed", made.lights.length ? lightsOf(made.lights) : null, printed("designed", "What was designed", made.said), el("p", {}, link("controller", "Download the controller")), command(made.command)));
  if (of === "step") stagePart(page, response);
  if (!made) return;
  loopPart(page, view);
  page.append(trackPart(lab, page, of, view, { tracked, onStage }), tablePart(lab, of, exported, link));
  if (exported) page.append(imagePart(lab, of, place));
}

/** The controller that is designed from the campaign's records. */
async function campaignController(lab, campaign) {
  const view = await ask("controller", { of: "campaign" });
  const page = el("div", {},
    el("p", {}, el("a", { href: "#controller", id: "to-campaign" }, "Back to the campaign")),
    el("h2", {}, "Controller: from the campaign's records"),
    el("p", {}, "Hysteresis, creep, lag and modes are undone as the records of your own stage have them; feedback takes what is left."));
  designParts(lab, page, { of: "campaign", place: "campaign", view, made: campaign.controller, onStage: campaign.on_stage, exported: campaign.table });
  return page;
}

export async function controllerPage(lab) {
  const { state } = lab;
  const { campaign, current: number } = state;
  if (location.hash === "#controller/campaign" && done(campaign)) return campaignController(lab, campaign);
  if (number === null) {
    return el("div", {}, el("h2", {}, "Controller"),
      el("p", {}, "A controller is designed from a model that was fitted here, or from records that a campaign asks of your own stage."),
      el("p", {}, el("a", { class: campaign ? "button quiet" : "button", href: state.data ? "#fit" : "#data" }, state.data ? "Choose a model" : "Bring recordings")),
      await campaignPart(lab));
  }
  const [view, response] = await Promise.all([ask("controller", { step: number }), ask("response", { step: number })]);
  const page = el("div", {},
    staleNotice(lab),
    el("h2", {}, `Controller: ${state.steps[number].title}`),
    el("p", {}, "Every effect of this model brings its compensator; feedback takes what is left, where a record of small signals tells up to where the stage does what the model says."),
    await campaignPart(lab));
  const of = (all) => all[number];
  designParts(lab, page, { of: "step", place: number, view, response, made: of(state.controllers), tracked: of(state.tracked), onStage: of(state.on_stage), exported: of(state.tables) });
  return page;
}
