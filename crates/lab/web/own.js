// An effect of one's own: its file is written here, kept as it is typed, and read by the parser of the command line.
import { ask, tell } from "./api.js";
import { el } from "./dom.js";

/** How long a person stops typing before the text is kept and read, milliseconds. */
const PAUSE = 300;

/** The text that was typed last, and where in it: a page that is drawn again goes on there. */
let typed = null;

const same = (text) => [document.createTextNode(text)];

/** The text with a mark at the place of what is wrong. */
function marked(text, judged) {
  if (!judged.line) return same(text);
  const lines = text.split("\n");
  const before = lines.slice(0, judged.line - 1).map((line) => `${line}\n`).join("");
  const characters = [...(lines[judged.line - 1] || "")];
  const at = Math.min(judged.column - 1, characters.length);
  const start = before.length + characters.slice(0, at).join("").length;
  const wrong = characters[at] || " ";
  return [...same(text.slice(0, start)), el("mark", {}, wrong), ...same(`${text.slice(start + (characters[at] || "").length)}\n`)];
}

/** The place of what is wrong, as the field counts it. */
function caret(text, { line, column }) {
  const lines = text.split("\n");
  const before = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
  return before + [...(lines[line - 1] || "")].slice(0, column - 1).join("").length;
}

/** What is wrong, as a sentence. */
const sentence = (judged) => `${judged.line ? `Line ${judged.line}, column ${judged.column}: ` : ""}${judged.wrong}.`;

export async function ownPart(lab) {
  const kept = await ask("own-effect");
  typed = typed || { text: kept.text, start: 0, end: 0, top: 0 };
  const { current, job, steps } = lab.state;
  const behind = el("pre", { "aria-hidden": "true" });
  const field = el("textarea", { id: "own-text", spellcheck: "false", autocapitalize: "off", autocomplete: "off", rows: "24", wrap: "off", "aria-label": "The effect file", "aria-describedby": "own-judged" });
  const said = el("p", { id: "own-judged", role: "status" });
  const there = el("button", { type: "button", class: "small", id: "own-show", click: () => { const at = caret(field.value, judged); field.focus(); field.setSelectionRange(at, Math.min(at + 1, field.value.length)); } }, "Show it in the text");
  const add = el("button", { type: "button", class: "main", id: "own-add", click: async () => { if (await keep() && judged.name) lab.act({ what: "add-own" }, "ladder"); } });
  let judged = kept.judged;
  let waits = null;
  const scroll = () => { [behind.scrollTop, behind.scrollLeft] = [field.scrollTop, field.scrollLeft]; };
  function show() {
    behind.replaceChildren(...marked(field.value, judged));
    field.setAttribute("aria-invalid", judged.name ? "false" : "true");
    said.className = judged.name ? "told" : "refused";
    said.textContent = judged.name ? `The file is right: ${judged.name}. ${judged.summary}` : sentence(judged);
    there.hidden = !judged.line;
    add.textContent = judged.name ? `Fit ${judged.name} and add it to step ${current + 1}` : "Fit it and add it";
    add.disabled = current === null || job.running || !judged.name;
    scroll();
  }
  /** Keeps and reads the text; whether what is kept is what stands there. */
  async function keep() {
    clearTimeout(waits);
    waits = null;
    const text = field.value;
    try {
      const answer = await tell("own-effect", { text });
      if (text !== field.value) return false;
      judged = answer;
      lab.say(null);
      show();
      return true;
    } catch (error) {
      lab.say(error, "own-text");
      return false;
    }
  }
  const note = () => { typed = { text: field.value, start: field.selectionStart, end: field.selectionEnd, top: field.scrollTop }; };
  field.value = typed.text;
  field.addEventListener("input", () => {
    note();
    // What was said is of another text; its mark goes until the new one is read.
    behind.replaceChildren(...same(field.value));
    scroll();
    clearTimeout(waits);
    waits = setTimeout(keep, PAUSE);
  });
  for (const event of ["keyup", "click", "select"]) field.addEventListener(event, note);
  field.addEventListener("scroll", scroll);
  const part = el("div", { class: "effect" },
    el("h2", {}, "An effect of your own"),
    el("p", { class: "lead" }, "An equation that the catalogue does not have, with its parameters and their bounds. It is fitted and compared like the others, by the same code."),
    el("p", {}, "Where it stands: delay or amplifier act on the voltage; creep, structure, coupling or sensor on the position. In expressions u is the input, du its rate, t the time, v the voltage at the stack. Up to four states have a rate or a next value."),
    el("div", { class: "editor" }, behind, field),
    el("div", { class: "row" }, said, there),
    current === null ? el("p", { class: "notice" }, "Fit a model first; the effect is added to it.") : el("p", { class: "hint" }, `It is added to step ${current + 1}, ${steps[current].title}, and everything is fitted anew.`),
    el("p", {}, add));
  part.addEventListener("shown", () => { field.setSelectionRange(typed.start, typed.end); field.scrollTop = typed.top; if (kept.text !== field.value) keep(); else show(); });
  return part;
}
