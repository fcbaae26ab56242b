// The ladder: how the error fell, step by step, branches beside each other, down to the noise floor.
import { el, table, command, printed, right } from "./dom.js";
import { percent } from "./numbers.js";
import { effects, effectName } from "./effects.js";
import { sinceWords, staleNotice } from "./stale.js";

const many = (count, one) => `${count} ${one}${count === 1 ? "" : "s"}`;
const error = (step) => step.validate_percent ?? step.identify_percent;

/** The steps in the order of a tree: each behind its parent, branches indented. */
function order(steps) {
  const rows = [];
  const walk = (number, depth) => {
    rows.push([number, depth]);
    const children = steps.map((_, k) => k).filter((k) => steps[k].parent === number && !steps[k].removed);
    for (const child of children) walk(child, depth + 1);
  };
  steps.forEach((step, number) => { if (step.parent === null && !step.removed) walk(number, 0); });
  return rows;
}

/** From the root to a step. */
function way(steps, number) {
  const path = [];
  for (let at = number; at !== null; at = steps[at].parent) path.unshift(at);
  return path;
}

function rung(lab, number, depth, most) {
  const step = lab.state.steps[number];
  const here = number === lab.state.current;
  const value = error(step);
  const bar = el("span", { class: "bar" });
  bar.style.width = `${Math.max(0.5, 100 * (value || 0) / most)}%`;
  const floor = el("span", { class: "floor", title: "noise floor" });
  floor.style.left = `${100 * (step.noise_percent || 0) / most}%`;
  const row = el("li", { class: here ? "rung here" : "rung" },
    el("button", { type: "button", id: `step-${number}`, "aria-current": here ? "step" : null, click: () => lab.act({ what: "go-to", step: number }) }, `${number + 1}: ${step.title}`, step.since ? el("span", { class: "since", title: sinceWords(step.since) }, `fitted before ${step.since.records.length ? many(step.since.records.length, "record") : many(step.since.roles.length, "role")}`) : null),
    el("span", { class: "track", role: "img", "aria-label": `error ${percent(value)} of peak to peak, noise floor ${percent(step.noise_percent)}` }, bar, floor),
    el("span", { class: "figure" }, percent(value)),
    step.note ? el("span", { class: "note" }, step.note) : null);
  // Only the name is indented: all bars begin at one line, so that they can be compared.
  row.firstChild.style.marginLeft = `${1.4 * depth}rem`;
  return row;
}

/** Error of each record at two steps, beside what the noise alone would leave. */
function beside(steps, a, b, caption, titles) {
  const ratio = (before, after) => right(before && after !== null ? percent(100 * after / before) : "–");
  const line = (name, before, after, noise) => [name, right(percent(before)), right(percent(after)), ratio(before, after), right(percent(noise))];
  // Steps on different data know different records: each has its line.
  const [before, after] = [new Map(steps[a].records), new Map(steps[b].records)];
  const noise = new Map([a, b].flatMap((k) => steps[k].records.map(([file], index) => [file, steps[k].record_noise[index]])));
  const rows = [...new Set([...before.keys(), ...after.keys()])].map((file) => line(file, before.get(file) ?? null, after.get(file) ?? null, noise.get(file) ?? null));
  const judged = steps[b].validate_percent !== null;
  const pooled = (step) => (judged ? step.validate_percent : step.identify_percent);
  rows.unshift(line(judged ? "all not fitted to" : "all fitted to", pooled(steps[a]), pooled(steps[b]), steps[b].noise_percent));
  return table(caption, ["Record", titles[0], titles[1], "Ratio", "Noise alone"], rows);
}

let branch = null;

/** Takes the step that is looked at off the ladder, and puts those back that were taken off. */
function offLadder(lab) {
  const { steps, current, job } = lab.state;
  const off = steps.map((_, k) => k).filter((k) => steps[k].removed);
  return el("p", { class: "row" },
    el("a", { class: "button quiet", href: "#compare" }, `Look at step ${current + 1}`),
    el("a", { class: "button quiet", href: "#compare/by-hand" }, "Move its parameters by hand"),
    el("button", { type: "button", id: "remove", disabled: job.running, click: () => lab.act({ what: "remove", step: current }) }, `Take step ${current + 1} off the ladder`),
    off.map((k) => el("button", { type: "button", id: `keep-${k}`, disabled: job.running, click: () => lab.act({ what: "keep", step: k }) }, `Put back ${k + 1}: ${steps[k].title}`)));
}

/** What a person calls the step that is looked at, and wrote about it. */
function naming(lab) {
  const { steps, current } = lab.state;
  const step = steps[current];
  const name = el("input", { id: "step-name", maxlength: "80", value: step.title, placeholder: step.made, autocomplete: "off" });
  const note = el("textarea", { id: "step-note", rows: "3", maxlength: "4000" }, step.note || "");
  return el("details", { class: "panel", id: "naming" }, el("summary", {}, `Name and note of step ${current + 1}`),
    el("form", { submit: (event) => {
      event.preventDefault();
      lab.act({ what: "name", step: current, name: name.value, note: note.value });
    } },
    el("p", {}, el("label", { for: "step-name" }, `Name; empty for ${step.made}`), name),
    el("p", {}, el("label", { for: "step-note" }, "Note"), note),
    el("p", {}, el("button", { type: "submit", id: "keep-name", disabled: lab.state.job.running }, "Keep both"))));
}

/** What learning said of the way that this step is on. */
function learnedPart(lab) {
  const { steps, current, learned } = lab.state;
  const last = Object.keys(learned).map(Number).find((k) => way(steps, k).includes(current));
  if (last === undefined) return null;
  return el("details", { class: "panel", open: last === current }, el("summary", {}, "What learning did, and why it stopped"), printed("learned", "What learning did", learned[last]));
}

export async function ladderPage(lab) {
  const { steps, current } = lab.state;
  const known = await effects();
  const most = Math.max(...steps.map((step) => (step.removed ? 0 : error(step) || 0))) || 1;
  const step = steps[current];
  const judged = step.validate_percent !== null;
  const page = el("div", {},
    staleNotice(lab),
    el("h2", {}, "How the error fell"),
    el("p", { class: "lead" }, way(steps, current).map((k) => `${steps[k].title}: ${percent(error(steps[k]))}`).join(" → "),
      step.noise_percent ? `; the noise floor is ${percent(step.noise_percent)}.` : "."),
    el("p", {}, judged ? "Pooled error on records not fitted to, percent of peak to peak. The stroke is the noise floor. A step chosen here is the one that all pages show." : "Pooled error on the records fitted to; no record was kept to judge by, so a fall here proves nothing."),
    el("ol", { class: "rungs panel" }, order(steps).map(([number, depth]) => rung(lab, number, depth, most))),
    offLadder(lab),
    naming(lab),
    command([...new Set(way(steps, current).map((k) => steps[k].command))].join(" && ")),
    learnedPart(lab));
  const select = el("select", { id: "effect" }, known.map((k) => el("option", { value: k.name }, effectName(k.name))));
  page.append(el("h2", {}, "What if it is another?"),
    el("p", { class: "row" }, el("label", { for: "effect" }, `Add to step ${current + 1}, ${step.title} `), select, " ",
      el("button", { type: "button", id: "add", class: "main", disabled: lab.state.job.running, click: () => lab.act({ what: "add", effect: select.value }, "ladder") }, "Add"),
      " ", el("a", { href: "#diagnose" }, "Or ask which"), " ", el("a", { href: "#effects/own", id: "to-own" }, "Or write one of your own")));
  const tables = el("div", { class: "pair" });
  page.append(tables);
  if (step.parent !== null) {
    const box = el("section", { class: "panel" }, el("h3", {}, `Before and after ${step.title}`), beside(steps, step.parent, current, "Error of each record, percent of peak to peak", ["Before", "After"]));
    if (judged && step.validate_percent >= steps[step.parent].validate_percent) box.append(el("p", { class: "notice", id: "no-support" }, "The records not fitted to do not support it: their error did not fall. Undo it, or try another."));
    tables.append(box);
  }
  const others = steps.map((_, k) => k).filter((k) => k !== current && !steps[k].removed);
  if (others.length) {
    branch = others.includes(branch) ? branch : others.at(-1);
    const to = el("select", { id: "branch", change: () => { branch = Number(to.value); holder.replaceChildren(apart(), pair()); } }, others.map((k) => el("option", { value: k, selected: k === branch }, `${k + 1}: ${steps[k].title}`)));
    const pair = () => beside(steps, current, branch, `Error of each record, percent of peak to peak: step ${current + 1}, ${step.title}, and step ${branch + 1}, ${steps[branch].title}`, [`Step ${current + 1}`, `Step ${branch + 1}`]);
    const apart = () => (steps[branch].generation === step.generation ? "" : el("p", { class: "notice" }, "These steps were fitted on different records: only the errors of the same record can be compared."));
    const holder = el("div", {}, apart(), pair());
    tables.append(el("section", { class: "panel" }, el("h3", {}, "Branches beside each other"), el("p", {}, el("label", { for: "branch" }, "Set this step beside "), to), holder));
  }
  return page;
}
