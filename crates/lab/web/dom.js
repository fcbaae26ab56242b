// Small helpers: elements, numbers, tables.

/** An element. Attributes that are functions are listeners; text is never read as HTML. */
export function el(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key, value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** A number with three significant digits; a whole one, such as a count of samples, with all of its own. */
export function num(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Number.isSafeInteger(value) && Math.abs(value) < 1e9) return String(value).replace("-", "−");
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(digits - 1).replace("-", "−").replace("e", " e");
  return Number(value.toPrecision(digits)).toString().replace("-", "−");
}

export const percent = (value) => (value === null || value === undefined ? "–" : `${num(value)} %`);

export const unit = (text) => text.replace("um", "µm");

/** A table; cells that are numbers stand to the right. */
export function table(caption, columns, rows) {
  const cell = (value, index) => {
    const numeric = typeof value === "number" || value === null;
    const attributes = numeric ? { class: "number" } : {};
    const content = numeric ? num(value) : value;
    return index === 0 ? el("th", { scope: "row", ...attributes }, content) : el("td", attributes, content);
  };
  return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
    el("table", {},
      el("caption", {}, caption),
      el("thead", {}, el("tr", {}, columns.map((title) => el("th", { scope: "col" }, title)))),
      el("tbody", {}, rows.map((row) => el("tr", {}, row.map(cell))))));
}

/** The command that does the same. */
export function command(text) {
  const copy = el("button", { type: "button", click: async () => {
    await navigator.clipboard.writeText(text);
    copy.textContent = "Copied";
  } }, "Copy");
  return el("div", { class: "command" }, el("span", {}, "The same on the command line:"), el("code", {}, text), copy);
}

/** A picture's frame with its heading. */
export function panel(title, ...children) {
  return el("section", { class: "panel" }, el("h3", {}, title), ...children);
}
