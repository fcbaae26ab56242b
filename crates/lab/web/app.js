// The way from left to right: data, fit, compare, diagnose, ladder, controller, board, export.
import { ask, tell, Refused } from "./api.js";
import { el, table, command, right } from "./dom.js";
import { num, quantity, readable, unit } from "./numbers.js";
import { dataPage, fitForm } from "./data.js";
import { comparePage } from "./compare.js";
import { diagnosePage } from "./diagnose.js";
import { effectName, effectPage } from "./effects.js";
import { ladderPage } from "./ladder.js";
import { controllerPage } from "./controller.js";
import { boardPage } from "./board.js";
import { exportPage } from "./take.js";
import { projectsPage } from "./projects.js";
import { staleNotice } from "./stale.js";
import { drawTour } from "./tour.js";

const STATIONS = [["data", "Data"], ["fit", "Fit"], ["compare", "Compare"], ["diagnose", "Diagnose"], ["ladder", "Ladder"], ["controller", "Controller"], ["board", "Board"], ["export", "Export"]];
const by = (id) => document.getElementById(id);
const fault = by("fault");

/** What every page gets: the state, and how to act on it. */
const lab = {
  state: null,
  async act(deed, after) {
    const from = origin;
    const before = [follow, started];
    say(null);
    // Before the answer: news of the job's end may come first.
    [follow, started] = [after || null, from];
    try {
      await tell("do", { revision: lab.state.revision, do: deed });
      return true;
    } catch (error) {
      [follow, started] = before;
      say(error, from);
      return false;
    }
  },
  say,
  go(station) { location.hash = station; },
  async refresh() { lab.state = await ask("session"); await draw(); },
  redraw() { shown = null; draw(); },
};

let follow = null;
let shown = null;
let pages = 0;
/** The control that was used last, the one that started the job, and the one that the message stands at. */
let [origin, started, place] = [null, null, null];

/** Says what went wrong, where it was asked for. */
function say(error, at = origin) {
  fault.hidden = error === null;
  fault.textContent = error === null ? "" : error instanceof Refused ? error.message : `${error.message || error}`;
  place = at;
  putFault(true);
}

function putFault(look) {
  const control = place && by(place);
  const box = control && control.closest("form, .drop, .card, .panel, main > div > p");
  if (box && by("main").contains(box)) box.append(fault);
  else by("main").before(fault);
  if (look && !fault.hidden) fault.scrollIntoView({ block: "nearest" });
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
  for (const aside of ["effects", "projects"]) by(`to-${aside}`).toggleAttribute("aria-current", here === aside);
  for (const [name, keys] of [["undo", "Ctrl+Z"], ["redo", "Ctrl+Y"]]) {
    const what = lab.state[name];
    by(name).disabled = what === null;
    by(name).title = `${name === "undo" ? "Undo" : "Redo"}${what === null ? "" : `: ${what}`} (${keys})`;
  }
  by("version").textContent = `hysteron ${lab.state.version}.`;
  by("folder").textContent = `Project ${lab.state.project}, in ${lab.state.folder}.`;
  document.title = `${(STATIONS.find(([name]) => name === here) || ["", here === "projects" ? "Projects" : "Effects"])[1]} · ${lab.state.project} · Hysteron workbench`;
}

function drawJob() {
  const job = lab.state.job;
  by("job").hidden = !job.running;
  by("job-share").value = job.share;
  const kind = job.kind.charAt(0).toUpperCase() + job.kind.slice(1);
  const text = `${kind}: ${effectName(job.message)}, ${Math.round(100 * job.share)} %`;
  if (by("job-text").textContent !== text) by("job-text").textContent = text;
  const { reading } = lab.state;
  const bar = by("reading-share");
  if (bar) { bar.hidden = reading === null; bar.value = reading ?? 0; }
}

/** What a page depends on; while it is the same, the page is left alone. */
function key() {
  const s = lab.state;
  return JSON.stringify([location.hash, s.run, s.revision, s.files, s.data === null, s.current, s.diagnosed, s.reported, s.controllers, s.tracked, s.on_stage, s.tables, s.images, s.campaign, s.challenge, s.job.running]);
}

async function draw() {
  drawWay();
  drawJob();
  drawTour(lab, by("tour"));
  if (key() === shown) return;
  shown = key();
  const turn = ++pages;
  const here = station();
  const main = by("main");
  let page;
  try {
    const make = PAGES[here] || dataPage;
    page = !allowed(here) ? el("div", {}, el("p", {}, "Not yet: go the way from the left. "), el("p", {}, el("a", { class: "button", href: lab.state.data ? "#fit" : "#data" }, lab.state.data ? "Choose a model" : "Bring recordings"))) : await make(lab);
  } catch (error) {
    page = el("p", { class: "refused" }, error.message);
  }
  if (turn !== pages) return;
  const active = document.activeElement && document.activeElement.id;
  main.replaceChildren(page);
  putFault(false);
  page.dispatchEvent(new CustomEvent("shown"));
  if (active && by(active)) by(active).focus();
}

async function fitPage() {
  const { state } = lab;
  const step = state.current === null ? null : state.steps[state.current];
  const page = el("div", {}, staleNotice(lab) || "", el("h2", {}, "Choose a model"), fitForm(lab));
  if (step) {
    const words = await ask("words", { step: state.current });
    const rows = words.parameters.map((p) => {
      const [factor, name] = readable(p.unit, Math.abs(p.value));
      return [p.name.replaceAll("_", " "), right(quantity(p.value, p.unit)), right(p.standard_error === null ? "undetermined" : `${num(p.standard_error * factor)}${name ? `\u00a0${name}` : ""}`)];
    });
    page.append(
      el("h2", {}, `The model: ${step.title}`),
      ...words.headline.map((line) => el("p", {}, line)),
      ...words.notices.map((line) => el("p", { class: "notice" }, line.charAt(0).toUpperCase() + unit(line).slice(1))),
      el("p", {}, el("a", { class: "button", href: "#compare" }, "See it beside the measurement")),
      command(step.command),
      table("Parameters", ["Parameter", "Value", "Standard error"], rows));
  }
  return page;
}

const PAGES = { data: dataPage, fit: fitPage, compare: comparePage, diagnose: diagnosePage, ladder: ladderPage, controller: controllerPage, board: boardPage, export: exportPage, effects: effectPage, projects: projectsPage };

for (const event of ["click", "submit", "change"]) {
  addEventListener(event, ({ target }) => {
    const control = target instanceof Element && target.closest("[id]");
    if (control) origin = control.id;
  }, true);
}
by("back-close").addEventListener("click", () => { by("back").hidden = true; });
by("undo").addEventListener("click", () => lab.act({ what: "undo" }));
by("redo").addEventListener("click", () => lab.act({ what: "redo" }));
by("job-stop").addEventListener("click", async () => {
  try { await tell("do", { revision: lab.state.revision, do: { what: "stop" } }); } catch (error) { say(error, null); }
});
addEventListener("hashchange", () => { say(null); scrollTo(0, 0); draw(); });
addEventListener("keydown", (event) => {
  if (!event.ctrlKey && !event.metaKey) return;
  if (/INPUT|TEXTAREA|SELECT/.test(event.target.tagName)) return;
  if (event.key === "z") { event.preventDefault(); by("undo").click(); }
  if (event.key === "y") { event.preventDefault(); by("redo").click(); }
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => lab.redraw());

/** Asks for news for as long as the page is open. */
async function listen() {
  let seen = 0;
  let lost = false;
  for (;;) {
    try {
      const was = lab.state;
      lab.state = await ask("session", seen ? { seen } : {});
      seen = lab.state.tick;
      // Another version of the program has another page.
      if (was && was.version !== lab.state.version) { location.reload(); return; }
      // Another project has other steps: what this page remembers of those is of no use.
      if (was && was.folder !== lab.state.folder) { location.hash = lab.state.current === null ? "data" : "ladder"; location.reload(); return; }
      if (lost) { say(null); lost = false; }
      if (was && was.run !== lab.state.run) by("back").hidden = false;
      const { job } = lab.state;
      // A short job begins and ends between two looks.
      if (was && !job.running && (was.job.running || was.job.number !== job.number)) {
        if (job.failed) { say(new Error(job.failed), started); follow = null; }
        if (job.stopped) { say(new Error(`${job.kind.charAt(0).toUpperCase()}${job.kind.slice(1)} was stopped; ${was.revision === lab.state.revision ? "nothing was changed" : "what was fitted before that stays"}.`), started); follow = null; }
        if (follow) { const to = follow; follow = null; lab.go(to); }
      }
      await draw();
    } catch (error) {
      say(new Error("The server does not answer. It ends with the terminal it runs in; start `hysteron lab` on the same folder again, and this page goes on."), null);
      lost = true;
      await new Promise((done) => setTimeout(done, 2000));
      seen = 0;
    }
  }
}
listen();
