// Charts by uPlot, with zoom, pan, a shared cursor, and finer points fetched once the view rests.
import { count, num, power, readable } from "./numbers.js";
import { takeable } from "./picture.js";
import uPlot from "./vendor/uPlot.esm.js";

const style = getComputedStyle(document.documentElement);
const dark = matchMedia("(prefers-color-scheme: dark)");
/** Colours by Okabe and Ito, told apart by the colour-blind; as in the reports. */
export const COLOURS = {
  get measured() { return dark.matches ? "#6cbef0" : "#0072b2"; },
  get model() { return dark.matches ? "#f59a4c" : "#d55e00"; },
  get residual() { return dark.matches ? "#33bd97" : "#008f69"; },
  get noise() { return dark.matches ? "#9aa4af" : "#6e7781"; },
  get input() { return dark.matches ? "#df9cc4" : "#b25e92"; },
  /** Further models over the same record, in the order they are chosen. */
  get others() { return dark.matches ? ["#df9cc4", "#e6c84a", "#b7a6f0", "#5fd0c5"] : ["#b25e92", "#6a4fc4", "#00797a", "#9a7500"]; },
};

const wash = (colour) => `color-mix(in srgb, ${colour} 22%, transparent)`;
/** A band between two values that go on for the whole width: its series, and what fills it. */
const bandOf = (label, colour, scale = "y") => [{ label: `${label}, upper`, stroke: "transparent", scale, width: 0, points: { show: false }, class: "edge" }, { label: `${label}, lower`, stroke: "transparent", scale, width: 0, points: { show: false }, class: "edge", colour }];

const short = (v) => (v === null || v === undefined ? "–" : Number(v.toPrecision(4)).toString().replace("-", "−"));
const ink = () => style.getPropertyValue("--muted").trim();
const rule = () => style.getPropertyValue("--rule").trim();
const axis = (label, scale, extra = {}) => ({ label, scale, labelSize: 22, labelGap: 2, stroke: ink, grid: { stroke: rule, width: 1 }, ticks: { stroke: rule, width: 1 }, size: 54, font: "12px system-ui", labelFont: "12px system-ui", ...extra });
const width = (host) => Math.max(280, host.clientWidth || 600);
const settle = 120;

/** Follows the width of its host. */
function fit(chart, host, height) {
  new ResizeObserver(() => chart.setSize({ width: width(host), height })).observe(host);
}

/** Wheel zooms about the pointer, drag with Shift pans, arrow keys pan, plus and minus zoom, 0 shows all. */
function hands(chart, host, whole, moved) {
  const set = (min, max) => {
    const span = Math.min(max - min, whole[1] - whole[0]);
    const low = Math.max(whole[0], Math.min(min, whole[1] - span));
    chart.setScale("x", { min: low, max: low + span });
    moved(low, low + span);
  };
  const view = () => [chart.scales.x.min, chart.scales.x.max];
  const zoom = (factor, at) => { const [a, b] = view(); const m = at ?? (a + b) / 2; set(m - (m - a) * factor, m + (b - m) * factor); };
  const pan = (share) => { const [a, b] = view(); set(a + share * (b - a), b + share * (b - a)); };
  chart.over.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) pan((event.deltaX || event.deltaY) / 800);
    else zoom(Math.exp(event.deltaY / 500), chart.posToVal(event.offsetX, "x"));
  }, { passive: false });
  host.tabIndex = 0;
  host.setAttribute("role", "application");
  host.addEventListener("keydown", (event) => {
    const deed = { Enter: () => chart.ask && chart.ask(...view()), ArrowLeft: () => pan(-0.2), ArrowRight: () => pan(0.2), "+": () => zoom(0.6), "-": () => zoom(1 / 0.6), "0": () => set(...whole) }[event.key];
    if (deed) { event.preventDefault(); deed(); }
  });
  chart.over.addEventListener("dblclick", () => set(...whole));
  chart.pan = pan;
  chart.zoomBy = zoom;
  chart.setView = set;
}

/** Series over time. `finer(from, to)` is called once the view rests. */
export function timePlot(host, points, series, finer, options = {}) {
  const height = options.height || 260;
  // The edges of the band about zero that noise stays in.
  const edges = (x) => (options.band ? [1, -1].map((sign) => x.map(() => sign * options.band.half)) : []);
  const data = [points.x, ...points.y, ...edges(points.x)];
  const whole = [points.x[0], points.x.at(-1)];
  const scales = { x: { time: false } };
  for (const one of series) scales[one.scale] = {};
  const sides = [...new Set(series.map((one) => one.scale))];
  const chart = new uPlot({
    width: width(host), height, scales,
    cursor: { sync: options.sync ? { key: options.sync, filters: { sub: (type) => type === "mousemove" || type === "mouseleave" } } : undefined, drag: { x: true, y: false, setScale: false }, focus: { prox: 20 } },
    series: [{ label: "time, s", value: (_, v) => short(v) }, ...series.map((one) => ({ label: one.label, stroke: one.colour, scale: one.scale, width: 1.2, points: { show: false }, value: (_, v) => short(v) })), ...(options.band ? bandOf(options.band.label, COLOURS.noise, series[0].scale) : [])],
    bands: options.band ? [{ series: [series.length + 1, series.length + 2], fill: wash(COLOURS.noise) }] : [],
    axes: [axis("time, s", "x", { size: 34 }), ...sides.map((scale, index) => axis(options.title || series.find((one) => one.scale === scale).label, scale, index ? { side: 1, grid: { show: false } } : {}))],
    hooks: { setSelect: [selected], setCursor: options.at ? [(u) => options.at(u.cursor.idx)] : [] },
  }, data, host);
  function selected(u) {
    if (u.select.width <= 3) return;
    const [from, to] = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
    if (options.select) { options.select(from, to); return; }
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    u.setView(from, to);
  }
  let timer = 0;
  const moved = (from, to) => {
    if (options.follow) for (const other of options.follow()) if (other !== chart) other.setScale("x", { min: from, max: to });
    clearTimeout(timer);
    timer = setTimeout(() => finer(from, to), settle);
  };
  hands(chart, host, whole, moved);
  chart.ask = options.select;
  host.setAttribute("aria-label", `${series.map((one) => one.label).join(", ")} over time. Arrow keys pan, plus and minus zoom, 0 shows all${options.select ? ", Enter asks what the error in view is" : ""}.`);
  chart.renew = (more, pick = (y) => y) => {
    const { min, max } = chart.scales.x;
    chart.setData([more.x, ...pick(more.y), ...edges(more.x)], false);
    chart.setScale("x", { min, max });
  };
  chart.key = options.band ? [{ label: options.band.label, colour: COLOURS.noise, faint: true }] : [];
  if (options.band) host.append(keyOf(chart.key));
  return placed(chart, host, height, options.name);
}

/** A chart in its place: it follows the width, and can be taken home under a name. */
function placed(chart, host, height, name) {
  host.chart = chart;
  fit(chart, host, height);
  if (name) takeable(host, name);
  return chart;
}

/** Which colour is which. */
function keyOf(curves) {
  const key = document.createElement("p");
  key.className = "key";
  for (const curve of curves) {
    const dot = document.createElement("span");
    if (curve.dot) dot.className = "dot";
    dot.style.background = curve.hollow ? "transparent" : curve.colour;
    if (curve.faint) dot.style.opacity = "0.35";
    if (curve.dot) dot.style.borderColor = curve.colour;
    const name = document.createElement("span");
    name.textContent = curve.label;
    const entry = document.createElement("span");
    entry.className = "entry";
    entry.append(dot, name);
    key.append(entry);
  }
  return key;
}

/** Loops: points that run to and fro over the abscissa. */
export function loopPlot(host, curves, xTitle, yTitle, height = 300, name = null) {
  const series = curves.map((curve) => ({ label: curve.label, stroke: curve.colour, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }], paths: trace, width: 1.2 }));
  const range = (index) => () => {
    let low = Infinity; let high = -Infinity;
    for (const { path } of curves) for (const v of index ? path.y : path.x) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
    const room = 0.03 * (high - low || 1);
    return [low - room, high + room];
  };
  const chart = new uPlot({
    mode: 2, width: width(host), height, legend: { show: false }, cursor: { drag: { x: false, y: false } },
    scales: { x: { time: false, range: range(0) }, y: { range: range(1) } },
    series: [null, ...series], axes: [axis(xTitle, "x", { size: 34 }), axis(yTitle, "y")],
  }, [null, ...curves.map((curve) => [curve.path.x, curve.path.y])], host);
  host.append(keyOf(curves));
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", `${curves.map((curve) => curve.label).join(" and ")}: ${yTitle} over ${xTitle}`);
  const dots = curves.map((curve) => {
    const dot = document.createElement("span");
    dot.className = "at";
    dot.style.background = curve.colour;
    chart.over.append(dot);
    return dot;
  });
  /** Marks where the cursor of another view is: an abscissa, and a value for each curve; nothing without them. */
  chart.mark = (x, values) => dots.forEach((dot, index) => {
    dot.hidden = x === undefined;
    if (x !== undefined) dot.style.transform = `translate(${chart.valToPos(x, "x")}px, ${chart.valToPos(values[index], "y")}px)`;
  });
  chart.mark();
  chart.renew = (paths) => { paths.forEach((path, index) => { curves[index].path = path; }); chart.setData([null, ...paths.map((path) => [path.x, path.y])]); };
  return placed(chart, host, height, name);
}

function trace(u, index) {
  const [xs, ys] = u.data[index];
  const { ctx } = u;
  const one = u.series[index];
  ctx.save();
  ctx.beginPath();
  ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
  ctx.clip();
  ctx.strokeStyle = typeof one.stroke === "function" ? one.stroke(u, index) : one.stroke;
  ctx.lineWidth = one.width * devicePixelRatio;
  ctx.beginPath();
  let down = false;
  for (let k = 0; k < xs.length; k++) {
    if (xs[k] === null) { down = false; continue; }
    const x = u.valToPos(xs[k], "x", true);
    const y = u.valToPos(ys[k], "y", true);
    if (down) ctx.lineTo(x, y); else ctx.moveTo(x, y);
    down = true;
  }
  ctx.stroke();
  ctx.restore();
  return null;
}

/** Labels at the powers of ten alone. */
const decades = (words) => (_, ticks) => ticks.map((v) => (Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-9 ? words(v) : ""));

/** Spectra on logarithmic axes. */
export function spectrumPlot(host, spectrum, outputUnit, height = 300, name = null) {
  const keep = spectrum.frequency_hz.map((f, k) => [f, k]).filter(([f]) => f > 0).map(([, k]) => k);
  const positive = (values) => keep.map((k) => (values[k] > 0 ? values[k] : null));
  const line = (label, colour, dash) => ({ label, stroke: colour, width: 1.2, dash, points: { show: false }, value: (_, v) => (v === null || v === undefined ? "–" : num(v)) });
  const chart = new uPlot({
    width: width(host), height, scales: { x: { time: false, distr: 3 }, y: { distr: 3 } }, cursor: { drag: { x: true, y: false } },
    series: [{ label: "frequency, Hz", value: (_, v) => (v === null || v === undefined ? "–" : num(v)) }, line("measured", COLOURS.measured), line("error", COLOURS.residual), line("noise floor", COLOURS.noise, [6, 4])],
    axes: [axis("frequency, Hz", "x", { size: 34, values: decades((v) => (v >= 1 ? count(v) : String(v))) }), axis(`${outputUnit}/√Hz`, "y", { values: decades((v) => power(Math.round(Math.log10(v)))) })],
  }, [keep.map((k) => spectrum.frequency_hz[k]), positive(spectrum.measured_um_per_rthz), positive(spectrum.residual_um_per_rthz), positive(spectrum.noise_um_per_rthz)], host);
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", "Spectrum of the error, against the measurement and the noise floor");
  return placed(chart, host, height, name);
}

/** Curves over frequency: name, colour, values, dash. A band has a label, a colour, its upper and its lower edge; a mark a place and a label. */
export function curvesPlot(host, frequency, curves, title, { log = false, height = 200, band = null, mark = null, name = null }) {
  const shown = (v) => (v === null || v === undefined ? "–" : num(v));
  const chart = new uPlot({
    width: width(host), height, scales: { x: { time: false, distr: 3 }, y: log ? { distr: 3 } : {} }, cursor: { drag: { x: true, y: false } },
    series: [{ label: "frequency, Hz", value: (_, v) => shown(v) }, ...curves.map(([label, stroke, , dash]) => ({ label, stroke, dash, width: 1.4, points: { show: false }, value: (_, v) => shown(v) })), ...(band ? bandOf(band.label, band.colour) : [])],
    bands: band ? [{ series: [curves.length + 1, curves.length + 2], fill: wash(band.colour) }] : [],
    hooks: mark ? { draw: [(u) => strokeAt(u, mark.x)] } : {},
    axes: [axis("frequency, Hz", "x", { size: 34, values: decades((v) => (v >= 1 ? count(v) : String(v))) }), axis(title, "y", log ? { values: decades((v) => (v >= 0.01 && v <= 100 ? num(v) : power(Math.round(Math.log10(v))))) } : {})],
  }, [frequency, ...curves.map(([, , values]) => values), ...(band ? [band.upper, band.lower] : [])], host);
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", `${curves.map(([label]) => label).join(", ")}: ${title} over frequency`);
  chart.key = [...(band ? [{ label: band.label, colour: band.colour, faint: true }] : []), ...(mark ? [{ label: mark.label, colour: COLOURS.noise }] : [])];
  if (chart.key.length) host.append(keyOf(chart.key));
  return placed(chart, host, height, name);
}

/** An upright stroke at a place. */
function strokeAt(u, x) {
  const at = u.valToPos(x, "x", true);
  if (at < u.bbox.left || at > u.bbox.left + u.bbox.width) return;
  u.ctx.save();
  u.ctx.strokeStyle = COLOURS.noise;
  u.ctx.lineWidth = devicePixelRatio;
  u.ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
  u.ctx.beginPath();
  u.ctx.moveTo(at, u.bbox.top);
  u.ctx.lineTo(at, u.bbox.top + u.bbox.height);
  u.ctx.stroke();
  u.ctx.restore();
}

/** A correlation over lags with its band. */
export function correlationPlot(host, found, title, { height = 240, name = null } = {}) {
  const value = (_, v) => short(v);
  const chart = new uPlot({
    width: width(host), height, scales: { x: { time: false } }, cursor: { drag: { x: true, y: false } },
    series: [{ label: "lag, s", value }, { label: title, stroke: COLOURS.residual, width: 1.4, points: { show: false }, value }, ...bandOf("by chance", COLOURS.noise)],
    bands: [{ series: [2, 3], fill: wash(COLOURS.noise) }],
    axes: [axis("lag, s", "x", { size: 34 }), axis(title, "y")],
  }, [found.lag_s, found.value, found.band, found.band.map((v) => -v)], host);
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", `${title} over lags, and the band that it stays in by chance`);
  chart.key = [{ label: "by chance", colour: COLOURS.noise, faint: true }];
  host.append(keyOf(chart.key));
  return placed(chart, host, height, name);
}

/** Values of named things, as dots: each series with its label, its colour, its values, hollow or filled. */
export function dotsPlot(host, names, series, title, { height = 320, name = null } = {}) {
  const narrow = width(host) < 1000;
  const ground = style.getPropertyValue("--panel").trim();
  const chart = new uPlot({
    width: width(host), height, scales: { x: { time: false, range: [-0.5, names.length - 0.5] }, y: { distr: 3, range: (_, low, high) => [low / 1.6, high * 1.6] } }, cursor: { drag: { x: false, y: false } },
    legend: { show: false },
    series: [{ label: "reference", value: (_, v) => names[v] ?? "–" }, ...series.map((one) => ({ label: one.label, stroke: one.colour, width: 0, paths: () => null, points: { show: true, size: 9, width: 2, fill: one.hollow ? ground : one.colour }, hollow: one.hollow }))],
    axes: [axis(undefined, "x", { size: narrow ? 140 : 34, rotate: narrow ? 60 : 0, splits: () => names.map((_, k) => k), values: () => names }), axis(title, "y", { size: 60, values: (_, ticks) => ticks.map((v) => (/^0*1?0*$/.test(String(v).replace(".", "")) ? String(v) : "")) })],
  }, [names.map((_, k) => k), ...series.map((one) => one.values)], host);
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", `${series.map((one) => one.label).join(", ")}: ${title}, for ${names.join(", ")}`);
  host.append(keyOf(series.map((one) => ({ ...one, dot: true }))));
  chart.dots = true;
  return placed(chart, host, height, name);
}

/** A small picture of two errors over time, for a card. */
export function tracePlot(host, time, without, withIt, outputUnit) {
  const [factor, name] = readable(outputUnit, Math.max(...without.map(Math.abs)));
  const line = (label, colour) => ({ label, stroke: colour, width: 1.2, points: { show: false }, value: (_, v) => short(v) });
  const scaled = (values) => values.map((v) => v * factor);
  const chart = new uPlot({
    width: width(host), height: 150, scales: { x: { time: false } }, cursor: { drag: { x: false, y: false } },
    legend: { show: false },
    series: [{ label: "time, s", value: (_, v) => short(v) }, line("without it", COLOURS.noise), line("with it", COLOURS.model)],
    axes: [axis("time, s", "x", { size: 30 }), axis(`error, ${name}`, "y", { space: 16, size: 46 })],
  }, [time, scaled(without), scaled(withIt)], host);
  host.append(keyOf([{ label: "without it", colour: COLOURS.noise }, { label: "with it", colour: COLOURS.model }]));
  host.setAttribute("role", "img");
  host.setAttribute("aria-label", "Error over time without the effect and with it");
  fit(chart, host, 150);
  return chart;
}
