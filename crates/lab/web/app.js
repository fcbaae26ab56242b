// The way from left to right: data, fit, compare, diagnose, ladder, export.
import { ask, tell, download, Refused } from "./api.js";
import { el, table, command, percent, num, unit } from "./dom.js";
import { dataPage, fitForm } from "./data.js";
import { comparePage } from "./compare.js";
import { diagnosePage, effectPage } from "./diagnose.js";
import { ladderPage } from "./ladder.js";

const STATIONS = [["data", "Data"], ["fit", "Fit"], ["compare", "Compare"], ["diagnose", "Diagnose"], ["ladder", "Ladder"], ["export", "Export"], ["effects", "Effects"]];
const by = (id) => document.getElementById(id);

/** What every page gets: the state, and how to act on it. */
export const lab = {
  state: null,
  async act(deed, after) {
    say(null);
    try {
      await tell("do", { revision: lab.state.revision, do: deed });
      if (after) follow = after;
      return true;
    } catch (error) {
      say(error);
      return false;
    }
  },
  say,
  go(station) { location.hash = station; },
  async refresh() { lab.state = await ask("session"); draw(); },
};

let follow = null;
let shown = null;
let pages = 0;

function say(error) {
  const fault = by("fault");
  fault.hidden = error === null;
  fault.textContent = error === null ? "" : error instanceof Refused ? error.message : `${error.message || error}`;
}

function station() {
  return location.hash.slice(1).split("/")[0] || "data";
}

function allowed(name) {
  if (name === "fit") return lab.state.data !== null;
  if (["compare", "diagnose", "ladder", "export"].includes(name)) return lab.state.current !== null;
  return true;
}

function drawWay() {
  const here = station();
  by("way").replaceChildren(...STATIONS.map(([name, title]) => {
    const open = allowed(name);
    const attributes = { href: open ? `#${name}` : null, "aria-current": name === here ? "step" : null, "aria-disabled": open ? null : "true", role: open ? null : "link" };
    return el("li", {}, el("a", attributes, title));
  }));
  const steps = lab.state.steps;
  const step = lab.state.current === null ? null : steps[lab.state.current];
  by("undo").disabled = !step || step.parent === null;
  by("redo").disabled = !step || step.redo === null;
  by("version").textContent = `hysteron ${lab.state.version}.`;
  by("folder").textContent = `The session is in ${lab.state.folder}.`;
}

function drawJob() {
  const job = lab.state.job;
  by("job").hidden = !job.running;
  by("job-share").value = job.share;
  const text = `${job.kind}: ${job.message} (${Math.round(100 * job.share)} %)`;
  if (by("job-text").textContent !== text) by("job-text").textContent = text;
}

/** What a page depends on; while it is the same, the page is left alone. */
function key() {
  const s = lab.state;
  return JSON.stringify([location.hash, s.revision, s.files, s.reading, s.data === null, s.current, s.diagnosed, s.job.running]);
}

async function draw() {
  drawWay();
  drawJob();
  if (key() === shown) return;
  shown = key();
  const turn = ++pages;
  const here = station();
  const main = by("main");
  const active = document.activeElement && document.activeElement.id;
  let page;
  try {
    page = !allowed(here) ? el("p", {}, "Not yet: go the way from the left.") : await PAGES[here](lab);
  } catch (error) {
    page = el("p", { class: "refused" }, error.message);
  }
  if (turn !== pages) return;
  main.replaceChildren(page);
  page.dispatchEvent(new CustomEvent("shown"));
  if (active && by(active)) by(active).focus();
}

async function fitPage() {
  const { state } = lab;
  const step = state.current === null ? null : state.steps[state.current];
  const page = el("div", {}, el("h2", {}, "Choose a model"), fitForm(lab));
  if (step) {
    const words = await ask("words", { step: state.current });
    const rows = words.parameters.map((p) => [p.name, p.value, p.standard_error === null ? "undetermined" : num(p.standard_error), unit(p.unit)]);
    page.append(
      el("h2", {}, `The model: ${step.title}`),
      ...words.headline.map((line) => el("p", {}, line)),
      ...words.notices.map((line) => el("p", { class: "notice" }, line)),
      command(step.command),
      table("Parameters", ["Parameter", "Value", "Std. error", "Unit"], rows),
      el("p", {}, el("a", { class: "button", href: "#compare" }, "See it beside the measurement")));
  }
  return page;
}

async function exportPage() {
  const { state } = lab;
  const number = state.current;
  const words = await ask("words", { step: number });
  const link = (what, title, about, text) => el("li", {}, el("a", { class: "button", href: download(what, number), download: true, id: `export-${what}` }, title), el("p", {}, about), text ? command(text) : null);
  return el("div", {},
    el("h2", {}, `Take it home: ${state.steps[number].title}`),
    el("ul", { class: "exports" },
      link("model", "Model", "All parameters with units and standard errors, as a readable file; the one that every command takes.", state.steps[number].command),
      link("report", "Report", "Comparison, diagnosis and ladder in one file to send to a colleague; it needs no program and no network. Takes some seconds.", words.report_command),
      link("session", "Session", "Data, models and diagnoses as a folder that the command line opens.", `cd ${state.folder}`)));
}

const PAGES = { data: dataPage, fit: fitPage, compare: comparePage, diagnose: diagnosePage, ladder: ladderPage, export: exportPage, effects: effectPage };

by("undo").addEventListener("click", () => lab.act({ what: "undo" }));
by("redo").addEventListener("click", () => lab.act({ what: "redo" }));
by("job-stop").addEventListener("click", () => lab.act({ what: "stop" }));
addEventListener("hashchange", () => { say(null); draw(); });
addEventListener("keydown", (event) => {
  if (!event.ctrlKey && !event.metaKey) return;
  if (/INPUT|TEXTAREA|SELECT/.test(event.target.tagName)) return;
  if (event.key === "z") { event.preventDefault(); by("undo").click(); }
  if (event.key === "y") { event.preventDefault(); by("redo").click(); }
});

/** Asks for news for as long as the page is open. */
async function listen() {
  let seen = 0;
  for (;;) {
    try {
      const was = lab.state;
      lab.state = await ask("session", seen ? { seen } : {});
      seen = lab.state.tick;
      const { job } = lab.state;
      if (was && was.job.running && !job.running) {
        if (job.failed) { say(new Error(job.failed)); follow = null; }
        if (job.stopped) { say(new Error(`${job.kind} was stopped; nothing was changed.`)); follow = null; }
        if (follow) { const to = follow; follow = null; lab.go(to); }
      }
      await draw();
    } catch (error) {
      say(new Error("The server does not answer. It ends with the terminal it runs in; start `hysteron lab` again and open the address it prints."));
      await new Promise((done) => setTimeout(done, 2000));
      seen = 0;
    }
  }
}
listen();
