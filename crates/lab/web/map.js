// The error map: no chart library has cells of uneven size with a table behind them.
import { el, table } from "./dom.js";
import { num, readable, unit } from "./numbers.js";
import { takeable } from "./picture.js";

/** Viridis at five places: dark is little, bright is much, also in grey. */
const STOPS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

function colour(share) {
  const at = Math.max(0, Math.min(1, share)) * (STOPS.length - 1);
  const low = Math.min(STOPS.length - 2, Math.floor(at));
  return `rgb(${STOPS[low].map((c, i) => Math.round(c + (at - low) * (STOPS[low + 1][i] - c))).join(",")})`;
}

const SVG = "http://www.w3.org/2000/svg";
function svg(name, attributes, text) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Places of edges that are labelled: both ends, and as many between as fit, alike from both sides. */
function labelled(count, most) {
  const stride = Math.max(1, Math.ceil(count / most));
  return Array.from({ length: count + 1 }, (_, k) => k).filter((k) => Math.min(k, count - k) % stride === 0 && (k === 0 || k === count || Math.min(k, count - k) >= stride));
}

/** A number at an edge, without zeros at its end. */
const edge = (value) => { const text = num(value); return text.includes(".") && !text.includes("×") ? text.replace(/\.?0+$/, "") : text; };

/**
 * A map of the error: cells of equal size on the sheet, whatever their width in the quantity; edges are written.
 * An axis is { name, unit, edges }; `values` go row by row from the lowest, and so do the stretches `worst`, which `open` shows.
 */
export function errorMap(title, across, up, values, outputUnit, worst, open) {
  const columns = across.edges.length - 1;
  const rows = up.edges.length - 1;
  const all = values.flat().filter((v) => v !== null && v > 0);
  if (columns < 1 || rows < 1 || all.length === 0) return el("p", {}, "No record moves, so there is no map.");
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const share = (v) => (high > low && v > 0 ? Math.log(v / low) / Math.log(high / low) : 0.5);
  const [scale, name] = readable(outputUnit, high);
  const shown = (axis) => {
    const [factor, text] = readable(axis.unit, Math.max(...axis.edges.map(Math.abs)));
    return { edges: axis.edges.map((v) => v * factor), unit: text, title: `${axis.name}, ${text}` };
  };
  const [x, y] = [shown(across), shown(up)];
  const [w, h, left, bottom] = [520, 320, 82, 44];
  const [cw, ch] = [(w - left - 24) / columns, (h - bottom - 6) / rows];
  const top = (row) => 6 + (rows - row) * ch;
  const sheet = svg("svg", { viewBox: `0 0 ${w} ${h}`, role: "img", "aria-label": `${title}, from ${num(low * scale)} to ${num(high * scale)} ${name} rms; the figures are in the table below` });
  values.forEach((line, r) => line.forEach((value, c) => {
    if (value === null) return;
    const cell = svg("rect", { x: left + c * cw, y: top(r + 1), width: cw + 0.3, height: ch + 0.3, fill: colour(share(value)), class: "cell" });
    cell.addEventListener("click", () => open(worst[r][c]));
    const span = (axis, k) => `${edge(axis.edges[k])} to ${edge(axis.edges[k + 1])} ${axis.unit}`;
    cell.append(svg("title", {}, `${num(value * scale)} ${name} rms at ${span(x, c)}, ${span(y, r)}; a click shows where it is largest`));
    sheet.append(cell);
  }));
  sheet.append(svg("rect", { x: left, y: top(rows), width: columns * cw, height: rows * ch, class: "frame" }));
  for (const k of labelled(columns, 7)) sheet.append(svg("text", { x: left + k * cw, y: h - bottom + 16, "text-anchor": "middle" }, edge(x.edges[k])));
  for (const k of labelled(rows, 8)) sheet.append(svg("text", { x: left - 6, y: top(k) + 4, "text-anchor": "end" }, edge(y.edges[k])));
  sheet.append(svg("text", { x: left + columns * cw / 2, y: h - 8, "text-anchor": "middle" }, x.title));
  sheet.append(svg("text", { x: 14, y: top(rows / 2), transform: `rotate(-90 14 ${top(rows / 2)})`, "text-anchor": "middle" }, y.title));
  const bar = el("p", { class: "key" }, `${num(low * scale)} ${name}`, ...Array.from({ length: 11 }, (_, k) => { const dot = el("span", { class: "block" }); dot.style.background = colour(k / 10); return dot; }), `${num(high * scale)} ${name} rms; blank: no sample; a cell opens where its error is largest`);
  const cells = table(`${title}, rms in ${name}: ${y.title} in rows, ${x.title} in columns, each from`, ["", ...x.edges.slice(0, -1).map(edge)], values.map((line, r) => [edge(y.edges[r]), ...line.map((v, c) => (v === null ? null : { element: el("button", { type: "button", class: "figure", click: () => open(worst[r][c]) }, num(v * scale)) }))]));
  const host = el("div", { class: "map" }, sheet, bar, el("details", {}, el("summary", {}, "Figures"), cells));
  // In the units of the numbers themselves: a row a cell that has samples.
  host.cells = [[`${across.name} from, ${unit(across.unit)}`, "to", `${up.name} from, ${unit(up.unit)}`, "to", `error rms, ${unit(outputUnit)}`], ...values.flatMap((line, r) => line.map((v, c) => [across.edges[c], across.edges[c + 1], up.edges[r], up.edges[r + 1], v]).filter(([, , , , v]) => v !== null))];
  const box = el("div", {}, host);
  takeable(host, title.toLowerCase());
  return box;
}
