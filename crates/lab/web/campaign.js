// The campaign on a stage of one's own: its plan, the files that came back, what is wrong with them, the next pass, the controller.
import { ask, sendBack } from "./api.js";
import { el, command, printed, table, right, typed } from "./dom.js";
import { num, quantity, text } from "./numbers.js";
import { chosen, dropped, readingFields, wanted } from "./data.js";

/** Whether the section is open, and what was typed: a page that is drawn anew must not take them away. */
let open = false;
const given = {};

/** A number of a form, its option beside it. */
function field(id, name, title, option, hint, value, attributes = {}) {
  return el("p", {}, el("label", { for: `${id}-${name}` }, `${title} `, el("code", { class: "option" }, option)),
    el("input", { id: `${id}-${name}`, name, type: "number", step: "any", value, placeholder: hint, input: (event) => { given[name] = event.target.value; }, ...attributes }));
}

const exact = (value) => (value === null || value === undefined ? null : String(Number(value.toPrecision(12))));

/** What is asked for before there is a plan. */
function planForm(lab, usual) {
  const value = (name) => given[name] ?? exact(usual[name]);
  const known = ["top_v", "rate_hz", "latency_us"].some((name) => usual[name] !== null);
  return el("form", { id: "campaign-plan-form", submit: (event) => {
    event.preventDefault();
    const asked = Object.fromEntries(["top_v", "rate_hz", "latency_us"].map((name) => [name, typed(event.target.elements[name].value)]));
    lab.act({ what: "campaign-plan", asked });
  } },
  el("p", {}, "Voltages for your own stage, as files to be played. What comes back is known by its voltage whatever its name, checked, and made a controller, in three passes. The plan needs a generator or controller that plays samples up to the highest voltage at the actuator, and a recorder of voltage and position by the same clock."),
  el("div", { class: "fields" },
    field("campaign", "top_v", "Highest voltage at the actuator, V", "--top-v", "such as 150", value("top_v"), { required: true }),
    field("campaign", "rate_hz", "Sample rate of your controller, Hz", "--rate-hz", "such as 50000", value("rate_hz"), { required: true }),
    field("campaign", "latency_us", "Its latency, reading to command, µs", "--latency-us", "may be given later", value("latency_us"))),
  known ? el("p", { class: "hint" }, "Filled in from the recordings of this session; correct what is not so.") : null,
  el("p", {}, el("button", { type: "submit", id: "campaign-plan", class: "main", disabled: lab.state.job.running }, "Make the plan")));
}

/** The commands to be played: download, and how. */
function playPart(campaign, pass) {
  const last = campaign.passes.length - 1;
  const earlier = Array.from({ length: pass }, (_, k) => k);
  const title = (k) => (k === 0 ? "Download the plan" : `Download pass ${k}`);
  const zip = (k, attributes) => el("a", { href: `api/export/plan?pass=${k}`, download: true, ...attributes }, title(k));
  return el("section", { class: "panel" }, el("h4", {}, pass === 0 ? "1. Play and record the plan" : `1. Play and record the next pass, ${pass} of 2`),
    pass > 0 ? el("p", {}, "Made with what is known so far; what was recorded before stays.") : null,
    el("p", { class: "row" }, zip(Math.min(pass, last), { class: "button", id: "campaign-download" }), earlier.map((k) => zip(k, { class: "button quiet" }))),
    printed("campaign-words", "What is played", campaign.passes[Math.min(pass, last)]),
    pass === 0 ? command(campaign.command) : null);
}

function status(words) {
  const line = document.getElementById("campaign-status");
  if (line) line.textContent = words;
}

/** How what came back is looked at. */
function look(lab) {
  const { campaign } = lab.state;
  const latency_us = campaign.latency_us === null ? typed(given.back_latency_us ?? "") : null;
  const sensor_bandwidth_hz = typed(given.sensor_bandwidth_hz ?? exact(campaign.sensor_bandwidth_hz) ?? "");
  return lab.act({ what: "campaign-look", looked: { latency_us, sensor_bandwidth_hz, short_rests: given.short_rests ?? campaign.short_rests } });
}

/** Sends files that came back, then has all of them looked at. */
async function bringBack(lab, files) {
  const { list, skip } = wanted(files);
  list.sort((a, b) => a.path.localeCompare(b.path, "en", { numeric: true }));
  const refused = [];
  const known = [];
  for (const [index, { file, path }] of list.entries()) {
    status(`Reading ${file.name} (${index + 1} of ${list.length})`);
    try { known.push(...(await sendBack(file, path.slice(skip))).known); } catch (error) { refused.push(error.message); }
  }
  await lab.refresh();
  status(known.length ? `There already: ${known.join(", ")}.` : "");
  if (!list.length) refused.push("There is no recording among these files: a recording is .csv, .tsv, .txt, .dat, .asc or .mat, or a zip with such files.");
  if (list.length > refused.length + known.length) await look(lab);
  if (refused.length) lab.say(new Error(refused.join("\n")), "campaign-drop");
}

function dropZone(lab) {
  const off = lab.state.job.running;
  const input = el("input", { type: "file", id: "campaign-files", class: "file", multiple: true, disabled: off, change: () => bringBack(lab, chosen(input)) });
  return el("div", { class: "drop", id: "campaign-drop",
    dragover: (event) => { event.preventDefault(); event.currentTarget.classList.add("over"); },
    dragleave: (event) => event.currentTarget.classList.remove("over"),
    drop: async (event) => {
      event.preventDefault();
      event.currentTarget.classList.remove("over");
      if (!off) bringBack(lab, await dropped(event.dataTransfer));
    } },
  el("p", { class: "lead" }, "Drop what came back here"),
  el("p", { class: "hint" }, "Any names, any order; a file for each command or one of all.csv; voltage at the actuator and position."),
  el("p", { class: "choose" }, input, el("label", { for: "campaign-files", class: "button" }, "Choose files")),
  el("p", { id: "campaign-status", role: "status" }));
}

/** The files, each with what it was taken for. */
function filesPart(lab, campaign) {
  const records = campaign.back ? campaign.back.records : [];
  const item = (name, index) => {
    const is = records.filter(({ from }) => from === name).map((record) => record.name);
    const words = !campaign.back ? "not looked at yet" : is.length > 3 ? `${is.length} records of the plan` : is.length ? is.join(", ") : "no record of the plan";
    return el("li", {}, el("span", {}, el("strong", {}, name), `: ${words}`),
      el("button", { type: "button", class: "small", id: `campaign-forget-${index}`, "aria-label": `Take away: ${name}`, disabled: lab.state.job.running, click: async () => {
        if (!await lab.act({ what: "campaign-forget", file: name })) return;
        await lab.refresh();
        look(lab);
      } }, "Take away"));
  };
  return el("ul", { class: "came", id: "campaign-came", "aria-label": "Files that came back" }, campaign.files.map(item));
}

/** How the files are read, where the columns are taken wrongly. */
function readingForm(lab, campaign) {
  const { fields, typedIn } = readingFields("campaign", campaign.reading);
  const made = el("form", { id: "campaign-reading", submit: async (event) => {
    event.preventDefault();
    if (!await lab.act({ what: "campaign-reading", reading: typedIn(made) })) return;
    await lab.refresh();
    if (lab.state.campaign.files.length) look(lab);
  } }, fields, el("p", {}, el("button", { type: "submit", id: "campaign-read", disabled: lab.state.job.running }, "Read the files so")));
  return made;
}

const SIGNS = { refused: ["✕", "mend this", "look"], doubts: ["!", "doubt", "look"], notes: ["i", "note", "cannot-tell"] };

/** The file of the record that a sentence begins with. */
function fileOf(back, words) {
  const about = back.records.find(({ name }) => words.startsWith(`${name} `) || words.startsWith(`${name}:`));
  return about && about.from ? el("span", { class: "hint" }, ` (in ${about.from})`) : null;
}

/** What is to be said of the files, in kinds. */
function findings(back, id, kinds) {
  const said = kinds.flatMap((kind) => back[kind].map((words) => [kind, words]));
  if (!said.length) return null;
  return el("ul", { class: "lights", id }, said.map(([kind, words]) => {
    const [sign, name, shine] = SIGNS[kind];
    return el("li", { class: shine }, el("span", { class: "shine" }, el("span", { "aria-hidden": "true" }, sign), ` ${name}`), el("span", {}, text(words), fileOf(back, words)));
  }));
}

/** Whether a record should be there and is not: of the first pass, and of those of which something came back. */
const lacks = (back, { pass, from }) => from === null && (pass === 0 || back.records.some((record) => record.pass >= pass && record.from !== null));

/** The planned records, each with the file that it was found in. */
function recordsTable(back) {
  const rows = back.records.map(({ name, pass, tells, seconds, from }) => [name, right(String(pass)), from ?? (lacks(back, { pass, from }) ? "not there" : "to be recorded"), right(quantity(seconds, "s")), { element: el("span", { class: "words" }, tells) }]);
  return table("Records of the plan", ["Record", "Pass", "Found in", "Length", "What it tells"], rows);
}

/** The options of the look, and the look again. */
function lookForm(lab, campaign) {
  return el("form", { id: "campaign-look-form", submit: (event) => { event.preventDefault(); look(lab); } },
    el("div", { class: "fields" },
      campaign.latency_us === null ? field("campaign", "back_latency_us", "Latency of your controller, µs", "--latency-us", "needed, 0 to 10000", given.back_latency_us ?? null) : null,
      field("campaign", "sensor_bandwidth_hz", "Bandwidth of your sensor, Hz", "--sensor-bandwidth-hz", "where it filters", given.sensor_bandwidth_hz ?? exact(campaign.sensor_bandwidth_hz))),
    el("p", {}, el("input", { id: "campaign-short_rests", type: "checkbox", checked: given.short_rests ?? campaign.short_rests, change: (event) => { given.short_rests = event.target.checked; } }), " ",
        el("label", { for: "campaign-short_rests" }, "Take records that began while the stage moved ", el("code", { class: "option" }, "--short-rests"))),
    el("p", {}, el("button", { type: "submit", id: "campaign-look", class: campaign.back ? "" : "main", disabled: lab.state.job.running }, campaign.back ? "Look at them again" : "Look at them")));
}

/** Whether all passes were recorded, so that a controller can be designed. */
export const done = (campaign) => Boolean(campaign && campaign.back && campaign.back.said !== null && campaign.back.next === null);

/** One sentence that says where the campaign stands. */
function verdict(back) {
  const { records, refused, said, next } = back;
  const there = records.filter(({ from }) => from !== null).length;
  const found = `${there} of ${there + records.filter((record) => lacks(back, record)).length} records found`;
  if (refused.length) return `${found}. They cannot be used yet: ${refused.length === 1 ? "one thing is" : `${refused.length} things are`} to be mended.`;
  if (said === null) return `${found}.`;
  return next === null ? `${found}. The campaign is complete.` : `${found}. The next pass is ready.`;
}

/** A part that is closed until it is asked for, or until something in it is to be mended. */
const part = (id, title, shown, ...children) => el("details", { id, open: shown }, el("summary", {}, title), ...children);

/** What came back and what follows, the drop zone, and all that was found in the files. */
function backPart(lab, campaign) {
  const { back, files } = campaign;
  const wrong = Boolean(back && back.refused.length);
  const unsaid = !back && files.length > 0;
  return el("section", { class: "panel" }, el("h4", {}, done(campaign) ? "What came back" : "2. Bring what came back"),
    back ? el("p", { id: "campaign-verdict", class: wrong ? "notice" : "told" }, verdict(back)) : null,
    back ? findings(back, "campaign-findings", ["refused", "doubts"]) : null,
    done(campaign) ? el("p", {}, el("a", { class: "button", id: "campaign-design", href: "#controller/campaign" }, campaign.controller ? "To its controller" : "Design the controller")) : null,
    dropZone(lab),
    unsaid ? lookForm(lab, campaign) : null,
    files.length ? part("campaign-files-part", `Files that came back (${files.length})`, wrong || unsaid, filesPart(lab, campaign)) : null,
    back ? part("campaign-records-part", "Which record is in which file", back.records.some((record) => lacks(back, record)), recordsTable(back)) : null,
    back && back.notes.length ? part("campaign-notes-part", `Notes (${back.notes.length})`, false, findings(back, "campaign-notes", ["notes"])) : null,
    back && back.said !== null ? part("campaign-said-part", "What was identified", false, printed("campaign-said", "What was identified", back.said)) : null,
    part("campaign-reading-part", "Correct columns, units, rate", false, readingForm(lab, campaign)),
    back ? lookForm(lab, campaign) : null,
    back ? command(back.command) : null);
}

/** Where the campaign ends, on a second word. */
function endPart(lab) {
  return el("p", {}, el("button", { type: "button", class: "small", id: "campaign-end", disabled: lab.state.job.running, click: () => {
    if (confirm("End this campaign? Its plan, what came back and its controller are taken away.")) {
      for (const name of Object.keys(given)) delete given[name];
      lab.act({ what: "campaign-end" });
    }
  } }, "End this campaign"));
}

/** The section of the page, closed until it is asked for. */
export async function campaignPart(lab) {
  const { campaign } = lab.state;
  const made = el("details", { id: "campaign", class: "campaign", open, toggle: () => { open = made.open; } }, el("summary", {}, el("h3", {}, "Campaign: records from your own stage")));
  if (!campaign) {
    made.append(planForm(lab, await ask("campaign/usual")));
    return made;
  }
  const { back, passes, latency_us } = campaign;
  const pass = back && back.said !== null && back.next !== null ? back.next : passes.length - 1;
  const latency = latency_us === null ? "not given yet" : quantity(1e-6 * latency_us, "s");
  made.append(el("p", { class: "hint" }, `Up to ${num(campaign.top_v)} V, ${quantity(campaign.rate_hz, "Hz")}, latency ${latency}.`),
    done(campaign) ? "" : playPart(campaign, pass), backPart(lab, campaign), endPart(lab));
  return made;
}
