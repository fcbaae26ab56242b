// A picture to take home: as SVG and PNG as it is seen, and its numbers as CSV.
import { el } from "./dom.js";

const escape = (text) => String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const at = (value) => Number(value.toFixed(2));
const colourOf = (u, one, index) => (typeof one.stroke === "function" ? one.stroke(u, index) : one.stroke);
/** Height of the line that says which colour is which, and its letters. */
const KEY = 24;
const FONT = "font-family=\"system-ui, sans-serif\" font-size=\"12\"";

/** A stretch of the sheet in pixels: where the axes' box is, and the place of a value. */
function box(u) {
  const ratio = devicePixelRatio;
  const [left, top, w, h] = [u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height].map((v) => v / ratio);
  return { left, top, w, h, x: (v) => at(left + u.valToPos(v, "x")), y: (v, scale) => at(top + u.valToPos(v, scale)) };
}

/** A line through points, pen up at gaps. */
function path(points) {
  let down = false;
  let d = "";
  for (const [x, y] of points) {
    if (x === null || y === null || !Number.isFinite(x) || !Number.isFinite(y)) { down = false; continue; }
    d += `${down ? "L" : "M"}${x} ${y}`;
    down = true;
  }
  return d;
}

/** The points of a series as they are held; of a loop each curve has its own abscissa. */
const held = (u, index) => (u.mode === 2 ? u.data[index] : [u.data[0], u.data[index]]);

function curves(u, place) {
  let drawn = "";
  const spot = (index) => {
    const [xs, ys] = held(u, index);
    const scale = u.series[index].scale || "y";
    return xs.map((x, k) => (x === null || ys[k] === null || ys[k] === undefined ? [null, null] : [place.x(x), place.y(ys[k], scale)]));
  };
  for (const band of u.bands || []) {
    const [high, low] = band.series.map(spot);
    const fill = u.series[band.series[1]].colour;
    drawn += `<path d="${path(high)}${path(low.reverse()).replace("M", "L")}Z" fill="${fill}" fill-opacity="0.22"/>`;
  }
  u.series.forEach((one, index) => {
    if (index === 0 || one.class === "edge" || one.show === false) return;
    const colour = colourOf(u, one, index);
    if (u.dots) {
      const fill = typeof one.points.fill === "function" ? one.points.fill(u, index) : one.points.fill;
      drawn += spot(index).filter(([x]) => x !== null).map(([x, y]) => `<circle cx="${x}" cy="${y}" r="4" fill="${fill || colour}" stroke="${colour}" stroke-width="2"/>`).join("");
    } else drawn += `<path d="${path(spot(index))}" fill="none" stroke="${colour}" stroke-width="${one.width}"${one.dash ? ` stroke-dasharray="${one.dash.join(" ")}"` : ""}/>`;
  });
  return drawn;
}

function axes(u, place) {
  const [ink, rule] = [variable("--muted"), variable("--rule")];
  let [lines, words] = ["", ""];
  u.axes.forEach((axis, index) => {
    const across = index === 0;
    const scale = axis.scale;
    const right = axis.side === 1;
    (axis._splits || []).forEach((split, k) => {
      const label = axis._values && axis._values[k];
      const where = across ? place.x(split) : place.y(split, scale);
      if (!Number.isFinite(where)) return;
      if (!right) lines += across ? `<path d="M${where} ${place.top}v${place.h}" stroke="${rule}"/>` : `<path d="M${place.left} ${where}h${place.w}" stroke="${rule}"/>`;
      if (label === null || label === undefined || label === "") return;
      if (across && axis._rotate) words += `<text transform="translate(${where} ${place.top + place.h + 12}) rotate(${-axis._rotate})" text-anchor="${axis._rotate > 0 ? "end" : "start"}">${escape(label)}</text>`;
      else words += across ? `<text x="${where}" y="${place.top + place.h + 18}" text-anchor="middle">${escape(label)}</text>` : `<text x="${right ? place.left + place.w + 8 : place.left - 8}" y="${where + 4}" text-anchor="${right ? "start" : "end"}">${escape(label)}</text>`;
    });
    if (!axis.label) return;
    const middle = place.top + place.h / 2;
    words += across ? `<text x="${place.left + place.w / 2}" y="${u.height - (u.root.querySelector(".u-legend") ? 4 : 6)}" text-anchor="middle">${escape(axis.label)}</text>` : `<text transform="translate(${right ? u.width - 4 : 12} ${middle}) rotate(-90)" text-anchor="middle">${escape(axis.label)}</text>`;
  });
  return `<g fill="none">${lines}</g><g fill="${ink}">${words}</g>`;
}

/** Which colour is which: the series, then what else the sheet shows. */
function names(u) {
  const series = u.series.slice(1).map((one, k) => ({ label: one.label, colour: colourOf(u, one, k + 1), edge: one.class === "edge", hollow: one.hollow }));
  return [...series.filter((one) => !one.edge), ...(u.key || [])];
}

/** A chart as SVG. */
function chartSvg(u) {
  const place = box(u);
  let x = 8;
  const key = names(u).map(({ label, colour, hollow, faint }) => {
    const mark = u.dots ? `<circle cx="${x + 8}" cy="12" r="4" fill="${hollow ? "none" : colour}" stroke="${colour}" stroke-width="2"/>` : `<path d="M${x} 12h16" stroke="${colour}" stroke-opacity="${faint ? 0.35 : 1}" stroke-width="${faint ? 9 : 3}"/>`;
    const entry = `${mark}<text x="${x + 20}" y="16" fill="${variable("--text")}">${escape(label)}</text>`;
    x += 32 + 7 * label.length;
    return entry;
  }).join("");
  const clip = `<clipPath id="box"><rect x="${place.left}" y="${place.top}" width="${place.w}" height="${place.h}"/></clipPath>`;
  const width = Math.max(u.width, x);
  return { width, height: u.height + KEY, text: `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${u.height + KEY}" viewBox="0 0 ${width} ${u.height + KEY}" ${FONT}><rect width="100%" height="100%" fill="${variable("--ground")}"/>${key}<g transform="translate(0 ${KEY})">${clip}${axes(u, place)}<g clip-path="url(#box)">${curves(u, place)}</g></g></svg>\n` };
}

/** A cell of a table of ours: commas and quotes within quotes. */
const cell = (value) => { const text = value === null || value === undefined ? "" : String(value); return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text; };
const csv = (rows) => rows.map((row) => `${row.map(cell).join(",")}\n`).join("");

/** A chart's numbers: a column a series; of a loop a row a point, named by its curve. */
function chartCsv(u) {
  if (u.mode === 2) {
    const rows = u.series.slice(1).flatMap((one, k) => held(u, k + 1)[0].map((x, n) => [one.label, x, held(u, k + 1)[1][n]]));
    return csv([["curve", u.axes[0].label, u.axes[1].label], ...rows.filter(([, x]) => x !== null)]);
  }
  const own = u.dots ? (x) => u.series[0].value(u, x) : (x) => x;
  return csv([u.series.map((one) => one.label), ...u.data[0].map((x, k) => [own(x), ...u.data.slice(1).map((column) => column[k])])]);
}

const drawn = (name, attributes, text = "") => {
  const one = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
  one.textContent = text;
  return one;
};

/** A sheet that is SVG on the page already, with the colours that the page gives it and what they mean. */
function sheetSvg(host, sheet) {
  const copy = sheet.cloneNode(true);
  const [, , width, tall] = sheet.getAttribute("viewBox").split(" ").map(Number);
  const height = tall + KEY;
  copy.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const own = sheet.querySelectorAll("text, .frame");
  copy.querySelectorAll("text, .frame").forEach((part, k) => {
    const { fill, stroke } = getComputedStyle(own[k]);
    part.setAttribute("fill", fill);
    part.setAttribute("stroke", stroke);
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  copy.setAttribute("font-family", "system-ui, sans-serif");
  copy.setAttribute("font-size", "11.5");
  copy.prepend(drawn("rect", { width: "100%", height: "100%", fill: variable("--ground") }));
  const key = host.querySelector(".key");
  const [fill, y] = [variable("--muted"), tall + 14];
  copy.append(drawn("text", { x: 82, y, fill, "text-anchor": "end" }, key.firstChild.textContent));
  key.querySelectorAll(".block").forEach((block, k) => copy.append(drawn("rect", { x: 88 + 14 * k, y: y - 10, width: 14, height: 12, fill: block.style.backgroundColor })));
  copy.append(drawn("text", { x: 94 + 14 * key.querySelectorAll(".block").length, y, fill }, key.lastChild.textContent));
  return { width, height, text: `${new XMLSerializer().serializeToString(copy)}\n` };
}

function save(name, blob) {
  const link = el("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** The picture's pixels, two to one of the page's. */
async function png({ width, height, text }) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  await image.decode();
  const sheet = el("canvas", { width: 2 * width, height: 2 * height });
  sheet.getContext("2d").drawImage(image, 0, 0, 2 * width, 2 * height);
  return new Promise((done) => sheet.toBlob(done, "image/png"));
}

/** What a host shows, in each form. */
export const forms = (host) => {
  const sheet = host.querySelector(":scope > svg");
  const svg = () => (sheet ? sheetSvg(host, sheet) : chartSvg(host.chart));
  return {
    svg: async () => new Blob([svg().text], { type: "image/svg+xml" }),
    png: () => png(svg()),
    csv: async () => new Blob([sheet ? csv(host.cells) : chartCsv(host.chart)], { type: "text/csv" }),
  };
};

/** Buttons behind a picture that take it home. */
export function takeable(host, name) {
  host.forms = forms(host);
  const next = host.nextElementSibling;
  if (next && next.classList.contains("take")) next.remove();
  const button = (kind) => el("button", { type: "button", class: "small", "aria-label": `${name} as ${kind.toUpperCase()}`, click: async () => save(`${name.replaceAll(" ", "-")}.${kind}`, await host.forms[kind]()) }, kind.toUpperCase());
  host.after(el("p", { class: "take" }, ["svg", "png", "csv"].map(button)));
}
