// Recordings: dropped, previewed, corrected, taken. And the form that fits a model.
import { ask, tell, send } from "./api.js";
import { el, table, command, panel, right, typed } from "./dom.js";
import { count, quantity } from "./numbers.js";
import { timePlot, loopPlot, COLOURS } from "./plots.js";
import { challengeNotice } from "./riddle.js";

const FAMILIES = [
  ["mrpi", "MRPI: rate-dependent (the paper's)"], ["mpi", "MPI: with a cubic input function"], ["pi", "PI: plays alone"],
  ["wrpi", "WRPI: rate-dependent weights"], ["play-polynomial", "Play-polynomial: a cubic of each play"],
];

/** All files of a drop with their paths, folders opened. */
async function dropped(transfer) {
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

const chosen = (input) => [...input.files].map((file) => ({ file, path: file.webkitRelativePath || file.name }));
const RECORDING = /(^|\/)([^./][^/]*\.(csv|tsv|txt|dat|mat|asc|zip)|dataset\.toml)$/i;

/** The folder that all are in says nothing about which is which. */
function common(paths) {
  let folder = paths[0].slice(0, paths[0].lastIndexOf("/") + 1);
  while (!paths.every((path) => path.startsWith(folder))) folder = folder.slice(0, folder.lastIndexOf("/", folder.length - 2) + 1);
  return folder.length;
}

async function bring(lab, files) {
  const wanted = files.length > 1 ? files.filter(({ path }) => RECORDING.test(path)) : files;
  const skip = wanted.length ? common(wanted.map(({ path }) => path)) : 0;
  const refused = [];
  for (const [index, { file, path }] of wanted.entries()) {
    status(`Reading ${file.name} (${index + 1} of ${wanted.length})`);
    try { await send(file, path.slice(skip)); } catch (error) { refused.push(error.message); }
  }
  status("");
  await lab.refresh();
  lab.say(refused.length ? new Error(refused.join("\n")) : wanted.length ? null : new Error("There is no recording among these files: a recording is .csv, .tsv, .txt, .dat, .asc or .mat, or a zip with such files."), "drop");
}

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
  el("p", { id: "bring-status", role: "status" }));
}

function starts(lab) {
  return el("ul", { class: "starts" }, lab.state.starts.map((start) => el("li", { class: "card" },
    el("h3", {}, start.title), el("p", {}, start.about),
    el("button", { type: "button", id: `start-${start.name}`, "aria-label": `Begin with it: ${start.title}`, disabled: lab.state.job.running, click: () => lab.act({ what: "start", name: start.name }) }, "Begin with it"))));
}

function readingForm(lab) {
  const { reading } = lab.state;
  const field = (id, title, attributes) => el("p", {}, el("label", { for: id }, title), el("input", { id, ...attributes }));
  const select = (id, title, value, options) => el("p", {}, el("label", { for: id }, title),
    el("select", { id }, options.map(([name, words]) => el("option", { value: name, selected: name === (value || "refuse") }, words))));
  const column = (quantity) => (reading.columns.find((text) => text.startsWith(`${quantity}=`)) || "").slice(quantity.length + 1);
  const form = el("form", { class: "reading", id: "reading", submit: async (event) => {
    event.preventDefault();
    const value = (id) => form.querySelector(`#${id}`).value.trim();
    const columns = ["time", "voltage", "position"].filter((q) => value(`column-${q}`)).map((q) => `${q}=${value(`column-${q}`)}`);
    try {
      await tell("reading", { columns, rate_hz: typed(value("rate")), missing: value("missing"), gaps: value("gaps"), jitter: value("jitter"), validate: reading.validate });
      lab.say(null);
    } catch (error) { lab.say(error, "reading"); }
  } },
  el("p", { class: "hint" }, "Where a column was taken wrongly, say which it is by its name or number, then its unit and factor: CH1:mV*20 is the column CH1 in millivolts, times 20; :um corrects the unit alone."),
  el("div", { class: "fields" },
    ...["time", "voltage", "position"].map((q) => field(`column-${q}`, `Column of ${q}`, { value: column(q), placeholder: "as found" })),
    field("rate", "Sample rate, Hz", { type: "number", step: "any", min: "0", value: reading.rate_hz ?? "", placeholder: "from the time" }),
    select("missing", "Empty cells", reading.missing, [["refuse", "refuse the file"], ["trim", "cut off at the ends"], ["interpolate", "interpolate"]]),
    select("gaps", "Gaps in time", reading.gaps, [["refuse", "refuse the file"], ["split", "split into records"]]),
    select("jitter", "Uneven time stamps", reading.jitter, [["refuse", "refuse the file"], ["clock", "trust the clock"], ["interpolate", "interpolate"]])),
  el("button", { type: "submit", id: "read-again" }, "Read again"));
  return el("details", { id: "correct", open: lab.state.files.some((file) => file.error) }, el("summary", {}, "Correct columns, units, rate"), form);
}

const periodOf = (r) => right(r.period_samples ? quantity(r.period_samples / r.rate_hz, "s") : "none found");
const COLUMNS = ["Samples", "Sample rate", "Length", "Period"];
const measures = (r) => [right(count(r.samples)), right(quantity(r.rate_hz, "Hz")), right(quantity(r.seconds, "s")), periodOf(r)];

function fileCard(lab, file) {
  const { reading } = lab.state;
  const index = lab.state.files.indexOf(file);
  const id = `role-${index}`;
  const role = el("select", { id, change: async () => {
    const validate = reading.validate.filter((name) => name !== file.name).concat(role.value === "validate" ? [file.name] : []);
    try { await tell("reading", { ...reading, validate }); } catch (error) { lab.say(error, id); }
  } }, [["identify", "fit the model"], ["validate", "judge the model"]].map(([name, words]) => el("option", { value: name, selected: (name === "validate") === reading.validate.includes(file.name) }, words)));
  const native = lab.state.files.some((one) => one.name === "dataset.toml");
  return el("article", { class: file.error ? "card bad" : "card" },
    el("h3", {}, file.name),
    file.error ? el("p", { class: "refused" }, file.error) : el("pre", { tabindex: "0", "aria-label": `What was found in ${file.name}` }, file.preview),
    file.records.length ? table(`Records in ${file.name}`, ["Record", ...COLUMNS], file.records.map((r) => [r.file, ...measures(r)])) : null,
    el("p", { class: "row" },
      native || file.error ? null : el("span", {}, el("label", { for: id }, "Used to "), role),
      el("button", { type: "button", class: "small", id: `forget-${index}`, "aria-label": `Take away ${file.name}`, click: async () => { try { await tell("forget", { name: file.name }); } catch (error) { lab.say(error, "drop"); } } }, "Take away")));
}

/** A record as it came: over time, and as a loop. */
export function rawView(lab, of, records) {
  const select = el("select", { id: "raw-record", change: () => show() }, records.map((record, index) => el("option", { value: index }, record.file)));
  const time = el("div", { class: "plot" });
  const loop = el("div", { class: "plot" });
  const view = el("div", {}, el("p", {}, el("label", { for: "raw-record" }, "Look at "), select,
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
    ], async (from, to) => { const more = await fetchPoints({ from, to }); chart.renew(more.points); });
    loopPlot(loop, [{ label: "position over voltage", colour: COLOURS.measured, path }], "voltage, V", "position, µm", 275);
    document.body.dataset.firstPicture = performance.now();
  }
  view.addEventListener("shown", show);
  return view;
}

/** Files that were brought and are not used yet. */
function found(lab, views) {
  const { state } = lab;
  const records = state.files.flatMap((file) => file.records);
  const native = state.files.some((file) => file.name === "dataset.toml");
  const usable = native || (records.length > 0 && state.files.every((file) => !file.error));
  const view = records.length ? rawView(lab, "files", records) : null;
  if (view) views.push(view);
  return [
    el("h2", {}, "What was found"),
    el("div", { class: "cards" }, state.files.map((file) => fileCard(lab, file))),
    readingForm(lab),
    view,
    state.steps.length ? el("p", { class: "notice" }, `These recordings take the place of the data of this session; its models (${state.steps.length}) end with them. Export what should stay.`) : null,
    native || state.files.some((file) => state.reading.validate.includes(file.name)) || state.files.length < 2 ? null : el("p", { class: "notice" }, "No file is kept to judge the model by. Let one that was recorded differently judge it: only that tells whether a model holds beyond its own data."),
    el("p", {}, el("button", { type: "button", id: "use", class: "main", disabled: !usable || state.job.running, click: () => lab.act({ what: "take-files" }) }, "Use these recordings")),
    command(native ? "cp -r uploads data" : state.import_command),
  ];
}

/** The data of the session. */
function taken(lab, views) {
  const { data } = lab.state;
  const view = rawView(lab, "data", data.records);
  views.push(view);
  return [
    el("h2", {}, `The data: ${data.name}`),
    challengeNotice(lab),
    table("Records", ["Record", "Role", "Excitation", ...COLUMNS], data.records.map((r) => [r.file, r.role, r.excitation, ...measures(r)])),
    ...data.notices.map((notice) => el("p", { class: "notice" }, notice)),
    view,
    el("p", {}, el("a", { class: "button", href: "#fit", id: "to-fit" }, "Choose a model")),
    data.command ? command(data.command) : null,
  ];
}

let again = false;

export async function dataPage(lab) {
  const { state } = lab;
  const views = [];
  const page = el("div", {});
  const pending = state.files.length > 0 && (!state.files_taken || again);
  if (pending) {
    page.append(el("h2", {}, "Bring recordings"), dropZone(lab), ...found(lab, views).filter(Boolean));
    if (state.data && state.files_taken) page.append(el("p", {}, el("button", { type: "button", click: () => { again = false; lab.redraw(); } }, "Back to the data")));
    else if (state.data) page.append(el("p", { class: "hint" }, `Until then the data stay ${state.data.name}.`));
  } else if (state.data) {
    page.append(...taken(lab, views).filter(Boolean),
      el("details", { class: "other" }, el("summary", {}, "Bring other recordings"), dropZone(lab),
        state.files.length ? el("p", {}, el("button", { type: "button", id: "files-again", click: () => { again = true; lab.redraw(); } }, `See the files brought before (${state.files.length})`)) : null,
        el("p", {}, "Or begin anew with"), starts(lab)));
  } else {
    page.append(el("h2", {}, "Bring recordings"), el("p", {}, "From recordings of a piezo stage to a model that explains them: go the way above from left to right."), dropZone(lab), el("h2", {}, "Or begin with"), starts(lab));
  }
  page.addEventListener("shown", () => views.forEach((view) => view.dispatchEvent(new CustomEvent("shown"))));
  return page;
}

export function fitForm(lab) {
  const model = el("select", { id: "model" }, FAMILIES.map(([value, title]) => el("option", { value }, title)));
  const plays = el("input", { id: "plays", type: "number", min: "1", max: "64", value: "10", required: true });
  return el("form", { class: "fit panel", id: "fit-form", submit: (event) => {
    event.preventDefault();
    lab.act({ what: "fit", model: model.value, plays: Number(plays.value) }, "compare");
  } },
  el("p", {}, el("label", { for: "model" }, "Hysteresis model"), model),
  el("p", {}, el("label", { for: "plays" }, "Play operators, 1 to 64"), plays),
  el("p", {}, el("button", { type: "submit", class: "main", id: "fit", disabled: lab.state.job.running }, "Fit")));
}
