// Recordings: dropped, previewed, corrected, taken. And the form that fits a model.
import { ask, tell, send } from "./api.js";
import { el, table, command, panel, right, typed } from "./dom.js";
import { count, quantity } from "./numbers.js";
import { timePlot, loopPlot, COLOURS } from "./plots.js";
import { effectName } from "./effects.js";
import { challengeNotice } from "./riddle.js";
import { smallPictures } from "./small.js";
import { staleNotice } from "./stale.js";
import { tourButton } from "./tour.js";

const FAMILIES = [
  ["mrpi", "MRPI: rate-dependent (the paper's)"], ["mpi", "MPI: with a cubic input function"], ["pi", "PI: plays alone"],
  ["wrpi", "WRPI: rate-dependent weights"], ["play-polynomial", "Play-polynomial: a cubic of each play"],
];

/** All files of a drop with their paths, folders opened. */
export async function dropped(transfer) {
  const walk = async (entry) => {
    if (entry.isFile) return [{ file: await new Promise((done, failed) => entry.file(done, failed)), path: entry.fullPath.replace(/^\//, "") }];
    const reader = entry.createReader();
    const files = [];
    for (;;) {
      const entries = await new Promise((done, failed) => reader.readEntries(done, failed));
      if (entries.length === 0) return files;
      for (const inner of entries) files.push(...await walk(inner));
    }
  };
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry && item.webkitGetAsEntry()).filter(Boolean);
  return (await Promise.all(entries.map(walk))).flat();
}

const RECORDING = /(^|\/)([^./][^/]*\.(csv|tsv|txt|dat|mat|asc|zip)|dataset\.toml)$/i;

/** The folder that all are in says nothing about which is which. */
function common(paths) {
  let folder = paths[0].slice(0, paths[0].lastIndexOf("/") + 1);
  while (!paths.every((path) => path.startsWith(folder))) folder = folder.slice(0, folder.lastIndexOf("/", folder.length - 2) + 1);
  return folder.length;
}

/** The recordings among files, and how much of their paths says nothing. */
export function wanted(files) {
  const list = files.length > 1 ? files.filter(({ path }) => RECORDING.test(path)) : files;
  return { list, skip: list.length ? common(list.map(({ path }) => path)) : 0 };
}

/** Sends files; `asked` is the step whose diagnosis asked for them. */
export async function bring(lab, files, asked = null) {
  const { list, skip } = wanted(files);
  const refused = [];
  const known = [];
  for (const [index, { file, path }] of list.entries()) {
    status(`Reading ${file.name} (${index + 1} of ${list.length})`);
    try { known.push(...(await send(file, path.slice(skip), asked)).known); } catch (error) { refused.push(error.message); }
  }
  again = false;
  await lab.refresh();
  status(known.length ? `In the project already: ${known.join(", ")}.` : "");
  // What the cards say of their files is not said twice.
  const told = lab.state.files.map((file) => file.error);
  const more = refused.filter((message) => !message.split("\n").every((line) => told.some((said) => said && said.split("\n").includes(line))));
  lab.say(more.length ? new Error(more.join("\n")) : list.length ? null : new Error("There is no recording among these files: a recording is .csv, .tsv, .txt, .dat, .asc or .mat, or a zip with such files."), "drop");
}

/** Files chosen one by one. */
export const chosen = (input) => [...input.files].map((file) => ({ file, path: file.webkitRelativePath || file.name }));

function status(text) {
  const line = document.getElementById("bring-status");
  if (line) line.textContent = text;
}

function dropZone(lab) {
  const input = el("input", { type: "file", id: "files", class: "file", multiple: true, change: () => bring(lab, chosen(input)) });
  const folder = el("input", { type: "file", id: "folder-files", class: "file", webkitdirectory: true, change: () => bring(lab, chosen(folder)) });
  return el("div", { class: "drop", id: "drop",
    dragover: (event) => { event.preventDefault(); event.currentTarget.classList.add("over"); },
    dragleave: (event) => event.currentTarget.classList.remove("over"),
    drop: async (event) => {
      event.preventDefault();
      event.currentTarget.classList.remove("over");
      bring(lab, await dropped(event.dataTransfer));
    } },
  el("p", { class: "lead" }, "Drop recordings here"),
  el("p", { class: "hint" }, "CSV of any dialect, MATLAB .mat, PI GCS arrays; files, a folder, or a zip. They stay on this computer."),
  el("p", { class: "choose" }, input, el("label", { for: "files", class: "button" }, "Choose files"), " ", folder, el("label", { for: "folder-files", class: "button quiet" }, "Choose a folder")),
  el("p", { id: "bring-status", role: "status" }),
  el("progress", { id: "reading-share", max: "100", value: "0", "aria-label": "Read of the file", hidden: true }));
}

/** Begins anew; where models end with it, only on a second word. */
function beginAnew(lab, deed) {
  const count = lab.state.steps.length;
  if (count && !confirm(`Begin anew? The data of this session and ${many(count, "model")} end with it. A new project (above, Projects) keeps them.`)) return;
  again = false;
  lab.act(deed);
}

function starts(lab) {
  return el("ul", { class: "starts" }, lab.state.starts.map((start) => el("li", { class: "card" },
    el("h3", {}, start.title), el("p", {}, start.about),
    el("button", { type: "button", id: `start-${start.name}`, "aria-label": `Begin with it: ${start.title}`, disabled: lab.state.job.running, click: () => beginAnew(lab, { what: "start", name: start.name }) }, "Begin with it"))));
}

/** The fields that say how a file is read, and what is typed into them; `mark` tells their ids apart. */
export function readingFields(mark, reading) {
  const id = (name) => `${name}-${mark}`;
  const field = (name, title, attributes) => el("p", {}, el("label", { for: id(name) }, title), el("input", { id: id(name), ...attributes }));
  const select = (name, title, value, options) => el("p", {}, el("label", { for: id(name) }, title),
    el("select", { id: id(name) }, options.map(([option, words]) => el("option", { value: option, selected: option === (value || "refuse") }, words))));
  const column = (quantity) => (reading.columns.find((text) => text.startsWith(`${quantity}=`)) || "").slice(quantity.length + 1);
  const typedIn = (form) => {
    const value = (name) => form.querySelector(`#${id(name)}`).value.trim();
    const columns = ["time", "voltage", "position"].filter((q) => value(`column-${q}`)).map((q) => `${q}=${value(`column-${q}`)}`);
    // Columns that have no field here stay as they are.
    columns.push(...reading.columns.filter((text) => !/^(time|voltage|position)=/.test(text)));
    return { columns, rate_hz: typed(value("rate")), missing: value("missing"), gaps: value("gaps"), jitter: value("jitter") };
  };
  const fields = [
    el("p", { class: "hint" }, "Where a column was taken wrongly, say which it is by its name or number, then its unit and factor: CH1:mV*20 is the column CH1 in millivolts, times 20; :um corrects the unit alone."),
    el("div", { class: "fields" },
      ...["time", "voltage", "position"].map((q) => field(`column-${q}`, `Column of ${q}`, { value: column(q), placeholder: "as found" })),
      field("rate", "Sample rate, Hz", { type: "number", step: "any", min: "0", value: reading.rate_hz ?? "", placeholder: "from the time" }),
      select("missing", "Empty cells", reading.missing, [["refuse", "refuse the file"], ["trim", "cut off at the ends"], ["interpolate", "interpolate"]]),
      select("gaps", "Gaps in time", reading.gaps, [["refuse", "refuse the file"], ["split", "split into records"]]),
      select("jitter", "Uneven time stamps", reading.jitter, [["refuse", "refuse the file"], ["clock", "trust the clock"], ["interpolate", "interpolate"]]))];
  return { fields, typedIn };
}

/** How a file is read, to be corrected; for it alone or for all files that are shown. */
function readingForm(lab, file, index, others) {
  const id = (name) => `${name}-${index}`;
  const { fields, typedIn } = readingFields(index, file.reading);
  const others_too = others.filter((name) => name !== file.name);
  const read = async (files) => {
    try {
      await tell("reading", { files, reading: typedIn(form) });
      lab.say(null);
    } catch (error) { lab.say(error, id("reading")); }
  };
  const form = el("form", { class: "reading", id: id("reading"), submit: (event) => { event.preventDefault(); read([file.name]); } },
    fields,
    el("p", { class: "row" },
      el("button", { type: "submit", id: id("read-again") }, others_too.length ? "Read this file again" : "Read again"),
      others_too.length ? el("button", { type: "button", id: id("read-all"), click: () => read([file.name, ...others_too]) }, `Read all ${others_too.length + 1} files so`) : null));
  return el("details", { id: id("correct"), open: Boolean(file.error) }, el("summary", {}, "Correct columns, units, rate"), form);
}

const periodOf = (r) => right(r.period_samples ? quantity(r.period_samples / r.rate_hz, "s") : "none found");
const COLUMNS = ["Samples", "Sample rate", "Length", "Period"];
const measures = (r) => [right(count(r.samples)), right(quantity(r.rate_hz, "Hz")), right(quantity(r.seconds, "s")), periodOf(r)];

const ROLES = [["identify", "fit the model"], ["validate", "judge the model"]];
const MANIFEST = "dataset.toml";

/** What a recording is used for, and how that is changed. */
function roleSelect(id, role, change, attributes = {}) {
  const select = el("select", { id, ...attributes, change: () => change(select.value) }, ROLES.map(([name, words]) => el("option", { value: name, selected: name === role }, words)));
  return select;
}

/** The words for a record that a diagnosis asked for. */
const askedBy = (lab, step) => (step === null || step === undefined ? null : `the record that the diagnosis of step ${step + 1}${lab.state.steps[step] ? `, ${lab.state.steps[step].title},` : ""} asked for`);

function fileCard(lab, file, others) {
  const index = lab.state.files.indexOf(file);
  const id = `role-${index}`;
  const role = roleSelect(id, file.role, async (value) => { try { await tell("use", { file: file.name, role: value }); } catch (error) { lab.say(error, id); } });
  const asked = askedBy(lab, file.asked_by);
  const manifest = file.name === MANIFEST;
  return el("article", { class: file.error ? "card bad" : "card" },
    el("h3", {}, file.name),
    asked ? el("p", { class: "hint" }, `Brought as ${asked}.`) : null,
    file.error ? el("p", { class: "refused" }, file.error) : el("pre", { tabindex: "0", "aria-label": `What was found in ${file.name}` }, file.preview),
    file.records.length ? table(`Records in ${file.name}`, ["Record", ...COLUMNS], file.records.map((r) => [r.file, ...measures(r)])) : null,
    el("p", { class: "row" },
      manifest || file.error ? null : el("span", {}, el("label", { for: id }, "Used to "), role),
      el("button", { type: "button", class: "small", id: `forget-${index}`, "aria-label": `Take away ${file.name}`, click: async () => { try { await tell("forget", { name: file.name }); lab.say(null); } catch (error) { lab.say(error, "drop"); } } }, "Take away")),
    manifest ? null : readingForm(lab, file, index, others));
}

/** A record as it came: over time, and as a loop. */
export function rawView(lab, of, records) {
  const id = `raw-record-${of}`;
  const select = el("select", { id, change: () => { strip.mark(select.selectedIndex); show(); } }, records.map((record, index) => el("option", { value: record.index ?? index }, record.file)));
  const time = el("div", { class: "plot", id: `${id}-time` });
  const loop = el("div", { class: "plot", id: `${id}-loop` });
  const numbers = records.map((record, index) => record.index ?? index);
  const strip = smallPictures({ of }, "All records, their voltage and position over time", (index) => records[index].file, () => select.selectedIndex, (index) => { select.selectedIndex = index; show(); }, numbers);
  const view = el("div", {}, records.length > 1 ? strip : null, el("p", {}, el("label", { for: id }, "Look at "), select,
    el("span", { class: "hint" }, " Wheel zooms, Shift and wheel pans, double click shows all; by keyboard: arrows, plus, minus, 0.")),
  el("div", { class: "wide-narrow" }, panel("Over time", time), panel("Loop", loop)));
  let chart = null;
  const fetchPoints = (range) => ask("raw", { of, record: select.value, width: 1200, ...range });
  async function show() {
    const { points, loop: path } = await fetchPoints({});
    time.replaceChildren();
    loop.replaceChildren();
    chart = timePlot(time, points, [
      { label: "voltage, V", colour: COLOURS.input, scale: "v" }, { label: "position, µm", colour: COLOURS.measured, scale: "y" },
    ], async (from, to) => { const more = await fetchPoints({ from, to }); chart.renew(more.points); }, { name: `record ${select.selectedOptions[0].text}` });
    loopPlot(loop, [{ label: "position over voltage", colour: COLOURS.measured, path }], "voltage, V", "position, µm", 275, `loop ${select.selectedOptions[0].text}`);
    document.body.dataset.firstPicture = performance.now();
  }
  // What takes longer on long records comes after the first picture.
  view.first = new Promise((done) => view.addEventListener("shown", () => show().finally(done)));
  if (records.length > 1) view.first.then(() => strip.dispatchEvent(new CustomEvent("fill")));
  return view;
}

const many = (count, one, more = `${one}s`) => `${count} ${count === 1 ? one : more}`;

/** That other data end the models there are. */
const end = (state) => (state.steps.length ? el("p", { class: "notice" }, `Beginning anew takes the place of the data of this session; its models (${state.steps.length}) end with them. Export what should stay.`) : null);

/** Files as cards, and their records as pictures. */
function found(lab, files, views) {
  const records = files.flatMap((file) => file.records);
  const names = files.filter((file) => file.name !== MANIFEST).map((file) => file.name);
  // A picture's record goes by its place among all that were brought.
  const all = lab.state.files.flatMap((file) => file.records.map((record) => ({ file, record })));
  const own = all.map(({ file, record }, index) => ({ ...record, index, of: file })).filter((record) => files.includes(record.of));
  const view = records.length ? rawView(lab, "files", own) : null;
  if (view) views.push(view);
  return [el("div", { class: "cards" }, files.map((file) => fileCard(lab, file, names))), view];
}

/** Which files are left out, where others can be used. */
function leftOut(files) {
  const bad = files.filter((file) => file.error).map((file) => file.name);
  if (!bad.length || bad.length === files.length) return null;
  const [are, their, them] = bad.length === 1 ? ["is", "its", "it"] : ["are", "their", "them"];
  return el("p", { class: "notice", id: "left-out" }, `${bad.join(", ")} cannot be read and ${are} left out: correct ${their} columns, or take ${them} away.`);
}

/** Why a button cannot be pressed; it says so itself. */
function deed(lab, id, title, kind, why, click) {
  return el("p", {}, el("button", { type: "button", id, class: kind, disabled: Boolean(why) || lab.state.job.running, "aria-describedby": why ? `${id}-why` : null, click }, title),
    why ? el("span", { class: "hint", id: `${id}-why` }, ` ${why}`) : null);
}

/** Files that wait to be used. */
function waiting(lab, files, views) {
  const { state } = lab;
  const records = files.flatMap((file) => file.records);
  const judging = files.some((file) => file.role === "validate") || (state.data && state.data.records.some((r) => r.role === "validate"));
  const why = records.length ? null : files.some((file) => file.error) ? "No file can be read yet: see what is said of each, and correct it." : "No recording is among them.";
  return [
    el("h2", {}, "What was found"),
    leftOut(files),
    judging || records.length < 2 ? null : el("p", { class: "notice" }, "No file is kept to judge the model by. Let one that was recorded differently judge it: only that tells whether a model holds beyond its own data."),
    state.data
      ? deed(lab, "add-files", records.length ? `Add ${many(records.length, "record")} to the project` : "Add to the project", "main", why, () => lab.act({ what: "add-files" }))
      : deed(lab, "use", records.length && files.some((file) => file.error) ? "Use the recordings that can be read" : "Use these recordings", "main", why, () => lab.act({ what: "take-files" })),
    state.data && state.steps.length && records.length ? el("p", { class: "hint" }, "Data and models that are there stay. The models are marked as fitted before these records, until you fit them anew.") : null,
    ...found(lab, files, views),
  ];
}

/** The records of the data; what each is used for can be changed. */
function records(lab) {
  const { data, job } = lab.state;
  const role = (r, index) => ({ element: roleSelect(`record-role-${index}`, r.role, async (value) => { if (!await lab.act({ what: "role", record: r.file, role: value })) lab.redraw(); }, { "aria-label": `${r.file} is used to`, disabled: job.running }) });
  const came = (r) => (r.came_in ? `${r.came_in}${r.asked_by === null ? "" : `, asked for by step ${r.asked_by + 1}`}` : "with the data");
  const files = data.records.some((r) => r.came_in);
  return table("Records", ["Record", "Used to", "Excitation", ...(files ? ["Came in"] : []), ...COLUMNS],
    data.records.map((r, index) => [r.file, role(r, index), { element: el("span", { class: "words" }, r.excitation || "–") }, ...(files ? [came(r)] : []), ...measures(r)]));
}

/** What these records can tell of the effects, and what they cannot, whatever model is fitted. */
function toldPart(first) {
  const part = panel("What these records can tell", el("p", { class: "hint" }, "Looking through the records."));
  part.id = "told";
  part.addEventListener("shown", async () => {
    await first;
    const { reasons, effects } = await ask("told");
    const [can, cannot] = [effects.filter((e) => e.refused === null), effects.filter((e) => e.refused !== null)];
    const sentence = (words) => `${words.charAt(0).toUpperCase()}${words.slice(1)}.`;
    part.replaceChildren(part.firstChild,
      reasons.length ? el("ul", {}, reasons.map((words) => el("li", {}, el("strong", {}, "Look here: "), sentence(words)))) : "",
      el("p", {}, can.length ? `They can show ${can.map((e) => effectName(e.name)).join(", ")}. From which strength on, a diagnosis says.` : "They can show no effect."),
      cannot.length ? el("ul", {}, cannot.map((e) => el("li", {}, `Nothing of ${effectName(e.name)}: ${e.refused}.`))) : "");
  });
  return part;
}

/** The data of the session. */
function taken(lab, views) {
  const { data, steps } = lab.state;
  const view = rawView(lab, "data", data.records);
  const told = toldPart(view.first);
  views.push(view, told);
  return [
    el("h2", {}, `The data: ${data.name}`),
    challengeNotice(lab),
    records(lab),
    ...data.notices.map((notice) => el("p", { class: "notice" }, notice)),
    told,
    view,
    el("p", {}, el("a", { class: steps.length ? "button quiet" : "button", href: "#fit", id: "to-fit" }, steps.length ? "Fit another model" : "Choose a model")),
    data.command ? command(data.command) : null,
  ];
}

let again = false;

/** Begin anew: the files that were brought, corrected, or a starting point. */
function anew(lab, views) {
  const { state } = lab;
  const brought = state.files.filter((file) => file.stands !== "waits");
  const redraw = (value) => { again = value; lab.redraw(); };
  const box = el("details", { class: "other", open: again }, el("summary", {}, "Begin anew"));
  if (again && brought.length) {
    const usable = state.files.some((file) => file.records.length);
    box.append(el("h2", {}, "All files that were brought"), end(state) || "", leftOut(state.files) || "",
      deed(lab, "use", "Begin anew with these recordings", "", usable ? null : "No file can be read yet.", () => beginAnew(lab, { what: "take-files" })),
      ...found(lab, state.files, views).filter(Boolean),
      el("p", {}, el("button", { type: "button", click: () => redraw(false) }, "Back to the data")));
    return box;
  }
  if (brought.length) box.append(el("p", {}, el("button", { type: "button", id: "files-again", click: () => redraw(true) }, `Correct the files that were brought (${brought.length}), then begin anew`)));
  box.append(el("p", {}, brought.length ? "Or begin anew with" : "Begin anew with"), starts(lab), end(state) || "");
  return box;
}

export async function dataPage(lab) {
  const { state } = lab;
  const views = [];
  const page = el("div", {});
  const files = state.files.filter((file) => file.stands === "waits");
  if (!state.data) {
    page.append(el("h2", {}, "Bring recordings"));
    if (!files.length) page.append(el("p", {}, "From recordings of a piezo stage to a model that explains them: go the way above from left to right. ", tourButton(lab)));
    page.append(dropZone(lab));
    if (files.length) page.append(...waiting(lab, files, views).filter(Boolean));
    else page.append(el("h2", {}, "Or begin with"), starts(lab));
  } else {
    const wait = files.length && !again ? waiting(lab, files, views).filter(Boolean) : [];
    const more = [el("h2", {}, "Bring more recordings"), dropZone(lab), ...wait];
    const data = taken(lab, views).filter(Boolean);
    // What is to be decided now comes first.
    const first = wait.length && files.some((file) => file.records.length) ? [...more, ...data] : [...data, ...more];
    page.append(staleNotice(lab) || "", ...first, anew(lab, views));
  }
  page.addEventListener("shown", () => views.forEach((view) => view.dispatchEvent(new CustomEvent("shown"))));
  return page;
}

/** What was chosen last: news must not take it away. */
const wish = { model: "mrpi", plays: "10" };

export function fitForm(lab) {
  const model = el("select", { id: "model", change: () => { wish.model = model.value; } }, FAMILIES.map(([value, title]) => el("option", { value, selected: value === wish.model }, title)));
  const plays = el("input", { id: "plays", type: "number", min: "1", max: "64", value: wish.plays, required: true, input: () => { wish.plays = plays.value; } });
  return el("form", { class: "fit panel", id: "fit-form", submit: (event) => {
    event.preventDefault();
    lab.act({ what: "fit", model: model.value, plays: Number(plays.value) }, "compare");
  } },
  el("p", {}, el("label", { for: "model" }, "Hysteresis model"), model),
  el("p", {}, el("label", { for: "plays" }, "Play operators, 1 to 64"), plays),
  el("p", {}, el("button", { type: "submit", class: "main", id: "fit", disabled: lab.state.job.running }, "Fit"), " ",
    el("button", { type: "button", id: "learn", disabled: lab.state.job.running, click: () => {
      if (plays.reportValidity()) lab.act({ what: "learn", model: model.value, plays: Number(plays.value) }, "ladder");
    } }, "Learn")),
  el("p", { class: "hint wide" }, "Fit makes the hysteresis model alone. Learn goes on by itself: it adds effect after effect, as long as the records not fitted to confirm it. Each step stands on the ladder, and other models stay."));
}
