// What is taken home: model, report, session.
import { ask, download } from "./api.js";
import { el, command, typed } from "./dom.js";

/** What differs from the paper's bench: name, title, the option's meaning. */
const ENDS = [
  ["input_min_um", "Lowest position, µm"], ["input_max_um", "Highest position, µm"],
  ["amplifier_min_v", "Lowest voltage at the stack, V"], ["amplifier_max_v", "Highest voltage at the stack, V"],
  ["latency_us", "Latency of the loop, µs"], ["mode_hz", "First mode, Hz"], ["damping", "Its damping ratio"],
];

/** What was typed last: a refusal must not take it away. */
let given = {};

/** The table for the firmware: made with what is known of the bench, or why there is none. */
function tableItem(lab, words, link) {
  const { state } = lab;
  const made = state.tables[state.current];
  if (words.no_table) return el("li", { class: "card wide" }, el("h3", {}, "Table for the firmware"), el("p", { id: "no-table" }, words.no_table), el("p", {}, el("a", { href: "#ladder" }, "To the ladder")));
  const form = el("form", { id: "table-form", submit: (event) => {
    event.preventDefault();
    given = Object.fromEntries(ENDS.map(([name]) => [name, typed(form.querySelector(`#${name}`).value)]));
    lab.act({ what: "table", ends: given });
  } },
  el("div", { class: "fields" }, ENDS.map(([name, title]) => el("p", {}, el("label", { for: name }, title), el("input", { id: name, type: "number", step: "any", placeholder: "by default", value: given[name] ?? null })))),
  el("button", { type: "submit", id: "make-table", class: made ? "" : "main", disabled: state.job.running }, made ? "Make it again" : "Make the table"));
  return el("li", { class: "card wide" }, el("h3", {}, "Table for the firmware"),
    el("p", {}, "The direct inverse of this model's family, fitted to the same data, as the controller reads it at start. Left empty, positions are those of the fit, converters and voltages those of the paper's bench, and feedback is off: no gain is safe without the loop's latency and first mode."),
    form, made ? el("p", {}, link("table", "Download the table")) : null, made ? command(made) : null);
}

export async function exportPage(lab) {
  const { state } = lab;
  const number = state.current;
  const words = await ask("words", { step: number });
  const link = (what, title) => el("a", { class: "button", href: download(what, number), download: true, id: `export-${what}` }, title);
  const item = (title, about, actions, text) => el("li", { class: "card" }, el("h3", {}, title), el("p", {}, about), el("p", { class: "row" }, actions), text ? command(text) : null);
  const write = (title, kind) => el("button", { type: "button", id: "write-report", class: kind, disabled: state.job.running, click: () => lab.act({ what: "report" }) }, title);
  const written = state.reported[number];
  return el("div", {},
    el("h2", {}, `Take it home: ${state.steps[number].title}`),
    el("ul", { class: "exports" },
      item("Model", "All parameters with units and standard errors, as a readable file; the one that every command takes.", link("model", "Download the model"), state.steps[number].command),
      tableItem(lab, words, link),
      item("Report", `Comparison, diagnosis and ladder in one file to send to a colleague; it needs no program and no network.${state.diagnosed[number] || written ? "" : " This step is not diagnosed yet, so writing it takes some seconds; it can be stopped."}`,
        written ? [link("report", "Download the report"), write("Write it again", "small")] : write("Write the report", "main"), words.report_command),
      item("Session", "Recordings, data, models, diagnoses and reports as a folder that the command line opens, and the workbench too.", link("session", "Download the session"), `hysteron lab --session ${state.folder}`)));
}
