// Data with something hidden in them: one answer, then the truth.
import { el, command, right, table } from "./dom.js";
import { percent, quantity } from "./numbers.js";

/** That something is hidden, and where to answer. */
export function challengeNotice(lab) {
  const { challenge } = lab.state;
  if (!challenge) return null;
  const text = challenge.revealed ? "What was hidden in these data is shown under " : challenge.answer ? `Your answer is ${challenge.answer.effects.join(" and ")}. See the truth under ` : "Something may be hidden in these data. Fit a model, find what is missing, then answer under ";
  return el("p", { class: "told" }, text, el("a", { href: "#diagnose" }, "Diagnose"), ".");
}

function truth({ truth: hidden, answer, judgement }, seed) {
  const rows = hidden.hidden.flatMap((one) => [[one.outside_of_the_catalogue ? `${one.effect} (the catalogue does not have it)` : one.effect, right(percent(one.contribution_percent)), one.strength],
    ...one.parameters.map((p) => [`${p.name.replaceAll("_", " ")}`, right(quantity(p.value, p.unit)), ""])]);
  return [
    judgement ? el("p", { class: "lead", id: "judgement" }, `${answer.effects.map((name) => name.replaceAll("-", " ")).join(" and ")}: ${judgement.outcome.replace("-", " ")}; ${judgement.because}.`) : el("p", { class: "lead", id: "judgement" }, "No answer was given before."),
    rows.length ? table("What was hidden, and what it adds to the error", ["Hidden", "Value", "Strength"], rows) : el("p", {}, "Nothing was hidden."),
    el("p", { class: "hint" }, `The stage has ${hidden.family} hysteresis, ${quantity(hidden.stroke_um, "um")} of stroke at ${quantity(hidden.full_v, "V")}, sensor noise of ${quantity(hidden.noise_rms_um, "um")} rms; seed ${seed}.`),
  ];
}

/** The part of the page that takes the answer and shows the truth. */
export function riddlePart(lab) {
  const { challenge, job } = lab.state;
  if (!challenge) return null;
  if (challenge.error) return el("section", { class: "panel" }, el("h3", {}, "What is hidden?"), el("p", { class: "refused" }, challenge.error));
  const part = el("section", { class: "panel", id: "riddle" }, el("h3", {}, "What is hidden?"));
  const reveal = el("button", { type: "button", id: "reveal", disabled: job.running, click: () => lab.act({ what: "reveal" }) }, "Show the truth");
  if (challenge.revealed) part.append(...truth(challenge.revealed, challenge.seed));
  else if (challenge.answer) part.append(el("p", {}, `You answered ${challenge.answer.effects.join(" and ")}.`), el("p", {}, reveal), command(challenge.reveal_command));
  else {
    const choice = (id, none) => el("select", { id }, none ? el("option", { value: "" }, none) : null, challenge.names.map((name) => el("option", { value: name }, name.replaceAll("-", " "))));
    const [first, second] = [choice("answer-1", null), choice("answer-2", "nothing more")];
    part.append(el("p", {}, "One answer is taken. Two names mean that both are there, or that these data cannot tell them apart; none and unknown stand alone."),
      el("form", { class: "row", id: "answer-form", submit: (event) => {
        event.preventDefault();
        lab.act({ what: "answer", effects: [first.value, second.value].filter(Boolean) });
      } }, el("label", { for: "answer-1" }, "It is "), first, el("label", { for: "answer-2" }, " and "), second, el("button", { type: "submit", class: "main", id: "answer" }, "Answer")),
      el("p", {}, el("span", { class: "hint" }, "Or give up: "), reveal), command(challenge.answer_command));
  }
  return part;
}
