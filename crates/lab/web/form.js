// Forms: fields with their options, the values kept over a refusal.
import { el, typed } from "./dom.js";

/** What was typed last, by form: neither a refusal nor a page that is drawn anew takes it away. */
const given = {};

/** A form: parts with their fields, and the button that sends what was filled in. */
export function form(lab, id, parts, title, act) {
  const kept = given[id] || {};
  const field = ({ name, title: label, otherwise, choices, tick, words }) => {
    const own = `${id}-${name}`;
    const input = choices
      ? el("select", { id: own, name }, choices.map(([value, words]) => el("option", { value, selected: kept[name] === value }, words)))
      : words ? el("input", { id: own, name, type: "text", placeholder: otherwise, value: kept[name] ?? null, autocomplete: "off", spellcheck: "false" }) : el("input", tick ? { id: own, name, type: "checkbox", checked: kept[name] === true } : { id: own, name, type: "number", step: "any", placeholder: otherwise, value: kept[name] ?? null });
    // `Rate, Hz (--rate-hz)`: the option, by which a refusal names the field, stays in one piece.
    const [title, option] = label.replace(")", "").split(" (");
    const named = el("label", { for: own }, `${title} `, option ? el("code", { class: "option" }, option) : null);
    return el("p", { class: tick ? "tick" : null }, tick ? [input, " ", named] : [named, input]);
  };
  const value = (input) => (input.type === "checkbox" ? input.checked : input.type === "number" ? typed(input.value) : input.value);
  const read = () => Object.fromEntries([...made.querySelectorAll("input[name], select")].map((input) => [input.name, value(input)]));
  const made = el("form", { id: `${id}-form`, input: () => { given[id] = read(); }, submit: (event) => {
    event.preventDefault();
    given[id] = read();
    act(given[id]);
  } },
  parts.map(([part, fields]) => el("fieldset", {}, el("legend", {}, part), el("div", { class: "fields" }, fields.map(field)))),
  el("button", { type: "submit", id, class: title.includes("again") ? "" : "main", disabled: lab.state.job.running }, title));
  made.read = read;
  return made;
}
