// Recordings: dropped, previewed, corrected, taken. And the form that fits a model.
import { ask, tell, send } from "./api.js";
import { el, table, command, panel } from "./dom.js";
import { timePlot, loopPlot, COLOURS } from "./plots.js";

const FAMILIES = [
  ["mrpi", "MRPI: rate-dependent (the paper's)"], ["mpi", "MPI: with a cubic input function"], ["pi", "PI: plays alone"],
  ["wrpi", "WRPI: rate-dependent weights"], ["play-polynomial", "Play-polynomial: a cubic of each play"],
];

/** All files of a drop, folders opened. */
async function dropped(transfer) {
  const walk = async (entry) => {
    if (entry.isFile) return [await new Promise((done, failed) => entry.file(done, failed))];
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

const RECORDING = /(\.(csv|tsv|txt|dat|mat|asc|zip)|^dataset\.toml)$/i;

async function bring(lab, files) {
  const wanted = files.length > 1 ? files.filter((file) => RECORDING.test(file.name)) : files;
  const refused = [];
  for (const [index, file] of wanted.entries()) {
    status(`reading ${file.name} (${index + 1} of ${wanted.length})`);
    try { await send(file); } catch (error) { refused.push(error.message); }
  }
  status("");
  await lab.refresh();
  lab.say(refused.length ? new Error(refused.join("\n")) : wanted.length ? null : new Error("There is no recording among these files."));
}

function status(text) {
  const line = document.getElementById("bring-status");
  if (line) line.textContent = text;
}

function dropZone(lab) {
  const input = el("input", { type: "file", id: "files", multiple: true, change: () => bring(lab, [...input.files]) });
  const folder = el("input", { type: "file", id: "folder-files", webkitdirectory: true, change: () => bring(lab, [...folder.files]) });
  return el("div", { class: "drop", id: "drop",
    dragover: (event) => { event.preventDefault(); event.currentTarget.classList.add("over"); },
    dragleave: (event) => event.currentTarget.classList.remove("over"),
    drop: async (event) => {
      event.preventDefault();
      event.currentTarget.classList.remove("over");
      bring(lab, await dropped(event.dataTransfer));
    } },
  el("p", {}, "Drop recordings here: CSV, MATLAB .mat, a folder, or a zip. "),
  el("p", {}, el("label", { for: "files" }, "Or choose files "), input),
  el("p", {}, el("label", { for: "folder-files" }, "Or a folder "), folder),
  el("p", { id: "bring-status", role: "status" }));
}

function readingForm(lab) {
  const { reading } = lab.state;
  const field = (id, title, attributes) => el("p", {}, el("label", { for: id }, title), el("input", { id, ...attributes }));
  const select = (id, title, value, options) => el("p", {}, el("label", { for: id }, title),
    el("select", { id }, options.map((name) => el("option", { value: name, selected: name === (value || "refuse") }, name))));
  const column = (quantity) => (reading.columns.find((text) => text.startsWith(`${quantity}=`)) || "").slice(quantity.length + 1);
  const form = el("form", { class: "reading", submit: async (event) => {
    event.preventDefault();
    const value = (id) => form.querySelector(`#${id}`).value.trim();
    const columns = ["time", "voltage", "position"].filter((q) => value(`column-${q}`)).map((q) => `${q}=${value(`column-${q}`)}`);
    const rate = value("rate");
    try {
      await tell("reading", { columns, rate_hz: rate ? Number(rate) : null, missing: value("missing"), gaps: value("gaps"), jitter: value("jitter"), validate: reading.validate });
      lab.say(null);
    } catch (error) { lab.say(error); }
  } },
  el("p", {}, "Where a column was taken wrongly, say which it is: its name or number, then unit and factor, as in CH1:mV*20."),
  el("div", { class: "fields" },
    ...["time", "voltage", "position"].map((q) => field(`column-${q}`, `Column of ${q}`, { value: column(q), placeholder: "found by its name" })),
    field("rate", "Sample rate, Hz", { type: "number", step: "any", min: "0", value: reading.rate_hz ?? "", placeholder: "from the time" }),
    select("missing", "Empty cells", reading.missing, ["refuse", "trim", "interpolate"]),
    select("gaps", "Gaps in time", reading.gaps, ["refuse", "split"]),
    select("jitter", "Jitter", reading.jitter, ["refuse", "clock", "interpolate"])),
  el("button", { type: "submit" }, "Read again"));
  return el("details", { id: "correct", open: lab.state.files.some((file) => file.error) }, el("summary", {}, "Correct columns, units, rate"), form);
}

function fileCard(lab, file) {
  const { reading } = lab.state;
  const id = `role-${lab.state.files.indexOf(file)}`;
  const role = el("select", { id, change: async () => {
    const validate = reading.validate.filter((name) => name !== file.name).concat(role.value === "validate" ? [file.name] : []);
    try { await tell("reading", { ...reading, validate }); } catch (error) { lab.say(error); }
  } }, ["identify", "validate"].map((name) => el("option", { value: name, selected: (name === "validate") === reading.validate.includes(file.name) }, name)));
  const rows = file.records.map((r) => [r.file, r.samples, r.rate_hz, r.seconds, r.period_samples ? `${r.period_samples} samples` : "not periodic"]);
  return el("article", { class: file.error ? "card bad" : "card" },
    el("h3", {}, file.name),
    file.error ? el("p", { class: "refused" }, file.error) : el("pre", { tabindex: "0", "aria-label": `What was found in ${file.name}` }, file.preview),
    rows.length ? table(`Records in ${file.name}`, ["Record", "Samples", "Rate, Hz", "Seconds", "Period"], rows) : null,
    lab.state.files.some((one) => one.name === "dataset.toml") || file.error ? null : el("p", {}, el("label", { for: id }, "Used to "), role),
    el("button", { type: "button", click: async () => { try { await tell("forget", { name: file.name }); } catch (error) { lab.say(error); } } }, `Take ${file.name} away`));
}

/** A record as it came: over time, and as a loop. */
export function rawView(lab, of, records) {
  const select = el("select", { id: "raw-record", change: () => show() }, records.map((record, index) => el("option", { value: index }, record.file)));
  const time = el("div", { class: "plot" });
  const loop = el("div", { class: "plot" });
  const view = el("div", {}, el("p", {}, el("label", { for: "raw-record" }, "Record "), select), el("div", { class: "wide-narrow" }, panel("Over time", time), panel("Loop", loop)));
  let chart = null;
  const fetchPoints = (range) => ask("raw", { of, record: select.value, width: 1200, ...range });
  async function show() {
    const { points, loop: path } = await fetchPoints({});
    time.replaceChildren();
    loop.replaceChildren();
    chart = timePlot(time, points, [
      { label: "voltage, V", colour: COLOURS.input, scale: "v" }, { label: "position, µm", colour: COLOURS.measured, scale: "y" },
    ], async (from, to) => { const more = await fetchPoints({ from, to }); chart.renew(more.points); });
    loopPlot(loop, [{ label: "position over voltage", colour: COLOURS.measured, path }], "voltage, V", "position, µm");
    document.body.dataset.firstPicture = performance.now();
  }
  view.addEventListener("shown", show);
  return view;
}

export async function dataPage(lab) {
  const { state } = lab;
  const page = el("div", {}, el("h2", {}, "Bring recordings"), dropZone(lab));
  const views = [];
  if (state.files.length === 0) {
    page.append(el("h3", {}, "Or begin with"), el("ul", { class: "starts" }, state.starts.map((start) => el("li", {},
      el("button", { type: "button", id: `start-${start.name}`, disabled: state.job.running, click: () => lab.act({ what: "start", name: start.name }) }, start.title), el("p", {}, start.about)))));
  } else {
    const records = state.files.flatMap((file) => file.records);
    const native = state.files.some((file) => file.name === "dataset.toml");
    const usable = native || (records.length > 0 && state.files.every((file) => !file.error));
    page.append(
      el("h2", {}, "What was found"), readingForm(lab),
      el("div", { class: "cards" }, state.files.map((file) => fileCard(lab, file))),
      command(native ? "cp -r uploads data" : state.import_command),
      el("button", { type: "button", id: "use", class: "main", disabled: !usable || state.job.running, click: () => lab.act({ what: "take-files" }) }, "Use these recordings"));
    if (records.length) { const view = rawView(lab, "files", records); views.push(view); page.append(view); }
  }
  if (state.data) {
    const rows = state.data.records.map((r) => [r.file, r.role, r.excitation, r.samples, r.rate_hz, r.seconds, r.period_samples ? `${r.period_samples} samples` : "not periodic"]);
    page.append(el("h2", {}, `The data: ${state.data.name}`),
      table("Records", ["Record", "Role", "Excitation", "Samples", "Rate, Hz", "Seconds", "Period"], rows),
      ...state.data.notices.map((notice) => el("p", { class: "notice" }, notice)),
      state.data.command ? command(state.data.command) : "");
    if (state.files.length === 0) { const view = rawView(lab, "data", state.data.records); views.push(view); page.append(view); }
    page.append(el("p", {}, el("a", { class: "button", href: "#fit", id: "to-fit" }, "Choose a model")));
  }
  page.addEventListener("shown", () => views.forEach((view) => view.dispatchEvent(new CustomEvent("shown"))));
  return page;
}

export function fitForm(lab) {
  const model = el("select", { id: "model" }, FAMILIES.map(([value, title]) => el("option", { value }, title)));
  const plays = el("input", { id: "plays", type: "number", min: "1", max: "64", value: "10", required: true });
  return el("form", { class: "fit", submit: (event) => {
    event.preventDefault();
    lab.act({ what: "fit", model: model.value, plays: Number(plays.value) }, "compare");
  } },
  el("p", {}, el("label", { for: "model" }, "Hysteresis model "), model),
  el("p", {}, el("label", { for: "plays" }, "Play operators, 1 to 64 "), plays),
  el("p", {}, el("button", { type: "submit", class: "main", id: "fit", disabled: lab.state.job.running }, "Fit")));
}
