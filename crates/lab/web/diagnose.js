// Which effect is missing: the verdict, and the candidates as cards.
import { ask, download } from "./api.js";
import { el, table, command, facts, right, tiles } from "./dom.js";
import { between, count, num, percent, readable, text } from "./numbers.js";
import { tracePlot } from "./plots.js";
import { effects, effectName } from "./effects.js";
import { riddlePart } from "./riddle.js";
import { bring, chosen } from "./data.js";
import { staleNotice } from "./stale.js";

/** Why a candidate does not count, from its figures. */
function whyNot(effect, numbers) {
  if (numbers.further.includes(effect.effect)) return `Counts once ${effectName(numbers.verdict)} is in the model: add that first, then this.`;
  if (effect.statistic <= effect.threshold) return "Does not count: what it gains on records it was not fitted to could be chance.";
  if (numbers.verdict === "unknown" || numbers.cannot_answer.length) return "Gains something, but these records cannot confirm it.";
  return "Does not count: it is too small to matter, or another explains the same better.";
}

/** What the candidate gains: added to this model as a step of the ladder will show it, and beside loops of free shape, by which it is judged. */
function evidence(effect, numbers, signature) {
  const share = effect.share < 0 ? "nothing; records it was not fitted to get worse" : percent(100 * effect.share);
  const judged = numbers.before.validate_percent !== null;
  const of = (errors) => (judged ? errors.validate_percent : errors.identify_percent);
  const fell = (after, before) => `${percent(of(after))}, without it ${percent(of(before))}`;
  return facts([
    ...(signature ? [[`Error once added, records ${judged ? "not fitted to" : "fitted to"}`, fell(signature, numbers.before)]] : []),
    [numbers.shape_determined ? "Error with it, loops of free shape" : "Error with it, plays fitted anew", fell(effect, numbers.free_shape)],
    ["Takes of the squared error", share],
    ["Statistic", `${num(effect.statistic)}; must exceed ${num(effect.threshold)}`],
    ["Independent samples", count(effect.effective_samples)],
    ["Kind", effect.level === "physical" ? "physical: a hysteresis of free shape does not explain it" : "a matter of the loops' shape"],
  ]);
}

/** The candidate's parameters: as `add` fits them where that was done, else as they were tried. */
function parameters(effect, bounds, signature) {
  const own = signature ? signature.parameters : effect.parameters;
  if (!own.length) return null;
  const rows = own.map((p) => {
    const range = bounds[p.name];
    const [factor, name] = readable(p.unit, Math.abs(p.value));
    const error = p.standard_error ? ` ± ${Number((p.standard_error * factor).toPrecision(1))}` : "";
    return [p.name.replaceAll("_", " "), right(`${num(p.value * factor)}${error}${name ? `\u00a0${name}` : ""}`), range ? (range[0] === range[1] ? "fixed" : between(range[0], range[1], p.unit)) : "–"];
  });
  const of = effectName(effect.effect);
  return table(signature ? `Parameters of ${of}, with standard errors` : `Parameters of ${of} as tried`, ["Parameter", "Value", "Physical between"], rows);
}

/** How a candidate that counts stands to the verdict: part of it, not told apart from others, or behind it. */
function standing(effect, numbers) {
  const set = [numbers.verdict, ...numbers.also_possible];
  const named = [...set, ...numbers.further].includes(effect.effect);
  if (!named && numbers.verdict !== "unknown") return el("p", { class: "told" }, `Significant by itself, but ${effectName(numbers.verdict)} explains these records better and takes most of the same error.`);
  if (numbers.also_possible.length === 0 || !set.includes(effect.effect)) return null;
  return el("p", { class: "told" }, `These records cannot tell it from ${set.filter((name) => name !== effect.effect).map(effectName).join(" or ")}.`);
}

function card(lab, found, index, words, views) {
  const { numbers, bounds, signatures } = found;
  const effect = numbers.ranking[index];
  const name = effectName(effect.effect);
  const signature = signatures.find((one) => one.effect === effect.effect);
  const picture = signature ? el("div", { class: "plot" }) : null;
  if (picture) views.push(() => tracePlot(picture, signature.time_s, signature.without, signature.with, "um"));
  const more = [
    evidence(effect, numbers, signature), parameters(effect, bounds[index], signature),
    words ? facts([["What it is", text(words.summary)], ["Equation", el("code", {}, text(words.equation))], ["How it shows", text(words.shows)], ["Mistaken for", text(words.mistaken_for)], ["Separated by", text(words.separated_by)], ["Compensated by", text(words.compensated_by)]]) : null,
  ];
  return el("article", { class: effect.significant ? "card counts" : "card", id: `card-${effect.effect}` },
    el("h3", {}, `${index + 1}. ${name}`),
    el("p", {}, effect.significant ? "Significant, and large enough to matter." : whyNot(effect, numbers)),
    effect.significant ? standing(effect, numbers) : null,
    signature ? [el("p", { class: "hint" }, `Error in ${signature.file} without it and with it, everything fitted anew:`), picture] : null,
    effect.significant ? more.slice(0, 2) : null,
    el("details", {}, el("summary", {}, effect.significant ? `What ${name} is, and what it is mistaken for` : "Evidence, parameters, what it is"), effect.significant ? more.slice(2) : more),
    el("p", { class: "row" }, el("button", { type: "button", id: `add-${effect.effect}`, disabled: lab.state.job.running, click: () => lab.act({ what: "add", effect: effect.effect }, "ladder") }, `Add ${name}`),
      el("a", { href: `#effects/${effect.effect}` }, "See it in your loops")));
}

/** What to do now: add what is named, then take the record that would tell more. */
function nextSteps(lab, { numbers, named }) {
  const step = lab.state.current;
  const input = el("input", { type: "file", id: "bring-next", class: "file", change: () => { lab.go("data"); bring(lab, chosen(input), step); } });
  const next = numbers.next_record ? [
    el("a", { class: named ? "button quiet" : "button", href: download("next", step), download: true, id: "next-record" }, "Download the record to take next"),
    el("span", { class: "choose" }, input, el("label", { for: "bring-next", class: "button quiet" }, "Bring its recording"))] : [];
  return [
    el("p", { class: "row", id: "next-steps" },
      named ? el("button", { type: "button", class: "main", id: "add-named", disabled: lab.state.job.running, click: () => lab.act({ what: "add", effect: named }, "ladder") }, `Add ${effectName(named)}`) : null,
      ...next),
    el("p", { id: "bring-status", role: "status" })];
}

/** How likely each candidate is, as bars: the digits are the command line's. */
function oddsPart(odds) {
  if (!odds) return null;
  const bar = (share) => { const one = el("span", { class: "bar" }); one.style.width = `${100 * share}%`; return el("span", { class: "track", "aria-hidden": "true" }, one); };
  return el("div", { id: "odds" }, el("p", {}, `${odds.title}:`),
    el("ul", { class: "odds" }, odds.each.map(({ name, said, share }) => el("li", {}, el("span", {}, name), bar(share), el("span", { class: "figure" }, said)))));
}

export async function diagnosePage(lab) {
  const step = lab.state.current;
  const [known, words] = await Promise.all([effects(), ask("words", { step })]);
  const page = el("div", {}, staleNotice(lab) || "", el("h2", {}, `Which effect is missing from ${lab.state.steps[step].title}?`));
  const run = (title, kind) => el("button", { type: "button", class: kind, id: "diagnose", disabled: lab.state.job.running, click: () => lab.act({ what: "diagnose" }) }, title);
  const riddle = riddlePart(lab) || "";
  if (!lab.state.diagnosed[step]) {
    page.append(el("section", { class: "panel" }, el("p", {}, "Every effect of the catalogue is fitted in its place, together with everything else, and judged on records it was not fitted to. It takes some seconds and can be stopped."),
      el("p", {}, run("Diagnose", "main"))), command(words.diagnose_command), riddle);
    return page;
  }
  const found = await ask("diagnosis", { step });
  const { numbers, fails, verdict, lines, odds } = found;
  const views = [];
  page.append(
    el("section", { class: numbers.cannot_answer.length ? "panel verdict unsure" : "panel verdict" },
      el("p", { class: "sentence", id: "verdict" }, verdict),
      ...nextSteps(lab, found),
      oddsPart(odds),
      lines.length ? el("ul", {}, lines.map((line) => el("li", {}, line))) : null,
      el("p", { class: "hint" }, "How often such a verdict is right was counted on simulated stages only: take it as a hint, and take the record it asks for.")),
    tiles([
      ["The model", percent(numbers.before.validate_percent), "of peak to peak, records not fitted to"],
      [numbers.shape_determined ? "A hysteresis of free shape instead" : "Its plays, fitted anew", percent(numbers.free_shape.validate_percent), "of peak to peak, records not fitted to"],
      ["Left unexplained", percent(numbers.unexplained.percent), "of peak to peak, all records that move"],
      ["Of this, noise", percent(numbers.unexplained.noise_percent), "of peak to peak"]]),
    el("ul", { id: "fails" }, fails.map((line) => el("li", {}, line))),
    riddle);
  const cards = numbers.ranking.map((effect, index) => [effect, card(lab, found, index, known.find((k) => k.name === effect.effect), views)]);
  const group = (title, wanted) => {
    const own = cards.filter(([effect]) => effect.significant === wanted).map(([, one]) => one);
    if (own.length) page.append(el("h2", {}, title), el("div", { class: "cards" }, own));
  };
  group("Candidates that count", true);
  group(cards.some(([effect]) => effect.significant) ? "Candidates that do not count" : "Candidates, best first; none counts", false);
  page.append(el("p", {}, run("Diagnose again", "")), command(words.diagnose_command));
  page.addEventListener("shown", () => views.forEach((draw) => draw()));
  return page;
}
