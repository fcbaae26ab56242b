// All records in small pictures: each opens its record.
import { ask } from "./api.js";
import { el } from "./dom.js";
import { COLOURS } from "./plots.js";

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [120, 44];

/** A line of values within the picture; `span` is what its whole height stands for, from its own values where none is given. */
function line(values, kind, span = null) {
  const there = values.filter((v) => v !== null);
  const [low, high] = [Math.min(...there), Math.max(...there)];
  const height = span ?? (high - low);
  const middle = (low + high) / 2;
  const place = (v, k) => `${(k * WIDTH / Math.max(1, values.length - 1)).toFixed(1)},${(HEIGHT / 2 - (height > 0 ? 0.9 * HEIGHT * (v - middle) / height : 0)).toFixed(1)}`;
  const path = document.createElementNS(SVG, "polyline");
  path.setAttribute("points", values.map((v, k) => (v === null ? "" : place(v, k))).join(" "));
  path.setAttribute("stroke", COLOURS[kind]);
  return path;
}

/**
 * The strip of records, of all or of those with these numbers: `named(index)` says what stands below a picture, `choose(index)` opens it. Of a step the error
 * stands before the measurement, of all records at one scale.
 */
export function smallPictures(parameters, label, named, chosen, choose, numbers = null) {
  const strip = el("div", { class: "small-pictures", id: `small-${parameters.of || "step"}`, role: "group", "aria-label": label });
  const mark = (index) => [...strip.children].forEach((one, k) => one.setAttribute("aria-pressed", k === index ? "true" : "false"));
  strip.mark = mark;
  strip.addEventListener("fill", async () => {
    const every = await ask("small", parameters);
    const all = numbers === null ? every : numbers.map((number) => every[number]);
    const peak = (values) => Math.max(...values) - Math.min(...values);
    const widest = Math.max(...all.map(([, error]) => peak(error)));
    strip.replaceChildren(...all.map(([first, second], index) => {
      const picture = document.createElementNS(SVG, "svg");
      picture.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
      picture.setAttribute("aria-hidden", "true");
      if ("step" in parameters) picture.append(line(first, "measured"), line(second, "residual", widest));
      else picture.append(line(first, "input"), line(second, "measured"));
      return el("button", { type: "button", id: `small-${parameters.of || "step"}-${index}`, click: () => { mark(index); choose(index); } }, picture, el("span", {}, named(index)));
    }));
    mark(chosen());
  });
  return strip;
}
