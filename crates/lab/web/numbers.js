// Numbers and units as people read them; the same rules as in the reports.

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const superscript = (n) => String(n).replace("-", "⁻").replace(/\d/g, (d) => SUPERSCRIPTS[d]);

/** A power of ten. */
export const power = (exponent) => `10${superscript(exponent)}`;

/** A count with its thousands set apart, from five digits on. */
export function count(value) {
  const digits = String(Math.round(Math.abs(value)));
  const grouped = digits.length < 5 ? digits : digits.replace(/\B(?=(\d{3})+$)/g, "\u202f");
  return value < 0 ? `−${grouped}` : grouped;
}

/** A number with three significant digits and no exponent while that stays readable. */
export function num(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const rounded = Number(value.toPrecision(3));
  const exponent = Math.floor(Math.log10(Math.abs(rounded)));
  if (exponent >= -4 && exponent <= 3) return rounded.toFixed(Math.max(0, 2 - exponent)).replace("-", "−");
  if (exponent >= 4 && exponent <= 8) return count(rounded);
  return `${(rounded / 10 ** exponent).toFixed(2).replace("-", "−")}×10${superscript(exponent)}`;
}

/** Percent, kept on one line. */
export const percent = (value) => (value === null || value === undefined ? "–" : `${num(value)}\u00a0%`);

/** A unit as printed. */
export const unit = (text) => text.replace(/\bum\b/g, "µm").replace("degC", "°C").replace("^(1-n)", "¹⁻ⁿ").replace(/\^(\d)/, (_, d) => SUPERSCRIPTS[d]);

/** A text of the catalogue with its units as printed. */
export const text = (words) => words.replace(/\bum\b/g, "µm").replace(/(\d) us\b/g, "$1 µs");

// Units, factor to them, and from which value in them they read best.
const SIBLINGS = {
  "um": [["µm", 1, 0.1], ["nm", 1e3, 0.1], ["pm", 1e6, 0]],
  "um/s": [["mm/s", 1e-3, 10], ["µm/s", 1, 0.1], ["nm/s", 1e3, 0]],
  "V": [["V", 1, 0.1], ["mV", 1e3, 0.1], ["µV", 1e6, 0]],
  "s": [["s", 1, 0.1], ["ms", 1e3, 0.1], ["µs", 1e6, 0]],
  "Hz": [["kHz", 1e-3, 10], ["Hz", 1, 0]],
};

/** The factor and the unit in which a quantity of this size reads best. */
export function readable(text, size) {
  const found = (SIBLINGS[text.replace("µ", "u")] || []).find(([, factor, from]) => size > 0 && size * factor >= from);
  return found ? [found[1], found[0]] : [1, unit(text)];
}

/** A value with its unit. */
export function quantity(value, text) {
  if (value === null || value === undefined) return "–";
  const [factor, name] = readable(text, Math.abs(value));
  return name ? `${num(value * factor)}\u00a0${name}` : num(value);
}

/** Two values with one unit between them. */
export function between(low, high, text) {
  const [factor, name] = readable(text, Math.max(Math.abs(low), Math.abs(high)));
  return `${num(low * factor)} to ${num(high * factor)}${name ? `\u00a0${name}` : ""}`;
}
