// Small helpers: elements, tables, commands.
import { num } from "./numbers.js";

/** An element. Attributes that are functions are listeners; text is never read as HTML. */
export function el(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key, value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== ""));
  return element;
}

/** A cell that stands to the right, as numbers do. */
export const right = (text) => ({ text });

/** A table; cells that are numbers stand to the right, a cell may hold an element. */
export function table(caption, columns, rows) {
  const is = (value, part) => value !== null && typeof value === "object" && part in value;
  const numeric = (value) => typeof value === "number" || value === null || is(value, "text");
  const shown = (value) => (is(value, "element") ? value.element : is(value, "text") ? value.text : numeric(value) ? num(value) : value);
  const cell = (value, index) => {
    const attributes = numeric(value) ? { class: "number" } : {};
    return index === 0 ? el("th", { scope: "row", ...attributes }, shown(value)) : el("td", attributes, shown(value));
  };
  const head = (title, index) => el("th", { scope: "col", class: rows.length && numeric(rows[0][index]) ? "number" : null }, title);
  return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
    el("table", {},
      el("caption", {}, caption),
      el("thead", {}, el("tr", {}, columns.map(head))),
      el("tbody", {}, rows.map((row) => el("tr", {}, row.map(cell))))));
}

/** The command that does the same, or what else it is about. A line that is pasted must stay one line: no name in it may end it. */
export function command(words, about = "The same on the command line") {
  const text = words.replace(/[\p{Cc}\u2028\u2029]/gu, " ");
  const copy = el("button", { type: "button", class: "small", "aria-label": `Copy the command ${text}`, click: async () => {
    await navigator.clipboard.writeText(text);
    copy.textContent = "Copied";
  } }, "Copy");
  return el("div", { class: "command" }, el("span", {}, about), el("code", {}, text), copy);
}

/** What a command prints: sentences wrap, the lines of a table stay whole. */
export function printed(id, label, text) {
  const table = (line) => /\S {2,}\S/.test(line);
  const lines = text.trimEnd().split("\n").map((line) => el("span", { class: table(line) ? null : "prose" }, `${line}\n`));
  return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label }, el("pre", { id, class: "printed" }, lines));
}

/** A picture's frame with its heading. */
export function panel(title, ...children) {
  return el("section", { class: "panel" }, el("h3", {}, title), ...children);
}

/** Names with their values. */
export function facts(rows) {
  return el("dl", { class: "facts" }, rows.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
}

/** Figures that matter, large. */
export function tiles(rows) {
  return el("dl", { class: "tiles" }, rows.map(([label, value, note]) => el("div", {}, el("dt", {}, label), el("dd", { class: "value" }, value), el("dd", { class: "note" }, note))));
}

/** A number that a person typed, or nothing. */
export const typed = (text) => (text.trim() === "" ? null : Number(text));
