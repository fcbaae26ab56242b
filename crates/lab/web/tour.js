// A tour of one minute: an example, from its records to the board, each stop with what to look at and the button that goes on.
import { ask } from "./api.js";
import { el } from "./dom.js";
import { percent } from "./numbers.js";

const EXAMPLE = "hidden-resonance";
/** The converters of the example's bench: volts at the stack, micrometres. */
const BENCH = { dac_min_v: 0, dac_full_v: 66, adc_min_um: -5, adc_full_um: 12 };
const KEY = "hysteron-tour";

const error = (step) => step.validate_percent ?? step.identify_percent;

/** Where it stops: the page, what is to be seen on it, and what goes on to the next. */
const STOPS = [
  { station: "data", words: () => "These are fifteen records of a simulated stage, and something is hidden in it. Each stands over time and as a loop below. Those used to judge the model are not fitted to.",
    next: "Fit a model", deed: () => ({ what: "fit", model: "play-polynomial", plays: 10 }) },
  { station: "compare", words: () => "The model stands beside the measurement, the worst of the records that it is judged by first. The strip about zero is the noise: what leaves it is missing in the model.",
    next: "Ask what is missing", deed: () => ({ what: "diagnose" }) },
  { station: "diagnose", words: () => "The verdict comes first, then where in your data it stands, with the effect and without it. The table has every candidate with the error that it would leave.",
    next: "Add the effect", deed: async (state) => ({ what: "add", effect: (await ask("diagnosis", { step: state.current, plain: 1 })).verdict }) },
  { station: "ladder", words: ({ steps, current }) => `The error fell from ${percent(error(steps[0]))} to ${percent(error(steps[current]))} of peak to peak; the stroke on each bar is the noise. Every step can be taken back, named, or set beside another.`,
    next: "Design its controller", deed: () => ({ what: "design", wishes: {} }) },
  { station: "controller", words: () => "The effect brought its compensator. Each light says what is known and what is not; below are the loop's margins, a run of the law, and the table for the firmware, here for converters of 0 to 66 V and −5 to 12 µm.",
    next: "Make the table", deed: () => ({ what: "table", bench: BENCH }) },
  { station: "board", words: () => "A board at its cable, or a simulated one, runs this table: with a scope, references, gains, and recordings that go back into the data. That is the whole way.",
    next: null },
];

const at = () => { const kept = sessionStorage.getItem(KEY); return kept === null ? null : Number(kept); };
const put = (stop) => (stop === null ? sessionStorage.removeItem(KEY) : sessionStorage.setItem(KEY, stop));

/** Begins it where there are no data yet. */
export function tourButton(lab) {
  return el("button", { type: "button", id: "take-tour", disabled: lab.state.job.running, click: async () => {
    put(0);
    if (!await lab.act({ what: "start", name: EXAMPLE }, "data")) put(null);
  } }, "Take the tour: one minute");
}

/** The stop where one is, above the page; nothing where no tour is taken. */
export function drawTour(lab, host) {
  const { state } = lab;
  const page = location.hash.slice(1).split("/")[0] || "data";
  // What did not come to its end is begun again from where it was.
  const broken = state.job.failed !== null || state.job.stopped;
  const stop = at() > 0 && broken && page === STOPS[at() - 1].station ? at() - 1 : at();
  const here = stop === null ? null : STOPS[stop];
  // Data of another kind end it.
  if (here && state.data && !(state.data.command || "").includes(EXAMPLE)) put(null);
  const there = at() !== null && state.data !== null && (stop < 3 || state.steps.length > 1);
  host.hidden = !there;
  if (!there) return;
  const end = () => { put(null); drawTour(lab, host); };
  const next = here.next && el("button", { type: "button", class: "main", id: "tour-next", disabled: state.job.running, click: async () => {
    const deed = await here.deed(lab.state);
    put(stop + 1);
    if (!await lab.act(deed, STOPS[stop + 1].station)) put(stop);
  } }, here.next);
  const busy = state.job.running;
  host.replaceChildren(el("p", { id: "tour-words" }, el("strong", {}, `${stop + 1} of ${STOPS.length}. `), busy ? "One moment." : here.words(state)),
    el("p", { class: "row" }, next, page === here.station || busy ? null : el("a", { class: "button quiet", href: `#${here.station}` }, "Back to the tour's page"),
      el("button", { type: "button", id: "tour-end", click: end }, next ? "End the tour" : "Done")));
}
