// The projects under this address: which there are, another one opened, a new one begun.
import { ask } from "./api.js";
import { el, table, right } from "./dom.js";
import { count, percent } from "./numbers.js";

const when = (seconds) => (seconds === null ? "–" : new Date(1000 * seconds).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }));

export async function projectsPage(lab) {
  const { projects } = await ask("projects");
  const { job } = lab.state;
  const open = (project, index) => (project.open ? el("span", { id: `project-${index}`, "aria-current": "true" }, "open now")
    : el("button", { type: "button", class: "small", id: `project-${index}`, disabled: job.running || project.unreadable !== null, "aria-label": `Open ${project.title}`, click: () => lab.act({ what: "open-project", name: project.name }) }, "Open"));
  const state = (project) => project.unreadable || (project.models ? project.model : project.has_data ? "no model yet" : "no data yet");
  const name = el("input", { id: "project-name", required: true, maxlength: "40", autocomplete: "off", placeholder: "x axis" });
  return el("div", {},
    el("h2", {}, "Projects"),
    el("p", {}, "Each has its own recordings, models and controllers, in a folder of its own that every command opens. Nothing of one changes another."),
    table("Projects", ["Project", "Models", "The one looked at", "Its error, of peak to peak", "Last changed", "Open it"],
      projects.map((project, index) => [project.title, right(count(project.models)), state(project), right(project.error_percent === null ? "–" : percent(project.error_percent)), when(project.changed_s), { element: open(project, index) }])),
    el("form", { class: "panel", id: "new-project", submit: (event) => {
      event.preventDefault();
      lab.act({ what: "new-project", name: name.value });
    } },
    el("p", {}, el("label", { for: "project-name" }, "Name of a new project "), name),
    el("p", {}, el("button", { type: "submit", class: "main", id: "begin-project", disabled: job.running }, "Begin it"))));
}
