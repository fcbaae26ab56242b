// What is taken home: model, report, controller, session.
import { ask, download } from "./api.js";
import { el, command } from "./dom.js";
import { staleNotice } from "./stale.js";

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
      item("Session", "Recordings, data, models, diagnoses, reports and controllers as a folder that the command line opens, and the workbench too.", link("session", "Download the session"), state.session_command),
      item("Controller", state.controllers[number] ? "The law that was designed from this model, and its table for the firmware." : "Designed from this model by one button, run on it, and made the firmware's table.",
        state.controllers[number] ? [link("controller", "Download the controller"), state.tables[number] ? link("table", "Download the table") : el("a", { class: "button quiet", href: "#controller" }, "Its table")] : el("a", { class: "button", href: "#controller" }, "To the controller"),
        state.controllers[number] ? state.controllers[number].command : null)));
}
