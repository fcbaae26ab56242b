// The error map: no chart library has cells of uneven size with a table behind them.
import { el, num, table } from "./dom.js";

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

/** Cells of equal size on the sheet, whatever their width in the quantity; edges are written. */
export function errorMap(map, outputUnit) {
  const columns = map.position_edges_um.length - 1;
  const rows = map.rate_edges_um_per_s.length - 1;
  const all = map.rms_um.flat().filter((v) => v !== null && v > 0);
  if (columns < 1 || rows < 1 || all.length === 0) return el("p", {}, "No record moves, so there is no map.");
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const share = (v) => (high > low && v > 0 ? Math.log(v / low) / Math.log(high / low) : 0);
  const [w, h, left, bottom] = [520, 300, 78, 46];
  const [cw, ch] = [(w - left) / columns, (h - bottom) / rows];
  const sheet = svg("svg", { viewBox: `0 0 ${w} ${h}`, role: "img", "aria-label": `Error by position and rate, from ${num(low)} to ${num(high)} ${outputUnit} rms; the table below has the cells` });
  map.rms_um.forEach((line, r) => line.forEach((value, c) => {
    if (value === null) return;
    const cell = svg("rect", { x: left + c * cw, y: (rows - 1 - r) * ch, width: cw + 0.3, height: ch + 0.3, fill: colour(share(value)) });
    const edges = (list, k, unit) => `${num(list[k])} to ${num(list[k + 1])} ${unit}`;
    cell.append(svg("title", {}, `${num(value)} ${outputUnit} rms at ${edges(map.position_edges_um, c, outputUnit)}, ${edges(map.rate_edges_um_per_s, r, `${outputUnit}/s`)}`));
    sheet.append(cell);
  }));
  for (const k of [0, Math.round(columns / 2), columns]) sheet.append(svg("text", { x: left + k * cw, y: h - bottom + 16, "text-anchor": k === columns ? "end" : k === 0 ? "start" : "middle" }, num(map.position_edges_um[k])));
  for (const k of [0, Math.round(rows / 2), rows]) sheet.append(svg("text", { x: left - 6, y: Math.max(11, (rows - k) * ch + 4 - (k === 0 ? 6 : 0)), "text-anchor": "end" }, num(map.rate_edges_um_per_s[k])));
  sheet.append(svg("text", { x: left + (w - left) / 2, y: h - 8, "text-anchor": "middle" }, `position, ${outputUnit}; up: rate, ${outputUnit}/s`));
  const scale = el("p", { class: "key" }, `${num(low)} `, ...[0, 0.25, 0.5, 0.75, 1].map((s) => { const dot = el("span", { class: "block" }); dot.style.background = colour(s); return dot; }), ` ${num(high)} ${outputUnit} rms`);
  const cells = table("Error rms by rate (rows) and position (columns)", ["Rate from", ...map.position_edges_um.slice(0, -1).map((v) => num(v))], map.rms_um.map((line, r) => [num(map.rate_edges_um_per_s[r]), ...line]));
  return el("div", { class: "map" }, sheet, scale, el("details", {}, el("summary", {}, "Figures"), cells));
}
