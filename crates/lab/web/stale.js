// Steps that were fitted before the data grew: what came since, and the button that fits them anew.
import { el } from "./dom.js";

const list = (names, most = 4) => (names.length > most ? `${names.slice(0, most).join(", ")} and ${names.length - most} more` : names.join(", "));

/** What a step does not know yet, in words. */
export function sinceWords({ records, roles }) {
  const parts = [];
  if (records.length) parts.push(`${list(records)} came`);
  if (roles.length) parts.push(`the ${roles.length === 1 ? "role" : "roles"} of ${list(roles)} changed`);
  return `fitted before ${parts.join(" and ")}`;
}

/** On every page that shows a step which was fitted before the data grew. */
export function staleNotice(lab) {
  const { state } = lab;
  const step = state.current === null ? null : state.steps[state.current];
  if (!step || !step.since) return null;
  const count = state.data.records.length;
  return el("div", { class: "notice row", id: "stale" },
    el("span", {}, `Step ${state.current + 1}, ${step.title}, was ${sinceWords(step.since)}. Its figures are of the records that it knows.`),
    el("button", { type: "button", class: "main", id: "refit", disabled: state.job.running, click: () => lab.act({ what: "refit" }) }, `Fit it anew on ${count === 1 ? "the one record" : `all ${count} records`}`));
}
