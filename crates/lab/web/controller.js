// The controller of a step: designed by one button, run on the step's model, taken home as it is and as the firmware's table.
import { ask, download } from "./api.js";
import { el, command, panel, printed, typed } from "./dom.js";
import { num } from "./numbers.js";
import { COLOURS, curvesPlot } from "./plots.js";
import { staleNotice } from "./stale.js";

/** What was typed last, by form: a refusal must not take it away. */
const given = {};

/** A form: parts with their fields, and the button that sends what was filled in. */
function form(lab, id, parts, title, act) {
  const kept = given[id] || {};
  const field = ({ name, title: label, otherwise, choices, tick }) => {
    const own = `${id}-${name}`;
    const input = choices
      ? el("select", { id: own, name }, choices.map(([value, words]) => el("option", { value, selected: kept[name] === value }, words)))
      : el("input", tick ? { id: own, name, type: "checkbox", checked: kept[name] === true } : { id: own, name, type: "number", step: "any", placeholder: otherwise, value: kept[name] ?? null });
    // `Rate, Hz (--rate-hz)`: the option, by which a refusal names the field, stays in one piece.
    const [words, option] = label.replace(")", "").split(" (");
    const named = el("label", { for: own }, `${words} `, el("code", { class: "option" }, option));
    return el("p", { class: tick ? "tick" : null }, tick ? [input, " ", named] : [named, input]);
  };
  const value = (input) => (input.type === "checkbox" ? input.checked : input.tagName === "SELECT" ? input.value : typed(input.value));
  const made = el("form", { id: `${id}-form`, submit: (event) => {
    event.preventDefault();
    given[id] = Object.fromEntries([...made.querySelectorAll("input, select")].map((input) => [input.name, value(input)]));
    act(given[id]);
  } },
  parts.map(([part, fields]) => el("fieldset", {}, el("legend", {}, part), el("div", { class: "fields" }, fields.map(field)))),
  el("button", { type: "submit", id, class: title.includes("again") ? "" : "main", disabled: lab.state.job.running }, title));
  return made;
}

const BEYOND = { name: "beyond_records", title: "Leave what the records cover (--beyond-records)", tick: true };

function designForm(lab, usual, made) {
  const [low, high] = usual.volts;
  return form(lab, "design", [
    ["When the reference is known", [{ name: "reference", title: "Reference (--reference)", choices: [["previewed", "16 samples before it is due"], ["live", "not before it is due"]] }]],
    ["Commands", [{ name: "volts_min", title: "Lowest voltage, V (--volts)", otherwise: `${num(low)}, of the records` }, { name: "volts_max", title: "Highest voltage, V (--volts)", otherwise: `${num(high)}, of the records` },
      { name: "rate_hz", title: "Rate, Hz (--rate-hz)", otherwise: usual.rate_hz === null ? "not in the records" : `${num(usual.rate_hz)}, of the records` }]],
    ["Feedback", [{ name: "margin", title: "Largest peak of the sensitivity (--margin)", otherwise: num(usual.margin) }, { name: "rigid_hz", title: "No other mode below, Hz (--rigid)", otherwise: "as the records tell" },
      { name: "open", title: "Without feedback (--open)", tick: true }, BEYOND]],
  ], made ? "Design again" : "Design the controller", (wishes) => lab.act({ what: "design", wishes }));
}

/** Gain and phase around the loop, and what it leaves of a disturbance. */
function pictures(page, view) {
  const { curves } = view;
  if (!curves) return;
  const hosts = [0, 1, 2].map((k) => el("div", { class: "plot", id: `loop-${["sensitivity", "gain", "phase"][k]}` }));
  const [sensitivity, gain, phase] = hosts;
  page.append(el("div", { class: "pair" },
    panel("What is left of a disturbance", sensitivity, el("p", { class: "hint" }, `Below 1 feedback helps, above it adds. Worst: over modes ±10 % and loop gain 0.6 to 1.3. The peak of the design, with a mode wherever nothing is told, is ${num(view.margin)}; above ${num(view.told_to_hz)} Hz nothing is told.`)),
    el("section", { class: "panel" }, el("h3", {}, "Gain around the loop"), gain, el("h3", {}, "Its phase"), phase)));
  page.addEventListener("shown", () => {
    const x = curves.frequency_hz;
    const level = (value) => x.map(() => value);
    curvesPlot(sensitivity, x, [["nominal", COLOURS.measured, curves.sensitivity], ["worst", COLOURS.model, curves.worst_sensitivity], ["no feedback", COLOURS.noise, level(1), [6, 4]]], "error over disturbance", { height: 420, log: true });
    curvesPlot(gain, x, [["gain", COLOURS.measured, curves.gain], ["crossover", COLOURS.noise, level(1), [6, 4]]], "gain", { log: true });
    curvesPlot(phase, x, [["phase, degrees", COLOURS.measured, curves.phase_deg], ["critical", COLOURS.noise, level(-180), [6, 4]]], "phase, °", {});
  });
}

function trackPart(lab, view, tracked) {
  const part = el("section", { class: "panel" }, el("h3", {}, "On the model"),
    el("p", {}, "The law, as it runs on the chip, along seven references on this step's model: what the design expects beside what comes out."),
    form(lab, "track", [["References", [{ name: "range_min_um", title: "Lowest position, µm (--range)", otherwise: num(view.range_um[0]) }, { name: "range_max_um", title: "Highest position, µm (--range)", otherwise: num(view.range_um[1]) }, BEYOND]]],
      tracked ? "Run it again" : "Run it on the model", (along) => lab.act({ what: "track", along })));
  if (tracked) part.append(printed("tracked", "Expected and found", tracked.said), command(tracked.command));
  return part;
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

function tablePart(lab, made, link) {
  const part = el("section", { class: "panel" }, el("h3", {}, "Table for the firmware"),
    el("p", {}, "The complete law of this controller, as the firmware's build takes it."),
    form(lab, "table", BENCH, made ? "Make it again" : "Make the table", (bench) => lab.act({ what: "table", bench })));
  if (made) part.append(printed("table-said", "What the table is", made.said), el("p", {}, link("table", "Download the table")), command(made.command));
  return part;
}

export async function controllerPage(lab) {
  const { state } = lab;
  const number = state.current;
  const view = await ask("controller", { step: number });
  const [made, tracked, exported] = [state.controllers, state.tracked, state.tables].map((all) => all[number]);
  const link = (what, title) => el("a", { class: "button", href: download(what, number), download: true, id: `export-${what}` }, title);
  const page = el("div", {},
    staleNotice(lab),
    el("h2", {}, `Controller: ${state.steps[number].title}`),
    el("p", {}, "Every effect of this model brings its compensator; feedback takes what is left, where a record of small signals tells up to where the stage does what the model says."),
    el("section", { class: "panel" }, el("h3", {}, "Design"), designForm(lab, view.usual, made)));
  if (!made) return page;
  page.append(panel("What was designed", printed("designed", "What was designed", made.said), el("p", {}, link("controller", "Download the controller")), command(made.command)));
  pictures(page, view);
  page.append(trackPart(lab, view, tracked), tablePart(lab, exported, link));
  return page;
}
