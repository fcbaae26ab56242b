// The server, as the page sees it. All addresses are relative, so that the token in the address goes with each.

export class Refused extends Error {}

async function answer(response) {
  const body = (response.headers.get("content-type") || "").includes("json") ? await response.json() : await response.text();
  if (!response.ok) throw new Refused((body && body.error) || `the server answered ${response.status}`);
  return body;
}

export async function ask(path, parameters = {}, signal = undefined) {
  const query = new URLSearchParams(parameters).toString();
  return answer(await fetch(`api/${path}${query ? `?${query}` : ""}`, { signal }));
}

export async function tell(path, body) {
  return answer(await fetch(`api/${path}`, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) }));
}

/** Sends a file under its path within what was brought; `asked` is the step whose diagnosis asked for it. */
export async function send(file, path, asked = null) {
  const query = new URLSearchParams({ name: path, ...(asked === null ? {} : { asked }) });
  return answer(await fetch(`api/upload?${query}`, { method: "POST", body: file }));
}

/** Sends a file that came back of the campaign's plan. */
export async function sendBack(file, path) {
  return answer(await fetch(`api/campaign/upload?${new URLSearchParams({ name: path })}`, { method: "POST", body: file }));
}

/** Where a file of a step is downloaded, or one of the campaign. */
export const download = (what, step) => `api/export/${what}?${step === "campaign" ? "of=campaign" : `step=${step}`}`;
