// What is taken home: model, table, report, session.
import { ask, download } from "./api.js";
import { el, command, typed } from "./dom.js";
import { staleNotice } from "./stale.js";

/** What the bench is: its part, then field, title and what holds where it is left empty. */
const BENCH = [
  ["Reference", [["input_min_um", "Lowest position, µm", "as fitted"], ["input_max_um", "Highest position, µm", "as fitted"]]],
  ["Loop", [["rate_hz", "Rate of the control loop, Hz", "50000"], ["latency_us", "Latency, command to reading, µs", "unknown"], ["mode_hz", "First mode, Hz", "unknown"], ["damping", "Its damping ratio", "unknown"]]],
  ["Amplifier, DAC and ADC", [["amplifier_min_v", "Lowest voltage at the stack, V", "the paper's"], ["amplifier_max_v", "Highest voltage at the stack, V", "the paper's"],
    ["dac_min_v", "DAC's lowest code, V at the stack", "the paper's"], ["dac_full_v", "DAC's full scale, V at the stack", "the paper's"],
    ["adc_min_um", "ADC's lowest code, µm", "the paper's"], ["adc_full_um", "ADC's full scale, µm", "the paper's"]]],
];

/** What was typed last: a refusal must not take it away. */
let given = {};

/** The table for the firmware: made with what is known of the bench, or why there is none. */
function tableItem(lab, words, link) {
  const { state } = lab;
  const made = state.tables[state.current];
  const item = el("li", { class: "card wide" }, el("h3", {}, "Table for the firmware"));
  if (words.no_table) {
    item.append(el("p", { id: "no-table" }, words.no_table), el("p", {}, el("a", { href: "#ladder" }, "To the ladder")));
    return item;
  }
  const field = ([name, title, otherwise]) => el("p", {}, el("label", { for: name }, title), el("input", { id: name, type: "number", step: "any", placeholder: otherwise, value: given[name] ?? null }));
  const form = el("form", { id: "table-form", submit: (event) => {
    event.preventDefault();
    given = Object.fromEntries([...form.querySelectorAll("input")].map((input) => [input.id, typed(input.value)]));
    lab.act({ what: "table", bench: given });
  } },
  BENCH.map(([part, fields]) => el("fieldset", {}, el("legend", {}, part), el("div", { class: "fields" }, fields.map(field)))),
  el("button", { type: "submit", id: "make-table", class: made ? "" : "main", disabled: state.job.running }, made ? "Make it again" : "Make the table"));
  item.append(
    el("p", {}, "The direct inverse of this model's family, fitted to the same data, as the controller reads it at start. Without the loop's latency feedback stays off: no gain is known to be safe."),
    form);
  if (made) item.append(el("p", { class: "told lines", id: "table-said" }, made.said.trim()), el("p", {}, link("table", "Download the table")), command(made.command));
  return item;
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
    staleNotice(lab),
    el("h2", {}, `Take it home: ${state.steps[number].title}`),
    el("ul", { class: "exports" },
      item("Model", "All parameters with units and standard errors, as a readable file; the one that every command takes.", link("model", "Download the model"), state.steps[number].command),
      item("Report", `Comparison, diagnosis and ladder in one file to send to a colleague; it needs no program and no network.${state.diagnosed[number] || written ? "" : " This step is not diagnosed yet, so writing it takes some seconds; it can be stopped."}`,
        written ? [link("report", "Download the report"), write("Write it again", "small")] : write("Write the report", "main"), words.report_command),
      item("Session", "Recordings, data, models, diagnoses and reports as a folder that the command line opens, and the workbench too.", link("session", "Download the session"), state.session_command),
      tableItem(lab, words, link)));
}
